"""Errors of images against references: relMSE, block error, convergence slope, z-test.

Images are (h, w, 3) arrays of linear radiance; all sums are float64.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

EPSILON = 0.01
"""Added to the squared reference, (W/(m² sr))²: dark pixels don't outweigh all others."""
DROP = 0.001
"""Share of the worst pixels that `relmse_drop` leaves out."""
BLOCK = 8

F8 = NDArray[np.float64]


def _pair(image: NDArray[Any], reference: NDArray[Any]) -> tuple[F8, F8]:
    if image.shape != reference.shape:
        raise ValueError(f"an image of shape {image.shape} can't be compared with a reference of {reference.shape}")
    return np.asarray(image, np.float64), np.asarray(reference, np.float64)


def squared_error(image: NDArray[Any], reference: NDArray[Any]) -> F8:
    """(I−R)²/(R²+ε) of each pixel, averaged over its channels; (h, w)."""
    i, r = _pair(image, reference)
    return ((i - r) ** 2 / (r**2 + EPSILON)).mean(axis=-1)


def relmse(image: NDArray[Any], reference: NDArray[Any]) -> float:
    """Mean of (I−R)²/(R²+0.01) over all pixels and channels."""
    return float(squared_error(image, reference).mean())


def crossed_relmse(image: NDArray[Any], one: NDArray[Any], other: NDArray[Any]) -> float:
    """`relmse` against what two references with independent noise both converge to: the mean of (I−A)(I−B)/(I²+0.01).
    Their noise cancels in it, where it would add to the error against either; in the denominator it would not, so that
    the image stands there, which should be near."""
    (i, a), (_, b) = _pair(image, one), _pair(image, other)
    return float(((i - a) * (i - b) / (i**2 + EPSILON)).mean())


def relmse_drop(image: NDArray[Any], reference: NDArray[Any], drop: float = DROP) -> float:
    """`relmse` without the worst pixels, a share `drop` of all: what remains when fireflies don't count."""
    errors = np.sort(squared_error(image, reference), axis=None)
    return float(errors[: errors.size - round(errors.size * drop)].mean())


def mean_ratio(image: NDArray[Any], reference: NDArray[Any]) -> float:
    """Mean of the image over that of the reference: 1.01 is one percent too bright as a whole."""
    i, r = _pair(image, reference)
    return _ratio(i.mean(), r.mean())


def channel_ratios(image: NDArray[Any], reference: NDArray[Any]) -> list[float]:
    """`mean_ratio` of each channel: a wrong colour shows here and cancels there."""
    i, r = _pair(image, reference)
    return [_ratio(i[..., c].mean(), r[..., c].mean()) for c in range(i.shape[-1])]


def _ratio(value: float, reference: float) -> float:
    """NaN where the reference is black: no factor leads from it to the image."""
    return float(value / reference) if reference else math.nan


def block_means(image: NDArray[Any], size: int = BLOCK) -> F8:
    """(h, w, …) averaged over size × size pixels; an incomplete last row or column of blocks is left out.

    Raises ValueError when there is not one whole block.
    """
    h, w = image.shape[0] // size, image.shape[1] // size
    if h == 0 or w == 0:
        raise ValueError(f"an image of {image.shape[1]}×{image.shape[0]} has no block of {size}×{size} pixels")
    whole = np.asarray(image[: h * size, : w * size], np.float64)
    return whole.reshape(h, size, w, size, *image.shape[2:]).mean(axis=(1, 3))


def block_error(image: NDArray[Any], reference: NDArray[Any], size: int = BLOCK) -> float:
    """`relmse` of the block means: noise averages out, bias and blotches stay."""
    _pair(image, reference)
    return relmse(block_means(image, size), block_means(reference, size))


@dataclass(frozen=True)
class Metrics:
    """The errors of an image by the functions of the same names."""

    relmse_all: float
    relmse_drop: float
    mean_ratio: float
    block_error: float


def metrics(image: NDArray[Any], reference: NDArray[Any]) -> Metrics:
    """All errors at once; an image without one whole block has no block error (NaN)."""
    blocks = min(image.shape[:2]) >= BLOCK
    return Metrics(
        relmse(image, reference),
        relmse_drop(image, reference),
        mean_ratio(image, reference),
        block_error(image, reference) if blocks else math.nan,
    )


