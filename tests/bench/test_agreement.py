"""The block test accepts equal expectations, finds differences, and knows tolerances."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.bench.agreement import agreement


def runs(seed: int, count: int = 16, scale: float = 1.0) -> np.ndarray:
    """(count, 32, 32, 3) noisy images of mean `scale`, correlated within 4 × 4 pixels as photon maps are."""
    rng = np.random.default_rng(seed)
    noise = np.kron(rng.normal(0, 0.2, (count, 8, 8, 3)), np.ones((1, 4, 4, 1)))
    return scale * (1 + noise)


def test_false_alarms_are_as_rare_as_the_p_value_says():
    p = np.array([agreement(runs(2 * i), runs(2 * i + 1), 8).p_value for i in range(200)])
    # Uniform in [0, 1]: 20 ± 4.2 below a tenth, three standard deviations allowed.
    assert 6 <= (p < 0.1).sum() <= 33
    assert p.mean() == pytest.approx(0.5, abs=0.07)


def test_a_difference_is_found_and_tolerated_only_within_its_share():
    ours, theirs = runs(1, 32, 1.25), runs(2, 32)
    assert agreement(ours, theirs, 8).p_value < 1e-6
    assert agreement(ours, theirs, 8, tolerance=0.1).p_value < 0.01
    assert agreement(ours, theirs, 8, tolerance=0.3).p_value > 0.05
    assert agreement(ours, theirs, 8).ratio == pytest.approx(1.25, abs=0.02)


def test_one_wrong_block_is_found():
    ours = runs(1)
    ours[:, 8:16, 8:16, 1] += 0.5
    assert agreement(ours, runs(2), 8).p_value < 1e-4


def test_constant_and_black_blocks_agree_and_rounding_is_no_difference():
    black = np.zeros((4, 16, 16, 3))
    assert agreement(black, black, 8).p_value == pytest.approx(1)
    lit = np.full((4, 16, 16, 3), 7.0)
    assert agreement(lit, lit * (1 + 1e-7), 8).p_value > 0.5
    assert agreement(lit, lit * (1 + 1e-3), 8).p_value < 1e-6


def test_not_a_number_never_passes():
    ours = runs(1)
    ours[3, 5, 5, 0] = np.nan
    assert agreement(ours, runs(2), 8).p_value == 0


def test_shapes_and_single_runs_are_refused():
    with pytest.raises(ValueError, match="can't be tested"):
        agreement(runs(1)[:1], runs(2), 8)
    with pytest.raises(ValueError, match="can't be tested"):
        agreement(runs(1)[:, :16], runs(2), 8)
