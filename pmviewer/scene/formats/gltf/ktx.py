"""KTX 2 pictures: plain ones by their header ("KTX File Format Specification", version 2.0, Khronos), those that are
compressed as KHR_texture_basisu asks through a library that is loaded when a file has one.
"""

from __future__ import annotations

import io
import zlib
from importlib import import_module

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pmviewer.errors import SceneError

_MAGIC = b"\xabKTX 20\xbb\r\n\x1a\n"
_MOST_SIDE = 1 << 14
_LEVELS = 80
"""Where the index of levels begins: offset, length and uncompressed length of each, the largest picture's first."""
_NO_COMPRESSION, _ZLIB = 0, 3
_CHANNELS = {
    **dict.fromkeys((9, 15), "r"),
    **dict.fromkeys((16, 22), "rg"),
    **dict.fromkeys((23, 29), "rgb"),
    **dict.fromkeys((30, 36), "bgr"),
    **dict.fromkeys((37, 43), "rgba"),
    **dict.fromkeys((44, 50), "bgra"),
}
"""Channels of bytes by Vulkan's numbers of formats (VK_FORMAT_…_UNORM and …_SRGB)."""


def is_ktx2(data: bytes) -> bool:
    """Does the file begin like KTX 2?"""
    return data[:12] == _MAGIC


def png_from_ktx2(data: bytes, name: str) -> bytes:
    """The picture's largest level as a PNG file. Raises SceneError for damaged data and a missing library."""
    layout, _, width, height = (_word(data, at) for at in (12, 16, 20, 24))
    if not (0 < width <= _MOST_SIDE and 0 < height <= _MOST_SIDE):
        raise SceneError(f"The texture {name!r} of {width} × {height} pixels can't be read.")
    if layout in _CHANNELS and _word(data, 44) in (_NO_COMPRESSION, _ZLIB):
        pixels = _plain(data, _CHANNELS[layout], width, height)
        if pixels is None:
            raise _damaged(name)
        return _png(pixels)
    try:
        alktx2 = import_module("alktx2")
    except ImportError:
        what = f"The texture {name!r} is compressed as KTX 2, and the Python package 'alktx2' is not installed."
        raise SceneError(what, hint='Install it with pip install "pmviewer[gltf]".') from None
    try:
        png, _ = alktx2.decode_ktx2_to_bytes(data, format="png")
    except (RuntimeError, ValueError, MemoryError):
        raise _damaged(name) from None
    return bytes(png)


def _word(data: bytes, at: int, size: int = 4) -> int:
    return int.from_bytes(data[at : at + size], "little")


def _damaged(name: str) -> SceneError:
    return SceneError(f"The texture {name!r} can't be read: its KTX 2 data are damaged or of an unknown kind.")


def _plain(data: bytes, channels: str, width: int, height: int) -> NDArray[np.uint8] | None:
    """(height, width, 3 or 4) bytes as PNG files have them, None where there are too few. Channels that the picture
    lacks are 0, as the specification says, unless the file's own swizzle puts others in their place."""
    start, length = (_word(data, _LEVELS + 8 * k, 8) for k in range(2))
    level, size = data[start : start + length], width * height * len(channels)
    if _word(data, 44) == _ZLIB:
        try:
            level = zlib.decompressobj().decompress(level, size)
        except zlib.error:
            return None
    if len(level) < size:
        return None
    stored = np.frombuffer(level, np.uint8, size).reshape(height, width, len(channels))
    order = _noted(data, b"KTXswizzle") or ("rgba" if "a" in channels else "rgb1")
    if len(order) != 4 or not set(order) <= set("rgba01"):
        return None
    pixels = np.empty((height, width, 3 if order[3] == "1" else 4), np.uint8)
    for k in range(pixels.shape[2]):
        if order[k] in channels:
            pixels[..., k] = stored[..., channels.index(order[k])]
        else:
            pixels[..., k] = 255 if order[k] in "1a" else 0
    return pixels[::-1] if _noted(data, b"KTXorientation")[1:2] == "u" else pixels


def _noted(data: bytes, key: bytes) -> str:
    """What the file's key and value data say of a key, "" for nothing."""
    start, length = _word(data, 56), _word(data, 60)
    found = data[start : start + length].partition(key + b"\0")[2]
    return found[:8].partition(b"\0")[0].decode("ascii", "replace")


def _png(pixels: NDArray[np.uint8]) -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(file, "png", compress_level=0)
    return file.getvalue()
