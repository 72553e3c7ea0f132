"""Deposition rules on the photons of a light pass: unbiased, reproducible, with an honest ledger (I4, I5)."""

import math

import numpy as np
import pytest

from pmviewer.engine.pool import WorkPool
from pmviewer.maps.density.decide import COSINE, STEP
from pmviewer.maps.power import LARGEST, encode_powers
from pmviewer.maps.record import unpack
from pmviewer.photons.deposition.deposited import FIRST_WEIGHT, weight_histogram
from pmviewer.photons.deposition.rules import Density, Deposition, KellerWald, constant, rounds
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.scene.arrays.flatten import LUMINANCE, flatten
from pmviewer.settings.access import Photons
from tests.support.scenes import diffuse_box

ALL = 0b1111
N = 10_000
f4, u4 = np.float32, np.uint32


def in_order(tasks):
    return [task() for task in tasks]


def light_pass(rule, seed=1, run=in_order, n=N, classes=ALL, sample=0, first=0):
    flat = flatten(diffuse_box())
    deposition = None if rule is None else Deposition(rule, rule, classes, classes, sample)
    return trace_pass(flat, Photons(), seed, first, n, False, run, deposition=deposition)


def by_place(positions, normals):
    """From 1 at one side of the box to nothing at the other."""
    return np.clip(positions[:, 0], 0, 1).astype(f4)


def power_in_cells(photons, unit):
    """Luminance (4, 4, 4) by cells of the box."""
    all_ = unpack(photons, unit)
    cell = np.clip(((all_["position"] + 1) * 2).astype(int), 0, 3)
    sums = np.zeros((4, 4, 4))
    np.add.at(sums, tuple(cell.T), all_["Phi"].astype(float) @ LUMINANCE)
    return sums


def test_without_a_rule_everything_is_stored_as_ever():
    plain, judged = light_pass(None), light_pass(KellerWald(constant(1.0), 0.01))
    np.testing.assert_array_equal(plain.global_.view(u4), judged.global_.view(u4))
    everything = trace_pass(
        flatten(diffuse_box()), Photons(), 1, 0, N, False, in_order, deposition=Deposition(None, None, ALL, ALL)
    )
    np.testing.assert_array_equal(plain.global_.view(u4), everything.global_.view(u4))
    assert everything.deposited["global"].rejected == 0


@pytest.mark.parametrize(
    "rule",
    [KellerWald(by_place, 0.05), Density(constant(300.0), STEP), Density(constant(300.0), COSINE)],
    ids=["Keller-Wald", "step", "cosine"],
)
def test_threads_do_not_matter(rule):
    pool = WorkPool(3)
    try:
        many = light_pass(rule, run=pool.run, n=40_000)
    finally:
        pool.close()
    one = light_pass(rule, n=40_000)
    np.testing.assert_array_equal(many.global_.view(u4), one.global_.view(u4))
    np.testing.assert_array_equal(many.normals, one.normals)
    assert len(one.normals) == len(one.global_) < 100_000
    assert many.deposited == one.deposited


def test_clamping_is_unbiased():
    """z-test over 48 seeds: thinned minus whole power, cell by cell. The photons are the same, so all differences come
    from the rule."""
    differences = []
    for seed in range(48):
        whole, thinned = light_pass(None, seed, n=4000), light_pass(KellerWald(by_place, 0.05, seed=seed), seed, n=4000)
        assert len(thinned.global_) < 0.5 * len(whole.global_)
        cells = [power_in_cells(m.global_, m.global_unit) for m in (thinned, whole)]
        differences.append(cells[0] - cells[1])
    differences = np.array(differences)
    lit = differences.std(axis=0) > 0
    z = differences.mean(axis=0)[lit] / (differences.std(axis=0, ddof=1)[lit] / math.sqrt(len(differences)))
    assert np.count_nonzero(lit) > 30
    assert abs(z).max() < 4.2  # one cell in a thousand such tests
    assert abs(z.mean()) < 4 / math.sqrt(len(z))
    total = differences.sum(axis=(1, 2, 3))
    assert abs(total.mean()) < 3.3 * total.std(ddof=1) / math.sqrt(len(total))


