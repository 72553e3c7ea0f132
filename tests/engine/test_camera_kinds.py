"""Orthographic and shifted cameras: rays, projection, OpenGL's matrices, importons, settings, navigation, texts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.kernels.accel.raycast import cast_closest
from pmviewer.output.frame_export import frame_metadata
from pmviewer.output.session_file import read_session, write_session
from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.render.direct.outline import outline_pixels
from pmviewer.render.free_camera import as_perspective, frustum_lines
from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.clean import check_camera
from pmviewer.scene.describe import describe
from pmviewer.scene.description import Camera, Parallelogram, Scene, Shape, Sphere
from pmviewer.settings.access import CameraSettings, Settings, with_values
from pmviewer.viewer.viewport import controls
from tests.support.importon_paths import SHOWN, traced
from tests.support.scenes import diffuse, diffuse_box, rendered, settings_of

ORTHOGRAPHIC = CameraPose(
    (1, 2, 3), (0.5, 0, -1), (0, 1, 0), 50.0, 64, 40, projection="orthographic", view_width=3.0, shift=(0.1, -0.3)
)
SHIFTED = CameraPose((1, 2, 3), (0.5, 0, -1), (0, 1, 0), 50.0, 64, 40, shift=(0.2, 0.15))
POSES = [ORTHOGRAPHIC, SHIFTED, replace(ORTHOGRAPHIC, mirrored=True), replace(SHIFTED, mirrored=True)]


@pytest.mark.parametrize("pose", POSES)
def test_rays_project_to_where_they_start(pose):
    """Points along the rays of known pixels come back to these pixels, by `project` and by OpenGL's matrices."""
    x, y = np.array([0.0, 64.0, 10.5, 33.0]), np.array([0.0, 40.0, 3.25, 20.0])
    origins, directions = pose.rays(x, y)
    for distance in (0.5, 2.0, 7.0):
        points = origins + distance * directions
        found = pose.project(points)
        np.testing.assert_allclose(found[:, :2], np.stack([x, y], 1), atol=1e-9)
        np.testing.assert_allclose(found[:, 2], (points - pose.origin) @ pose.axes()[2])
        clip = pose.projection_matrix(0.1, 10.0) @ pose.view_matrix() @ np.vstack([points.T, np.ones(4)])
        np.testing.assert_allclose((clip[0] / clip[3] + 1) / 2 * 64, x, atol=1e-9)
        np.testing.assert_allclose((1 - clip[1] / clip[3]) / 2 * 40, y, atol=1e-9)
    forward = pose.axes()[2]
    for depth, z in ((0.1, -1.0), (10.0, 1.0)):
        clip = pose.projection_matrix(0.1, 10.0) @ pose.view_matrix() @ np.append(pose.origin + depth * forward, 1.0)
        assert clip[2] / clip[3] == pytest.approx(z)


def test_known_pixels():
    """Counted by hand: the picture spans x from −1 to 3 at the top, its middle half a width to the right."""
    pose = CameraPose((0, 0, 5), (0, 0, 0), (0, 1, 0), 40.0, 8, 4, projection="orthographic", view_width=4.0)
    found = pose.project(np.array([[-2.0, 1.0, 0.0], [2.0, -1.0, 4.0], [0.5, 0.0, -90.0]]))
    np.testing.assert_allclose(found, [[0, 0, 5], [8, 4, 1], [5, 2, 95]], atol=1e-12)
    moved = replace(pose, shift=(0.25, 0.5))  # a width to the right is 4, a height down is 2
    found = moved.project(np.array([[1.0, -1.0, 0.0]]))
    np.testing.assert_allclose(found[0, :2], [4, 2], atol=1e-12)
    assert not pose.sees_like(moved)
    assert pose.sees_like(replace(pose, fov=80.0, target=(0, 0, -7)))
    assert not pose.sees_like(replace(pose, view_width=4.01))


def scene_of(camera, size=(64, 40)):
    ball = Shape("ball", Sphere((0.4, 0.3, -0.5), 0.5), 0, (1.0, 1.0, 1.0))
    floor = Shape("floor", Parallelogram((-4, -0.6, -4), (0, 0, 8), (8, 0, 0)), 0)
    return Scene("views", None, (ball, floor), (diffuse(),), (), camera, *size)


