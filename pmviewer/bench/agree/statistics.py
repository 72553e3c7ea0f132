"""Do two programs render the same picture, when single paths may be very bright?

Each run gives the means of the picture and of its blocks, channel by channel; runs are independent, so that Welch's
test asks nothing of pixels. Bright paths that are too rare to have come yet make a mean too dark by more than its
standard error says. With a finite variance the density of bright paths falls faster than x⁻³; what lies beyond the
brightest, m, of n is then at most twice the share of that one in the mean (in the limit of a tail index of 2:
∫ₘ x·2m²x⁻³ dx / n = 2m/n). The darker side is granted this much, measured on the brightest run, and one such path more
or less is added to its standard error. Both fall as 1/n, faster than the noise.

A difference counts when it shows again and again: in `STAGES` of more samples, from the third on with fresh seeds; and
the last test alone gives the p-value, so that how often was looked before does not change its meaning. It is corrected
for the number of comparisons of the whole run (Holm).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from pmviewer.output.metric import block_means

BLOCK = 16
CHANNELS = 3
ROUNDING = 1e-5
"""Relative difference that is no error: single precision, some additions and products deep."""
NO_LIGHT, BLACK = 1e-12, 1e-18
"""Of the brightest block, and of a scene's lights, which are some one W/(m² sr) bright: as good as black. Microfacets
whose probability is below 1e-20 are none for Mitsuba, here they are; a block that sees a lamp in such alone is black in
one picture and at 1e-24 in the other, and so is a whole picture that sees nothing else."""
TAIL = 2.0
SPIKES = 3.0
"""The same where light comes as 1/d² from points: of virtual light and surface point on both sides of an edge, or in
media, those closer than d are a share d³, and what one brings falls with its x⁻⁵ᐟ²: no variance, and ∫ₘ beyond the
brightest of n is 3m/n."""
NEGLIGIBLE = 1e-4
"""Share of the picture's light that one of its terms may be off by. Photons that bring less come so rarely, and count
so much where a camera ray meets their small discs, that in most sets of runs none has come at all."""
LEVEL = 0.01
"""Probability that a run in which all agree shows any disagreement."""


@dataclass(frozen=True)
class Outcome:
    """p: chance of so large a difference where there is none (Šidák over the tests). ratio: ours to theirs where the
    difference shows most. noise: the median standard error of a test relative to its value. tests: how many. whole:
    ours to theirs over the whole picture and all channels, NaN where nobody told or theirs is black."""

    p: float
    ratio: float
    noise: float
    tests: int
    whole: float = math.nan


def summaries(images: NDArray[Any], seen: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
    """(runs, tests): of (runs, h, w, c), the means of each channel over the picture, then over blocks.

    With `seen` (h, w), over these pixels alone; blocks without any are left out.
    """
    weight = np.ones(images.shape[1:3]) if seen is None else seen.astype(np.float64)
    share = block_means(weight, BLOCK)
    kept = share > 0
    rows = []
    for image in np.asarray(images, np.float64):
        weighed = image * weight[..., None]
        blocks = block_means(weighed, BLOCK)[kept] / share[kept][:, None]
        rows.append(np.concatenate([weighed.mean(axis=(0, 1)) / weight.mean(), blocks.ravel()]))
    return np.array(rows)


def negligible(picture: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k,) from the summaries (n, k) of whole pictures: the difference of a term that is none, in the picture and in
    each block, where all of it may lie."""
    means = picture[:, :CHANNELS].mean(axis=0)
    blocks = picture.shape[1] // CHANNELS - 1
    return np.asarray(NEGLIGIBLE * np.concatenate([means, blocks * np.tile(means, blocks)]))


def compared(
    ours: NDArray[np.float64],
    theirs: NDArray[np.float64],
    tolerance: float = 0.0,
    sparse: bool = False,
    floor: NDArray[np.float64] | None = None,
    tails: tuple[float, float] = (TAIL, TAIL),
) -> Outcome:
    """Test that (n, k) and (m, k) runs have the same k expectations, but for `tolerance` times the second's and for
    `floor` (k,).

    `sparse`: light may come as single photons, so that a block that none has met in any run says nothing about its
    mean. Such blocks are left to the test of the whole picture. `tails`: of both sides, TAIL or SPIKES.
    """
    if not (np.isfinite(ours).all() and np.isfinite(theirs).all()):
        return Outcome(0.0, math.nan, math.nan, ours.shape[1])
    small = np.zeros(ours.shape[1]) if floor is None else floor
    if sparse:
        met = np.logical_and((ours > 0).any(axis=0), (theirs > 0).any(axis=0))
        met |= np.arange(len(met)) < CHANNELS
        ours, theirs, small = ours[:, met], theirs[:, met], small[met]
    n, m = len(ours), len(theirs)
    mean_a, mean_b = ours.mean(axis=0), theirs.mean(axis=0)
    var_a, var_b = ours.var(axis=0, ddof=1) / n, theirs.var(axis=0, ddof=1) / m
    variance = np.maximum(var_a + var_b, 1e-60)
    freedom = variance**2 / np.maximum(var_a**2 / (n - 1) + var_b**2 / (m - 1), variance**2 / (n + m - 2))
    sizes = np.abs(mean_a) + np.abs(mean_b)
    rounding = ROUNDING * sizes + NO_LIGHT * sizes.max(initial=0.0) + BLACK
    tail = np.where(mean_a < mean_b, *tails)
    one_more = np.where(mean_a < mean_b, _brightest(ours), _brightest(theirs)) * np.maximum(mean_a, mean_b)
    unseen = tail * one_more
    error = np.sqrt(variance + rounding**2 + one_more**2)
    beyond = np.maximum(np.abs(mean_a - mean_b) - unseen - tolerance * np.abs(mean_b) - rounding - small, 0.0)
    p = 2 * stdtr(np.maximum(freedom, 1.0), -beyond / error)
    worst = int(p.argmin())
    sidak = -math.expm1(p.size * math.log1p(-min(float(p[worst]), 1 - 1e-16)))
    lit = mean_b > 0
    noise = float(np.median(error[lit] / mean_b[lit])) if lit.any() else 0.0
    ratio = float(mean_a[worst] / mean_b[worst]) if mean_b[worst] else (math.inf if mean_a[worst] else 1.0)
    total = float(mean_b[:CHANNELS].sum())
    whole = float(mean_a[:CHANNELS].sum()) / total if total > 0 else math.nan
    return Outcome(sidak, ratio, noise, p.size, whole)


def _brightest(runs: NDArray[np.float64]) -> NDArray[np.float64]:
    """The share that the brightest path has in a mean. For a block it is the largest of all blocks, since none at all
    of these paths may have come to this one."""
    brightest = (runs.max(axis=0) - np.median(runs, axis=0)) / len(runs)
    mean = runs.mean(axis=0)
    share = np.divide(brightest, mean, out=np.zeros_like(mean), where=mean > 0)
    share[CHANNELS:] = share[CHANNELS:].max(initial=0.0)
    return np.asarray(share)


def rejected(p_values: list[float], level: float = LEVEL) -> list[bool]:
    """Holm: which hypotheses fall when any false fall among all of them shall have probability `level`."""
    order = np.argsort(p_values)
    fallen = [False] * len(p_values)
    for rank, index in enumerate(order):
        if p_values[index] > level / (len(p_values) - rank):
            break
        fallen[index] = True
    return fallen
