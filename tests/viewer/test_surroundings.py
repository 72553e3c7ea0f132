"""What is near the camera: rays against the drawn triangles, walls, and what is said where there is nothing to see."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui

from pmviewer.render.camera import CameraPose
from pmviewer.settings.access import with_values
from pmviewer.viewer.background import Background
from pmviewer.viewer.viewport import surroundings
from pmviewer.viewer.viewport.surface_rays import SurfaceRays
from pmviewer.viewer.viewport.surroundings import GAP, NOTHING, OUTSIDE, UNLIT, Surroundings
from tests.viewer.driver import drag_picture, drive
from tests.viewer.fake_session import FakeSession

K = imgui.Key
BACKGROUND = Background(lambda level, text: None)
UP = (0.0, 1.0, 0.0)


@dataclass(frozen=True)
class Geometry:
    vertices: np.ndarray
    radius: float = float(np.sqrt(3))
    center: tuple[float, float, float] = (0.0, 0.0, 0.0)


def room(open_side: int | None = None) -> Geometry:
    """The cube from −1 to 1, without one of its sides (0 to 5: −x, x, −y, y, −z, z)."""
    triangles = []
    for side in range(6):
        axis, at = side // 2, -1.0 if side % 2 == 0 else 1.0
        corners = []
        for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            corner = np.zeros(3)
            corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3] = at, u, v
            corners.append(corner)
        if side != open_side:
            triangles += [corners[0], corners[1], corners[2], corners[0], corners[2], corners[3]]
    return Geometry(np.array(triangles, np.float32))


def nearest_of_all(corners, origin, direction):
    """Distance to the first triangle (n, 3, 3), by solving for each one alone."""
    a, b, c = corners.swapaxes(0, 1)
    matrices = np.stack([b - a, c - a, np.broadcast_to(-direction, a.shape)], axis=2)
    seen = np.abs(np.linalg.det(matrices)) >= 1e-12
    u, v, t = np.linalg.solve(matrices[seen], (origin - a[seen])[:, :, None])[:, :, 0].T
    return t[(u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)].min(initial=np.inf)


def test_rays_meet_what_solving_for_every_triangle_finds():
    rng = np.random.default_rng(3)
    middle = rng.uniform(-1, 1, (400, 1, 3))
    corners = (middle + rng.normal(0, 0.15, (400, 3, 3))).astype(np.float32)
    rays = SurfaceRays(Geometry(corners.reshape(-1, 3)))
    met = 0
    for number in range(200):
        origin = rng.uniform(-1.5, 1.5, 3)
        direction = rng.normal(size=3)
        if number % 10 == 0:  # along an axis
            direction = np.eye(3)[number // 10 % 3]
        direction /= np.linalg.norm(direction)
        expected, got = nearest_of_all(corners.astype(float), origin, direction), rays.nearest(origin, direction)
        assert (got is None) == np.isinf(expected)
        if got is not None:
            met += 1
            assert got[0] == pytest.approx(expected, rel=1e-6)
            assert got[1] @ direction <= 0
    assert met > 50


def test_rays_along_the_walls_planes_and_scenes_without_surfaces():
    rays = SurfaceRays(room())
    distance, normal = rays.nearest(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    assert distance == pytest.approx(1.0)
    np.testing.assert_allclose(normal, (0, 0, -1), atol=1e-12)
    assert rays.nearest(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.1) is None
    assert SurfaceRays(Geometry(np.zeros((0, 3), np.float32))).nearest(np.zeros(3), np.array([1.0, 0, 0])) is None


def pose_at(origin, target=(0.0, 0.0, -5.0)) -> CameraPose:
    return CameraPose(tuple(origin), tuple(target), UP, 60.0, 64, 48)


def test_the_eye_is_kept_in_and_slides_along_walls():
    near = Surroundings()
    near.take(room(), BACKGROUND)
    rng = np.random.default_rng(5)
    limit = 1 - 0.01 * GAP
    pose = pose_at((0.0, 0.0, 0.0))
    stops = 0
    for _ in range(300):
        step = rng.normal(0, 0.4, 3)
        wanted = replace(pose, origin=tuple(np.add(pose.origin, step)), target=tuple(np.add(pose.target, step)))
        moved, stopped = near.kept_out(pose, wanted)
        assert np.abs(moved.origin).max() < limit
        np.testing.assert_allclose(np.subtract(moved.target, moved.origin), np.subtract(pose.target, pose.origin))
        if not stopped:
            assert moved == wanted
        stops += stopped
        pose = moved
    assert 50 < stops < 300
    slid, stopped = near.kept_out(pose_at((0, 0, 0.9)), pose_at((0.4, 0, 1.5)))
    assert stopped
    assert slid.origin[0] == pytest.approx(0.4)
    assert 0.9 < slid.origin[2] < limit


def test_large_scenes_are_boxed_beside_the_window(monkeypatch):
    monkeypatch.setattr(surroundings, "AT_ONCE", 3)
    near = Surroundings()
    near.take(room(), BACKGROUND)
    pose = pose_at((0.0, 0.0, 0.5))
    deadline = time.monotonic() + 20
    while near.under(pose, (32, 24)) is None:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    np.testing.assert_allclose(near.under(pose, (32, 24)), (0, 0, -1), atol=1e-9)


def test_depths_are_those_of_what_is_seen():
    near = Surroundings()
    near.take(room(), BACKGROUND)
    pose = pose_at((0.0, 0.0, 0.5))
    np.testing.assert_allclose(near.under(pose, (32, 24)), (0, 0, -1), atol=1e-9)
    np.testing.assert_allclose(near.under(replace(pose, near=1.6), (32, 24)) is None, True)
    assert 1.5 < near.depth_ahead(pose) < 1.75, "the back wall, looked at up to 25° aside"
    assert near.depth_ahead(pose_at((0, 0, -0.9999))) == pytest.approx(0.02 * np.sqrt(3)), "nobody gets stuck"


def test_what_is_said_of_a_camera_that_sees_nothing():
    session = FakeSession()
    session.open("box")
    frame = session.frame
    dark = replace(frame, planes=np.zeros_like(frame.planes))
    unlit = dark.planes.copy()
    unlit[..., surroundings.PLANES["depth"]] = 1.0
    unlit = replace(dark, planes=unlit, serial=99)
    own, outside = pose_at((0, 0, 0)), pose_at((0, 0, 3))
    near = Surroundings()
    near.take(room(), BACKGROUND)
    assert near.advice(pose_at((0.5, 0, 0)), own, frame) == ""
    assert near.advice(outside, own, frame) == OUTSIDE
    assert near.advice(own, own, replace(dark, serial=98)) == NOTHING
    assert near.advice(own, own, unlit) == UNLIT
    assert near.advice(own, own, replace(unlit, coarse=True)) == ""
    near.take(room(open_side=5), BACKGROUND)
    assert near.advice(outside, own, frame) == "", "no closed room"


def closed(session: FakeSession) -> None:
    """The scene is a closed room, the camera in its middle."""
    walls = room()
    normals = np.zeros_like(walls.vertices)
    session.geometry = replace_geometry(session.geometry, walls.vertices, normals)
    inside = {"camera.origin": (0.0, 0.0, 0.5), "camera.target": (0.0, 0.0, -1.0)}
    session.set(with_values(session.settings, inside))
    session.scene = replace(session.scene, camera=replace(session.scene.camera, origin=(0.0, 0.0, 0.5)))


def replace_geometry(geometry, vertices, normals):
    return replace(
        geometry, vertices=vertices, normals=normals, albedo=np.ones_like(vertices), radius=float(np.sqrt(3))
    )


def test_drags_and_flights_stay_in_the_room_unless_asked(app, session):
    closed(session)

    def inside():
        return float(np.abs(session.settings.camera.origin).max()) < 1

    def script(c):
        c.yield_(3)
        for dx, dy in ((120, 40), (-300, 200), (250, -180)):
            drag_picture(c, app, dx, dy)
            assert inside()
        drag_picture(c, app, 0, 300, button=1)
        assert inside()
        c.key_press(K.f)
        c.key_down(K.s)
        c.yield_(75)
        assert inside()
        assert "in the camera's way" in app.viewport.advice()
        session.set(with_values(session.settings, {"display.through_surfaces": True}))
        c.yield_(100)
        c.key_up(K.s)
        c.yield_(30)
        assert not inside()
        assert app.viewport.advice() == OUTSIDE
        c.key_press(K.backspace)
        c.yield_(30)
        assert app.viewport.advice() == ""

    drive(app, script)


def test_a_drag_turns_around_what_is_under_the_mouse(app, session):
    def script(c):
        c.yield_(2)
        pose = app.state.live_camera()
        x, y = app.viewport.origin
        left, top, width, height = app.viewport.rectangle()
        place = 0.3, 0.55  # on the quad before the wall
        c.mouse_move_to_pos(ImVec2(x + left + place[0] * width, y + top + place[1] * height))
        held = app.viewport.surroundings.under(pose, app.viewport.place_under_mouse(pose))
        assert held[2] == pytest.approx(0.0, abs=1e-6)
        c.mouse_down(0)
        c.mouse_move_to_pos(ImVec2(x + left + place[0] * width + 80, y + top + place[1] * height + 10))
        c.mouse_up(0)
        c.yield_(2)
        moved = app.state.live_camera()
        assert moved.origin != pose.origin
        np.testing.assert_allclose(
            np.linalg.norm(np.subtract(moved.origin, held)), np.linalg.norm(np.subtract(pose.origin, held)), rtol=1e-5
        )

    drive(app, script)
