"""A planted error is found, equal pictures agree even when single paths are very bright."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.bench.agree.statistics import SPIKES, TAIL, compared, negligible, rejected, summaries
from pmviewer.bench.agree.trial import LEAST_LIGHT, unseen_in

PIXELS = (32, 32, 3)


def runs(seed: int, count: int, samples: int, mean: float = 1.0, tail: float = 0.0) -> np.ndarray:
    """(count, 32, 32, 3) means of `samples` exponential samples of a pixel; with `tail`, every one in so many of them
    is drawn from a Pareto distribution of index 2.2 instead, of the same mean. Sums of exponential samples are drawn at
    once: they have a gamma distribution."""
    rng = np.random.default_rng(seed)
    shape = (count, *PIXELS)
    if not tail:
        return mean / samples * rng.standard_gamma(samples, shape)
    rare = rng.binomial(samples, 1 / tail, shape)
    bright = (rng.pareto(2.2, int(rare.sum())) + 1) * 1.2 / 2.2 * tail / 2
    sums = np.bincount(np.repeat(np.arange(rare.size), rare.ravel()), bright, rare.size).reshape(shape)
    sums += 0.5 * rng.standard_gamma(samples - rare)
    return mean / samples / (0.5 + 0.5 * (1 - 1 / tail)) * sums


def p_of(ours: np.ndarray, theirs: np.ndarray, **more: float) -> float:
    return compared(summaries(ours), summaries(theirs), **more).p


def test_three_percent_are_found():
    found = [p_of(runs(2 * i, 24, 64, 1.03), runs(2 * i + 1, 24, 64)) for i in range(10)]
    assert max(found) < 1e-6


def test_equal_pictures_agree():
    p = np.array([p_of(runs(2 * i, 12, 16), runs(2 * i + 1, 12, 16)) for i in range(200)])
    # The allowance for bright paths makes it a little shy; it must never be bold: 20 ± 4.2 below a tenth.
    assert (p < 0.1).sum() <= 33


def test_rare_bright_paths_are_no_disagreement():
    """One side with a heavy tail: Welch's test alone rejects far too often."""
    p = np.array([p_of(runs(2 * i, 12, 16, tail=3000.0), runs(2 * i + 1, 12, 64)) for i in range(100)])
    assert (p < 1e-4).sum() == 0


def spiky(seed: int, count: int, samples: int, mean: float = 1.0) -> np.ndarray:
    """(count, 32, 32, 3) means of `samples` of a pixel, one in a hundred of them 1/d² of a d whose third power is
    uniform: point lights beside an edge. Half of the light comes so, and has no variance."""
    rng = np.random.default_rng(seed)
    shape = (count, *PIXELS)
    rare = rng.binomial(samples, 0.01, shape)
    spikes = (1 - rng.random(int(rare.sum()))) ** (-2 / 3) / 3  # of mean 1
    sums = np.bincount(np.repeat(np.arange(rare.size), rare.ravel()), spikes, rare.size).reshape(shape)
    return mean / samples * (50 * sums + 0.5 * rng.standard_gamma(samples, shape))


@pytest.mark.parametrize(("samples", "missing"), [(2, 0.5), (16, 0.2)])
def test_spikes_of_point_lights_are_no_disagreement_and_missing_light_is(samples, missing):
    """Few samples, whose brightest spikes have not come, and many, which find a lesser error."""

    def found(mean: float, count: int = 100) -> np.ndarray:
        pairs = ((spiky(2 * i, 12, samples, mean), runs(2 * i + 1, 12, 64)) for i in range(count))
        return np.array([p_of(ours, theirs, tails=(SPIKES, TAIL)) for ours, theirs in pairs])

    p = found(1.0)
    assert (p < 1e-4).sum() == 0
    assert (p < 0.1).sum() <= 18
    assert np.median(found(1 - missing, 10)) < 1e-4


def test_tolerance_is_a_share_of_the_second():
    ours, theirs = runs(1, 24, 64, 1.03), runs(2, 24, 64)
    assert p_of(ours, theirs, tolerance=0.05) > 0.5
    assert p_of(ours, theirs, tolerance=0.01) < 1e-3


