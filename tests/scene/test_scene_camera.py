"""Sensor and film, and what is cleaned out of a scene."""

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from pmviewer.errors import SettingError
from pmviewer.render.camera import resolve_camera
from pmviewer.scene.clean import clean_mesh
from pmviewer.scene.description import Mesh, PixelFilter, Scene
from pmviewer.settings.access import CameraSettings
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
    assert without.cameras == ()
    meter = sensor(tmp_path, FILM, kind="irradiancemeter")
    assert "looks nowhere in particular" in meter.warnings[0]
    assert (meter.width, meter.height) == (200, 100)
    lens = sensor(
        tmp_path, f'<float name="fov" value="30"/><float name="aperture_radius" value="1"/>{FILM}', kind="thinlens"
    )
    assert lens.warnings == ()
    assert lens.camera.fov == 30
    odd = sensor(tmp_path, f'<float name="fov" value="30"/>{FILM}', kind="fisheye")
    assert "approximated by a perspective camera" in odd.warnings[0]
    assert odd.camera.fov == 30


def test_orthographic_cameras(tmp_path: Path) -> None:
    """Mitsuba's documentation: 2 units wide and high, which `to_world` scales."""
    turn = '<scale x="10" y="10"/><lookat origin="1 1 9" target="1 1 1" up="0 1 0"/>'
    scene = sensor(tmp_path, FILM, turn, kind="orthographic")
    camera = scene.camera
    assert (camera.projection, camera.width, camera.shift, scene.warnings) == ("orthographic", 20, (0, 0), ())
    assert (camera.origin, camera.up[1]) == ((1, 1, 9), 10)
    uneven = sensor(tmp_path, FILM, '<scale x="2" y="3"/><translate z="-9"/>', kind="telecentric")
    assert uneven.camera.width == 4
    assert len(uneven.warnings) == 2


def test_cameras_with_a_lens(tmp_path: Path) -> None:
    """Mitsuba 3.9.1 says of a thinlens without a distance: focus_distance = 10000, its far_clip."""
    lens = '<float name="aperture_radius" value="0.25"/>'
    given = sensor(tmp_path, lens + '<float name="focusDistance" value="3.5"/>' + FILM, kind="thinlens")
    assert (given.camera.aperture, given.camera.focus, given.warnings) == (0.25, 3.5, ())
    left = sensor(tmp_path, lens + FILM, kind="thinlens")
    assert (left.camera.aperture, left.camera.focus, left.warnings) == (0.25, 10000, ())
    clipped = sensor(tmp_path, lens + '<float name="far_clip" value="70"/>' + FILM, kind="thinlens")
    assert clipped.camera.focus == 70
    flat = sensor(tmp_path, lens + '<float name="focus_distance" value="2"/>' + FILM, kind="telecentric")
    assert (flat.camera.projection, flat.camera.aperture, flat.camera.focus) == ("orthographic", 0.25, 2)
    assert flat.warnings == ()
    none = sensor(tmp_path, FILM, kind="thinlens")
    assert (none.camera.aperture, len(none.warnings)) == (0, 1)
    assert "has no 'aperture_radius'" in none.warnings[0]
    odd = '<float name="aperture_radius" value="-1"/><float name="focus_distance" value="0"/>'
    wrong = sensor(tmp_path, odd + FILM, kind="thinlens")
    assert (wrong.camera.aperture, wrong.camera.focus) == (0, None)
    assert "can't be -1" in wrong.warnings[0]
    assert "can't be 0" in wrong.warnings[1]
    pinhole = sensor(tmp_path, lens + FILM)
    assert (pinhole.camera.aperture, pinhole.warnings) == (0, ())


FILTERS = {
    "box": ('type="box"/>', PixelFilter("box", 0.5)),
    "tent": ('type="tent"><float name="radius" value="1.5"/></rfilter>', PixelFilter("tent", 1.5)),
    "gaussian": ('type="gaussian"><float name="stddev" value="0.4"/></rfilter>', PixelFilter("Gaussian", 1.6, (0.4,))),
    "mitchell": (
        'type="mitchell"><float name="B" value="0.2"/><float name="C" value="0.4"/></rfilter>',
        PixelFilter("Mitchell-Netravali", 2.0, (0.2, 0.4)),
    ),
    "catmullrom": ('type="catmullrom"/>', PixelFilter("Catmull-Rom", 2.0)),
    "lanczos": ('type="lanczos"><integer name="lobes" value="2"/></rfilter>', PixelFilter("Lanczos", 2.0)),
}


