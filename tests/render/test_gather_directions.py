"""Guided gather rays: their densities, and that no rule of directions changes the mean of a picture."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.kernels.bsdf.plain import STORED, PlainBsdf
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.memory import stack_i4, stack_put_f4
from pmviewer.render.gather.cones import ONE_MINUS_COS, cone_direction, cone_pdf
from pmviewer.render.gather.guide import AIM_WORDS, MOST_IN_CELLS, concentration
from pmviewer.render.gather.hemicells import cell_direction, cell_pdf, fill_cells
from pmviewer.scene.analysis import analyse
from pmviewer.scene.description import Parallelogram, Scene, Shape
from tests.support.scenes import box_camera, box_walls, closed_sphere, diffuse, rendered, settings_of

_f4 = np.float32
_AT = 4 * MOST_IN_CELLS
GUIDED = ("photon cones", "hemisphere grid")
NORMAL = np.array([0.36, 0.48, 0.8], np.float32)


@kernel
def densities(by_cones, photons, normal, numbers, directions, densities_, everywhere, chosen):
    """Directions drawn with `numbers` (n, 3) and their densities; the densities at the directions `everywhere`."""
    found = stack_i4(AIM_WORDS)
    for j in range(len(photons)):
        for k in range(4):
            stack_put_f4(found, 4 * j + k, photons[j, k])
    n = (normal[0], normal[1], normal[2])
    b = PlainBsdf(STORED, (_f4(0.5), _f4(0.5), _f4(0.5)), np.int64(0), n, n)
    fill_cells(found, np.int64(_AT), len(photons), b, n)
    for i in range(len(numbers)):
        u, v, w = numbers[i, 0], numbers[i, 1], numbers[i, 2]
        if by_cones:
            d, densities_[i] = cone_direction(found, len(photons), u, v, w)
        else:
            d, densities_[i] = cell_direction(found, np.int64(_AT), b, u, v, w)
        for k in range(3):
            directions[i, k] = d[k]
    for i in range(len(everywhere)):
        d = (everywhere[i, 0], everywhere[i, 1], everywhere[i, 2])
        chosen[i] = cone_pdf(found, len(photons), d) if by_cones else cell_pdf(found, np.int64(_AT), b, d)


@kernel
def spreads(photons, normal, result):
    found = stack_i4(AIM_WORDS)
    for j in range(len(photons)):
        for k in range(4):
            stack_put_f4(found, 4 * j + k, photons[j, k])
    result[0] = concentration(found, len(photons), (normal[0], normal[1], normal[2]))


def unit(v):
    return np.ascontiguousarray(v / np.linalg.norm(v, axis=1, keepdims=True), np.float32)


def cosine_directions(rng, n):
    """Above NORMAL, with density cos/π."""
    return unit(unit(rng.normal(size=(n, 3))) + NORMAL * (1 - 1e-4))


def photons_around(rng, m):
    """Half of them from about one direction."""
    w = cosine_directions(rng, m)
    w[: m // 2] = unit(np.array([0.6, 0.3, 0.75]) + 0.1 * rng.normal(size=(m // 2, 3)))
    return np.ascontiguousarray(np.c_[w, rng.random(m) + 0.5], np.float32)


def drawn(directions, m, n, everywhere):
    rng = np.random.default_rng(8)
    d, pdf = np.empty((n, 3), np.float32), np.empty(n, np.float32)
    at = np.empty(len(everywhere), np.float32)
    photons = photons_around(rng, m)
    densities(directions == "photon cones", photons, NORMAL, rng.random((n, 3), np.float32), d, pdf, everywhere, at)
    return d, pdf, at


def even_directions(turns, heights):
    """One direction from each of turns × heights cells of the sphere of equal size."""
    rng = np.random.default_rng(4)
    phi = (np.arange(turns)[:, None] + rng.random((turns, heights))) / turns * 2 * np.pi
    z = (np.arange(heights)[None] + rng.random((turns, heights))) / heights * 2 - 1
    r = np.sqrt(1 - z * z)
    return np.ascontiguousarray(np.stack([r * np.cos(phi), r * np.sin(phi), z], -1).reshape(-1, 3), np.float32)


def bins(d):
    """Number of a direction's bin among 20 heights and 20 turns."""
    turn = np.arctan2(d[:, 1], d[:, 0]) / (2 * np.pi) % 1.0
    return np.minimum(((d[:, 2] + 1) * 10).astype(int), 19) * 20 + np.minimum((turn * 20).astype(int), 19)


def test_half_angle_of_cones_is_ten_degrees():
    assert pytest.approx(np.cos(np.radians(10.0))) == 1 - ONE_MINUS_COS


@pytest.mark.parametrize("m", [1, 50])
@pytest.mark.parametrize("directions", GUIDED)
def test_density_of_guided_directions(directions, m):
    """It integrates to 1, is that which the sampler returns, and is that of the sampler's histogram (chi-square)."""
    n = 1_000_000
    everywhere = even_directions(2000, 1000)
    d, pdf, at = drawn(directions, m, n, everywhere)
    print(f"{directions}, {m}: integral {4 * np.pi * at.mean():.5f}")
    assert 4 * np.pi * at.mean(dtype=float) == pytest.approx(1.0, abs=2e-3)
    assert (pdf > 0).mean() > 0.9999
    _, _, again = drawn(directions, m, n, d)
    assert np.isclose(again, pdf, rtol=1e-3).mean() > 0.999  # but on the rims of cones and cells
    mass = np.bincount(bins(everywhere), at.astype(float), 400) * n * 4 * np.pi / len(everywhere)
    counts = np.bincount(bins(d), minlength=400)
    wanted = mass > 50
    assert counts[mass == 0].sum() < 1e-4 * n
    # A bin's expectation is known to half a per cent: 5000 directions, the rims of cones between them.
    statistic = ((counts - mass)[wanted] ** 2 / (mass + (0.005 * mass) ** 2)[wanted]).sum()
    print(f"chi-square {statistic:.0f} of {wanted.sum()} bins")
    assert statistic < chi2.ppf(1 - 1e-4, wanted.sum())


