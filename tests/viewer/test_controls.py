"""Camera moves, without a window."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.render.camera import CameraPose
from pmviewer.viewer.viewport import controls

POSE = CameraPose((0.3, 1.2, 5.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0), 50.0, 640, 480)
POSES = [POSE, replace(POSE, mirrored=True), replace(POSE, up=(0.2, -0.3, 1.0))]


def distance(pose):
    return float(np.linalg.norm(np.subtract(pose.origin, pose.target)))


@pytest.mark.parametrize("pose", POSES)
def test_orbit_moves_what_is_seen_with_the_mouse(pose):
    """A point in front of the target moves right when dragged right and down when dragged down, in the picture."""
    _, _, forward = pose.axes()
    near = np.asarray(pose.target) - 0.5 * forward
    for dx, dy in ((0.05, 0.0), (0.0, 0.05)):
        moved = controls.orbit(pose, dx, dy)
        before, after = pose.project(near[None])[0], moved.project(near[None])[0]
        assert distance(moved) == pytest.approx(distance(pose))
        if dx:
            assert after[0] > before[0] + 1
        else:
            assert after[1] > before[1] + 1


@pytest.mark.parametrize("pose", POSES)
def test_orbit_stops_at_the_poles(pose):
    for dy in (5.0, -5.0):
        moved = controls.orbit(pose, 0.0, dy)
        _, _, forward = moved.axes()
        up = np.asarray(pose.up) / np.linalg.norm(pose.up)
        assert abs(forward @ up) == pytest.approx(np.cos(controls.POLE), abs=1e-6)
        back = controls.orbit(moved, 0.1, -np.sign(dy) * 0.1)
        assert distance(back) == pytest.approx(distance(pose))


@pytest.mark.parametrize("pose", POSES)
def test_pan_keeps_the_target_plane_under_the_mouse(pose):
    moved = controls.pan(pose, 0.1, 0.05)
    before, after = pose.project(np.asarray([pose.target]))[0], moved.project(np.asarray([pose.target]))[0]
    np.testing.assert_allclose((after - before)[:2], (0.1 * pose.height, 0.05 * pose.height), atol=1e-6)


@pytest.mark.parametrize("pose", POSES)
def test_looking_around_turns_the_view_with_the_mouse(pose):
    ahead = np.asarray(pose.target)
    moved = controls.look(pose, 0.05, 0.0)
    assert moved.origin == pose.origin
    assert moved.project(ahead[None])[0, 0] < pose.project(ahead[None])[0, 0] - 1, "looking right moves things left"
    moved = controls.look(pose, 0.0, 0.05)
    assert moved.project(ahead[None])[0, 1] < pose.project(ahead[None])[0, 1] - 1


def test_zoom_never_gets_stuck():
    pose, radius = POSE, 2.0
    for _ in range(300):
        pose = controls.zoom(pose, 1.0, radius)
    _, _, forward = pose.axes()
    _, _, before = POSE.axes()
    np.testing.assert_allclose(forward, before, atol=1e-6)
    travelled = float(np.subtract(pose.origin, POSE.origin) @ before)
    assert travelled > distance(POSE) + 1.0, "it goes on through the target"
    out = controls.zoom(POSE, -10, radius)
    assert distance(out) == pytest.approx(distance(POSE) * 0.9**-10)


@pytest.mark.parametrize("pose", POSES)
def test_frame_all_shows_the_whole_sphere_and_little_else(pose):
    center, radius = np.array([3.0, -1.0, 2.0]), 4.0
    moved = controls.frame_all(pose, center, radius)
    directions = np.random.default_rng(1).normal(size=(5000, 3))
    points = center + radius * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    x, y, depth = moved.project(points).T
    assert depth.min() > 0
    assert y.min() > 0
    assert y.max() < pose.height
    assert y.max() - y.min() > 0.93 * pose.height
    assert x.min() > 0
    assert x.max() < pose.width


def test_fly_moves_along_the_picture_axes():
    right, top, forward = POSE.axes()
    moved = controls.fly(POSE, 1.0, 0.0, 1.0, 0.5)
    np.testing.assert_allclose(np.subtract(moved.origin, POSE.origin), 0.5 * (right + forward), atol=1e-12)
    np.testing.assert_allclose(np.subtract(moved.target, POSE.target), 0.5 * (right + forward), atol=1e-12)
    assert top @ np.subtract(moved.origin, POSE.origin) == pytest.approx(0, abs=1e-12)


def test_the_pivot_of_a_matrix_camera_is_at_the_scenes_depth():
    pose = replace(POSE, target=tuple(np.asarray(POSE.origin) + 1e-3 * POSE.axes()[2]))
    center = np.array([0.1, 0.9, 0.0])
    fixed = controls.with_pivot(pose, center, 2.0)
    assert distance(fixed) == pytest.approx((center - np.asarray(pose.origin)) @ pose.axes()[2])
    np.testing.assert_allclose(fixed.axes()[2], pose.axes()[2], atol=1e-9)
    behind = controls.with_pivot(pose, np.array([0.0, 1.0, 50.0]), 2.0)
    np.testing.assert_allclose(behind.axes()[2], pose.axes()[2], atol=1e-9)