def test_black_against_light_is_found_and_black_agrees_with_black():
    light, black = runs(1, 12, 16), np.zeros((12, *PIXELS))
    assert p_of(black, light) < 1e-6
    assert compared(summaries(black), summaries(light), sparse=True).p < 1e-6
    assert p_of(black, black) == 1
    assert p_of(np.full((4, *PIXELS), 7.0), np.full((4, *PIXELS), 7.0 * (1 + 1e-6))) > 0.5
    assert p_of(np.full((4, *PIXELS), 7.0), np.full((4, *PIXELS), 7.01)) < 1e-6


def test_blocks_that_no_photon_met_say_nothing_where_light_is_sparse():
    theirs = np.zeros((12, *PIXELS))
    theirs[:, 16:, 16:] = runs(1, 12, 16)[:, 16:, 16:]
    ours = theirs + 0.01 * runs(2, 12, 16)
    assert compared(summaries(ours), summaries(theirs)).tests == 3 + 12
    assert compared(summaries(ours), summaries(theirs), sparse=True).tests == 3 + 3


def test_a_term_may_lack_what_is_nothing_beside_the_picture():
    """A ten-thousandth of the picture, wherever it lies; a thousandth is found, even in one block of four."""
    picture = summaries(runs(1, 12, 16))
    faint, black = np.zeros((12, *PIXELS)), np.zeros((12, *PIXELS))
    faint[:, 16:, 16:] = 1e-4 * runs(2, 12, 16)[:, 16:, 16:]
    lacking = summaries(black), summaries(faint)
    assert compared(*lacking, sparse=True).p < 1e-6
    assert compared(*lacking, sparse=True, floor=negligible(picture)).p == 1
    assert compared(10 * lacking[1], lacking[0], floor=negligible(picture)).p < 1e-6


def test_pixels_that_are_not_seen_do_not_count():
    ours, theirs = runs(1, 24, 64), runs(2, 24, 64)
    ours[:, :16] *= 2
    seen = np.zeros((32, 32), bool)
    seen[16:] = True
    assert p_of(ours, theirs) < 1e-6
    lower = compared(summaries(ours, seen), summaries(theirs, seen))
    assert lower.p > 1e-3
    assert lower.tests == 3 + 6


def test_not_a_number_never_agrees():
    ours = runs(1, 12, 16)
    ours[3, 2, 2, 1] = np.nan
    assert p_of(ours, runs(2, 12, 16)) == 0


def test_outcome_says_what_differs_most():
    ours, theirs = runs(1, 24, 64), runs(2, 24, 64)
    ours[:, :16, :16, 0] *= 1.5
    found = compared(summaries(ours), summaries(theirs))
    assert found.ratio == pytest.approx(1.5, abs=0.02)
    assert 0 < found.noise < 0.02


def test_holm_rejects_in_order():
    assert rejected([0.5, 1e-6, 0.004, 0.0049], 0.01) == [False, True, False, False]
    assert rejected([0.001, 0.004, 0.009], 0.01) == [True, True, True]
    assert rejected([], 0.01) == []


def test_light_of_no_account_is_none():
    """Scene 268 of seed 31: at 1e-21 of the picture's brightness, and black for the other."""
    rng = np.random.default_rng(5)
    ours, theirs = rng.uniform(0.9, 1.1, (2, 16, *PIXELS))
    theirs[:, :16] = 0.0
    ours[:, :16] *= 1e-21
    assert p_of(ours, theirs) > 0.5
    ours[:, :16] *= 1e13
    assert p_of(ours, theirs) < 1e-6


def test_a_picture_that_sees_next_to_nothing_is_black():
    """A sheet of Beckmann metal, seen where its microfacets have a probability of 1e-29: black for Mitsuba."""
    faint, black = runs(1, 12, 16) * 1e-30, np.zeros((12, *PIXELS))
    assert p_of(faint, black) == 1
    assert p_of(runs(1, 12, 16) * 1e-6, black) < 1e-6


def test_terms_of_black_pictures_are_not_compared():
    lit, black = np.full((4, *PIXELS), 2 * LEAST_LIGHT), np.full((4, *PIXELS), LEAST_LIGHT / 2)
    none, all_of_it = np.zeros_like(lit), summaries(lit + runs(3, 4, 8, LEAST_LIGHT / 100))
    assert compared(summaries(none), all_of_it, floor=unseen_in(summaries(lit))).p < 1e-3
    assert compared(summaries(none), all_of_it, floor=unseen_in(summaries(black))).p == 1
