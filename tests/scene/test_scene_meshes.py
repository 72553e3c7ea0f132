"""glTF, OBJ, PLY and STL, from files made here."""

import re
import struct
from pathlib import Path

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.render.camera import resolve_camera
from pmviewer.scene.description import BLACK, Mesh, Parallelogram, Scene
from pmviewer.scene.formats.ply import read_ply
from pmviewer.scene.load import load_scene, read_scene
from pmviewer.settings.access import CameraSettings
from tests.scene.helpers import load

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)


def only_mesh(scene: Scene) -> Mesh:
    (mesh,) = (s.geometry for s in scene.shapes if isinstance(s.geometry, Mesh))
    return mesh


def corners(mesh: Mesh) -> list[list[float]]:
    return sorted(np.round(mesh.vertices[mesh.faces].reshape(-1, 3), 6).tolist())


def test_obj_with_materials_polygons_and_old_encoding(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text(
        "newmtl wall\nKd 0.1 0.2 0.3\nnewmtl lamp\nKd 0 0 0\nKe 5 4 3\n"
        "newmtl glass\nillum 7\nNi 1.4\nnewmtl mirror\nillum 3\nKd 0 0 0\nKs 0.9 0.9 0.9\n"
    )
    text = "# größe\nmtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    for name in ("wall", "lamp", "glass", "mirror"):
        text += f"usemtl {name}\nf 1 2 3 4\n"
    (tmp_path / "a.obj").write_bytes(text.encode("latin-1"))
    scene = read_scene(tmp_path / "a.obj")
    by_name = {scene.materials[s.material].name: (scene.materials[s.material], s) for s in scene.shapes}
    assert by_name["wall"][0].reflectance == (0.1, 0.2, 0.3)
    assert by_name["lamp"][1].radiance == (5, 4, 3)
    assert (by_name["glass"][0].kind, by_name["glass"][0].eta) == ("dielectric", 1.4)
    assert (by_name["mirror"][0].kind, by_name["mirror"][0].reflectance) == ("conductor", (0.9, 0.9, 0.9))
    assert all(len(s.geometry.faces) == 2 for s in scene.shapes)
    assert scene.lights == ()


def test_obj_without_its_material_file(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib gone.mtl\nusemtl x\nf 1 2 3\n")
    scene = load_scene(tmp_path / "a.obj")
    assert "line 4: The material file 'gone.mtl' does not exist" in scene.warnings[0]
    assert scene.shapes[0].name == "a"


STL = (
    "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n"
)


def test_stl_text_and_binary(tmp_path: Path) -> None:
    (tmp_path / "text.stl").write_text(STL)
    record = struct.pack("<3f", 0, 0, 1) + TRIANGLE.tobytes() + b"\0\0"
    (tmp_path / "binary.stl").write_bytes(b"solid but binary".ljust(80) + struct.pack("<I", 1) + record)
    for name in ("text.stl", "binary.stl"):
        scene = load_scene(tmp_path / name)
        assert corners(only_mesh(scene)) == sorted(TRIANGLE.tolist())
        assert scene.camera.up == (0, 0, 1)


PLY_HEADER = (
    "ply\nformat {} 1.0\ncomment made here\nelement vertex 4\nproperty {f} x\nproperty {f} y\nproperty {f} z\n"
    "property float nx\nproperty float ny\nproperty float nz\nelement face 2\n"
    "property list uchar {i} vertex_indices\nend_header\n"
)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("mixed", [False, True])
def test_ply_in_all_its_formats(tmp_path: Path, kind: str, mixed: bool) -> None:
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    polygons = [(0, 1, 2), (0, 1, 2, 3)] if mixed else [(0, 1, 2), (0, 2, 3)]
    header = PLY_HEADER.format(kind, f="double", i="uint")
    if kind == "ascii":
        rows = [" ".join(map(str, (*p, 0, 0, 1))) for p in points]
        rows += [" ".join(map(str, (len(p), *p))) for p in polygons]
        body = "\n".join(rows).encode()
    else:
        order = "<" if kind == "binary_little_endian" else ">"
        body = b"".join(struct.pack(order + "3d3f", *p, 0, 0, 1) for p in points)
        body += b"".join(struct.pack(f"{order}B{len(p)}I", len(p), *p) for p in polygons)
    path = tmp_path / "a.ply"
    path.write_bytes(header.encode() + body)
    mesh = read_ply(path)
    assert mesh.vertices.tolist() == [list(p) for p in points]
    assert mesh.normals is not None
    assert mesh.normals.tolist() == [[0, 0, 1]] * 4
    expected = [[0, 1, 2], [0, 1, 2], [0, 2, 3]] if mixed else [[0, 1, 2], [0, 2, 3]]
    assert sorted(mesh.faces.tolist()) == expected


def test_scene_without_light_gets_one_out_of_sight(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_text(STL)
    scene = load_scene(tmp_path / "a.stl")
    light = next(shape for shape in scene.shapes if shape.radiance)
    assert isinstance(light.geometry, Parallelogram)
    assert np.cross(light.geometry.edge_u, light.geometry.edge_v)[2] < 0
    assert scene.materials[light.material].reflectance == BLACK
    assert any("soft light above" in w for w in scene.warnings)
    pose = resolve_camera(scene, CameraSettings())
    corner, u, v = (np.array(x) for x in (light.geometry.corner, light.geometry.edge_u, light.geometry.edge_v))
    s, t = (x.reshape(-1, 1) for x in np.meshgrid(np.linspace(0, 1, 20), np.linspace(0, 1, 20)))
    x, y, depth = pose.project(corner + s * u + t * v).T
    assert not ((x >= 0) & (x < 512) & (y >= 0) & (y < 512) & (depth > 0)).any()


def test_framed_camera_sees_everything(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1000 0 0\nv 0 1 0\nv 0 0 30\nf 1 2 3\nf 1 3 4\n")
    scene = load_scene(tmp_path / "a.obj")
    corners = np.array([[0, 0, 0], [1000, 0, 0], [0, 1, 0], [0, 0, 30]])
    x, y, depth = resolve_camera(scene, CameraSettings()).project(corners).T
    assert ((x > 0) & (x < 512) & (y > 0) & (y < 512) & (depth > 0)).all()


OBJ_ROOF = "v -1 0 0\nv 0 1 0\nv 1 0 0\nv -1 0 1\nv 0 1 1\nv 1 0 1\nf 1 4 5\nf 1 5 2\nf 2 5 6\nf 2 6 3\n"


def test_mitsuba_smooths_meshes_without_normals_unless_told_not_to(tmp_path: Path) -> None:
    (tmp_path / "roof.obj").write_text(OBJ_ROOF)
    shape = '<shape type="obj"><string name="filename" value="roof.obj"/>{}</shape>'
    smooth = load(tmp_path, shape.format("")).shapes[0].geometry
    ridge = smooth.normals[smooth.vertices[:, 1] == 1]
    assert ridge == pytest.approx(np.tile([0, 1, 0], (2, 1)), abs=1e-9)
    flat = load(tmp_path, shape.format('<boolean name="face_normals" value="true"/>')).shapes[0].geometry
    assert flat.normals is None


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("own_normals", [False, True])
def test_mirrored_mesh_turns_inside_out_unless_it_has_normals_of_its_own(
    tmp_path: Path, own_normals: bool, flip: bool
) -> None:
    roof = OBJ_ROOF
    if own_normals:
        roof = re.sub(r"^(f .*)$", lambda m: re.sub(r"(\d+)(?=\s|$)", r"\1//1", m[1]), roof, flags=re.MULTILINE)
        roof = "vn 0 1 0\n" + roof
    (tmp_path / "roof.obj").write_text(roof)
    mirror = '<transform name="to_world"><scale x="-1"/></transform>'
    more = '<boolean name="flip_normals" value="true"/>' if flip else ""
    text = f'<shape type="obj"><string name="filename" value="roof.obj"/>{mirror}{more}</shape>'
    mesh = load(tmp_path, text).shapes[0].geometry
    sign = (1 if own_normals else -1) * (-1 if flip else 1)
    c = mesh.vertices[mesh.faces]
    geometric = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
    assert (sign * geometric[:, 1] > 0).all()
    assert (sign * mesh.normals[:, 1] > 0).all()


def test_normals_in_the_file_tell_the_outside_whatever_the_order_of_corners(tmp_path: Path) -> None:
    for face in ("f 1//1 2//1 3//1", "f 3//1 2//1 1//1"):
        (tmp_path / "one.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n{face}\n")
        text = '<shape type="obj"><string name="filename" value="one.obj"/></shape>'
        c = load(tmp_path, text).shapes[0].geometry
        a, b, d = c.vertices[c.faces[0]]
        assert np.cross(b - a, d - a)[2] > 0


def test_computed_normals_stop_at_vertices_that_are_there_twice(tmp_path: Path) -> None:
    """As in Mitsuba: faces share a normal where they share a vertex, not where they only touch."""
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nv 0 1 0\nv 0 0 1\n"
    text = '<shape type="obj"><string name="filename" value="edge.obj"/></shape>'
    (tmp_path / "edge.obj").write_text(corners + "f 1 2 3\nf 4 5 6\n")
    mesh = load(tmp_path, text).shapes[0].geometry
    assert sorted(map(tuple, np.abs(mesh.normals).round(6).tolist())) == [(0, 0, 1)] * 3 + [(1, 0, 0)] * 3


def test_folder_and_parameters_of_other_formats(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_text(STL)
    assert any("'res' was given" in warning for warning in load_scene(tmp_path / "a.stl", {"res": "1"}).warnings)
    with pytest.raises(SceneError, match=r"no scene\.xml"):
        load_scene(tmp_path)
