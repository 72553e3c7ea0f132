"""KTX 2 pictures of KHR_texture_basisu, through a library that is loaded when a file has one."""

from __future__ import annotations

from importlib import import_module

from pmviewer.errors import SceneError

_MAGIC = b"\xabKTX 20\xbb\r\n\x1a\n"
_MOST_SIDE = 1 << 14


def is_ktx2(data: bytes) -> bool:
    """Does the file begin like KTX 2?"""
    return data[:12] == _MAGIC


def png_from_ktx2(data: bytes, name: str) -> bytes:
    """The picture's largest level as a PNG file. Raises SceneError for damaged data and a missing library."""
    width, height = (int.from_bytes(data[at : at + 4], "little") for at in (20, 24))
    if not (0 < width <= _MOST_SIDE and 0 < height <= _MOST_SIDE):
        raise SceneError(f"The texture {name!r} of {width} × {height} pixels can't be read.")
    try:
        alktx2 = import_module("alktx2")
    except ImportError:
        what = f"The texture {name!r} is compressed as KTX 2, and the Python package 'alktx2' is not installed."
        raise SceneError(what, hint='Install it with pip install "pmviewer[gltf]".') from None
    try:
        png, _ = alktx2.decode_ktx2_to_bytes(data, format="png")
    except (RuntimeError, ValueError, MemoryError):
        raise SceneError(
            f"The texture {name!r} can't be read: its KTX 2 data are damaged or of an unknown kind."
        ) from None
    return bytes(png)
