"""The picture without its noise, by Intel Open Image Denoise (V10; Áfra 2019), which the extra `denoise` installs.

It is a guess, by a trained network, of what the picture converges to: no estimate with an error that falls, and up to a
percent darker. So it is a view and a layer of its own, with a name that says so, and never the beauty.
"""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import OutputError

INSTALL = "pip install 'pmviewer[denoise]'"

_lock = threading.Lock()
_devices: dict[int, Any] = {}
"""By number of threads. They live as long as the process, and so do their trained weights."""


def denoised(
    colour: NDArray[np.float32],
    albedo: NDArray[np.float32],
    normal: NDArray[np.float32],
    threads: int = 0,
    *,
    fast: bool = False,
) -> NDArray[np.float32]:
    """The radiance (h, w, 3) without noise, as float32 of that shape.

    albedo, normal: of the first hit, (h, w, 3), as noisy as they are; threads: as many as there are for 0; fast: by a
    smaller network, in half of the time.

    Raises OutputError where Open Image Denoise is not installed or refuses to work here.
    """
    try:
        import pyoidn
    except (ImportError, OSError) as error:
        raise OutputError(f"Open Image Denoise can't be used ({error}): {INSTALL}") from error
    images = {
        "color": np.ascontiguousarray(np.maximum(colour, 0.0), np.float32),
        "albedo": np.ascontiguousarray(np.clip(albedo, 0.0, 1.0), np.float32),
        "normal": np.ascontiguousarray(normal, np.float32),
        "output": np.empty(colour.shape, np.float32),
    }
    with _lock:
        device = _device(pyoidn, threads)
        filter_ = pyoidn.Filter(device, "RT")
        try:
            for name, image in images.items():
                filter_.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
            filter_.set_bool("hdr", True)
            filter_.set_quality(pyoidn.OIDN_QUALITY_FAST if fast else pyoidn.OIDN_QUALITY_HIGH)
            filter_.commit()
            filter_.execute()
            _check(device)
        finally:
            filter_.release()
    return images["output"]


def _device(pyoidn: Any, threads: int) -> Any:
    if threads not in _devices:
        device = pyoidn.Device()
        device.set_int("numThreads", threads)
        device.set_bool("setAffinity", False)  # or its threads stay on cores that the render threads share
        device.commit()
        _check(device)
        _devices[threads] = device
    return _devices[threads]


def _check(device: Any) -> None:
    said = device.get_error()
    if said is not None:
        raise OutputError(f"Open Image Denoise failed: {said}.")
