"""Transformations, and the orientation of shapes under them."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pmviewer.scene.description import Cylinder, Disk, Mesh, Parallelogram, Sphere
from pmviewer.scene.formats.mitsuba.transform import apply, look_at, rotation, similar_columns
from tests.scene.helpers import load


def shape(folder: Path, kind: str, transform: str = "", more: str = ""):
    text = f'<shape type="{kind}"><transform name="to_world">{transform}</transform>{more}</shape>'
    scene = load(folder, text)
    return scene.shapes[0].geometry, scene


def facing(p: Parallelogram) -> list[float]:
    normal = np.cross(p.edge_u, p.edge_v)
    return (normal / np.linalg.norm(normal)).tolist()


def outward(mesh: Mesh, center: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """Cosine-like sign per triangle: positive where it faces away from the centre."""
    c = mesh.vertices[mesh.faces]
    normal = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
    return ((c.mean(axis=1) - center) * normal).sum(axis=1)


def test_rotation_is_right_handed_and_about_any_axis() -> None:
    assert apply(rotation((0, 0, 1), 90), (1, 0, 0)) == pytest.approx((0, 1, 0))
    assert apply(rotation((3**-0.5,) * 3, 120), (1, 0, 0)) == pytest.approx((0, 1, 0))


def test_axis_that_is_not_of_unit_length_shears_as_in_mitsuba(tmp_path: Path) -> None:
    # mi.ScalarTransform4f().rotate([1, 1, 0], 60).matrix of Mitsuba 3.9.1
    mitsuba = [[1, 0.5, 0.866025], [0.5, 1, -0.866025], [-0.866025, 0.866025, 0.5]]
    assert rotation((1, 1, 0), 60)[:3, :3] == pytest.approx(np.array(mitsuba), abs=1e-6)
    _, scene = shape(tmp_path, "cube", '<rotate x="1" y="1" angle="60"/>')
    assert [w for w in scene.warnings if "not of unit length" in w]
    _, scene = shape(tmp_path, "cube", '<rotate x="0.71" y="0.71" angle="60"/>')
    assert scene.warnings == ()


def test_lookat_has_its_x_axis_to_the_left() -> None:
    m = look_at((0, 0, 5), (0, 0, 0), (0, 1, 0))
    assert apply(m, (0, 0, 5)) == pytest.approx((0, 0, 0))
    # Looking along −z with +y up, the viewer's left is −x.
    assert apply(m, (1, 0, 0)) == pytest.approx((-1, 0, 5))


def test_operations_apply_in_the_order_of_the_file(tmp_path: Path) -> None:
    sphere, _ = shape(tmp_path, "sphere", '<scale value="2"/><translate x="1"/><rotate z="1" angle="90"/>')
    assert sphere.center == pytest.approx((0, 1, 0))
    assert sphere.radius == pytest.approx(2)


def test_matrix_of_nine_and_sixteen_numbers(tmp_path: Path) -> None:
    a, _ = shape(tmp_path, "sphere", '<matrix value="3 0 0 0 3 0 0 0 3"/>')
    b, _ = shape(tmp_path, "sphere", '<matrix value="3 0 0 7 0 3 0 0 0 0 3 0 0 0 0 1"/>')
    assert isinstance(a, Sphere)
    assert isinstance(b, Sphere)
    assert (a.center, a.radius, b.center, b.radius) == ((0, 0, 0), 3, (7, 0, 0), 3)
    # Mitsuba 3.9.1 takes no notice of the last row: the same sphere.
    c, scene = shape(tmp_path, "sphere", '<matrix value="3 0 0 7 0 3 0 0 0 0 3 0 0 0 1 2"/>')
    assert c == replace(b, frame=c.frame)
    assert any("The last row of a <matrix> is not 0 0 0 1" in w for w in scene.warnings)


def test_rotation_about_no_axis_changes_nothing(tmp_path: Path) -> None:
    still, scene = shape(tmp_path, "rectangle", '<rotate angle="0"/>')
    assert facing(still) == [0, 0, 1]
    assert scene.warnings == ()
    odd, scene = shape(tmp_path, "rectangle", '<rotate angle="90"/><translate z="1"/>')
    assert facing(odd) == [0, 0, 1]
    assert scene.warnings == ("line 2: <rotate> has no axis: it was left out.",)


def test_lookat_without_up_is_mitsubas() -> None:
    # Columns left, up, forward and origin of to_world in Mitsuba 3.9.1 for <lookat origin="1 2 3" target="4 -5 6"/>.
    mitsuba = [
        [-0.22936767, 0.90169954, 0.36650833, 1],
        [-0.46480876, 0.22936767, -0.8551861, 2],
        [-0.8551861, -0.36650833, 0.36650833, 3],
    ]
    assert look_at((1, 2, 3), (4, -5, 6), (0, 0, 0))[:3] == pytest.approx(np.array(mitsuba), abs=1e-6)


def test_shapes_whose_place_is_unknown_are_left_out(tmp_path: Path) -> None:
    scene = load(
        tmp_path, '<shape type="cube"/>', '<shape type="cube"><transform name="to_world"><shear/></transform></shape>'
    )
    assert len(scene.shapes) == 1
    assert "found <shear>. The shape is left out." in scene.warnings[0]


def test_similarity() -> None:
    assert similar_columns(rotation((0.6, 0, 0.8), 40) * 2) == pytest.approx(2)
    assert similar_columns(np.diag([1.0, 1, 1.001, 1])) is None


@pytest.mark.parametrize(
    ("transform", "more", "normal"),
    [
        ("", "", [0, 0, 1]),
        ('<rotate x="1" angle="90"/>', "", [0, -1, 0]),
        ("", '<boolean name="flip_normals" value="true"/>', [0, 0, -1]),
        # A mirrored rectangle keeps facing where its transformed normal points.
        ('<scale x="-1"/>', "", [0, 0, 1]),
        ('<scale z="-1"/>', "", [0, 0, -1]),
    ],
)
def test_rectangle_faces_its_normal(tmp_path: Path, transform: str, more: str, normal: list[float]) -> None:
    rectangle, _ = shape(tmp_path, "rectangle", transform, more)
    assert facing(rectangle) == pytest.approx(normal, abs=1e-12)
    center = np.array(rectangle.corner) + (np.array(rectangle.edge_u) + rectangle.edge_v) / 2
    assert center == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("mirror", ["", '<scale x="-1"/>'])
@pytest.mark.parametrize("flip", ["false", "true"])
def test_cube_faces_outwards_unless_flipped(tmp_path: Path, mirror: str, flip: str) -> None:
    cube, _ = shape(tmp_path, "cube", mirror, f'<boolean name="flip_normals" value="{flip}"/>')
    signs = outward(cube)
    assert len(signs) == 12
    assert (signs < 0).all() if flip == "true" else (signs > 0).all()


def test_disk_and_its_normal(tmp_path: Path) -> None:
    disk, _ = shape(tmp_path, "disk", '<scale value="2"/><rotate y="1" angle="90"/><translate z="3"/>')
    assert isinstance(disk, Disk)
    assert disk.center == pytest.approx((0, 0, 3))
    assert disk.normal == pytest.approx((1, 0, 0))
    assert disk.radius == pytest.approx(2)
    flipped, _ = shape(tmp_path, "disk", "", '<boolean name="flip_normals" value="true"/>')
    assert flipped.normal == pytest.approx((0, 0, -1))


def test_cylinder_by_its_points_and_by_transformation(tmp_path: Path) -> None:
    more = '<point name="p0" value="0 0 1"/><point name="p1" value="0 0 3"/><float name="radius" value="0.5"/>'
    tube, _ = shape(tmp_path, "cylinder", '<rotate x="1" angle="-90"/><scale value="2"/>', more)
    assert isinstance(tube, Cylinder)
    assert tube.p0 == pytest.approx((0, 2, 0))
    assert tube.p1 == pytest.approx((0, 6, 0))
    assert tube.radius == pytest.approx(1)
    # Stretching along the axis leaves a cylinder a cylinder.
    stretched, scene = shape(tmp_path, "cylinder", '<scale z="5"/>')
    assert isinstance(stretched, Cylinder)
    assert scene.warnings == ()


def test_mirrored_sphere_turns_inside_out_and_a_cylinder_does_not(tmp_path: Path) -> None:
    assert shape(tmp_path, "sphere", '<scale x="-1"/>')[0].flip_normals
    assert not shape(tmp_path, "sphere", '<scale x="-1" y="-1"/>')[0].flip_normals
    assert not shape(tmp_path, "cylinder", '<scale x="-1"/>')[0].flip_normals
    assert not shape(tmp_path, "cylinder", '<scale z="-1"/>')[0].flip_normals


@pytest.mark.parametrize(("kind", "area"), [("sphere", 0), ("cylinder", 0), ("disk", 2 * math.pi)])
def test_uneven_scale_gives_a_mesh_and_a_warning(tmp_path: Path, kind: str, area: float) -> None:
    mesh, scene = shape(tmp_path, kind, '<scale x="2"/>')
    assert isinstance(mesh, Mesh)
    assert "scaled unevenly" in scene.warnings[0]
    assert np.abs(mesh.vertices).max(axis=0)[0] == pytest.approx(2, rel=1e-3)
    if kind != "disk":
        assert (outward(mesh) > 0).all()
        assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1)
    else:
        c = mesh.vertices[mesh.faces]
        cross = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
        assert np.linalg.norm(cross, axis=1).sum() / 2 == pytest.approx(area, rel=1e-3)
        assert (cross[:, 2] > 0).all()


def test_normals_of_a_stretched_sphere_stand_on_it(tmp_path: Path) -> None:
    mesh, _ = shape(tmp_path, "sphere", '<scale x="2" y="3"/>')
    gradient = mesh.vertices / np.array([4.0, 9, 1])
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    assert mesh.normals == pytest.approx(gradient, abs=1e-9)