@pytest.mark.parametrize("name", FILTERS)
def test_reconstruction_filters_of_the_film(tmp_path: Path, name: str) -> None:
    text, expected = FILTERS[name]
    scene = sensor(tmp_path, FILM.replace("</film>", f"<rfilter {text}</film>"))
    assert scene.warnings == ()
    assert scene.camera.filter is not None
    assert (scene.camera.filter.kind, scene.camera.filter.radius) == (expected.kind, pytest.approx(expected.radius))
    assert scene.camera.filter.shape == expected.shape


def test_filters_that_can_not_be(tmp_path: Path) -> None:
    assert sensor(tmp_path, FILM).camera.filter == PixelFilter("Gaussian", 2.0, (0.5,)), "Mitsuba's, without one"
    unknown = sensor(tmp_path, FILM.replace("</film>", '<rfilter type="sinc"/></film>'))
    assert unknown.camera.filter is None
    assert "the box filter replaces it" in unknown.warnings[0]
    wide = '<rfilter type="lanczos"><integer name="lobes" value="900"/></rfilter></film>'
    scene = sensor(tmp_path, FILM.replace("</film>", wide))
    assert scene.camera.filter == PixelFilter("Lanczos", 8.0)
    assert "can't reach 900 pixels" in scene.warnings[0]
    flat = '<rfilter type="gaussian"><float name="stddev" value="0"/></rfilter></film>'
    scene = sensor(tmp_path, FILM.replace("</film>", flat))
    assert scene.camera.filter == PixelFilter("Gaussian", 2.0, (0.5,))
    assert "must be above zero" in scene.warnings[0]


CROP = (
    '<film type="hdrfilm"><integer name="width" value="200"/><integer name="height" value="100"/>'
    '<integer name="crop_width" value="{w}"/><integer name="crop_height" value="20"/>'
    '<integer name="crop_offset_x" value="110"/><integer name="crop_offset_y" value="10"/></film>'
)


@pytest.mark.parametrize(("axis", "fov"), [("x", 90), ("y", 90), ("diagonal", 90), ("larger", 90), ("smaller", 90)])
def test_a_cropped_film_is_a_smaller_picture_moved_aside(tmp_path: Path, axis: str, fov: float) -> None:
    words = f'<float name="fov" value="{fov}"/><string name="fov_axis" value="{axis}"/>'
    whole, part = sensor(tmp_path, words + FILM), sensor(tmp_path, words + CROP.format(w=50))
    assert (part.width, part.height) == (50, 20)
    # Columns 110 to 160 lie 35 pixels right of the film's middle, rows 10 to 30 lie 30 above it.
    assert part.camera.shift == pytest.approx((35 / 50, -30 / 20))
    a, b = (resolve_camera(s, CameraSettings()).pixel_angle() for s in (whole, part))
    assert b == pytest.approx(a)


def test_crop_windows_that_leave_the_film_and_odd_sizes_are_cut(tmp_path: Path) -> None:
    scene = sensor(tmp_path, CROP.format(w=150))
    assert (scene.width, scene.height, scene.camera.shift) == (200, 100, (0, 0))
    assert "leaves the film" in scene.warnings[0]
    huge = FILM.replace('"200"', '"32768"').replace('"100"', '"0"')
    scene = sensor(tmp_path, huge)
    assert (scene.width, scene.height) == (16384, 1)
    assert "can't be 32768 × 0 pixels" in scene.warnings[0]


def test_the_principal_point(tmp_path: Path) -> None:
    """Mitsuba 3.9.1 with principal_point_offset_x = 0.1: what was in the middle of 20 pixels is 2 pixels to the left,
    so the picture's middle lies to the right of the view direction."""
    offsets = '<float name="principal_point_offset_x" value="0.1"/><float name="principalPointOffsetY" value="-0.2"/>'
    scene = sensor(tmp_path, offsets + FILM)
    assert (scene.camera.shift, scene.warnings) == ((0.1, -0.2), ())


