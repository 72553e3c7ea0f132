"""Sensor and film, and what is cleaned out of a scene."""

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.render.camera import resolve_camera
from pmviewer.scene.clean import clean_mesh
from pmviewer.scene.description import Mesh, Scene
from pmviewer.settings import CameraSettings
from tests.scene.helpers import load


def sensor(folder: Path, inside: str, transform: str = "", kind: str = "perspective") -> Scene:
    text = f'<sensor type="{kind}"><transform name="to_world">{transform}</transform>{inside}</sensor>'
    return load(folder, '<shape type="cube"/>', camera=text)


FILM = '<film type="hdrfilm"><integer name="width" value="200"/><integer name="height" value="100"/></film>'


def test_without_transformation_it_looks_along_z_with_x_to_the_left(tmp_path: Path) -> None:
    scene = sensor(tmp_path, f'<float name="fov" value="90"/>{FILM}')
    # 90° along x over 200 pixels: one unit to the side at distance one is the picture's edge.
    found = resolve_camera(scene, CameraSettings()).project(np.array([[1, 0, 1], [0, 0.5, 1]], float))
    assert found == pytest.approx(np.array([[0, 50, 1], [100, 0, 1]]), abs=1e-9)


@pytest.mark.parametrize(
    ("axis", "point"),
    [("x", [1, 0, 1]), ("y", [0, 1, 1]), ("smaller", [0, 1, 1]), ("larger", [1, 0, 1]), ("diagonal", None)],
)
def test_fov_along_every_axis(tmp_path: Path, axis: str, point: list[float] | None) -> None:
    scene = sensor(tmp_path, f'<float name="fov" value="90"/><string name="fov_axis" value="{axis}"/>{FILM}')
    if point is None:
        point = [2 / math.sqrt(5), 1 / math.sqrt(5), 1]
    x, y, _ = resolve_camera(scene, CameraSettings()).project(np.array([point], float))[0]
    assert x == pytest.approx(0, abs=1e-9) or y == pytest.approx(0, abs=1e-9)


def test_focal_length_is_of_a_35_mm_film_diagonal(tmp_path: Path) -> None:
    camera = sensor(tmp_path, '<string name="focal_length" value="50mm"/>').camera
    assert (camera.fov, camera.fov_axis) == (pytest.approx(46.793, abs=1e-3), "diagonal")
    assert sensor(tmp_path, "").camera.fov == camera.fov


def test_defaults_of_film_and_clipping(tmp_path: Path) -> None:
    scene = sensor(tmp_path, "")
    assert (scene.width, scene.height, scene.camera.near, scene.camera.far) == (768, 576, 0.0, float("inf"))


def test_mirrored_camera(tmp_path: Path) -> None:
    plain = sensor(tmp_path, FILM, '<lookat origin="1 2 5" target="0 0 0" up="0 1 0"/>')
    flipped = sensor(tmp_path, FILM, '<scale x="-1"/><lookat origin="1 2 5" target="0 0 0" up="0 1 0"/>')
    assert flipped.camera.mirrored
    assert flipped.warnings == ()
    point = np.array([[0.3, 0.2, 0.1]])
    a, b = (resolve_camera(s, CameraSettings()).project(point)[0] for s in (plain, flipped))
    assert b == pytest.approx([200 - a[0], a[1], a[2]])


def test_scaled_camera_is_straightened_with_a_warning(tmp_path: Path) -> None:
    scene = sensor(tmp_path, FILM, '<scale value="3"/><translate z="-9"/>')
    assert "Scale and shear" in scene.warnings[0]
    assert scene.camera.origin == (0, 0, -9)
    # Without a lookat the orbit point is the scene's middle.
    assert scene.camera.target == pytest.approx((0, 0, 0))


def test_missing_and_unsupported_sensors_are_replaced(tmp_path: Path) -> None:
    without = load(tmp_path, '<shape type="cube"/>', camera="")
    assert "no camera" in without.warnings[0]
    flat = sensor(tmp_path, FILM, kind="orthographic")
    assert "orthographic" in flat.warnings[0]
    assert (flat.width, flat.height) == (200, 100)
    lens = sensor(
        tmp_path, f'<float name="fov" value="30"/><float name="aperture_radius" value="1"/>{FILM}', kind="thinlens"
    )
    assert len(lens.warnings) == 1
    assert lens.camera.fov == 30


@pytest.mark.parametrize("inside", ['<float name="fov" value="180"/>', '<float name="fov" value="0"/>',
                                    '<string name="focal_length" value="long"/>',
                                    '<float name="fov" value="9"/><string name="fov_axis" value="z"/>'])  # fmt: skip
def test_impossible_lenses(tmp_path: Path, inside: str) -> None:
    with pytest.raises(SceneError) as caught:
        sensor(tmp_path, inside)
    assert caught.value.line == 3


def test_degenerate_triangles_are_dropped_and_counted() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [np.inf, 0, 0]], np.float64)
    faces = np.array([[0, 1, 2], [0, 1, 3], [1, 1, 2], [0, 1, 4]], np.int32)
    dropped: Counter[str] = Counter()
    mesh = clean_mesh(Mesh(vertices, faces), dropped)
    assert mesh is not None
    assert mesh.faces.tolist() == [[0, 1, 2]]
    assert len(mesh.vertices) == 3
    assert dropped == {"degenerate triangle": 2, "triangle with a NaN, infinite or huge vertex": 1}


@pytest.mark.parametrize("scale", [1e-12, 1e-4, 1e5, 1e12])
def test_size_does_not_decide_what_is_degenerate(scale: float) -> None:
    vertices = scale * np.array([[0, 0, 0], [1, 0, 0], [1, 1e-5, 0]])
    dropped: Counter[str] = Counter()
    assert clean_mesh(Mesh(vertices, np.array([[0, 1, 2]], np.int32)), dropped) is not None
    assert not dropped


def test_triangle_that_float32_flattens_is_dropped() -> None:
    vertices = np.array([[1e6, 0, 0], [1e6 + 1e-3, 0, 0], [1e6, 1, 0]])
    dropped: Counter[str] = Counter()
    assert clean_mesh(Mesh(vertices, np.array([[0, 1, 2]], np.int32)), dropped) is None
    assert dropped == {"degenerate triangle": 1}


def test_broken_normals_are_replaced_by_the_faces() -> None:
    normals = np.array([[0, 0, 2], [np.nan, 0, 0], [0, 0, 0]], np.float64)
    mesh = clean_mesh(Mesh(np.eye(3) * [1, 1, 0], np.array([[2, 0, 1]], np.int32), normals), Counter())
    assert mesh is not None
    assert mesh.normals == pytest.approx(np.tile([0, 0, 1], (3, 1)))