def test_discarding_is_biased_by_what_the_books_say():
    whole = light_pass(None)
    thinned = light_pass(KellerWald(by_place, 0.3, discard=True))
    deposited = thinned.deposited["global"]
    assert unpack(thinned.global_, 1.0)["position"][:, 0].min() >= 0.3
    expected = power_in_cells(whole.global_, whole.global_unit).sum()
    assert deposited.arrived_power == pytest.approx(expected, rel=1e-5)
    assert 0.3 < deposited.discarded_power / deposited.arrived_power < 0.9
    assert deposited.stored_power + deposited.discarded_power == pytest.approx(deposited.arrived_power, rel=0.03)
    assert deposited.largest_arrived <= 1.01 * thinned.global_unit * LUMINANCE.sum()


@pytest.mark.parametrize("acceptance", [STEP, COSINE])
def test_density_control_keeps_the_power_to_a_ten_thousandth(acceptance):
    made = light_pass(Density(constant(50.0), acceptance), n=30_000)
    deposited = made.deposited["global"]
    assert deposited.stored_power == pytest.approx(deposited.arrived_power, rel=1e-4)
    assert deposited.stored + deposited.redistributed == deposited.arrived
    assert deposited.stored < deposited.arrived / 10
    whole = light_pass(None, n=30_000)
    a, b = (unpack(m.global_, m.global_unit)["Phi"].astype(float).sum(axis=0) for m in (made, whole))
    np.testing.assert_allclose(a, b, rtol=1e-4)


@pytest.mark.parametrize("p", [0.0, -1.0, np.nan, np.inf, 1e-30])
@pytest.mark.parametrize("discard", [False, True])
def test_any_probability_is_survived(p, discard):
    made = light_pass(KellerWald(constant(p), 0.0, discard), n=5000)
    deposited = made.deposited["global"]
    assert np.isfinite(unpack(made.global_, made.global_unit)["Phi"]).all()
    if p == np.inf:
        assert deposited.rejected == 0
    elif discard:
        assert deposited.stored == 0
        assert deposited.discarded_power == pytest.approx(deposited.arrived_power)
    else:  # the smallest ε there is
        assert deposited.stored < 0.01 * deposited.arrived


def test_classes_and_sample():
    direct = light_pass(KellerWald(constant(0.1), 0.05), classes=0b0010, sample=0b0001)
    assert set(unpack(direct.global_, 1.0)["path_class"]) == {1}
    assert set(unpack(direct.sample, 1.0)["path_class"]) == {0}
    whole = light_pass(None)
    classes = unpack(whole.global_, 1.0)["path_class"]
    assert len(direct.sample) == np.count_nonzero(classes == 0)
    assert direct.deposited["global"].arrived == np.count_nonzero(classes == 1)
    assert direct.sample_unit == whole.global_unit


def test_passes_thin_differently():
    first, second = (light_pass(KellerWald(by_place, 0.05), first=i * N) for i in (0, 1))
    assert len(first.global_) != len(second.global_)


def test_codes_round_up_and_down_to_the_right_sum():
    photons = np.zeros((20_000, 6), f4)
    power = 1.0003  # 0.6 of a step above 1: to nearest, the sum would be wrong by 4e-4
    assert encode_powers(photons, np.full((20_000, 3), power), 5) == 1.0
    np.testing.assert_allclose(unpack(photons, 1.0)["Phi"].mean(axis=0, dtype=float), power, rtol=3e-5)
    assert len(np.unique(unpack(photons, 1.0)["Phi"])) == 2


def test_large_powers_make_the_unit_grow():
    photons = np.zeros((2, 6), f4)
    photons.view(u4)[:, 5] = 7 << 16  # lights
    powers = np.array([[3 * LARGEST, 1.0, 0.0], [1.0, 1.0, 100.0]])
    factor = encode_powers(photons, powers, 1)
    assert factor == 4.0
    np.testing.assert_allclose(unpack(photons, factor)["Phi"], powers, rtol=1e-3)
    assert set(unpack(photons, 1.0)["light"]) == {7}


def test_histogram_of_weights():
    counts = weight_histogram(np.array([0.0, 0.999, 1.0, 1.4, 1.42, 2.8, 1e9, 2.0**FIRST_WEIGHT], f4))
    assert sum(counts) == 8
    assert (counts[0], counts[-FIRST_WEIGHT], counts[1 - FIRST_WEIGHT], counts[-1]) == (2, 3, 2, 1)


def test_rounds_cover_all_batches_once():
    assert [i for some in rounds(77) for i in some] == list(range(77))
    assert [len(some) for some in rounds(77)][:6] == [1, 2, 4, 8, 16, 16]
