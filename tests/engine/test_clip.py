"""The render camera's clipping plane: which surfaces are seen, by rays intersected with planes here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.comparison.reference import reference_for
from pmviewer.errors import SceneError
from pmviewer.output.frame_export import camera_metadata
from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.render.clip import clipped
from pmviewer.render.record import eye_record
from pmviewer.scene.description import Camera, Parallelogram, Scene, Shape
from pmviewer.scene.load import load_scene
from pmviewer.settings.access import CameraSettings, Settings
from pmviewer.viewer.sides import same_view
from tests.support.importon_paths import SHOWN, in_turn, trace
from tests.support.scenes import diffuse, open_scene, rendered, settings_of

NEAR_WALL, FAR_WALL = 1.0, -1.0
RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
EYE = (1, 0.5, 5)


def two_walls(**camera):
    """Emitting walls across z, the camera before both, aslant."""
    shapes = tuple(
        Shape(name, Parallelogram((-3, -3, z), (6, 0, 0), (0, 6, 0)), 0, L)
        for name, z, L in (("near", NEAR_WALL, RED), ("far", FAR_WALL, GREEN))
    )
    own = Camera(EYE, (-0.3, 0, -1), (0, 1, 0), 50.0, **camera)
    return Scene("walls", None, shapes, (diffuse(albedo=(0.0,) * 3),), (), own, 40, 30)


def plane_of(settings, pose, radius):
    """(normal, offset) of the plane, from the setting's own words: × scene from its centre, which is the origin."""
    normal = pose.axes()[2] if settings.clip == "view" else np.eye(3)["xyz".index(settings.clip)]
    return normal, settings.clip_at * radius


def seen(points, origin, normal, offset):
    """Whether points (n, 3) are not on the eye's side of the plane."""
    return np.sign(points @ normal - offset) != np.sign(np.asarray(origin) @ normal - offset)


CAMERAS = {
    "perspective": {},
    "orthographic": {"projection": "orthographic", "width": 4.0},
    "lens": {"aperture": 1e-4, "focus": 6.0},
}


@pytest.mark.parametrize("at", [0.0, 0.3, -0.31])
@pytest.mark.parametrize("clip", ["view", "x", "y", "z"])
@pytest.mark.parametrize("camera", CAMERAS)
def test_what_lies_on_the_cameras_side_is_left_out(camera, clip, at):
    scene = two_walls(**CAMERAS[camera])
    # A lens with a filter, for which other tests have the kernels.
    wider = {"filter": "box", "filter_radius": 0.51} if camera == "lens" else {}
    settings = settings_of(render={"method": "path", **wider}, camera={"clip": clip, "clip_at": at})
    renderer = rendered(scene, settings, 1)
    pose = resolve_camera(scene, CameraSettings())
    normal, offset = plane_of(settings.camera, pose, float(renderer.scene.flat.radius))
    corners = []
    for dx, dy in ((-0.02, -0.02), (1.02, -0.02), (-0.02, 1.02), (1.02, 1.02)):  # what the pixel's filter covers
        x, y = np.meshgrid(np.arange(40.0) + dx, np.arange(30.0) + dy)
        corners.append(_colours(pose, x.ravel(), y.ravel(), normal, offset))
    alike = np.all([c == corners[0] for c in corners], axis=(0, 2))
    assert alike.sum() > 600
    image = renderer.frame(0).image().reshape(-1, 3)
    np.testing.assert_allclose(image[alike], corners[0][alike], atol=1e-5)
    if clip in "xy" and at == 0.0:
        assert len(np.unique(corners[0][alike], axis=0)) > 1, "the plane cuts through the picture"


def _colours(pose: CameraPose, x, y, normal, offset):
    """(n, 3) radiance along the camera's rays."""
    origins, directions = pose.rays(x, y)
    colour = np.zeros((len(origins), 3))
    for z, L in ((FAR_WALL, GREEN), (NEAR_WALL, RED)):  # the nearer one last
        points = origins + ((z - origins[:, 2]) / directions[:, 2])[:, None] * directions
        hit = (np.abs(points[:, :2]) <= 3).all(axis=1) & seen(points, pose.origin, normal, offset)
        colour[hit] = L
    return colour


@pytest.mark.parametrize("camera", CAMERAS)
def test_importons_start_beyond_the_plane(camera):
    """Importance is what matters for the picture that is shown."""
    opened = open_scene(scene := replace(two_walls(**CAMERAS[camera]), materials=(diffuse(),)))
    chosen = CameraSettings(clip="x", clip_at=0.1)
    pose = replace(resolve_camera(scene, CameraSettings()), focus=6.0)
    whole = eye_record(pose, Settings(), 0)
    cut = eye_record(clipped(pose, chosen, opened.flat.center, opened.flat.radius), Settings(), 0)
    edge = 0.1 * opened.flat.radius
    first = [trace(opened.flat, eye, SHOWN, 1, 0, 3000, in_turn).global_.positions[:, 0] for eye in (whole, cut)]
    assert (first[0] > edge).mean() > 0.1, "there is something to leave out"
    assert len(first[1]) > 500
    assert first[1].max() <= edge + 1e-4


def test_lights_that_are_left_out_shine_on():
    """A room seen through its wall has the light of the closed room."""
    scene = two_walls()
    wall = Shape("wall", Parallelogram((-3, -3, NEAR_WALL), (0, 6, 0), (6, 0, 0)), 0, (2.0,) * 3)
    floor = Shape("back", Parallelogram((-3, -3, FAR_WALL), (6, 0, 0), (0, 6, 0)), 1)
    scene = replace(scene, shapes=(wall, floor), materials=(diffuse(albedo=(0.0,) * 3), diffuse("half", (0.5,) * 3)))
    settings = {"render": {"method": "path"}, "camera": {"clip": "z", "clip_at": 0.0}}
    found = rendered(scene, settings_of(**settings), 64).frame(0).image()[15, 20]
    x, y = np.meshgrid((np.arange(400) + 0.5) / 400 * 6 - 3, (np.arange(400) + 0.5) / 400 * 6 - 3)
    pose = resolve_camera(scene, CameraSettings())
    origin, direction = (part[0] for part in pose.rays(np.array([20.5]), np.array([15.5])))
    point = origin + (FAR_WALL - origin[2]) / direction[2] * direction
    r2 = (x - point[0]) ** 2 + (y - point[1]) ** 2 + 4.0
    E = 2.0 * float((4.0 / r2**2).sum()) * (6 / 400) ** 2  # cos cos = (2/r)²
    assert found == pytest.approx(0.5 / np.pi * E, rel=0.03)


def test_a_clipped_picture_is_another_view():
    """It is compared with no reference of the whole one, and its files say so."""
    scene = two_walls()
    pose = resolve_camera(scene, CameraSettings())
    cut = clipped(pose, CameraSettings(clip="y"), np.zeros(3), 3.0)
    assert not pose.sees_like(cut)
    assert cut.sees_like(clipped(pose, CameraSettings(clip="y"), np.zeros(3), 3.0))
    assert not same_view(camera_metadata(pose), camera_metadata(cut))
    assert same_view(camera_metadata(cut), camera_metadata(cut))
    with pytest.raises(SceneError, match="leave out the camera settings"):
        reference_for(None, load_scene("cornell_diffuse"), settings_of(camera={"clip": "view"}))
