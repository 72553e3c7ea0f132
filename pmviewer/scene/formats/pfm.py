"""Portable float maps: a line of text each for kind, size and byte order, then float32 rows from the bottom up."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError

MOST_PIXELS = 1 << 27
_HEADER = re.compile(rb"(PF|Pf)\s+(\d{1,6})\s+(\d{1,6})\s+(-?\d{1,9}(?:\.\d{0,9})?(?:[eE][+-]?\d{1,2})?)\s")


def is_pfm(data: bytes) -> bool:
    """Does this look like the beginning of such a file?"""
    return _HEADER.match(data[:64]) is not None


def decode_pfm(data: bytes, name: str) -> NDArray[np.float32]:
    """Linear pixels (h, w, 3 or 1), rows from top to bottom; the sign of the scale is the byte order, its size is left
    alone, as other readers do. Raises SceneError."""
    header = _HEADER.match(data[:64])
    if header is None:
        raise SceneError(f"{name!r} is not a portable float map.")
    channels = 3 if header[1] == b"PF" else 1
    width, height = int(header[2]), int(header[3])
    if not 0 < width * height <= MOST_PIXELS or len(data) - header.end() < 4 * channels * width * height:
        what = f"The picture {name!r} claims {width} × {height} pixels and is cut off."
        raise SceneError(what, hint="Copy it again.")
    order = "<f4" if header[4].startswith(b"-") else ">f4"
    pixels = np.frombuffer(data, order, channels * width * height, header.end()).reshape(height, width, channels)
    return np.ascontiguousarray(pixels[::-1], np.float32)