def loglog_slope(x: ArrayLike, y: ArrayLike) -> float:
    """Exponent p of the least-squares fit y ∝ xᵖ: −1 is relMSE of independent samples against their number.

    Raises ValueError with fewer than two different x or values that aren't positive.
    """
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if not (np.all(x > 0) and np.all(y > 0) and np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
        raise ValueError("a slope in logarithms needs positive numbers")
    if len(np.unique(x)) < 2:
        raise ValueError("a slope needs two different x")
    u, v = np.log(x), np.log(y)
    u -= u.mean()
    return float((u * (v - v.mean())).sum() / (u * u).sum())


@dataclass(frozen=True)
class ZTest:
    """Outcome of `z_test`: are two images of equal expectation?

    max_z: largest |z| of all blocks and channels.
    beyond_2, beyond_3: shares of |z| above 2 and 3; 0.0455 and 0.0027 are expected.
    chi2: sum of z² over the noisy blocks of the worst channel; `blocks` is expected.
    blocks: noisy blocks of one channel.
    p_value: probability of an outcome at least that bad by chance, corrected for the number of tests.
    """

    max_z: float
    beyond_2: float
    beyond_3: float
    chi2: float
    blocks: int
    p_value: float

    def passes(self, significance: float = 0.01) -> bool:
        """Whether equal expectation isn't refuted at this level: `significance` is the share of false alarms."""
        return self.p_value > significance


def z_test(
    mean: NDArray[Any],
    variance_of_mean: NDArray[Any],
    reference: NDArray[Any],
    reference_variance: NDArray[Any] | float = 0.0,
    block: int = BLOCK,
) -> ZTest:
    """Test whether `mean` and `reference` differ by no more than their noise.

    Single pixels of a path tracer are far from Gaussian, with variances that their own fireflies decide. Means of
    block × block independent pixels are close to Gaussian, so those are tested: the largest |z| (with Šidák's
    correction, safe for dependent channels) finds a local error, the sum of z² (worst channel, corrected by the number
    of channels) a spread-out one. The p-value is the smaller of the two, doubled (Bonferroni).

    Parameters
    ----------
    mean, reference: (h, w, c).
    variance_of_mean, reference_variance: of each pixel's mean, (h, w, c), estimated from at least some tens of
        independent samples; or a number.
    """
    from scipy.special import chdtrc  # late: whoever renders imports this module, and few of them test

    m, r = _pair(mean, reference)
    variance = np.broadcast_to(np.asarray(variance_of_mean, np.float64) + reference_variance, m.shape)
    difference = block_means(m - r, block)
    # A light seen directly has no variance, yet two programs round it differently: one part in a million is no error.
    rounding = 1e-6 * (block_means(np.abs(m), block) + block_means(np.abs(r), block))
    noise = np.sqrt(block_means(variance, block)) / block
    noisy = (noise > rounding).any(axis=2)
    blocks = int(noisy.sum())
    if not np.all(np.isfinite(difference)) or not np.all(np.isfinite(noise)):
        return ZTest(math.inf, 1.0, 1.0, math.inf, blocks, 0.0)
    # Where both images are black, 0/tiny: no difference.
    z = np.abs(difference) / np.maximum(np.hypot(noise, rounding), np.finfo(np.float64).tiny)
    largest = float(z.max())
    squares = (z[noisy] ** 2).sum(axis=0)
    chi2 = float(squares.max())
    by_largest = _sidak(math.erfc(largest / math.sqrt(2)), z.size)
    by_sum = _sidak(float(chdtrc(blocks, chi2)), squares.size) if blocks else 1.0
    p_value = min(1.0, 2 * min(by_largest, by_sum))
    return ZTest(largest, float((z > 2).mean()), float((z > 3).mean()), chi2, blocks, p_value)


def _sidak(p: float, count: int) -> float:
    """Probability that the smallest of `count` independent p-values is at most p."""
    return 1.0 if p >= 1 else -math.expm1(count * math.log1p(-p))
