"""PLY and STL files as they occur; expectations are worked out by hand."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.scene.description import Mesh, Scene
from pmviewer.scene.formats.ply import read_ply, read_ply_file
from pmviewer.scene.load import load_scene

POINTS = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]


def ply(folder: Path, header: str, body: bytes | str, end: str = "\n") -> Path:
    path = folder / "a.ply"
    data = header.replace("\n", end).encode("latin-1")
    path.write_bytes(data + (body if isinstance(body, bytes) else body.encode()))
    return path


def rows(*numbers: tuple) -> str:
    return "".join(" ".join(map(str, row)) + "\n" for row in numbers)


XYZ = "property float x\nproperty float y\nproperty float z\n"
HEADER = (
    f"ply\nformat {{}} 1.0\nelement vertex 4\n{XYZ}element face 2\nproperty list uchar int vertex_indices\nend_header\n"
)
FACES = ((3, 0, 1, 2), (3, 0, 2, 3))


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_headers_as_programs_write_them(tmp_path: Path, end: str) -> None:
    header = (
        "ply\ncomment before the format, gr\xf6\xdfe\nformat ascii 1.0\nobj_info num_cols 512\nmade_by nobody\n"
        f"element vertex 4\ncomment inside\n{XYZ}property double quality\nproperty list uchar float more\n"
        "element edge 1\nproperty int vertex1\nproperty int vertex2\nelement face 2\nproperty uchar flags\n"
        "property list uint8 uint32 vertex_index\nproperty list uchar float other\nend_header\n"
    )
    body = rows(*((*p, 0.5, 2, 7, 8) for p in POINTS)) + "0 1\n" + rows((1, 3, 0, 1, 2, 0), (2, 3, 0, 2, 3, 1, 9.5))
    mesh = read_ply(ply(tmp_path, header, body, end))
    assert mesh.vertices.tolist() == [list(p) for p in POINTS]
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_names_of_places_in_capitals(tmp_path: Path) -> None:
    header = HEADER.format("ascii").replace(" x", " X").replace(" y", " Y").replace(" z", " Z")
    mesh = read_ply(ply(tmp_path, header, rows(*POINTS, *FACES)))
    assert mesh.vertices.tolist() == [list(p) for p in POINTS]
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_rows_of_different_lengths(tmp_path: Path, order: str) -> None:
    header = (
        f"ply\nformat binary_{'little' if order == '<' else 'big'}_endian 1.0\nelement vertex 4\n{XYZ}"
        "property list uchar short more\nelement face 3\nproperty short flags\n"
        "property list ushort ushort vertex_indices\nproperty list uchar float texcoord\nend_header\n"
    )
    body = b"".join(struct.pack(f"{order}3fB{i}h", *p, i, *range(i)) for i, p in enumerate(POINTS))
    for polygon, wedges in (((0, 1, 2), ()), ((0, 1, 2, 3), (0.5, 1.0)), ((0, 3), ())):
        n, m = len(polygon), len(wedges)
        body += struct.pack(f"{order}hH{n}HB{m}f", -1, n, *polygon, m, *wedges)
    mesh = read_ply(ply(tmp_path, header, body))
    assert mesh.vertices.tolist() == [list(p) for p in POINTS]
    assert sorted(mesh.faces.tolist()) == [[0, 1, 2], [0, 1, 2], [0, 2, 3]]


def test_triangle_strips(tmp_path: Path) -> None:
    header = f"ply\nformat ascii 1.0\nelement vertex 4\n{XYZ}element tristrips 1\n"
    header += "property list int int vertex_indices\nend_header\n"
    mesh = read_ply(ply(tmp_path, header, rows(*POINTS) + "8 0 1 3 2 -1 3 2 1\n"))
    assert mesh.faces.tolist() == [[0, 1, 3], [3, 1, 2], [3, 2, 1]]


def test_colours_of_vertices_and_faces(tmp_path: Path) -> None:
    colour = "property {0} red\nproperty {0} green\nproperty {0} blue\n"
    faces = "element face 1\nproperty list uchar int vertex_indices\n"
    header = f"ply\nformat ascii 1.0\nelement vertex 3\n{XYZ}{{}}{faces}{{}}end_header\n"
    points = POINTS[:3]
    # 188 encoded as sRGB is 0.5029 (IEC 61966-2-1); floats are linear.
    for kind, number, linear in (("uchar", 188, 0.5029), ("float", 0.5, 0.5), ("float", 188, 0.5029)):
        path = ply(
            tmp_path, header.format(colour.format(kind), ""), rows(*((*p, number, 0, 0) for p in points)) + "3 0 1 2\n"
        )
        mesh = read_ply(path)
        assert mesh.colours == pytest.approx(np.tile([linear, 0, 0], (3, 1)), abs=1e-4)
        scene = load_scene(path)
        assert scene.materials[0].vertex_colours
        assert scene.shapes[0].geometry.colours is not None
    alpha = colour.format("uchar") + "property uchar alpha\n"
    path = ply(tmp_path, header.format(alpha, ""), rows(*((*p, 255, 0, 0, 9) for p in points)) + "3 0 1 2\n")
    assert any("alpha" in w for w in load_scene(path).warnings)
    path = ply(tmp_path, header.format("", colour.format("uchar")), rows(*points) + "3 0 1 2 0 255 0\n")
    assert read_ply(path).colours == pytest.approx(np.tile([0, 1, 0], (3, 1)))


def test_scan_with_a_picture(tmp_path: Path) -> None:
    from PIL import Image

    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "skin.png")
    header = f"ply\nformat ascii 1.0\ncomment TextureFile skin.png\nelement vertex 3\n{XYZ}element face 1\n"
    header += "property list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"
    path = ply(tmp_path, header, rows(*POINTS[:3]) + "3 0 1 2 6 0 0 1 0 1 0.25\n")
    assert read_ply_file(path).picture == "skin.png"
    scene = load_scene(path)
    assert scene.shapes[0].geometry.uv.tolist() == [[0, 0], [1, 0], [1, 0.25]]
    texture = scene.materials[0].textures["reflectance"]
    assert texture.mean == pytest.approx((1, 0, 0))
    assert texture.to_uv == (1, 0, 0, 0, -1, 1)


@pytest.mark.parametrize(
    ("header", "body", "words"),
    [
        (HEADER.format("ascii").split("element face")[0] + "end_header\n", rows(*POINTS), ("cloud of 4 points",)),
        (HEADER.format("ascii"), rows(*POINTS) + "3 0 1 2\n-3 0 1 2\n", ("negative or absurd", "face")),
        (HEADER.format("ascii"), rows(*POINTS) + "3 0 1 2\n4 0 2 3\n", ("fewer than 2 rows",)),
        (HEADER.format("ascii").replace("vertex 4", "vertex 4000000000"), rows(*POINTS), ("cut off", "4,000,000,000")),
        (HEADER.format("binary_little_endian"), b"\0" * 48, ("cut off", "face")),
        (HEADER.format("binary_little_endian"), b"\0" * 60, ("no triangle",)),
        (HEADER.format("ascii").replace("float x", "real x"), "", ("'property real x'",)),
        (HEADER.format("ascii").replace("end_header\n", ""), "", ("no end",)),
        ("version https://git-lfs.github.com/spec/v1\n", "oid sha256:1\n", ("git lfs pull",)),
    ],
)
def test_unusable_files_in_a_sentence(tmp_path: Path, header: str, body: bytes | str, words: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as caught:
        load_scene(ply(tmp_path, header, body))
    for word in words:
        assert word in str(caught.value)


FACET = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex {} 0 0\nvertex 0 1 0\nendloop\nendfacet\n"


def binary_stl(count: int, claimed: int | None = None, attribute: int = 0, tail: bytes = b"") -> bytes:
    record = struct.pack("<12fH", 0, 0, 1, -0.0, 0, 0, 1, 0, 0, 0, 1, 0, attribute)
    return b"solid odd".ljust(80) + struct.pack("<I", count if claimed is None else claimed) + record * count + tail


def stl(folder: Path, data: bytes | str) -> Scene:
    (folder / "a.stl").write_bytes(data if isinstance(data, bytes) else data.encode())
    return load_scene(folder / "a.stl")


def meshes(scene: Scene) -> list[tuple[str, Mesh]]:
    return [(s.name, s.geometry) for s in scene.shapes if isinstance(s.geometry, Mesh)]


def test_solids_of_a_text_stl(tmp_path: Path) -> None:
    text = (
        f"solid left half\n{FACET.format(1)}{FACET.format('2.5e0')}endsolid\nsolid\n{FACET.format(3).upper()}endsolid\n"
    )
    (left, a), (right, b) = meshes(stl(tmp_path, text.replace("\n", "\r\n")))
    assert (left, right) == ("left half", "a")
    assert a.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2.5, 0, 0]]
    assert a.faces.tolist() == [[0, 1, 2], [0, 3, 2]]
    assert b.vertices[:, 0].max() == 3


@pytest.mark.parametrize(
    "written",
    [
        lambda text: text.encode("utf-16"),
        lambda text: text.replace("\n", " ").encode(),
        lambda text: text.upper().replace("\n", "\t").encode(),
    ],
    ids=["utf-16", "one line", "one line in capitals"],
)
def test_text_stl_in_other_dress(tmp_path: Path, written) -> None:
    text = f"solid a\n{FACET.format(1)}{FACET.format('2.5e0')}endsolid a\n"
    ((_, mesh),) = meshes(stl(tmp_path, written(text)))
    assert mesh.vertices[mesh.faces].tolist() == [
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        [[0, 0, 0], [2.5, 0, 0], [0, 1, 0]],
    ]


def test_binary_stl_with_odd_headers(tmp_path: Path) -> None:
    scene = stl(tmp_path, binary_stl(3, attribute=0x1234))
    ((_, mesh),) = meshes(scene)
    assert (len(mesh.faces), len(mesh.vertices)) == (3, 3)
    assert any("no colours" in w for w in scene.warnings)
    odd = binary_stl(3).replace(b"solid", b"thing")
    assert len(meshes(stl(tmp_path, odd + b"trailing words"))[0][1].faces) == 3
    cut = stl(tmp_path, odd[:-20])
    assert len(meshes(cut)[0][1].faces) == 2
    assert any("cut off: it says it has 3 triangles and holds 2" in w for w in cut.warnings)
    streamed = stl(tmp_path, binary_stl(3, 0).replace(b"solid", b"thing"))
    assert len(meshes(streamed)[0][1].faces) == 3
    with pytest.raises(SceneError, match="neither a binary nor a text"):
        stl(tmp_path, bytes(range(256)) * 8)


def test_parts_of_a_large_binary_stl_are_one_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Read on one thread and on three, in parts that end in the middle of what is read at once."""
    rng = np.random.default_rng(4)
    records = np.zeros(1000, [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    records["v"] = rng.normal(size=(300, 3)).astype("<f4")[np.argsort(rng.random((1000, 300)), axis=1)[:, :3]]
    records["a"][990] = 5
    data = b"many".ljust(80) + struct.pack("<I", len(records)) + records.tobytes()
    found = []
    for fewest in (10_000, 1):
        monkeypatch.setattr("pmviewer.scene.formats.stl._FEWEST", fewest)
        monkeypatch.setattr("pmviewer.scene.formats.stl._AT_ONCE", 70)
        monkeypatch.setattr("pmviewer.scene.formats.stl.available_threads", lambda: 3)
        scene = stl(tmp_path, data)
        assert any("no colours" in w for w in scene.warnings)
        found.append(meshes(scene)[0][1])
    for mesh in found:
        assert np.array_equal(mesh.vertices[mesh.faces], records["v"])
    assert np.array_equal(found[0].vertices, found[1].vertices)
    assert len(found[0].vertices) == 300


MIDDLE = ((15 / 31 + 0.055) / 1.055) ** 2.4
"""What 15 of 31 is, decoded from sRGB (IEC 61966-2-1)."""


@pytest.mark.parametrize(
    ("header", "attributes", "expected"),
    [
        (b"made by Magics COLOR=\xff\x00\x00\xff", [15 << 5, 0x8000], [[0, MIDDLE, 0], [1, 0, 0]]),
        (b"made by Magics COLOR=\x00\xff\x00\xff", [0, 0], [[0, 1, 0], [0, 1, 0]]),
        (b"VisCAM", [0x8000 | 15 << 10, 0], [[MIDDLE, 0, 0], [0.7, 0.7, 0.7]]),
    ],
    ids=["Magics", "Magics, one colour", "VisCAM"],
)
def test_colours_of_binary_stl(tmp_path: Path, header: bytes, attributes: list[int], expected: list) -> None:
    """Two triangles that share an edge: its vertices are there twice where colours differ."""
    records = np.zeros(2, [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    records["v"] = [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [0, 1, 0]]]
    records["a"] = attributes
    scene = stl(tmp_path, header.ljust(80) + struct.pack("<I", 2) + records.tobytes())
    ((_, mesh),) = meshes(scene)
    assert np.array_equal(mesh.vertices[mesh.faces], records["v"])
    assert mesh.colours is not None
    assert mesh.colours[mesh.faces] == pytest.approx(np.repeat(np.array(expected)[:, None], 3, axis=1), abs=1e-5)
    assert len(mesh.vertices) == (4 if expected[0] == expected[1] else 6)
    assert scene.materials[scene.shapes[0].material].vertex_colours
    assert not any("colours" in w for w in scene.warnings)
