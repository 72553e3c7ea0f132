"""The picture without its noise, by Intel Open Image Denoise (V10; Áfra 2019), which the extra `denoise` installs.

It is a guess, by a trained network, of what the picture converges to: no estimate with an error that falls, and up to a
percent darker. So it is a view and a layer of its own, with a name that says so, and never the beauty.
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import OutputError
from pmviewer.heap import keeps
from pmviewer.output import oidn

INSTALL = "pip install 'pmviewer[denoise]'"

_lock = threading.Lock()
_devices: dict[int, oidn.Device] = {}
"""By number of threads, until nothing is done for a while."""


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
        oidn.library()
    except (ImportError, OSError, AttributeError) as error:
        raise OutputError(f"Open Image Denoise can't be used ({error}): {INSTALL}") from error
    images = {
        "color": np.ascontiguousarray(np.maximum(colour, 0.0), np.float32),
        "albedo": np.ascontiguousarray(np.clip(albedo, 0.0, 1.0), np.float32),
        "normal": np.ascontiguousarray(normal, np.float32),
        "output": np.empty(colour.shape, np.float32),
    }
    with _lock:
        if threads not in _devices:
            _devices[threads] = oidn.Device(threads)
        _devices[threads].denoise(images, oidn.FAST if fast else oidn.HIGH)
    return images["output"]


def rest() -> None:
    """Free what the denoiser holds, five megabytes, unless it is at work: the next picture takes five milliseconds
    more."""
    if _lock.acquire(blocking=False):
        try:
            while _devices:
                _devices.popitem()[1].release()
        finally:
            _lock.release()


keeps(rest)
