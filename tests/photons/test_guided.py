"""Guided emission on a light pass: unbiased where it says so, within its number of trajectories, and sure of itself
where nothing is important (I6)."""

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.pool import WorkPool
from pmviewer.maps.record import unpack
from pmviewer.photons.deposition.rules import Deposition, Homogeneous
from pmviewer.photons.emission.guided import (
    ENOUGH,
    Guidance,
    Known,
    _at_least,
    beside,
    discard,
    estimated,
    keep,
    peter_pietrek,
)
from pmviewer.photons.emission.strata import Strata, strata_of
from pmviewer.photons.emission.tested import Sought
from pmviewer.photons.light_pass.light_pass import guided_emission_of, trace_pass
from pmviewer.scene.arrays.flatten import LUMINANCE, flatten
from pmviewer.scene.description import DirectionalLight, PointLight, SpotLight
from pmviewer.settings.access import Photons
from tests.support.scenes import box_walls, diffuse_box, light_scene

ALL = 0b1111
VARIANTS = ("Peter-Pietrek", "Christensen discard", "Christensen keep")
N = 4000
f4, u4 = np.float32, np.uint32


def in_order(tasks):
    return [task() for task in tasks]


def corner(positions, normals):
    """One corner of the box is important, and less and less around it."""
    return np.clip(1 - np.linalg.norm(positions - f4(-0.9), axis=1), 0, 1).astype(f4)


def nowhere(positions, normals):
    return np.zeros(len(positions), f4)


def two_lights():
    """A box with a panel on the ceiling and a point light."""
    scene = diffuse_box()
    return flatten(replace(scene, lights=(PointLight("point", (0.5, 0.2, -0.3), (1.0, 2.0, 0.5)),)))


def light_pass(variant, seed=1, run=in_order, n=N, importance=corner, before=None, flat=None, index=0):
    flat = flat or two_lights()
    how = Guidance(variant, (Sought("global", importance, ALL, ALL),), 2, 0.05)
    guided = guided_emission_of(flat, Photons(), seed, index * n, n, False, how, run, before)
    assert guided is not None
    rule = None if variant == "Peter-Pietrek" else Homogeneous(importance, 0.2, guided.smallest, seed)
    deposition = Deposition(rule, rule, 0, ALL)
    return trace_pass(flat, Photons(), seed, index * n, n, False, run, deposition=deposition, guided=guided)


def power_in_cells(photons):
    """Luminance in eight cells of the box, and in the important corner."""
    all_ = unpack(photons.global_, photons.global_unit)
    power = all_["Phi"].astype(float) @ LUMINANCE
    inside = corner(all_["position"], None) > 0
    cell = ((all_["position"] > 0) @ [1, 2, 4]).astype(int)
    return np.append(np.bincount(cell, power, 8), power[inside].sum())


@pytest.mark.parametrize("variant", VARIANTS)
def test_means(variant):
    """z-test over 32 seeds by place against photons that leave by power. Discard may miss light, not make any."""
    flat = two_lights()
    guided = np.array([power_in_cells(light_pass(variant, seed, flat=flat)) for seed in range(32)])
    plain = np.array([power_in_cells(trace_pass(flat, Photons(), 500 + s, 0, N, False, in_order)) for s in range(32)])
    error = np.sqrt((guided.var(axis=0, ddof=1) + plain.var(axis=0, ddof=1)) / 32)
    z = (guided.mean(axis=0) - plain.mean(axis=0)) / error
    print(variant, np.round(z, 2), "variance in the corner", guided.var(axis=0)[-1] / plain.var(axis=0)[-1])
    if variant == "Christensen discard":
        assert guided.mean(axis=0)[-1] == pytest.approx(plain.mean(axis=0)[-1], rel=0.05)
    else:
        assert np.all(np.abs(z) < 3.5)
    assert guided.sum() == pytest.approx(plain.sum(), rel=0.02)


@pytest.mark.parametrize("variant", VARIANTS)
def test_threads_do_not_matter_and_no_photon_too_many(variant):
    pool = WorkPool(3)
    try:
        many = light_pass(variant, run=pool.run, n=20_000)
    finally:
        pool.close()
    one = light_pass(variant, n=20_000)
    np.testing.assert_array_equal(many.global_.view(u4), one.global_.view(u4))
    assert one.emitted <= 20_000
    assert one.emitted > 19_000
    assert one.guided.lights.share.sum() == pytest.approx(1)
    assert one.guided.lights.power.sum() == pytest.approx(1)
    assert set(unpack(one.global_, 1.0)["light"]) <= {0, 1}
    weights = one.deposited["global"].percentiles
    assert weights[3] < 60 * weights[1]


@pytest.mark.parametrize("variant", VARIANTS)
def test_nothing_important(variant):
    """Photons leave by power, with a sentence, and the power is all there."""
    photons = light_pass(variant, importance=nowhere)
    assert "none of" in photons.guided.notes[0]
    plain = trace_pass(two_lights(), Photons(), 9, 0, N, False, in_order)
    assert photons.emitted <= N
    power = [float((unpack(p.global_, p.global_unit)["Phi"] @ LUMINANCE).sum()) for p in (photons, plain)]
    assert power[0] == pytest.approx(power[1], rel=0.1)
    np.testing.assert_allclose(photons.guided.lights.met, 0)


def test_too_few_photons_for_the_lights():
    how = Guidance("Christensen keep", (Sought("global", corner, ALL, ALL),), 64, 0.05)
    assert guided_emission_of(two_lights(), Photons(), 1, 0, 500, False, how, in_order) is None