CAMERAS = {
    "orthographic": Camera((1, 2, 3), (0.5, 0, -1), (0, 1, 0), 40.0, projection="orthographic", width=3.0),
    "shifted": Camera((1, 2, 3), (0.5, 0, -1), (0, 1, 0), 40.0, shift=(0.15, 0.1)),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_outline_of_a_light_is_where_its_rays_begin_to_meet_it(name):
    scene = scene_of(CAMERAS[name])
    pose = resolve_camera(scene, CameraSettings())
    n = 10
    place = (np.arange(n) + 0.5) / n
    x, y = np.meshgrid((np.arange(64)[:, None] + place).ravel(), (np.arange(40)[:, None] + place).ravel())
    rays = [np.ascontiguousarray(a, np.float32) for a in pose.rays(x.ravel(), y.ravel())]
    m = len(rays[0])
    t, prim, uv = np.empty(m, np.float32), np.empty(m, np.int32), np.empty((m, 2), np.float32)
    flat = flatten(scene)
    cast_closest(flat.record[0], *rays, np.zeros(m, np.float32), np.full(m, np.inf, np.float32), t, prim, uv)
    share = (prim == flat.n_triangles).reshape(40, n, 64, n).mean(axis=(1, 3)).ravel()
    partly = (share > 0) & (share < 1)
    marked = outline_pixels(scene, pose).astype(bool)
    assert partly.sum() > 20
    assert (partly & ~marked).sum() <= 0.02 * partly.sum()
    assert (marked & ~partly).sum() <= 1.2 * partly.sum()


@pytest.mark.parametrize("method", ["path", "progressive", "gather"])
@pytest.mark.parametrize("name", CAMERAS)
def test_depth_of_a_floor_is_that_of_its_pixels(name, method):
    """The eye passes' rays are the pose's: the depth of pixels that see the floor alone is that of its plane."""
    scene = replace(scene_of(CAMERAS[name]), shapes=(scene_of(CAMERAS[name]).shapes[1],))
    scene = replace(scene, shapes=(*scene.shapes, Shape("sun", Sphere((0, 30, 0), 0.5), 0, (900.0,) * 3)))
    pose = resolve_camera(scene, CameraSettings())
    frame = rendered(scene, settings_of(render={"method": method}, photons={"N": 2000}), 16).frame(0)
    x, y = np.meshgrid(np.arange(64) + 0.5, np.arange(40) + 0.5)
    origins, directions = pose.rays(x.ravel(), y.ravel())
    t = (-0.6 - origins[:, 1]) / directions[:, 1]
    points = origins + t[:, None] * directions
    depth = ((points - pose.origin) @ pose.axes()[2]).reshape(40, 64)
    seen = (np.abs(points[:, [0, 2]]) < 3.5).all(axis=1).reshape(40, 64) & (t.reshape(40, 64) > 0)
    found = frame.image("depth").reshape(40, 64)
    assert seen.sum() > 500
    assert np.median(found[seen] / depth[seen]) == pytest.approx(1.0, abs=2e-3)
    assert np.abs(found[seen] / depth[seen] - 1).max() < 0.03


def test_importance_of_an_orthographic_picture_is_pixels_per_area():
    """A floor seen straight from above: every importon's footprint is that of a pixel, whatever the distance."""
    camera = Camera((0, 7, 0), (0, 0, 0), (0, 0, -1), 40.0, projection="orthographic", width=2.0)
    floor = Shape("floor", Parallelogram((-4, 0, -4), (0, 0, 8), (8, 0, 0)), 0)
    lamp = Shape("lamp", Sphere((3, 30, 0), 0.5), 0, (1.0,) * 3)
    scene = Scene("above", None, (floor, lamp), (diffuse(),), (), camera, 50, 25)
    found = traced(scene, SHOWN, 2000)[0].global_
    assert found.n == 2000
    assert np.abs(found.positions[:, 0]).max() < 1.0
    assert np.abs(found.positions[:, 2]).max() < 0.5
    np.testing.assert_allclose(found.footprints, 1 / 0.04**2, rtol=1e-4)


def test_settings_change_the_camera():
    scene = diffuse_box()
    half = np.tan(np.radians(75.0) / 2)
    settings = CameraSettings(projection="orthographic")
    pose = resolve_camera(scene, settings)
    assert pose.orthographic
    assert pose.view_width == pytest.approx(2 * half * 0.95), "what the perspective camera sees at its target"
    pose = resolve_camera(scene, CameraSettings(projection="orthographic", view_width=0.5, shift_x=0.1, shift_y=-2.0))
    assert (pose.view_width, pose.shift) == (0.5, (0.1, -2.0))
    ortho = scene_of(CAMERAS["orthographic"])
    assert resolve_camera(ortho, CameraSettings()).view_width == 3.0
    assert not resolve_camera(ortho, CameraSettings(projection="perspective")).orthographic
    assert analyse(ortho).orthographic
    assert not analyse(scene).orthographic


def test_session_and_pictures_tell_the_camera(tmp_path):
    values = {"camera.projection": "orthographic", "camera.view_width": 2.5, "camera.shift_x": 0.25}
    settings = with_values(Settings(), values)
    write_session(tmp_path / "a.toml", settings, "cornell_diffuse", 3)
    assert read_session(tmp_path / "a.toml").settings.camera == settings.camera
    scene = replace(diffuse_box(size=4), width=4, height=4)
    about = frame_metadata(rendered(scene, settings, 1).frame(0))
    assert about["view.projection"] == "orthographic"
    assert (about["view.width"], about["view.shift"]) == (2.5, "0.25 0")
    assert "view.fov" not in about
    text = dict(describe(scene_of(CAMERAS["orthographic"])))["camera"]
    assert "orthographic, 3 wide" in text


@pytest.mark.parametrize("bad", [{"width": 0.0}, {"width": np.nan}, {"width": -1.0}, {"shift": (np.inf, 0.0)}])
def test_unusable_cameras_are_errors(bad):
    with pytest.raises(SceneError):
        check_camera(replace(CAMERAS["orthographic"], **bad), None)
    check_camera(CAMERAS["orthographic"], None)


def test_wheel_changes_the_width_and_a_drag_follows_the_mouse():
    pose = replace(ORTHOGRAPHIC, shift=(0.0, 0.0))
    near = controls.zoom(pose, 1.0, 2.0)
    assert near.view_width == pytest.approx(0.9 * pose.view_width)
    assert (near.origin, near.target) == (pose.origin, pose.target)
    assert controls.camera_values(near)["camera.view_width"] == near.view_width
    back = controls.zoom(near, -1.0, 2.0)
    assert back.view_width == pytest.approx(pose.view_width)
    moved = controls.pan(pose, 0.1, 0.05)
    before, after = (p.project(np.asarray([pose.target]))[0] for p in (pose, moved))
    np.testing.assert_allclose((after - before)[:2], (0.1 * pose.height, 0.05 * pose.height), atol=1e-9)
    turned = controls.orbit(pose, 0.1, 0.0)
    np.testing.assert_allclose(turned.project(np.asarray([pose.target]))[0, :2], (32, 20), atol=1e-9)


@pytest.mark.parametrize("pose", POSES)
def test_frame_all_shows_the_whole_sphere_in_the_middle(pose):
    pose = replace(pose, shift=(0.1, -0.1))
    center, radius = np.array([0.3, -0.2, 0.1]), 1.7
    moved = controls.frame_all(pose, center, radius)
    np.testing.assert_allclose(moved.project(center[None])[0, :2], (32, 20), atol=1e-6)
    right, top, forward = moved.axes()
    for direction in (right, -right, top, -top, -forward):
        x, y, depth = moved.project((center + radius * direction)[None])[0]
        assert depth > 0
        assert -2 <= x <= 66
        assert -2 <= y <= 42


def test_free_camera_starts_where_the_orthographic_one_looks():
    pose = as_perspective(ORTHOGRAPHIC)
    corners = ORTHOGRAPHIC.target + 1.5 * ORTHOGRAPHIC.axes()[0]
    assert pose.project(np.asarray(corners)[None])[0, 0] == pytest.approx(64.0)
    lines = frustum_lines(ORTHOGRAPHIC, 2.0)
    np.testing.assert_allclose(lines[1] - lines[0], 2.0 * ORTHOGRAPHIC.axes()[2])
    np.testing.assert_allclose(
        ORTHOGRAPHIC.project(lines[:8])[::2, :2], [[0, 0], [64, 0], [64, 40], [0, 40]], atol=1e-9
    )
