"""PLY meshes, ASCII and binary. Own reader: every bundled scene needs it at start and must not wait for imports."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.description import Mesh
from pmviewer.scene.primitives import fans

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_HEADER_LIMIT = 1 << 16
_COORDINATES = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"))
_FACE_LISTS = ("vertex_indices", "vertex_index")


@dataclass
class _Property:
    name: str
    type: str
    count_type: str | None = None  # for lists


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


def read_ply(path: Path) -> Mesh:
    """The file's triangles (polygons are cut into fans), with its normals and texture coordinates if it has
    them.

    Raises SceneError for anything unreadable; indices are checked by `clean`.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"The mesh can't be read: {error.strerror or error}.", path) from None
    if not data:
        raise SceneError("The PLY file is empty (0 bytes).", path, hint="Export the mesh again.")
    order, elements, body = _header(data, path)
    try:
        columns = _read_ascii(data[body:], elements) if order == "" else _read_binary(data, body, order, elements)
    except (ValueError, IndexError, OverflowError) as error:
        raise SceneError(f"The PLY file's data do not fit its header: {error}.", path, hint="Is it complete?") from None
    vertex = columns.get("vertex", {})
    if not {"x", "y", "z"} <= vertex.keys():
        raise SceneError("The PLY file has no vertex positions x, y, z.", path)
    vertices = np.stack([vertex[c] for c in "xyz"], axis=1).astype(np.float64)
    normals = None
    if {"nx", "ny", "nz"} <= vertex.keys():
        normals = np.stack([vertex[c] for c in ("nx", "ny", "nz")], axis=1).astype(np.float64)
    uv = None
    pair = next((names for names in _COORDINATES if set(names) <= vertex.keys()), None)
    if pair is not None:
        uv = np.stack([vertex[c] for c in pair], axis=1).astype(np.float64)
    face = columns.get("face", {})
    lists = next((face[name] for name in _FACE_LISTS if name in face), None)
    if lists is None or lists.ndim != 2:
        raise SceneError("The PLY file has no faces (it may be a point cloud).", path, hint="Export it with triangles.")
    # Indices beyond 32 bits must not wrap around to valid ones.
    faces = np.where((lists >= 0) & (lists < 2**31), lists, -1).astype(np.int32)
    return Mesh(vertices, faces, normals, uv)


def _header(data: bytes, path: Path) -> tuple[str, list[_Element], int]:
    """Byte order ("" for ASCII), elements and where the body begins."""
    end = data.find(b"end_header", 0, _HEADER_LIMIT)
    if not data.startswith(b"ply") or end < 0:
        raise SceneError("This is not a PLY file (it has no PLY header).", path, hint="Check the file's ending.")
    body = data.find(b"\n", end) + 1
    order: str | None = None
    elements: list[_Element] = []
    for number, line in enumerate(data[:end].decode("ascii", "replace").splitlines(), 1):
        words = line.split()
        try:
            match words:
                case ["format", name, *_]:
                    order = _FORMATS[name]
                case ["element", name, count]:
                    elements.append(_Element(name, int(count)))
                    if elements[-1].count < 0:
                        raise ValueError(count)
                case ["property", "list", count_type, item, name]:
                    elements[-1].properties.append(_Property(name, _TYPES[item], _TYPES[count_type]))
                case ["property", item, name]:
                    elements[-1].properties.append(_Property(name, _TYPES[item]))
                case ["ply"] | ["comment", *_] | ["obj_info", *_] | []:
                    pass
                case _:
                    raise ValueError(line)
        except (KeyError, ValueError, IndexError):
            raise SceneError(f"The PLY header's line {line[:60]!r} is not understood.", path, number) from None
    if order is None or body == 0:
        raise SceneError("The PLY header names no format or has no end.", path)
    return order, elements, body


Columns = dict[str, dict[str, NDArray]]


