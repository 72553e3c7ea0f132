"""Mitsuba's `.serialized` files: several triangle meshes, each compressed by zlib, and where each begins.

Format: two 16-bit words (0x041C and the version, 3 or 4) before each mesh's stream of flags, name (version 4), counts,
positions, normals, texture coordinates, colours and indices; at the end of the file the offsets of all meshes and their
number. Little-endian throughout.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.description import Mesh

_MAGIC = 0x041C
_NORMALS, _COORDINATES, _COLOURS, _DOUBLE = 0x0001, 0x0002, 0x0008, 0x2000
_CHUNK = 1 << 20
_LONGEST_NAME = 4096
_WIDEST = 1 << 32
"""Vertices beyond which indices have 64 bits."""
LARGEST_RATIO = 64
SMALL = 64 << 20
"""A mesh of more bytes than this that is LARGEST_RATIO times its compressed size is no honest mesh."""


def read_serialized(path: Path, index: int) -> Mesh:
    """The mesh of that number, from 0. Raises SceneError."""
    try:
        with path.open("rb") as file:
            return _read(file, path, index)
    except OSError as error:
        raise SceneError(f"The file can't be read: {error.strerror or error}.", path) from None


def _damaged(path: Path, reason: str) -> SceneError:
    hint = "It may be damaged: export it again."
    return SceneError(f"This is not a whole .serialized file ({reason}).", path, hint=hint)


def _read(file: BinaryIO, path: Path, index: int) -> Mesh:
    size = file.seek(0, 2)
    file.seek(0)
    version = _version(file, path)
    begin, end = _extent(file, path, size, version, index)
    if begin:
        file.seek(begin)
        _version(file, path)
    stream = _Stream(file, end - begin - 4, path)
    (flags,) = struct.unpack("<I", stream.take(4))
    if version == 4:
        stream.skip_name()
    n_vertices, n_faces = struct.unpack("<QQ", stream.take(16))
    if n_vertices > 2**31 or n_faces > 2**31:
        raise _damaged(path, f"it claims {n_vertices:,} vertices and {n_faces:,} triangles")
    columns = {"positions": 3}
    columns |= {name: n for name, bit, n in _PARTS if flags & bit}
    number = np.dtype("<f8" if flags & _DOUBLE else "<f4")
    whole = np.dtype("<u8" if n_vertices >= _WIDEST else "<u4")
    stream.expect(n_vertices * sum(columns.values()) * number.itemsize + n_faces * 3 * whole.itemsize)
    parts = {
        name: np.frombuffer(stream.take(n_vertices * n * number.itemsize), number).reshape(-1, n).astype(np.float64)
        for name, n in columns.items()
    }
    faces = np.frombuffer(stream.take(n_faces * 3 * whole.itemsize), whole).reshape(-1, 3)
    return Mesh(
        parts["positions"],
        # Indices beyond 31 bits must not wrap around to valid ones.
        np.where(faces < 2**31, faces, -1).astype(np.int32),
        parts.get("normals"),
        parts.get("coordinates"),
        parts.get("colours"),
    )


_PARTS = (("normals", _NORMALS, 3), ("coordinates", _COORDINATES, 2), ("colours", _COLOURS, 3))


def _version(file: BinaryIO, path: Path) -> int:
    header = file.read(4)
    if len(header) < 4 or header[:2] != _MAGIC.to_bytes(2, "little"):
        raise SceneError("This is not a .serialized file of Mitsuba.", path, hint="Check the file's ending.")
    version = int.from_bytes(header[2:], "little")
    if version not in (3, 4):
        hint = "Export the mesh as PLY."
        raise SceneError(f"Version {version} of .serialized files is not read, 3 and 4 are.", path, hint=hint)
    return version


def _extent(file: BinaryIO, path: Path, size: int, version: int, index: int) -> tuple[int, int]:
    """Where the mesh begins and the latest place where it can end."""
    if size < 8:
        raise _damaged(path, f"{size} bytes")
    file.seek(size - 4)
    (count,) = struct.unpack("<I", file.read(4))
    word = 8 if version == 4 else 4
    table = size - 4 - count * word
    if index == 0 and (count == 0 or table < 4):
        file.seek(4)
        return 0, size  # files of one mesh often lack the table
    if not 0 <= index < count or table < 4:
        raise SceneError(f"The file has {count} meshes; 'shape_index' is {index}.", path, hint="They count from 0.")
    file.seek(table + index * word)
    offsets: NDArray[np.uint64] = np.frombuffer(file.read(2 * word)[: -4 if index + 1 == count else None], f"<u{word}")
    begin = int(offsets[0])
    if not 0 <= begin <= table - 4:
        raise _damaged(path, f"mesh {index} begins beyond the end")
    if index == 0:
        begin = 0
    file.seek(begin + 4)
    return begin, table


class _Stream:
    """Bytes of a compressed mesh, never more than are asked for."""

    def __init__(self, file: BinaryIO, compressed: int, path: Path) -> None:
        self._file, self._left, self._path = file, compressed, path
        self._compressed = compressed
        self._zlib = zlib.decompressobj()
        self._pending = b""

    def expect(self, size: int) -> None:
        """Raises SceneError if the file can't honestly hold that many more bytes."""
        if size > SMALL and size > LARGEST_RATIO * self._compressed:
            raise _damaged(self._path, f"{size:,} bytes of mesh in {self._compressed:,} bytes of file")

    def take(self, size: int) -> bytes:
        parts: list[bytes] = []
        missing = size
        while missing > 0:
            if not self._pending:
                self._pending = self._file.read(min(_CHUNK, self._left))
                self._left -= len(self._pending)
            try:
                part = self._zlib.decompress(self._pending, missing)
            except zlib.error:
                raise _damaged(self._path, "it can't be decompressed") from None
            self._pending = self._zlib.unconsumed_tail
            if not part and (self._zlib.eof or (not self._pending and self._left <= 0)):
                raise _damaged(self._path, "it ends too early")
            missing -= len(part)
            parts.append(part)
        return b"".join(parts)

    def skip_name(self) -> None:
        for _ in range(_LONGEST_NAME):
            if self.take(1) == b"\0":
                return
        raise _damaged(self._path, "the mesh's name has no end")
