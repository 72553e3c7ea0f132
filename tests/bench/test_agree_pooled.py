"""What a method is off by in all scenes is seen over them, though in none alone."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.bench.agree.bench import report
from pmviewer.bench.agree.generate import scene_of
from pmviewer.bench.agree.known import DEVIATIONS
from pmviewer.bench.agree.pooled import LEAST_SCENES, farthest_off, pooled
from pmviewer.bench.agree.statistics import Outcome, compared
from pmviewer.bench.agree.verdict import Comparison, Verdict


def verdict(ratio: float, peer: str = "our path") -> Verdict:
    return Verdict([Comparison("gather", peer, "picture", Outcome(1.0, 1.0, 0.1, 51, ratio), 1, False)])


def test_two_percent_show_over_many_scenes_of_five_percent_noise_each():
    for error in (0.0, 0.02):
        rng = np.random.default_rng(3)
        ratios = (1 + error) * np.exp(0.05 * rng.normal(size=400))
        ratios[::50] *= 3  # bright paths
        (found,) = pooled(1, dict(enumerate(map(verdict, ratios))))
        assert found.error == pytest.approx(0.05 * 1.2533 / np.sqrt(found.scenes), rel=0.25)
        assert abs(found.ratio - 1 - error) < 3 * found.error
        assert found.error < 0.02 / 4
        assert (found.off > 0) == (error > 0)


def test_the_target_is_missed_by_a_method_that_is_off_everywhere_and_needs_scenes_enough():
    rng = np.random.default_rng(3)
    wrong, right = (
        {i: verdict(ratio * np.exp(0.01 * rng.normal())) for i in range(8 * LEAST_SCENES)} for ratio in (1.03, 1.0)
    )
    (missed,) = (t for t in report(1, wrong, [], "abc", 1.0).targets if t.id == "agreement over scenes")
    assert not missed.ok
    assert missed.value == pytest.approx(3, abs=0.6)
    assert "gather against our path" in missed.note
    assert all(t.ok for t in report(1, right, [], "abc", 1.0).targets)
    few = {i: wrong[i] for i in range(LEAST_SCENES - 1)}
    assert farthest_off(pooled(1, few)) is None
    assert len(report(1, few, [], "abc", 1.0).targets) == 1


def test_scenes_with_what_a_known_deviation_takes_do_not_count():
    plain = [i for i in range(100) if not any(d.without(scene_of(1, i)) for d in DEVIATIONS)]
    assert 5 < len(plain) < 95
    verdicts = {i: verdict(1.0 if i in plain else 2.0, "Mitsuba particles") for i in range(100)}
    (found,) = pooled(1, verdicts)
    assert (found.scenes, found.ratio) == (len(plain), 1.0)


def test_the_whole_is_the_ratio_of_the_first_means_and_black_says_nothing():
    ours, theirs = np.ones((4, 9)), np.ones((4, 9))
    ours[:, :3] = [1.0, 2.0, 3.0]
    assert compared(ours, theirs).whole == pytest.approx(2.0)
    theirs[:, :3] = 0.0
    assert np.isnan(compared(ours, theirs).whole)
    assert pooled(1, {0: verdict(np.nan), 1: verdict(np.nan)}) == []
