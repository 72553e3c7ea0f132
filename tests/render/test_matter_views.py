"""Views of media against formulas: optical depth, mean free path, slices, and the photons of beam estimates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.inspection import Wanted
from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.scene.description import Medium
from tests.render.test_grids import BARELY, ramp
from tests.render.test_media import CAMERA, SKY, cube_of
from tests.support.scenes import settings_of

pytestmark = pytest.mark.usefixtures("any_light_in_media")

SIZE = 16
HALF = np.tan(np.radians(10.0))
"""Of the picture at distance 1."""


def looked_at(pool, medium, camera=CAMERA, photons=2000, **estimate):
    settings = settings_of(render={"method": "progressive"}, photons={"N": photons}, estimate=estimate)
    scene = open_scene(cube_of(medium, SKY, camera=camera, size=SIZE))
    renderer = Renderer(scene, settings, pool, StageStore(0))
    renderer.step()
    return renderer


def rays():
    """Unit directions (SIZE, SIZE, 3) through the middles of pixels of a camera that looks along −z."""
    at = ((np.arange(SIZE) + 0.5) / SIZE * 2 - 1) * HALF
    x, y = np.meshgrid(at, -at)
    d = np.stack([x, y, np.full_like(x, -1.0)], axis=-1)
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


def ways(d, z):
    """Where rays from (0, 0, z) enter and leave the cube [−1, 1]³; equal where they miss it."""
    o = np.array([0.0, 0.0, z])
    with np.errstate(divide="ignore"):
        a, b = (-1 - o) / d, (1 - o) / d
    near, far = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
    near = np.maximum(near, 0)
    return near, np.maximum(far, near)


@pytest.mark.parametrize("z", [4.0, 0.25])
def test_depth_and_free_path_of_an_even_medium(pool, z):
    """σ̄ s and 1/σ̄ with the mean σ̄ of the channels, from outside and from within; nothing beside the cube."""
    sigma = (0.3, 0.6, 1.5)
    camera = replace(CAMERA, origin=(0.0, 0.0, z), target=(0.0, 0.0, z - 1), medium=-1 if z > 1 else 0)
    planes = looked_at(pool, Medium("fog", sigma, (0.5,) * 3), camera).inspect(Wanted("depth in media")).planes
    near, far = ways(rays(), z)
    met = far > near
    depth, free = planes["optical depth"][..., 0], planes["mean free path"][..., 0]
    np.testing.assert_allclose(depth[met], 0.8 * (far - near)[met], rtol=1e-5)
    np.testing.assert_allclose(free[met], 1 / 0.8, rtol=1e-5)
    assert (depth[~met] == -1).all()
    assert (free[~met] == -1).all()


def test_depth_and_slices_of_a_ramp(pool):
    """Across z the extinction is that of the plane; across x it rises along the picture; and the depth of rays along z
    is ∫σ (z + 1)/2, here by NumPy."""
    sigma = 2.0
    made = looked_at(pool, Medium("ramp", (sigma,) * 3, BARELY, density=ramp()))
    depth = made.inspect(Wanted("depth in media")).planes["optical depth"][..., 0]
    d = rays()
    near, far = ways(d, 4.0)
    steps = near[..., None] + (far - near)[..., None] * (np.arange(4000) + 0.5) / 4000
    z = 4 + steps * d[..., 2, None]
    expected = sigma * np.clip((z + 1) / 2, 1 / 128, 1 - 1 / 128).mean(axis=-1) * (far - near)
    np.testing.assert_allclose(depth[far > near], expected[far > near], rtol=1e-3)
    for place in (0.25, 0.8):
        cut = made.inspect(Wanted("slice", slice=(2, place))).planes["extinction slice"][..., 0]
        inside = np.abs(d[..., :2] / -d[..., 2:] * (4 - (2 * place - 1))).max(axis=-1) < 1
        np.testing.assert_allclose(cut[inside], sigma * place, rtol=1e-4)
        assert (cut[~inside] == -1).all()
    across = made.inspect(Wanted("slice", slice=(0, 0.55))).planes["extinction slice"][..., 0]
    t = 0.1 / d[..., 0]
    p = np.array([0, 0, 4]) + t[..., None] * d
    inside = (t > 0) & (np.abs(p) < 0.999).all(axis=-1)
    assert inside.sum() > 4
    np.testing.assert_allclose(across[inside], sigma * (p[inside][:, 2] + 1) / 2, rtol=2e-3)


@pytest.mark.parametrize("how", ["beam", "nearest"])
def test_beams_count_the_photons_around_them(pool, how):
    """Against all distances between rays and the photons of the volume map, whatever they are looked up in: in discs
    along the faces that the ray meets, up to four radii from them, and across it elsewhere."""
    fog = Medium("fog", (1.0,) * 3, (0.9,) * 3)
    made = looked_at(pool, fog, photons=20_000, in_media=how, volume_k=8, black_level=2.0)
    planes = made.inspect(Wanted("beams")).planes
    radius, counts = planes["volume radius"][..., 0], planes["volume photon count"][..., 0]
    d = rays()
    near, far = ways(d, 4.0)
    met = far > near
    r = radius[met][0]
    assert (radius[met] == r).all()
    assert (counts[~met] == -1).all()
    photons = made.latest.maps.photons.volume[:, :3].astype(np.float64) - [0, 0, 4]
    t = photons @ d[met].T
    apart = np.sqrt(np.maximum((photons**2).sum(axis=1)[:, None] - t**2, 0))
    to_face = photons[:, 2:] / d[met][:, 2]
    from_foot = np.linalg.norm(photons[:, None] - to_face[..., None] * d[met], axis=-1)
    begin, end = near[met] + 4 * r, far[met] - 4 * r
    through = (from_foot < r) & (to_face >= near[met]) & (to_face < begin)
    through |= (apart < r) & (t >= begin) & (t < end)
    through |= (from_foot < r) & (to_face >= end) & (to_face < far[met])
    expected = through.sum(axis=0)
    behind = np.abs(4 + far[met] * d[met][:, 2] + 1) < 1e-6  # those that leave by the face at the back
    assert behind.sum() > 100
    assert expected.max() > 10
    np.testing.assert_allclose(counts[met][behind], expected[behind], atol=2)  # photons on the rim, by float32
    cut = made.inspect(Wanted("slice", slice=(2, 0.5))).planes["photon slice"][..., 0]
    foot = 4 / -d[..., 2][met]
    near_plane = ((apart < r) & (np.abs(t - foot) < r)).sum(axis=0) / (2 * np.pi * r**3)
    np.testing.assert_allclose(cut[met].mean(), near_plane.mean(), rtol=0.02)
