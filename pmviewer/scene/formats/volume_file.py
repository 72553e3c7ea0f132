"""Files of numbers on a lattice: Mitsuba's `.vol` (version 3) and NumPy's `.npy`.

What a header claims is compared with the file's size before anything is read, so that a header that lies costs nothing.
"""

from __future__ import annotations

import math
import re
import struct
from pathlib import Path
from typing import Any, BinaryIO, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.formats.open_file import open_regular

LARGEST_BYTES = 4 << 30
"""Of numbers, as float32."""
LARGEST_SIDE = 1 << 14
_HEADER = struct.Struct("<3sB5i6f")
_ENCODINGS: dict[int, np.dtype[Any]] = {1: np.dtype("<f4"), 2: np.dtype("<f2"), 3: np.dtype("u1")}
_NPY_HEADER = 1 << 12
_KIND = re.compile(rb"'descr':\s*'([^']{1,16})'")
_ORDER = re.compile(rb"'fortran_order':\s*(True|False)")
_SIDES = re.compile(rb"'shape':\s*\(\s*(-?\d{1,19}(?:,\s*-?\d{1,19}){0,7}),?\s*\)")
_KINDS = {f"{o}{k}{n}".encode() for o in "<>|=" for k in "fui" for n in (1, 2, 4, 8)} - {b"<f1", b">f1", b"|f1", b"=f1"}
_AGAIN = "Write it again, or copy it again if it was cut off."
Box = tuple[tuple[float, float, float], tuple[float, float, float]]


class VolumeFile(NamedTuple):
    """`values` (nz, ny, nx, 1 or 3) float32, finite and not negative; the `box` that the file gives itself, None if it
    gives none; how many numbers were `mended` to 0 because they were not."""

    values: NDArray[np.float32]
    box: Box | None
    mended: int


def read_volume(path: Path) -> VolumeFile:
    """The numbers of a `.vol` or `.npy` file. Raises SceneError."""
    file, size = open_regular(path, "The volume")
    with file:
        try:
            start = file.read(6)
            file.seek(0)
            if start == b"\x93NUMPY":
                return _npy(file, size, path)
            if start[:3] == b"VOL":
                return _vol(file, size, path)
        except OSError as error:
            raise SceneError(f"The volume can't be read: {error.strerror or error}.", path) from None
    raise SceneError("The file is no volume: neither Mitsuba's 'VOL' nor NumPy's.", path, 0, "Write one of these.")


def _vol(file: BinaryIO, size: int, path: Path) -> VolumeFile:
    raw = file.read(_HEADER.size)
    if len(raw) < _HEADER.size:
        raise SceneError("The volume is cut off in its header.", path, 0, _AGAIN)
    _, version, encoding, nx, ny, nz, channels, *box = _HEADER.unpack(raw)
    if version != 3:
        raise SceneError(f"The volume has version {version}; 3 is supported.", path, 0, "Convert it to version 3.")
    if encoding not in _ENCODINGS:
        what = f"The volume's numbers are of kind {encoding}: 1 (float32), 2 (float16) and 3 (bytes) are supported."
        raise SceneError(what, path, 0, "Write float32.")
    kind = _ENCODINGS[encoding]
    values = _numbers(file, kind, (nz, ny, nx, channels), size - _HEADER.size, path)
    if kind == np.uint8:
        values = values / np.float32(255)
    low, high = (box[0], box[1], box[2]), (box[3], box[4], box[5])
    good = all(math.isfinite(x) for x in box) and all(a < b for a, b in zip(low, high))
    return _mended(values, (low, high) if good else None)


def _npy(file: BinaryIO, size: int, path: Path) -> VolumeFile:
    start = file.read(8)
    wide = len(start) == 8 and start[6] in (2, 3)
    raw = file.read(4 if wide else 2)
    length = int.from_bytes(raw, "little")
    head = file.read(length) if length <= _NPY_HEADER else b""
    kind, order, sides = (pattern.search(head) for pattern in (_KIND, _ORDER, _SIDES))
    if start[6:7] not in (b"\1", b"\2", b"\3") or len(head) < length or not (kind and order and sides):
        raise SceneError("The header of the NumPy file is broken.", path, 0, _AGAIN)
    if kind[1] not in _KINDS:
        raise SceneError("The NumPy file holds no real numbers.", path, 0, "Save an array of float32.")
    shape = tuple(int(n) for n in sides[1].split(b","))
    if len(shape) not in (3, 4):
        what = f"The array has {len(shape)} axes; a volume has (z, y, x) or (z, y, x, channels)."
        raise SceneError(what, path, 0, "Save it in that shape.")
    nz, ny, nx, channels = shape if len(shape) == 4 else (*shape, 1)
    fortran: Literal["C", "F"] = "F" if order[1] == b"True" else "C"
    kind_of: np.dtype[Any] = np.dtype(kind[1].decode())
    return _mended(_numbers(file, kind_of, (nz, ny, nx, channels), size - file.tell(), path, fortran), None)


def _numbers(
    file: BinaryIO, kind: np.dtype, shape: tuple[int, ...], left: int, path: Path, order: Literal["C", "F"] = "C"
) -> NDArray[np.float32]:
    """The file's next numbers as float32, if there are as many as the shape (nz, ny, nx, channels) says."""
    nz, ny, nx, channels = shape
    said = f"{nx:,} × {ny:,} × {nz:,} places"
    if channels not in (1, 3):
        raise SceneError(f"The volume has {channels:,} numbers at a place; 1 and 3 are supported.", path, 0, _AGAIN)
    if any(not 0 < n <= LARGEST_SIDE for n in (nx, ny, nz)):
        raise SceneError(f"The volume claims {said}; each side has 1 to {LARGEST_SIDE:,}.", path, 0, _AGAIN)
    count = math.prod(shape)
    if count * kind.itemsize > left:
        what = f"The volume claims {said}, {count * kind.itemsize:,} bytes, and {max(left, 0):,} follow."
        raise SceneError(what, path, 0, _AGAIN)
    if 4 * count > LARGEST_BYTES:
        raise SceneError(f"The volume has {said}, more than are read.", path, 0, "Make it coarser.")
    data = file.read(count * kind.itemsize)
    if len(data) < count * kind.itemsize:
        raise SceneError("The volume is cut off.", path, 0, _AGAIN)
    with np.errstate(all="ignore"):
        return np.frombuffer(data, kind, count).reshape(shape, order=order).astype(np.float32)


def _mended(values: NDArray[np.float32], box: Box | None) -> VolumeFile:
    bad = ~(np.isfinite(values) & (values >= 0))
    mended = int(bad.sum())
    if mended:
        values = np.where(bad, np.float32(0), values)
    return VolumeFile(np.ascontiguousarray(values, np.float32), box, mended)
