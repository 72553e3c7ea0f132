"""Ray marching through the volume map against integrals, and white media that vanish."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.engine.radius import volume_neighbours, widest_in_media
from pmviewer.engine.stages.pass_data import blank_pass, box_of
from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.radius import automatic_volume_radius
from pmviewer.maps.search.grid import build_grid
from pmviewer.maps.search.kdtree import build_kdtree
from pmviewer.render.media.march import march_record, marched_radiance, marches
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.medium import Medium
from pmviewer.settings.access import Estimate
from tests.render.test_media import SKY, cube_of, picture
from tests.support import naive_maps as naive
from tests.support.scenes import rendered, settings_of

pytestmark = pytest.mark.usefixtures("any_light_in_media")

f4 = np.float32
SIGMA, START, LENGTH, N = 0.8, -0.7, 1.4, 40_000
MILK = Medium("milk", (1.0, 2.0, 1.5), (1, 1, 1))


@kernel
def along_rays(scenes, maps, rays, radius, out):
    """Red radiance along the x axis from START; rays (n, 3): y, z, and the offset of the steps."""
    zero = f4(0.0)
    sigma, lobes = (f4(SIGMA), f4(SIGMA), f4(SIGMA)), (zero, zero, zero)
    for i in range(len(rays)):
        o, d = (f4(START), rays[i, 0], rays[i, 1]), (f4(1.0), zero, zero)
        L = marched_radiance(scenes[0], maps[0], o, d, f4(LENGTH), radius, f4(np.inf), sigma, lobes, rays[i, 2])
        out[i] = L[0]


def rising(seed):
    """N photons of power 1 in (−1, 1)³ from all directions, N/8 (1 + x) of them in a unit of volume at x."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-1, 1, (N, 3))
    places[:, 0] = 2 * np.sqrt(rng.random(N)) - 1
    wi = rng.normal(size=(N, 3))
    wi /= np.linalg.norm(wi, axis=1)[:, None]
    return naive.pack(places.astype(f4), wi.astype(f4), np.ones((N, 3), f4), np.zeros(N, int))


@pytest.mark.parametrize(
    ("kind", "step", "k", "share"),
    [("radius", 0.05, 0, 0), ("radius", 0.4, 0, 0), ("nearest", 0.2, 12, 1.0), ("nearest", 0.2, 12, 0.6)],
)
def test_marching_is_right_in_the_mean(kind, step, k, share):
    """∫ N/8 (1 + x) exp(−σ t)/(4π) dt within 1 % (noise 0.3 %): in a density that rises linearly balls of any size tell
    the mean of their middle. With the k-th photon it would be 9 % more."""
    scene = flatten(cube_of(MILK, SKY)).record
    found = []
    for seed in range(12):
        rng = np.random.default_rng([seed, 1])
        rays = np.concatenate([rng.uniform(-0.7, 0.7, (64, 2)), rng.random((64, 1))], axis=1).astype(f4)
        made = build_grid(rising(seed), 0.15, 1.0) if kind == "radius" else build_kdtree(rising(seed), 1.0)
        record = march_record(made.record, step, k, share, box_of(made))
        out = np.zeros(len(rays), f4)
        along_rays(scene, record, rays, f4(0.15 if kind == "radius" else 0.3), out)
        found.append(out.mean())
    t = (np.arange(2000) + 0.5) / 2000 * LENGTH
    expected = float(np.mean(N / 8 * (1 + START + t) * np.exp(-SIGMA * t)) * LENGTH / (4 * math.pi))
    assert np.mean(found) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("how", [pytest.param("point", marks=pytest.mark.extensive), "nearest"])
def test_white_medium_under_a_white_sky_vanishes_as_balls_shrink(how):
    """Radiance 1. A ball at the boundary misses what is outside, 1 to 2 % with the wider radius; with a quarter of it
    (or an eighth of the photons) less than 1 %. Balls of one radius are those of the mean along rays, above."""
    wide, narrow = {"radius": 0.05, "volume_k": 64}, {"radius": 0.02, "volume_k": 6}
    errors = []
    for values in (wide, narrow):
        settings = {"in_media": how, **values}
        image = picture(cube_of(MILK, SKY), "progressive", 16, estimate=settings, photons={"N": 150_000})
        errors.append(abs(image[2:14, 2:14].mean() - 1))
    assert errors[1] < 0.01
    assert errors[1] < errors[0]


def test_only_a_scene_that_asks_for_it_marches():
    """The record of the beam estimate is that of a plain grid, for which kernels are compiled without marching; what is
    compiled ahead has the records' types."""
    for how in ("beam", "nearest"):
        renderer = rendered(cube_of(MILK, SKY), settings_of(estimate={"in_media": how}, photons={"N": 100}), 1)
        record = renderer.latest.given.volume_map
        assert marches(record) == (how != "beam")
        blank = blank_pass(renderer.scene.flat.record, renderer.settings, renderer.plan)
        assert blank.volume_map.dtype == record.dtype


def test_largest_radius_in_media():
    """k photons of power Φ, scattered alike in all directions, are as bright as L_t σs where they fill the ball."""
    k, power, sigma, threshold = 40, 0.03, 2.5, 0.05
    r = automatic_volume_radius(k, power, sigma, threshold)
    assert k * power / (4 * math.pi) / (4 / 3 * math.pi * r**3) == pytest.approx(threshold * sigma)
    ink = Medium("ink", (9.0,) * 3, (0.0,) * 3)
    fog = Medium("fog", (1.0, 5.0, 1.0), (0.5,) * 3)
    assert widest_in_media(power, k, Estimate(), [ink, fog, MILK], 1.0) == pytest.approx(
        automatic_volume_radius(k, power, 2.0, 0.05)
    )


def test_neighbours_shrink_with_the_volume():
    """k·share, the photons that count, go with r³, r²ᵢ₊₁/r²ᵢ = (i + α)/(i + 1) (Knaus and Zwicker 2011)."""
    k, share = volume_neighbours(2, Estimate(alpha=0.5, volume_k=400))
    assert k * share == pytest.approx(400 * ((1 + 0.5) / 2 * (2 + 0.5) / 3) ** 1.5)
    assert k < 400
