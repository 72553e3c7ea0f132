"""Russian roulette (T3): equal weights by every rule that claims them, right in the mean, energy accounted for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.engine.pool import WorkPool
from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.record import unpack
from pmviewer.photons.light_pass.ledger import E_ABSORBED, E_EMITTED, E_ESCAPED, E_STORED, E_TERMINATED
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.light_pass.roulette import MOST_COPIES, RULES, copies, survival_probability
from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.flatten import LUMINANCE, flatten
from pmviewer.settings.access import Photons
from tests.support.scenes import cornell_box, diffuse_box, rendered, settings_of


def trace(scene, rule, N=60_000, **settings):
    flat = flatten(scene)
    photons = Photons(roulette=rule, **settings)
    return trace_pass(flat, photons, 1, 0, N, analyse(scene).has_specular, lambda tasks: [task() for task in tasks])


def powers(maps):
    return unpack(maps.global_, maps.global_unit)["Phi"].astype(float)


def spread(values):
    return np.percentile(values, 99) / np.percentile(values, 1)


@pytest.mark.parametrize("rule", RULES)
def test_weights_in_a_single_light_diffuse_box(rule):
    """T3: 99th / 1st percentile of photon weight at most 1.5, grey and coloured; "channel maximum" claims its own
    measure where surfaces have colours."""
    grey, coloured = powers(trace(diffuse_box(), rule)), powers(trace(diffuse_box_in_colour(), rule))
    for name, power in (("grey box", grey), ("coloured box", coloured)):
        print(f"{rule}, {name}: 99th / 1st percentile of luminance {spread(power @ LUMINANCE):.4f}, "
              f"of the largest channel {spread(power.max(1)):.4f}")  # fmt: skip
    assert spread(grey @ LUMINANCE) <= 1.5
    assert spread(coloured.max(1) if rule == "channel maximum" else coloured @ LUMINANCE) <= 1.5


def diffuse_box_in_colour():
    """The Cornell box's colours without its balls."""
    scene = cornell_box()
    return type(scene)(**{**scene.__dict__, "shapes": scene.shapes[:-2]})


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("scene", [diffuse_box_in_colour, cornell_box])
def test_energy_is_accounted_for(rule, scene):
    maps = trace(scene(), rule, N=20_000, max_bounces=12)
    ledger = maps.ledger
    assert ledger[E_ABSORBED] + ledger[E_ESCAPED] + ledger[E_TERMINATED] == pytest.approx(ledger[E_EMITTED], rel=1e-6)
    assert ledger[E_STORED] > 0
    assert maps.dropped == 0


def test_rules_have_the_same_power():
    """Stored power by channel, three estimates of one flux; their errors are correlated, so 1 % is generous."""
    total = {rule: powers(trace(cornell_box(), rule, N=150_000)).sum(0) for rule in RULES}
    print(total)
    for rule in RULES[1:]:
        assert total[rule] == pytest.approx(total["luminance"], rel=0.01)


def test_rules_have_the_same_mean_image():
    """Means over blocks of the picture, each rule's error estimated from two seeds."""
    blocks = {}
    for rule in RULES:
        for seed in (1, 2):
            settings = settings_of(photons={"roulette": rule, "N": 20_000}, render={"seed": seed})
            image = rendered(cornell_box(size=16), settings, 12).frame(0).beauty
            blocks[rule, seed] = image.reshape(4, 4, 4, 4, 3).mean(axis=(1, 3))
    for rule in RULES[1:]:
        difference = np.mean([blocks[rule, seed] - blocks["luminance", seed] for seed in (1, 2)], axis=0)
        noise = np.std([blocks[key] - np.mean(list(blocks.values()), axis=0) for key in blocks])
        print(
            f"{rule}: mean difference {difference.mean():+.2e}, largest {np.abs(difference).max():.2e}, "
            f"noise {noise:.2e}"
        )
        assert abs(difference.mean()) < 4 * noise / math.sqrt(16) + 1e-6
        assert np.abs(difference).max() < 6 * noise


@kernel
def _stored(betas, u, times, weight):
    for i in range(len(u)):
        n, factor = copies((betas[i, 0], betas[i, 1], betas[i, 2]), u[i])
        times[i], weight[i] = n, factor


@kernel
def _survival(rule, before, beta, after):
    b, a = (beta[0], beta[1], beta[2]), (after[0], after[1], after[2])
    return survival_probability(rule, before, b, a)


@pytest.mark.parametrize("Y", [0.0, 0.3, 1.0, 1.25, 2.9, 7.0])
def test_copies_are_right_in_the_mean_and_equal(Y):
    n = 100_000
    u = ((np.arange(n) + 0.5) / n).astype(np.float32)
    beta = np.float32(Y) * np.array([0.5, 1.1, 0.2]) / (np.array([0.5, 1.1, 0.2]) @ LUMINANCE)
    times, factor = np.zeros(n, np.int64), np.zeros(n, np.float32)
    _stored(np.broadcast_to(beta.astype(np.float32), (n, 3)).copy(), u, times, factor)
    assert (times * factor * Y).mean() == pytest.approx(Y, abs=2e-5)
    assert times.max() <= MOST_COPIES
    if 0 < Y <= MOST_COPIES - 1:
        assert factor * Y == pytest.approx(1.0, rel=1e-6)


def test_survival_by_each_rule():
    beta, after = np.array([2.0, 1.0, 0.5], np.float32), np.array([0.5, 0.8, 0.1], np.float32)
    before, Y = np.float32(beta @ LUMINANCE), after @ LUMINANCE
    chances = [_survival(rule, before, beta, after) for rule in range(3)]
    assert chances == pytest.approx([Y / before, 0.4, Y], rel=1e-6)
    assert [_survival(rule, before, beta, 3 * beta) for rule in range(3)] == [1, 1, 1]


def test_equal_photons_do_not_depend_on_threads():
    pool = WorkPool(2)
    try:
        flat, settings = flatten(cornell_box()), Photons(roulette="equal")
        one = trace_pass(flat, settings, 1, 0, 20_000, True, lambda tasks: [task() for task in tasks])
        two = trace_pass(flat, settings, 1, 0, 20_000, True, pool.run)
    finally:
        pool.close()
    assert one.global_.tobytes() == two.global_.tobytes()
    assert one.caustic.tobytes() == two.caustic.tobytes()
