"""Do two programs render the same picture? A test on block means over independent runs.

Pixels of one run are correlated where a photon map was looked up, so nothing is assumed about them: each run gives one
mean per block and channel, and runs are independent. Their means are compared by Welch's t-test.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from pmviewer.output.metric import block_means

ROUNDING = 1e-6
"""Relative difference that is no error: a light seen directly has no variance, but programs round it differently."""


@dataclass(frozen=True)
class Agreement:
    """Outcome of `agreement`.

    p_value: probability of a difference at least as large as the largest one by chance (Šidák over blocks and channels,
    safe for dependent ones). largest: that difference in standard errors. ratio: of the image means, ratio_error: its
    standard error. noise: standard error of a block's difference relative to its value, median over blocks. blocks:
    tests made.
    """

    p_value: float
    largest: float
    ratio: float
    noise: float
    blocks: int
    ratio_error: float = math.nan


def agreement(ours: NDArray[Any], theirs: NDArray[Any], block: int, tolerance: float = 0.0) -> Agreement:
    """Test that (n, h, w, c) and (m, h, w, c) have the same expectation in every block × block pixels.

    With a `tolerance`, that they differ by at most this share of the second's block mean: methods with a known bias are
    equal in this sense only. Raises ValueError when shapes differ or a side has fewer than two runs.
    """
    if ours.shape[1:] != theirs.shape[1:] or min(len(ours), len(theirs)) < 2:
        raise ValueError(f"runs of shape {ours.shape} can't be tested against {theirs.shape}")
    a, b = (np.stack([block_means(run, block) for run in runs]) for runs in (ours, theirs))
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    var_a, var_b = a.var(axis=0, ddof=1) / len(a), b.var(axis=0, ddof=1) / len(b)
    variance = np.maximum(var_a + var_b, 1e-60)  # its square is still a number
    freedom = variance**2 / np.maximum(
        var_a**2 / (len(a) - 1) + var_b**2 / (len(b) - 1), variance**2 / (len(a) + len(b) - 2)
    )
    rounding = ROUNDING * (np.abs(mean_a) + np.abs(mean_b))
    error = np.sqrt(variance + rounding**2)
    beyond = np.maximum(np.abs(mean_a - mean_b) - tolerance * np.abs(mean_b), 0.0)
    t = beyond / error
    if not np.all(np.isfinite(t)):
        return Agreement(0.0, float("inf"), float("nan"), float("nan"), t.size)
    smallest = float(2 * stdtr(np.maximum(freedom, 1.0), -t).min())
    p_value = -np.expm1(t.size * np.log1p(-min(smallest, 1 - 1e-16)))
    lit = mean_b > 0
    noise = float(np.median(error[lit] / mean_b[lit])) if lit.any() else 0.0
    ratio = mean_a.mean() / mean_b.mean() if mean_b.any() else float("nan")
    means = [runs.mean(axis=(1, 2, 3)) for runs in (a, b)]
    spread = math.sqrt(sum(m.var(ddof=1) / len(m) for m in means)) / mean_b.mean() if mean_b.any() else math.nan
    return Agreement(float(p_value), float(t.max()), float(ratio), noise, t.size, float(spread))