def test_concentration_is_the_relative_variance_of_radiance():
    """0 for evenly spread light, with neither bias nor much noise; 15 where all comes from one cell of sixteen."""
    rng = np.random.default_rng(2)
    even, one, result = [], [], np.empty(1, np.float32)
    for _ in range(400):
        spreads(np.c_[cosine_directions(rng, 50), np.ones(50)].astype(np.float32), NORMAL, result)
        even.append(float(result[0]))
        beam = unit(np.array([0.1, 0.8, 0.5]) + 0.01 * rng.normal(size=(50, 3)))
        spreads(np.c_[beam, np.ones(50)].astype(np.float32), NORMAL, result)
        one.append(float(result[0]))
    print(f"even {np.mean(even):.3f} ± {np.std(even):.3f}, beam {np.mean(one):.2f}")
    assert abs(np.mean(even)) < 4 * np.std(even) / 20
    assert np.std(even) < 0.25
    assert np.mean(one) == pytest.approx(15, rel=1e-3)


def lit_wall(size=32):
    """A closed box where a small light just off the left wall makes a bright spot that lights the rest."""
    facing = Parallelogram((-0.85, -0.05, -0.2), (0.0, 0.1, 0.0), (0.0, 0.0, -0.1))
    spot = Shape("spot", facing, 1, (300.0,) * 3)
    materials = (diffuse(), diffuse("black", (0.0, 0.0, 0.0)))
    return Scene("lit wall", None, (*box_walls(), spot), materials, (), box_camera(), size, size)


def indirect(scene, passes=12, **gather):
    settings = settings_of(render={"method": "gather"}, photons={"N": 40_000}, gather=gather)
    renderer = rendered(scene, settings, passes)
    assert renderer.tally.dropped == {"photons": 0, "samples": 0}
    return renderer.frame(1).image("indirect").astype(float)


@pytest.fixture(scope="module")
def wall():
    return open_scene(lit_wall())


@pytest.fixture(scope="module")
def by_bsdf(wall):
    return indirect(wall, rays=8)


@pytest.mark.extensive
@pytest.mark.parametrize("roulette", [0.0, 0.5])
@pytest.mark.parametrize("directions", GUIDED)
def test_guided_pictures_have_the_same_mean_and_less_noise(directions, roulette, wall, by_bsdf):
    """In 8 × 8 blocks within 4 standard errors; the photons are the same, so that directions alone differ."""
    image = indirect(wall, rays=8, directions=directions, roulette=roulette)

    def blocks(x):
        return x.mean(axis=2).reshape(4, 8, 4, 8).transpose(0, 2, 1, 3).reshape(16, 64)

    a, b = blocks(image), blocks(by_bsdf)
    difference = a - b
    z = difference.mean(axis=1) / (difference.std(axis=1, ddof=1) / 8)
    noise = [(np.diff(x, axis=1) ** 2).mean() for x in (a, b)]
    print(f"{directions}, roulette {roulette}: z {np.abs(z).max():.2f}, noise {noise[1] / noise[0]:.2f} times lower")
    assert np.abs(z).max() < 4.5
    error = difference.std() / 32
    assert abs(difference.mean()) < 4 * error < 0.1 * b.mean()
    if roulette == 0:
        assert noise[0] < 0.7 * noise[1]


def test_roulette_saves_rays_and_keeps_the_mean(wall, by_bsdf):
    scene = lit_wall()
    settings = {"render": {"method": "gather"}, "photons": {"N": 40_000}}
    rays = {}
    for roulette in (0.0, 1.0):
        renderer = rendered(scene, settings_of(gather={"rays": 8, "roulette": roulette}, **settings), 12)
        rays[roulette] = renderer.tally.rays
        assert renderer.frame(1).image("indirect").mean() == pytest.approx(by_bsdf.mean(), rel=0.02)
    gather_rays = 12 * 32 * 32 * 8
    assert rays[0.0] - rays[1.0] == pytest.approx(gather_rays / 2, rel=0.05)  # they leave surfaces of albedo ½


@pytest.mark.parametrize("directions", GUIDED)
def test_radiance_of_the_closed_sphere_is_one(directions):
    settings = settings_of(
        render={"method": "gather"}, photons={"N": 60_000}, gather={"directions": directions, "roulette": 0.6}
    )
    assert rendered(closed_sphere(), settings, passes=6).frame(1).image().mean() == pytest.approx(1.0, abs=0.005)


@pytest.mark.parametrize("directions", GUIDED)
def test_threads_change_nothing(directions, wall):
    settings = settings_of(render={"method": "gather"}, photons={"N": 20_000}, gather={"directions": directions})
    one, two = (rendered(wall, settings, 2, threads) for threads in (1, 2))
    assert np.array_equal(one.film.sums, two.film.sums)
    assert one.latest.maps.guides.radius == two.latest.maps.guides.radius


def test_a_single_ray_follows_the_bsdf():
    traits = analyse(lit_wall())
    settings = settings_of(render={"method": "gather"}, gather={"rays": 1, "directions": "photon cones"})
    assert plan_of(settings, traits).guided_rays == 0
    assert "single" in (inactive_reason("gather.directions", settings, traits) or "")
    both = settings_of(render={"method": "gather"}, gather={"rays": 2, "directions": "photon cones", "guided": 0.95})
    assert plan_of(both, traits).guided_rays == 1
    assert inactive_reason("gather.guided", both, traits) is None