@pytest.mark.parametrize("name", ["parallelogram", "sphere", "cylinder", "mesh", "point", "environment", "spot", "sun"])
def test_strata_hold_equal_power(name, request):
    """Even photons of all strata are the photons of the light: same mean direction and place, for every kind."""
    if name in ("spot", "sun"):
        request.getfixturevalue("every_surface")
    if name == "spot":
        light = SpotLight("spot", (0.3, 1.2, -0.4), (0.0, -1.0, 0.0), (2.0, 3.0, 1.0), 40.0, 20.0)
    elif name == "sun":
        light = DirectionalLight("sun", (0.0, -1.0, 0.0), (2.0, 3.0, 1.0))
    else:
        light = None
    scene = light_scene() if light else light_scene(name)
    room = tuple(replace(s, material=0) for s in box_walls(6.0)) if name not in ("environment", "sun") else ()
    scene = replace(scene, shapes=(*scene.shapes, *room), lights=(light,) if light else scene.lights)
    flat = flatten(scene)
    everywhere = lambda positions, normals: np.ones(len(positions), f4)  # noqa: E731
    photons = light_pass("Peter-Pietrek", importance=everywhere, flat=flat, n=40_000)
    plain = trace_pass(flat, Photons(), 3, 0, 40_000, False, in_order)
    a, b = (unpack(p.global_, p.global_unit) for p in (photons, plain))
    for made in (a, b):
        made["power"] = made["Phi"].astype(float) @ LUMINANCE
    assert a["power"].sum() == pytest.approx(b["power"].sum(), rel=0.03)
    scale = 0.05 * np.abs(b["position"]).max()
    means = [np.average(made["position"], axis=0, weights=made["power"]) for made in (a, b)]
    np.testing.assert_allclose(*means, atol=scale)


def some_strata():
    strata = strata_of(two_lights(), 300)
    rng = np.random.default_rng(1)
    met = np.where(rng.random(strata.n) < 0.1, rng.random(strata.n), 0.0)
    return strata, Known(met, np.full(strata.n, 2.0), (met > 0.5).astype(float))


def test_decisions_carry_all_power():
    """Whatever is met: the power of traced and of kept photons is that of each stratum, and bounded."""
    strata, known = some_strata()
    q, n, all_ = strata.power, 10_000, 12_000
    share, weight, _ = peter_pietrek(strata, known, n, all_)
    np.testing.assert_allclose(n * share * weight, q * all_)
    assert weight.max() <= all_ / (0.1 * n) * (1 + 1e-9)
    share, weight, (tests, others) = discard(strata, known, 2, n, all_)
    np.testing.assert_allclose(n * share * weight + 2 * (tests + others), q * all_)
    assert np.all((tests > 0) == (share == 0))
    assert np.all(n * share[share > 0] > 0.2 * ENOUGH * 4)
    other = Known(known.met[::-1].copy(), known.tests, known.hits)
    share, weight, (a, b) = keep(strata, known, other, 2, n, all_)
    np.testing.assert_allclose(n * share * weight + 2 * (a + b), q * all_)
    assert share.sum() == pytest.approx(1)


def test_keep_asks_the_other_set():
    """What set A met changes nothing about set A's own powers."""
    strata, known = some_strata()
    other = Known(known.met[::-1].copy(), known.tests, known.hits)
    nothing = Known(np.zeros(strata.n), known.tests, np.zeros(strata.n))
    own = [keep(strata, a, other, 2, 10_000, 12_000)[2][0] for a in (known, nothing)]
    np.testing.assert_array_equal(*own)
    others = [keep(strata, a, other, 2, 10_000, 12_000)[2][1] for a in (known, nothing)]
    assert not np.array_equal(*others)


def test_estimates():
    """Constant importance is found as it is; one stratum's spreads to its neighbours of the same light alone."""
    strata, _ = some_strata()
    ones = np.ones(strata.n)
    np.testing.assert_allclose(estimated(strata, Known(2.5 * ones, ones, ones)), 2.5)
    single = np.zeros(strata.n)
    single[strata.first[1] + 20] = 1.0
    spread = beside(strata, single)
    assert spread[strata.light == 0].sum() == 0
    assert (spread > 0).sum() == 9
    assert spread.max() == spread[strata.first[1] + 20] == 1.0


def test_keep_bounds_every_power_and_spends_all_photons():
    """However little was met where: no photon has more than MOST_WEIGHT, and the mean emitted power is right."""
    n_strata, h, N = 40, 4, 40 * 64
    strata = Strata(
        np.zeros(n_strata, np.int32),
        np.zeros(1, np.int32),
        np.array([[1, 1, 8, 5]], np.int32),
        np.full(n_strata, 1 / n_strata),
    )
    rng = np.random.default_rng(4)
    met = np.where(rng.random((2, n_strata)) < 0.1, 100 * rng.random((2, n_strata)), 0.0)
    a, b = (Known(m, np.full(n_strata, float(h)), (m > 0).astype(float)) for m in met)
    n = N - 2 * h * n_strata
    share, weight, powers = keep(strata, a, b, h, n, N)
    assert max(weight.max(), powers[0].max(), powers[1].max()) <= 4.0 + 1e-9
    emitted = n * (share * weight) + h * (powers[0] + powers[1])
    np.testing.assert_allclose(emitted, N / n_strata, rtol=1e-9)
    assert weight.min() < 0.5


def test_numbers_that_may_not_be_small_sum_to_the_total():
    numbers = _at_least(np.array([0.0, 1.0, 2.0, 100.0]), np.array([5.0, 5.0, 5.0, 5.0]), 60.0)
    np.testing.assert_allclose(numbers, [5, 5, 5, 45])
    np.testing.assert_allclose(_at_least(np.zeros(3), np.ones(3), 9.0), 1)