def _read_binary(data: bytes, offset: int, order: str, elements: list[_Element]) -> Columns:
    result: Columns = {}
    for element in elements:
        if element.count == 0:
            continue
        dtype = _fixed_dtype(data, offset, order, element)
        if dtype is None:
            result[element.name], offset = _read_records(data, offset, order, element)
            continue
        rows = np.frombuffer(data, dtype, element.count, offset)
        offset += rows.nbytes
        result[element.name] = _columns_of(rows, element)
    return result


def _fixed_dtype(data: bytes, offset: int, order: str, element: _Element) -> np.dtype | None:
    """Row type if all lists have the length of the first row's, else None. Almost every mesh is all triangles."""
    fields: list[tuple] = []
    for i, p in enumerate(element.properties):
        if p.count_type is None:
            fields.append((f"p{i}", order + p.type))
            continue
        before = np.dtype(fields).itemsize if fields else 0
        length = int(np.frombuffer(data, order + p.count_type, 1, offset + before)[0])
        if not 0 <= length <= 64:
            return None
        fields += [(f"c{i}", order + p.count_type), (f"p{i}", order + p.type, (length,))]
    dtype = np.dtype(fields)
    if any(name.startswith("c") for name in dtype.names or ()):
        if offset + dtype.itemsize * element.count > len(data):
            return None
        rows = np.frombuffer(data, dtype, element.count, offset)
        for name in dtype.names or ():
            if name.startswith("c") and (rows[name] != rows[name][0]).any():
                return None
    return dtype


def _columns_of(rows: NDArray, element: _Element) -> dict[str, NDArray]:
    columns = {}
    for i, p in enumerate(element.properties):
        if p.count_type is None:
            columns[p.name] = rows[f"p{i}"]
        else:
            columns[p.name] = fans(rows[f"p{i}"])
    return columns


def _read_records(data: bytes, offset: int, order: str, element: _Element) -> tuple[dict[str, NDArray], int]:
    """Row by row, for polygons of mixed sizes."""
    values: dict[str, list] = {p.name: [] for p in element.properties}
    byteorder = {"<": "little", ">": "big"}[order]
    swap = byteorder != sys.byteorder
    for _ in range(element.count):
        for p in element.properties:
            count = 1
            if p.count_type is not None:
                count = int(np.frombuffer(data, order + p.count_type, 1, offset)[0])
                offset += np.dtype(p.count_type).itemsize
                if count < 0:
                    raise ValueError("a list has a negative length")
            row = np.frombuffer(data, order + p.type, count, offset)
            offset += row.nbytes
            values[p.name].append(row.byteswap().view(p.type) if swap else row)
    return {p.name: _join(values[p.name], p) for p in element.properties}, offset


def _join(rows: list[NDArray], p: _Property) -> NDArray:
    if p.count_type is None:
        return np.concatenate(rows) if rows else np.zeros(0)
    triangles = [np.zeros((0, 3), np.int64)]
    sizes = np.array([len(r) for r in rows])
    for n in np.unique(sizes):
        if n >= 3:
            triangles.append(fans(np.stack([r for r in rows if len(r) == n])))
    return np.concatenate(triangles)


def _read_ascii(body: bytes, elements: list[_Element]) -> Columns:
    words = body.split()
    result: Columns = {}
    position = 0
    for element in elements:
        if not any(p.count_type for p in element.properties):
            width = len(element.properties)
            block = words[position : position + width * element.count]
            if len(block) < width * element.count:
                raise ValueError(f"fewer than {element.count} rows of '{element.name}'")
            table = np.array(block, np.float64).reshape(element.count, width)
            position += len(block)
            result[element.name] = {p.name: table[:, i] for i, p in enumerate(element.properties)}
            continue
        values: dict[str, list] = {p.name: [] for p in element.properties}
        for _ in range(element.count):
            for p in element.properties:
                count = 1
                if p.count_type is not None:
                    count = int(words[position])
                    position += 1
                if count < 0 or position + count > len(words):
                    raise ValueError(f"fewer than {element.count} rows of '{element.name}'")
                values[p.name].append(np.array(words[position : position + count], np.float64))
                position += count
        result[element.name] = {p.name: _join(values[p.name], p) for p in element.properties}
    return result
