"""OBJ files as programs write them; expectations are worked out by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.scene.description import Mesh, Scene
from pmviewer.scene.load import read_scene

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def opened(folder: Path, text: str | bytes, **files: str) -> Scene:
    for name, content in files.items():
        (folder / f"{name}.mtl").write_text(content)
    (folder / "a.obj").write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_scene(folder / "a.obj")


def meshes(scene: Scene) -> list[Mesh]:
    """The file's own, without the studio's floor."""
    return [s.geometry for s in scene.shapes if isinstance(s.geometry, Mesh)]


def area(mesh: Mesh) -> float:
    c = mesh.vertices[mesh.faces]
    return float(np.linalg.norm(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]), axis=1).sum()) / 2


@pytest.mark.parametrize(
    "text",
    [
        SQUARE + "f 1 2 3\nf 1 3 4\n",
        SQUARE + "f -4 -3 -2\nf -4 -2 -1\n",
        SQUARE + "fo 1 2 3\nfo 1 3 4\n",
        SQUARE.upper() + "F 1 2 3\nFO 1 3 4\n",
        (SQUARE + "f 1 2 3\nf 1 3 4\n").replace("\n", "\r\n"),
        (SQUARE + "f 1 2 3\nf 1 3 4\n").replace("\n", "\r"),
        SQUARE + "f 1 \\\n 2 3 \\\r\n 4",
        "\ufeff" + SQUARE + "f\t1//  2 3 4 # a comment\n",
        "v +0. -0 0.0e0 1\nv 1e0 0 0 1\nv 10.E-1 .1e+1 0\nv 0 0.1e1 0\nf 1 2 3 4\nl 1 2\np 1\n",
    ],
    ids=["plain", "relative", "old", "capitals", "CRLF", "CR", "continued", "BOM", "numbers"],
)
def test_a_square_in_all_spellings(tmp_path: Path, text: str) -> None:
    (mesh,) = meshes(opened(tmp_path, text))
    assert sorted(mesh.vertices.tolist()) == [[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]]
    assert len(mesh.faces) == 2
    assert area(mesh) == pytest.approx(1)
    assert mesh.normals is None


def test_keywords_in_capitals(tmp_path: Path) -> None:
    text = "MTLLIB m.mtl\n" + SQUARE + "VT 0.25 0.5\nVN 0 0 1\nUSEMTL Red\nFO 1/1/1 2/1/1 3/1/1 4/1/1\nL 1 2\n"
    scene = opened(tmp_path, text, m="NEWMTL Red\nKD 0.5 0.25 0.125\n")
    (mesh,) = meshes(scene)
    assert area(mesh) == pytest.approx(1)
    assert mesh.normals is not None
    assert (mesh.normals == [0, 0, 1]).all()
    assert scene.materials[scene.shapes[0].material].reflectance == pytest.approx((0.5, 0.25, 0.125))
    assert any("1 lines and points" in warning for warning in scene.warnings)


def test_utf_16_and_latin_1(tmp_path: Path) -> None:
    for data in ((SQUARE + "f 1 2 3 4\n").encode("utf-16"), b"# gr\xf6\xdfe\n" + SQUARE.encode() + b"f 1 2 3 4\n"):
        assert area(meshes(opened(tmp_path, data))[0]) == pytest.approx(1)


def test_polygons_that_are_not_convex(tmp_path: Path) -> None:
    # An L of three unit squares, and an arrow head whose first corner sees its notch only across the outside.
    letter = "v 0 0 5\nv 2 0 5\nv 2 1 5\nv 1 1 5\nv 1 2 5\nv 0 2 5\nf 1 2 3 4 5 6\n"
    head = "v 10 0 0\nv 12 -1 0\nv 11 0 0\nv 12 1 0\nf 2 3 4 1\n".replace("f 2 3 4 1", "f 8 9 10 7")
    (mesh,) = meshes(opened(tmp_path, letter + head))
    assert len(mesh.faces) == 4 + 2
    assert area(mesh) == pytest.approx(3 + 1)
    c = mesh.vertices[mesh.faces]
    up = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])[:, 2]
    assert (up[:4] > 0).all()


def test_faces_without_vertices_are_left_out_and_counted(tmp_path: Path) -> None:
    scene = opened(tmp_path, SQUARE + "f 1 2 3\nf 1 2 9\nf 0 1 2\nf 1 3 99999999999\nf -9 1 2\nf 1 2\n")
    assert len(meshes(scene)[0].faces) == 1
    assert scene.dropped["face with a vertex that does not exist"] == 4


def test_normals_and_coordinates_that_some_corners_lack(tmp_path: Path) -> None:
    text = SQUARE + "vn 0 0 2\nvn 0 1 0\nvt 0.25 0.25\nusemtl m\nf 1/1/1 2//1 3/9/1\nf 1 3 4\n"
    (tmp_path / "t.png").write_bytes(PNG)
    (mesh,) = meshes(opened(tmp_path, "mtllib m.mtl\n" + text, m="newmtl m\nmap_Kd t.png\n"))
    assert mesh.normals is not None
    assert mesh.uv is not None
    first, second = mesh.faces
    assert mesh.normals[first] == pytest.approx(np.tile([0, 0, 1], (3, 1)))
    # The second face has no normals: it is flat, with corners of its own.
    assert mesh.normals[second] == pytest.approx(np.tile([0, 0, 1], (3, 1)))
    assert not set(first) & set(second)
    assert mesh.uv[first].tolist() == [[0.25, 0.75], [0, 0], [0, 0]]


def test_smoothing_groups_share_normals_within_a_group(tmp_path: Path) -> None:
    roof = "v -1 0 0\nv 0 1 0\nv 1 0 0\nv -1 0 1\nv 0 1 1\nv 1 0 1\n"
    faces = "{}f 1 4 5 2\n{}f 2 5 6 3\n"
    flat = meshes(opened(tmp_path, roof + faces.format("s off\n", "")))[0]
    assert flat.normals is None
    smooth = meshes(opened(tmp_path, roof + faces.format("s 1\n", "")))[0]
    assert smooth.normals is not None
    ridge = smooth.normals[smooth.vertices[:, 1] == 1]
    assert ridge == pytest.approx(np.tile([0, 1, 0], (2, 1)), abs=1e-9)
    apart = meshes(opened(tmp_path, roof + faces.format("s 1\n", "s 2\n")))[0]
    assert apart.normals is not None
    half = 0.5**0.5
    ridge = apart.normals[apart.vertices[:, 1] == 1]
    assert sorted(ridge[:, 0]) == pytest.approx([-half, -half, half, half])
    assert ridge[:, 1] == pytest.approx(half)


def test_vertex_colours_are_decoded(tmp_path: Path) -> None:
    text = "v 0 0 0 1 0 0.5\nv 1 0 0 1 1 1\nv 0 1 0\nf 1 2 3\n"
    scene = opened(tmp_path, text)
    (mesh,) = meshes(scene)
    # 0.5 encoded as sRGB is 0.2140 (IEC 61966-2-1); a vertex without a colour is white.
    assert mesh.colours == pytest.approx(np.array([[1, 0, 0.21404], [1, 1, 1], [1, 1, 1]]), abs=1e-4)
    assert scene.materials[scene.shapes[0].material].vertex_colours
    bytes_ = meshes(opened(tmp_path, "v 0 0 0 1 255 0 127.5\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"))[0]
    assert bytes_.colours is not None
    assert bytes_.colours[0] == pytest.approx([1, 0, 0.21404], abs=1e-4)


def test_paint_of_zbrush(tmp_path: Path) -> None:
    """Colours in comments, up to 64 a line: mask, red, green, blue. Without one for each vertex they are none."""
    points = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    painted = "#MRGB ffff0080ff00FF00\n#MRGB 00ffffff\n"
    (mesh,) = meshes(opened(tmp_path, f"{points}#Vertex colours\n{painted}f 1 2 3\n"))
    assert mesh.colours == pytest.approx(np.array([[1, 0, 0.21586], [0, 1, 0], [1, 1, 1]]), abs=1e-4)
    (mesh,) = meshes(opened(tmp_path, f"{points}#MRGB ffff0080ff00ff00\nf 1 2 3\n"))
    assert mesh.colours is None


def test_one_shape_a_material_and_one_light_a_group(tmp_path: Path) -> None:
    text = "mtllib my lamps.mtl\n" + SQUARE
    for i in range(3):
        text += f"o lamp {i}\ng part\nusemtl wall paint\nf 1 2 3\no lamp {i}\nusemtl bulb\nf 1 3 4\n"
    (tmp_path / "My Lamps.MTL").write_text("newmtl wall paint\nKd 0.1 0.2 0.3\nnewmtl bulb\nKe 1 2 3\n")
    scene = opened(tmp_path, text)
    plain = [s for s in scene.shapes if s.radiance is None]
    lit = [s for s in scene.shapes if s.radiance is not None]
    assert [(s.name, len(s.geometry.faces)) for s in plain] == [("wall paint", 3)]
    assert [s.name for s in lit] == ["lamp 0 bulb", "lamp 1 bulb", "lamp 2 bulb"]
    assert scene.warnings == ()


def test_fifty_thousand_groups_take_seconds(tmp_path: Path) -> None:
    import time

    n = 50_000
    lines = [f"v {i} 0 0\nv {i} 1 0\nv {i} 0 1\ng part{i}\nusemtl m{i % 7}\nf -1 -2 -3" for i in range(n)]
    (tmp_path / "m.mtl").write_text("".join(f"newmtl m{i}\nKd 0.{i + 1} 0 0\n" for i in range(7)))
    (tmp_path / "a.obj").write_text("mtllib m.mtl\n" + "\n".join(lines))
    read_scene(tmp_path / "a.obj")  # compiles
    start = time.process_time()
    scene = read_scene(tmp_path / "a.obj")
    assert time.process_time() - start < 8
    assert sum(len(m.faces) for m in meshes(scene)) == n


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("v 0 0 0\nv 1 0 0\nl 1 2\n", ("no faces", "1 lines and points")),
        ("# nothing\n", ("no faces",)),
        ("v 1 2 3\nf 4 5 6\n", ("vertices that do not exist", "there are 1")),
        ("\xff\xfe\x00f 1 2 3\nf -99999999999999999999 1 2\nf / / /\nf 1/2/3/4 a b\n", ("do not exist",)),
    ],
)
def test_files_without_triangles(tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    with pytest.raises(SceneError) as caught:
        opened(tmp_path, text)
    for word in words:
        assert word in str(caught.value)


PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108020000009077"
    "53de0000000c49444154789c63f8cfc0000003010100c9fe92ef0000000049454e44ae426082"
)
"""One red pixel."""
