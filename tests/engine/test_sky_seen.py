"""Rooms that look out on a sky through a window: light samples go where the window is, and the light is the same."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import Arrangement, open_scene, rearranged
from pmviewer.kernels.lights.sky_square import SIDE, TABLE
from pmviewer.scene.description import Camera, ConstantEnvironment, ImageEnvironment, Parallelogram, Scene, Shape
from tests.support.scenes import GREY, box_walls, diffuse, rendered, settings_of

HALF = 0.5
"""Of the edge of a square window in the middle of the ceiling; the room reaches from −1 to 1."""
RADIANCE = 0.7
BLACK = 1


def sky(pixels=None):
    even = np.full((16, 32, 3), RADIANCE, np.float32)
    return ImageEnvironment("sky", even if pixels is None else pixels, np.eye(3))


def room(lights=None, window=True):
    """Seen from close below the ceiling, straight down; only the floor reflects."""
    walls = [replace(wall, material=0 if wall.name == "floor" else BLACK) for wall in box_walls()]
    if window:
        walls = [wall for wall in walls if wall.name != "ceiling"]
        for k, (x, z, along, across) in enumerate(
            ((-1, -1, 2, 1 - HALF), (-1, HALF, 2, 1 - HALF), (-1, -HALF, 1 - HALF, 2 * HALF),
             (HALF, -HALF, 1 - HALF, 2 * HALF))
        ):  # fmt: skip
            walls.append(Shape(f"strip {k}", Parallelogram((x, 1, z), (along, 0, 0), (0, 0, across)), BLACK))
    camera = Camera((0, 0.5, 0), (0, -1, 0), (0, 0, 1), 4.0, near=0.0, far=np.inf)
    materials = (diffuse(), diffuse("black", (0.0,) * 3))
    return Scene("room", None, tuple(walls), materials, (sky(),) if lights is None else lights, camera, 16, 16)


def of_a_quarter(a, b):
    """Form factor from a small patch to a parallel rectangle over its corner, with sides a and b times as long as it is
    far away."""
    x, y = math.hypot(1, a), math.hypot(1, b)
    return (a / x * math.atan(b / x) + b / y * math.atan(a / y)) / (2 * math.pi)


def passes(opened, seed):
    settings = settings_of(render={"method": "path", "max_depth": 1, "seed": seed})
    return rendered(opened, settings, 16).frame(0).image().astype(float)


def test_the_light_through_a_window_is_the_same_with_less_noise():
    """The floor's middle sees the window at a distance of 2 under a form factor that is known."""
    opened = open_scene(room())
    assert opened.seen_sky is not None
    expected = RADIANCE * GREY * 4 * of_a_quarter(HALF / 2, HALF / 2)
    found = np.array([passes(opened, seed) for seed in range(1, 5)])
    opened.flat.record["sky_frame"] = 0
    without = np.array([passes(opened, seed) for seed in range(1, 5)])
    print(f"radiance {found.mean():.6f}, without {without.mean():.6f}, {expected:.6f} by form factor")
    print(f"variance {found.var(axis=0).mean():.2e}, without {without.var(axis=0).mean():.2e}")
    assert found.mean() == pytest.approx(expected, rel=0.01)
    assert found.var(axis=0).mean() < 0.4 * without.var(axis=0).mean()


def test_tables_leave_no_direction_out():
    tables = open_scene(room()).seen_sky.tables
    assert tables.shape[1] == TABLE
    rows = np.diff(tables[:, :SIDE], axis=1, prepend=0.0)
    cells = np.diff(tables[:, SIDE:].reshape(-1, SIDE, SIDE), axis=2, prepend=0.0)
    share = rows[:, :, None] * cells
    assert share.min() > 0.5 * 0.01 / SIDE**2
    np.testing.assert_allclose(share.sum(axis=(1, 2)), 1, rtol=1e-4)


def test_only_a_sky_that_is_little_seen_has_tables():
    assert open_scene(room(window=False)).seen_sky is None  # nothing of it is
    assert open_scene(room(lights=(ConstantEnvironment("sky", (RADIANCE,) * 3),))).seen_sky is None
    outside = replace(room(), shapes=tuple(wall for wall in room().shapes if wall.name == "floor"))
    assert open_scene(outside).seen_sky is None


def test_what_is_seen_stays_while_surfaces_do():
    opened = open_scene(room())
    grey = Arrangement(edits={"material.grey.colour": (0.3, 0.3, 0.3)})
    again = rearranged(opened, grey)
    assert again is not opened
    assert again.seen_sky is opened.seen_sky
    assert again.flat.record["sky_frame"] == opened.flat.record["sky_frame"] != 0
