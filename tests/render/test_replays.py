"""Replays of a pixel meet the surface that the eye pass met, over mirrors and through glass.

The walls of a box emit their own position as a colour, so that the film tells where each pixel's chain ended.
"""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.scene.description import Scene, Shape, Sphere
from pmviewer.scene.texture import Bitmap
from tests.support.scenes import GLASS, MIRROR, box_camera, box_walls, diffuse, settings_of

pytestmark = pytest.mark.usefixtures("every_surface", "room_for_split_paths")

SIZE, TEXELS = 24, 128
ABOVE = 1.5
"""Added to positions in [-1, 1], so that they are radiances."""
NEAR = 0.02
"""Of two positions that are one: a texel's width, and what the walls reflect. Pixels lie 0.06 apart or more."""


def positions_of(wall) -> Bitmap:
    g = wall.geometry
    at = (np.arange(TEXELS) + 0.5) / TEXELS
    u, v = np.meshgrid(at, at)
    place = np.array(g.corner) + u[..., None] * np.array(g.edge_u) + v[..., None] * np.array(g.edge_v)
    return Bitmap(np.float32(place + ABOVE), "clamp")


def box() -> Scene:
    walls = []
    for wall in box_walls():
        picture = positions_of(wall)
        walls.append(Shape(wall.name, wall.geometry, 0, picture.mean, picture))
    spheres = (
        Shape("mirror", Sphere((-0.45, -0.5, -0.2), 0.45), 1),
        Shape("glass", Sphere((0.45, -0.3, 0.0), 0.45), 2),
    )
    materials = diffuse(albedo=(1e-4,) * 3), MIRROR, GLASS
    return Scene("positions", None, (*walls, *spheres), materials, (), box_camera(), SIZE, SIZE)


def rendered(mirror_rays=1):
    pool = WorkPool(1)
    settings = settings_of(
        render={"method": "gather", "outline_rays": 0, "splits": 0, "mirror_rays": mirror_rays},
        photons={"N": 2000},
        gather={"rays": 2},
    )
    renderer = Renderer(open_scene(box()), settings, pool, StageStore(0))
    renderer.step()
    frame = renderer.frame(1)
    directly, met = frame.image("emission"), frame.image("emission") + frame.image("specular")
    return renderer, met - ABOVE, directly.max(axis=-1) == 0, pool


def test_gather_rays_start_where_the_eye_pass_ended():
    renderer, met, over_chain, pool = rendered()
    checked = 0
    for y in range(SIZE):
        for x in range(SIZE):
            points = renderer.gather_points(x, y)
            assert len(points) > 0
            assert points[:, :3] == pytest.approx(np.tile(met[y, x], (len(points), 1)), abs=NEAR)
            checked += over_chain[y, x]
    pool.close()
    assert checked > 60


def test_of_two_samples_each_gathers_where_it_ended():
    """The picture shows the mean of both places."""
    renderer, met, over_chain, pool = rendered(mirror_rays=2)
    checked = 0
    for y in range(SIZE):
        for x in range(SIZE):
            points = renderer.gather_points(x, y)
            samples = renderer.latest.samples(y * SIZE + x)
            assert len(points) <= 2 * samples
            if len(points) == 2 * samples:
                assert points[:, :3].mean(axis=0) == pytest.approx(met[y, x], abs=NEAR)
                checked += samples == 2 and over_chain[y, x]
    pool.close()
    assert checked > 60