def test_all_cameras_of_a_file_are_there(tmp_path: Path) -> None:
    first = '<sensor type="irradiancemeter"/>'
    second = '<sensor type="perspective" id="front"><float name="fov" value="30"/></sensor>'
    third = f'<sensor type="batch"><sensor type="orthographic">{FILM}</sensor><sensor type="thinlens"/></sensor>'
    scene = load(tmp_path, '<shape type="cube"/>', first, second, third, camera="")
    assert [c.name for c in scene.cameras] == ["front", "orthographic (line 5)", "thinlens (line 5)"]
    assert scene.camera is scene.cameras[0].camera
    assert (scene.cameras[1].width, scene.cameras[1].camera.projection) == (200, "orthographic")
    assert any("'front' gives the view, 2 other cameras" in w for w in scene.warnings)


@pytest.mark.parametrize(
    ("inside", "fov", "words"),
    [
        ('<float name="fov" value="180"/>', 179, "can't be 180 degrees"),
        ('<float name="fov" value="0"/>', 0.001, "can't be 0 degrees"),
        ('<string name="focal_length" value="long"/>', 46.793, "50 mm replace it"),
        ('<float name="focal_length" value="50"/>', 46.793, ""),
        ('<float name="fov" value="9"/><string name="fov_axis" value="z"/>', 9, "'z' is not known, x"),
        ('<float name="near_clip" value="5"/><float name="far_clip" value="2"/>', 46.793, "nothing is clipped"),
    ],
)
def test_impossible_lenses_are_cut(tmp_path: Path, inside: str, fov: float, words: str) -> None:
    scene = sensor(tmp_path, inside)
    assert scene.camera.fov == pytest.approx(fov, abs=1e-3)
    assert [words in w for w in scene.warnings] == [True] * bool(words)


@pytest.mark.parametrize(
    "turn", ['<scale x="0"/>', '<scale value="1e-20"/>', '<matrix value="1 0 0 0 0 1 0 0 1 0 0 0 0 0 0 1"/>']
)
def test_a_singular_camera_is_left_out(tmp_path: Path, turn: str) -> None:
    scene = sensor(tmp_path, FILM, turn)
    if "1e-20" in turn:  # small, but it looks somewhere
        assert len(scene.cameras) == 1
        return
    assert scene.cameras == ()
    assert any("singular: it is left out" in w for w in scene.warnings)
    assert (scene.width, scene.height) == (200, 100)


def test_up_along_the_view_is_replaced(tmp_path: Path) -> None:
    scene = sensor(tmp_path, FILM, '<lookat origin="0 9 0" target="0 0 0" up="0 1 0"/>')
    assert (scene.camera.origin, scene.camera.target) == ((0, 9, 0), (0, 0, 0))
    assert abs(scene.camera.up[1]) < 1
    assert len(scene.warnings) == 1


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


def named_sensor(name: str, x: float) -> str:
    return (
        f'<sensor type="perspective" id="{name}"><transform name="to_world"><lookat origin="{x} 0 5" '
        f'target="0 0 0" up="0 1 0"/></transform><film type="hdrfilm"><integer name="width" value="{10 + int(x)}"/>'
        '<integer name="height" value="8"/></film></sensor>'
    )


def test_every_camera_of_the_file_can_be_chosen(tmp_path: Path) -> None:
    scene = load(tmp_path, '<shape type="sphere"/>', named_sensor("front", 0), named_sensor("aside", 3), camera="")
    assert [camera.name for camera in scene.cameras] == ["front", "aside"]
    assert resolve_camera(scene, CameraSettings()).origin == (0, 0, 5)
    for name in ("aside", "2"):
        pose = resolve_camera(scene, CameraSettings(name=name))
        assert (pose.origin, pose.width) == ((3, 0, 5), 13)
    moved = resolve_camera(scene, CameraSettings(name="aside", origin=(1.0, 2.0, 3.0), width=50))
    assert (moved.origin, moved.target, moved.width) == ((1, 2, 3), (0, 0, 0), 50)
    for name in ("behind", "3", "0"):
        with pytest.raises(SettingError, match=r"2 cameras: front, aside\."):
            resolve_camera(scene, CameraSettings(name=name))


def test_a_file_without_a_camera_has_none_to_choose(tmp_path: Path) -> None:
    scene = load(tmp_path, '<shape type="sphere"/>', camera="")
    with pytest.raises(SettingError, match="has no camera"):
        resolve_camera(scene, CameraSettings(name="1"))
