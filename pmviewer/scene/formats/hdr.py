"""Radiance HDR pictures (RGBE): three mantissas and a common exponent in four bytes a pixel (Ward 1991)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.formats.open_file import read_regular

MOST_PIXELS = 1 << 27
_SIZE = re.compile(rb"-Y (\d{1,6}) \+X (\d{1,6})")
_RUN_LENGTH_WIDTHS = range(8, 32768)
_HINT = "Save it again, best as OpenEXR."


def read_hdr(path: Path) -> NDArray[np.float32]:
    """Linear RGB (h, w, 3) of a .hdr file, rows from top to bottom. Raises SceneError."""
    return decode_hdr(read_regular(path, "It"), path)


def decode_hdr(data: bytes, path: Path | None = None) -> NDArray[np.float32]:
    """The same for a file's content; `path` is for error messages alone."""
    if not data.startswith((b"#?RADIANCE", b"#?RGBE")):
        raise SceneError("This is not a Radiance HDR picture.", path, hint="Is its ending right?")
    header, blank, rest = data.partition(b"\n\n")
    line, _, pixels = rest.partition(b"\n")
    size = _SIZE.fullmatch(line.strip())
    if not blank or size is None:
        raise SceneError("The picture's header has no size '-Y height +X width'.", path, hint=_HINT)
    if b"FORMAT=32-bit_rle_xyze" in header:
        raise SceneError("Pictures in XYZ colours can't be read.", path, hint="Convert it to RGBE.")
    height, width = int(size[1]), int(size[2])
    if not 0 < height * width <= MOST_PIXELS:
        raise SceneError(f"The picture claims {width} × {height} pixels.", path, hint=_HINT)
    coded = _decoded(pixels, height, width, path)
    scale = np.where(coded[:, :, 3] > 0, np.exp2(coded[:, :, 3].astype(np.float64) - 136), 0.0)
    return np.asarray(coded[:, :, :3] * scale[:, :, None], np.float32)


def _decoded(data: bytes, height: int, width: int, path: Path | None) -> NDArray[np.uint8]:
    """RGBE (h, w, 4), run-length coded by channel or not at all."""
    cut_off = SceneError("The picture is cut off or damaged.", path, hint="Copy it again.")
    new_style = width in _RUN_LENGTH_WIDTHS and data[:2] == b"\x02\x02" and len(data) > 3 and data[2] < 128
    if not new_style:
        if len(data) < 4 * height * width:
            raise cut_off
        return np.frombuffer(data, np.uint8, 4 * height * width).reshape(height, width, 4)
    out = np.empty((height, 4, width), np.uint8)
    at = 0
    try:
        for row in out:
            if data[at : at + 4] != bytes((2, 2, width >> 8, width & 255)):
                raise cut_off
            at += 4
            for channel in row:
                x = 0
                while x < width:
                    count = data[at]
                    run = count > 128
                    count = count - 128 if run else count
                    piece = data[at + 1 : at + 2] * count if run else data[at + 1 : at + 1 + count]
                    if not count or len(piece) != count or x + count > width:
                        raise cut_off
                    channel[x : x + count] = np.frombuffer(piece, np.uint8)
                    at += 2 if run else 1 + count
                    x += count
    except IndexError:
        raise cut_off from None
    return np.ascontiguousarray(out.transpose(0, 2, 1))
