"""Mitsuba's .serialized meshes: what they hold, and files that lie about it."""

from __future__ import annotations

import contextlib
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.scene.formats.serialized import read_serialized
from tests.scene.helpers import load

VERTICES = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1]]
FACES = [[0, 1, 2], [0, 2, 3]]
NORMALS = [[0, 0, 1]] * 4
COORDINATES = [[0, 0], [1, 0], [1, 1], [0, 1]]
COLOURS = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0.5]]


def stream(
    *columns: list, flags: int, version: int = 4, counts: tuple[int, int] = (4, 2), faces: list = FACES
) -> bytes:
    """One mesh, written from the description of the format in Mitsuba's manual."""
    number = "<f8" if flags & 0x2000 else "<f4"
    body = struct.pack("<I", flags) + (b"name\0" if version == 4 else b"") + struct.pack("<QQ", *counts)
    body += b"".join(np.array(c, number).tobytes() for c in columns) + np.array(faces, "<u4").tobytes()
    return struct.pack("<HH", 0x041C, version) + zlib.compress(body)


def file_of(folder: Path, *meshes: bytes, version: int = 4) -> Path:
    offsets = np.cumsum([0, *(len(m) for m in meshes[:-1])])
    table = offsets.astype("<u8" if version == 4 else "<u4").tobytes() + struct.pack("<I", len(meshes))
    path = folder / "meshes.serialized"
    path.write_bytes(b"".join(meshes) + table)
    return path


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("double", [0x1000, 0x2000])
def test_all_that_a_mesh_can_hold(tmp_path: Path, version: int, double: int) -> None:
    full = stream(VERTICES, NORMALS, COORDINATES, COLOURS, flags=double | 0b1011, version=version)
    bare = stream(np.array(VERTICES) + 5, flags=double, version=version)
    path = file_of(tmp_path, bare, full, bare, version=version)
    mesh = read_serialized(path, 1)
    np.testing.assert_array_equal(mesh.vertices, VERTICES)
    np.testing.assert_array_equal(mesh.faces, FACES)
    np.testing.assert_array_equal(mesh.normals, NORMALS)
    np.testing.assert_array_equal(mesh.uv, COORDINATES)
    np.testing.assert_array_equal(mesh.colours, COLOURS)
    for index in (0, 2):
        mesh = read_serialized(path, index)
        np.testing.assert_array_equal(mesh.vertices, np.array(VERTICES) + 5)
        assert mesh.normals is mesh.uv is mesh.colours is None


def test_as_a_shape(tmp_path: Path) -> None:
    file_of(tmp_path, stream(VERTICES, flags=0x1000), stream(VERTICES, NORMALS, COORDINATES, flags=0x1003))
    shape = '<shape type="serialized"><string name="filename" value="meshes.serialized"/>{}</shape>'
    second = '<integer name="shapeIndex" value="1"/>'
    lines = (shape.format(""), shape.format(second), shape.format('<boolean name="face_normals" value="true"/>'))
    scene = load(tmp_path, *lines)
    smooth, given, flat = (s.geometry for s in scene.shapes)
    assert scene.warnings == ()
    # Mitsuba 3.9.1 computes the normals that a file lacks: these are its numbers at the first two vertices.
    np.testing.assert_allclose(smooth.normals[:2], [(0.37, -0.37, 0.852), (0, 0, 1)], atol=1e-3)
    np.testing.assert_array_equal(given.normals, NORMALS)
    np.testing.assert_array_equal(given.uv, COORDINATES)
    assert flat.normals is None


def test_a_file_without_its_table_has_one_mesh(tmp_path: Path) -> None:
    path = tmp_path / "one.serialized"
    path.write_bytes(stream(VERTICES, flags=0x1000) + bytes(4))
    assert len(read_serialized(path, 0).faces) == 2


@pytest.mark.timeout(10)
@pytest.mark.parametrize(
    ("data", "index", "words"),
    [
        (b"", 0, "not a .serialized file"),
        (b"PK\3\4 zip", 0, "not a .serialized file"),
        (struct.pack("<HH", 0x041C, 5) + bytes(40), 0, "Version 5"),
        (stream(VERTICES, flags=0x1000)[:40] + bytes(4), 0, "ends too early|can't be decompressed"),
        (struct.pack("<HH", 0x041C, 4) + b"no zlib stream" + bytes(4), 0, "can't be decompressed"),
        (stream(VERTICES, flags=0x1000, counts=(1 << 40, 2)) + bytes(4), 0, "1,099,511,627,776 vertices"),
        (stream(VERTICES, flags=0x1000, counts=(1 << 30, 2)) + bytes(4), 0, "bytes of mesh in"),
        (stream(VERTICES, flags=0x1000, counts=(4, 1 << 30)) + bytes(4), 0, "bytes of mesh in"),
        (stream(VERTICES, flags=0x1000) + struct.pack("<QI", 0, 1), 7, "The file has 1 meshes; 'shape_index' is 7"),
        (stream(VERTICES, flags=0x1000) + struct.pack("<QQI", 0, 1 << 60, 2), 1, "begins beyond the end"),
        (stream(VERTICES, flags=0x1000) + struct.pack("<QI", 0, 0xFFFFFFFF), 3, "'shape_index' is 3"),
    ],
)  # fmt: skip
def test_files_that_lie(tmp_path: Path, data: bytes, index: int, words: str) -> None:
    path = tmp_path / "bad.serialized"
    path.write_bytes(data)
    with pytest.raises(SceneError, match=words):
        read_serialized(path, index)


@pytest.mark.timeout(60)
def test_a_bomb_is_not_unpacked(tmp_path: Path) -> None:
    """A gigabyte of zeros in a megabyte of file: the same block a thousand times, each for itself."""
    packed = zlib.compressobj(9)
    body = packed.compress(struct.pack("<I", 0x1000) + b"\0" + struct.pack("<QQ", 1 << 26, 1 << 25))
    body += packed.flush(zlib.Z_FULL_FLUSH)
    body += (packed.compress(bytes(1 << 20)) + packed.flush(zlib.Z_FULL_FLUSH)) * 1024
    assert len(zlib.decompressobj().decompress(body, 1 << 24)) == 1 << 24, "it is one that can be unpacked"
    path = tmp_path / "bomb.serialized"
    path.write_bytes(struct.pack("<HH", 0x041C, 4) + body + struct.pack("<QI", 0, 1))
    with pytest.raises(SceneError, match="bytes of mesh in"):
        read_serialized(path, 0)


def test_indices_out_of_range_are_an_error_of_the_scene(tmp_path: Path) -> None:
    file_of(tmp_path, stream(VERTICES, flags=0x1000, faces=[[0, 1, 2], [0, 2, 0xFFFFFFFF]]))
    shape = '<shape type="serialized"><string name="filename" value="meshes.serialized"/></shape>'
    with pytest.raises(SceneError, match="Triangle 1 uses a vertex that does not exist"):
        load(tmp_path, shape)


@pytest.mark.timeout(60)
def test_every_cut_of_a_file_opens_or_raises(tmp_path: Path) -> None:
    path = file_of(tmp_path, stream(VERTICES, NORMALS, flags=0x1001), stream(VERTICES, flags=0x1000))
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        for index in (0, 1):
            with contextlib.suppress(SceneError):
                assert len(read_serialized(path, index).faces) == 2
