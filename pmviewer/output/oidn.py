"""Intel Open Image Denoise 2 by its C interface. The package `pyoidn` brings the library along; its own interface reads
the C declarations anew in each process, which takes three megabytes and 40 milliseconds.

Source: the interface's documentation at openimagedenoise.org.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import OutputError

FAST, HIGH = 4, 6
"""Of OIDNQuality."""
_CPU, _FLOAT3 = 1, 3
"""Of OIDNDeviceType and OIDNFormat."""
_FOLDERS = {"win32": ("bin", ("OpenImageDenoise_device_cpu.dll", "OpenImageDenoise.dll"))} | {
    system: ("lib", (f"libOpenImageDenoise.{ending}",)) for system, ending in (("linux", "so"), ("darwin", "dylib"))
}

_pointer, _text, _size = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t
_SIGNATURES: Mapping[str, tuple[Any, ...]] = {
    "oidnNewDevice": (_pointer, ctypes.c_int),
    "oidnSetDeviceInt": (None, _pointer, _text, ctypes.c_int),
    "oidnSetDeviceBool": (None, _pointer, _text, ctypes.c_bool),
    "oidnCommitDevice": (None, _pointer),
    "oidnGetDeviceError": (ctypes.c_int, _pointer, ctypes.POINTER(_text)),
    "oidnReleaseDevice": (None, _pointer),
    "oidnNewFilter": (_pointer, _pointer, _text),
    "oidnSetSharedFilterImage": (None, _pointer, _text, _pointer, ctypes.c_int, *[_size] * 5),
    "oidnSetFilterBool": (None, _pointer, _text, ctypes.c_bool),
    "oidnSetFilterInt": (None, _pointer, _text, ctypes.c_int),
    "oidnCommitFilter": (None, _pointer),
    "oidnExecuteFilter": (None, _pointer),
    "oidnReleaseFilter": (None, _pointer),
}
"""What each function returns and takes."""


@cache
def library() -> ctypes.CDLL:
    """The functions that are used here. Raises ImportError or OSError where the library isn't there or can't be
    loaded."""
    found = find_spec("pyoidn")
    if found is None or not found.submodule_search_locations or sys.platform not in _FOLDERS:
        raise ImportError("there is no package pyoidn")
    folder, files = _FOLDERS[sys.platform]
    place = Path(found.submodule_search_locations[0]) / "oidn" / folder
    loaded = [ctypes.CDLL(str(place / file)) for file in files][-1]
    for name, (result, *arguments) in _SIGNATURES.items():
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    return loaded


class Device:
    """The processor with so many threads, all for 0. It holds trained weights, some five megabytes, until it is
    released."""

    def __init__(self, threads: int) -> None:
        self._c = library()
        self._device = self._c.oidnNewDevice(_CPU)
        self._c.oidnSetDeviceInt(self._device, b"numThreads", threads)
        # or its threads stay on cores that the render threads share
        self._c.oidnSetDeviceBool(self._device, b"setAffinity", False)
        self._c.oidnCommitDevice(self._device)
        try:
            self._check()
        except OutputError:
            self.release()
            raise

    def denoise(self, images: Mapping[str, NDArray[np.float32]], quality: int) -> None:
        """Fill the image "output" (h, w, 3) from "color", radiance without an upper bound, "albedo" and "normal", all
        contiguous. Raises OutputError."""
        c, filter_ = self._c, self._c.oidnNewFilter(self._device, b"RT")
        try:
            for name, image in images.items():
                height, width, _ = image.shape
                c.oidnSetSharedFilterImage(filter_, name.encode(), image.ctypes.data, _FLOAT3, width, height, 0, 0, 0)
            c.oidnSetFilterBool(filter_, b"hdr", True)
            c.oidnSetFilterInt(filter_, b"quality", quality)
            c.oidnCommitFilter(filter_)
            c.oidnExecuteFilter(filter_)
            self._check()
        finally:
            c.oidnReleaseFilter(filter_)

    def release(self) -> None:
        """Free what it holds; it can't be used any more."""
        self._c.oidnReleaseDevice(self._device)
        self._device = None

    def _check(self) -> None:
        said = ctypes.c_char_p()
        if self._c.oidnGetDeviceError(self._device, ctypes.byref(said)):
            text = (said.value or b"for a reason that it does not tell").decode(errors="replace")
            raise OutputError(f"Open Image Denoise failed: {text}.")
