"""Small pictures drawn out along edges, and earlier pictures seen by another camera, against the geometry of planes."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.render.camera import CameraPose
from pmviewer.render.preview.guided import GUIDES, SIGNALS, reproject, upsample, view_row

W, H, SHRINK = 40, 24, 4


def camera(x=0.0, width=W, height=H, **values):
    return CameraPose((x, 0.0, 0.0), (x, 0.0, -5.0), (0.0, 1.0, 0.0), 50.0, width, height, **values)


def seen(pose, depth):
    """Guides of planes that face the camera at depth(column) and the points (h, w, 3) that its pixels' middles see."""
    y, x = np.mgrid[: pose.height, : pose.width]
    origins, directions = pose.rays(x.ravel() + 0.5, y.ravel() + 0.5)
    far = np.array([depth(value) for value in (x.ravel() + 0.5) / pose.width])
    along = directions @ pose.axes()[2]
    points = origins + directions * (far / along)[:, None]
    guides = np.zeros((pose.height * pose.width, GUIDES), np.float32)
    guides[:, 2], guides[:, 3] = 1.0, far
    shape = pose.height, pose.width
    return guides.reshape(*shape, GUIDES), points.reshape(*shape, 3)


@pytest.mark.parametrize("values", [{}, {"projection": "orthographic", "view_width": 6.0}])
def test_surfaces_keep_their_own_light(values):
    """Behind an edge that no small pixel ends at, a surface is no brighter by what lies before it."""

    def depth(place):
        return 3.0 if place < 0.43 else 9.0

    large, small = camera(**values), camera(width=W // SHRINK, height=H // SHRINK, **values)
    guides, few = seen(large, depth)[0], seen(small, depth)[0]
    light = np.zeros((*few.shape[:2], SIGNALS), np.float32)
    light[...] = np.where(few[..., 3:] < 5.0, 1.0, 7.0)
    light[..., 4] *= 10.0
    out = np.empty((H, W, SIGNALS), np.float32)
    upsample(light, few, view_row(large), guides, float(SHRINK), out, 0, H)
    truth = np.where(guides[..., 3] < 5.0, 1.0, 7.0)
    assert np.abs(out[..., 0] / truth - 1).max() < 0.01
    assert np.abs(out[..., 4] / (10 * truth) - 1).max() < 0.01
    assert np.abs(out[:, 14:21, 0] - truth[:, 14:21]).max() < 0.05


def test_light_that_changes_evenly_is_drawn_out_evenly():
    large, small = camera(), camera(width=W // SHRINK, height=H // SHRINK)
    (guides, points), (few, places) = seen(large, lambda place: 4.0), seen(small, lambda place: 4.0)
    light = np.repeat((3.0 + places[..., :1]).astype(np.float32), SIGNALS, axis=-1)
    out = np.empty((H, W, SIGNALS), np.float32)
    upsample(light, few, view_row(large), guides, float(SHRINK), out, 0, H)
    inside = slice(2 * SHRINK, -2 * SHRINK)
    assert np.abs(out[:, inside, 2] - (3.0 + points[:, inside, 0])).max() < 0.03 * np.ptp(points[..., 0])


def test_what_meets_nothing_takes_from_what_meets_nothing():
    large, small = camera(), camera(width=W // SHRINK, height=H // SHRINK)
    guides, few = seen(large, lambda place: 4.0)[0], seen(small, lambda place: 4.0)[0]
    guides[:, : W // 2], few[:, : W // SHRINK // 2] = 0.0, 0.0
    light = np.full((*few.shape[:2], SIGNALS), 2.0, np.float32)
    light[:, : W // SHRINK // 2] = 0.0
    out = np.empty((H, W, SIGNALS), np.float32)
    upsample(light, few, view_row(large), guides, float(SHRINK), out, 0, H)
    assert out[:, : W // 2].max() < 0.01
    assert out[:, W // 2 :].min() > 1.99


@pytest.mark.parametrize("values", [{}, {"projection": "orthographic", "view_width": 6.0}])
def test_a_wall_looks_the_same_from_elsewhere(values):
    """Light that is a function of the place alone is found there again; what the first camera did not see is not."""
    before, after = camera(**values), camera(0.37, **values)
    (old_guides, places), (guides, points) = seen(before, lambda _: 4.0), seen(after, lambda _: 4.0)

    def light(at):
        return np.stack([2.0 + at[..., 0], 3.0 - at[..., 1], np.ones(at.shape[:2])], axis=-1)

    out, known = np.full((H, W, 3), -1.0, np.float32), np.empty((H, W), np.float32)
    rows = view_row(before), view_row(after)
    reproject(light(places).astype(np.float32), old_guides, *rows, guides, out, known, 0, H)
    place = before.project(points.reshape(-1, 3)).reshape(H, W, 3)
    inside = (place[..., 0] > 0.6) & (place[..., 0] < W - 0.6) & (place[..., 1] > 0.6) & (place[..., 1] < H - 0.6)
    beyond = (place[..., 0] < -0.6) | (place[..., 0] > W + 0.6)
    assert inside.sum() > H * W / 2
    assert np.abs(out[inside] - light(points)[inside]).max() < 1e-4
    assert known[inside].min() > 0.99
    assert beyond.any()
    assert known[beyond].max() == 0.0
    assert (out[beyond] == -1.0).all()


def test_other_surfaces_know_nothing_of_each_other():
    before, after = camera(), camera(0.37)
    old_guides = seen(before, lambda _: 3.0)[0]
    guides = seen(after, lambda _: 4.0)[0]
    out, known = np.zeros((H, W, 3), np.float32), np.empty((H, W), np.float32)
    reproject(np.ones((H, W, 3), np.float32), old_guides, view_row(before), view_row(after), guides, out, known, 0, H)
    assert known.max() < 0.05
    depths = np.linspace(3.0, 4.0, W)  # from far before the surface to it: all degrees of being another
    old_guides[..., 3] = depths
    reproject(np.ones((H, W, 3), np.float32), old_guides, view_row(before), view_row(after), guides, out, known, 0, H)
    assert np.isfinite(out).all()
    assert out.max() < 1.001
    old_guides = seen(before, lambda _: 4.0)[0]
    old_guides[..., 2], old_guides[..., 0] = 0.0, 1.0
    reproject(np.ones((H, W, 3), np.float32), old_guides, view_row(before), view_row(after), guides, out, known, 0, H)
    assert known.max() == 0.0
