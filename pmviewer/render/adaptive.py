"""Which pixels get more samples a pass, from what the first passes tell of their noise.

The variance of a pixel falls apart into what it has of its own, which more samples lower (edges, textures, outlines of
shadows, what is seen in glass), and what it shares with those around it: photons and records of a pass, which they do
not. Own noise is independent from pixel to pixel, so that the product of two neighbours' differences between the halves
of the passes has the shared part as mean.

With e_p and s_p, own and shared variances of a pass in units of relMSE, and c_p the cost of a pixel's samples, m_p
times as many leave Σ (e_p/m_p + s_p) at a cost of Σ c_p·m_p and what a pass costs beside its samples. m_p ∝ √(e_p/c_p)
makes the best of it, here 1, 2, 4 or 8; how large m is on the whole is what makes the product of cost and variance
least.

All passes count the same whatever their samples were, and a pass's samples depend on passes before it alone: the mean
stays what it is. (Weights by the number of samples would not do: pixels whose first passes were bright by chance would
get more samples, and those passes less weight.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.moments import EPSILON, Moments

DECIDED_AFTER = 8
"""Passes, a power of two. After four, rare bright paths were taken for noise that stays in half of 12 scenes tried."""
MOST = 3
"""Doublings."""
BESIDE = 0.25
"""What a pass costs beside its samples (photons, maps, records), in units of one sample for all pixels: 0.1 to 0.9 in
12 scenes, where what is gained does not depend on it by more than a few hundredths."""
EARLY, FALL = 0.2, 1.2
"""Share of the passes that are over before it is decided, in a picture of five times as many, and the power of the
passes with which the error of a picture falls: fewer passes cost more than their share."""
WORTH = 4 * DECIDED_AFTER
"""Passes from which on automatic mode has samples adapted."""
MISSED = 0.1
"""What a sample costs that meets nothing."""
NEAR, AROUND = 3, 7
"""Sides of the squares of pixels over which own and shared variances are averaged: of few passes they are noisy."""


def doublings_of(
    moments: Moments, size: tuple[int, int], cost: NDArray[np.float64], reach: int, refined: NDArray[np.bool_] | None
) -> NDArray[np.uint8]:
    """How often the samples of a pass are to be doubled, uint8 (pixels,), 0 to MOST.

    moments: with what DECIDED_AFTER passes have added, the last of them not closed yet; size: height and width;
    cost: (pixels,) of a pass's samples, in units of one (`cost_of`); reach: how many pixels away the reconstruction
    filter still finds a pixel's samples; refined: bool (pixels,), those that are rendered on, or None for all.
    """
    inside = np.ones(size[0] * size[1], bool) if refined is None else refined
    own, shared = _variances(moments, size, 2 * reach + 1, inside)
    chosen = np.zeros(len(own), np.uint8)
    chosen[inside] = _shared_out(own[inside], float(shared[inside].mean()), cost[inside])
    return chosen


def cost_of(samples: NDArray[np.int64], normals: NDArray[np.floating]) -> NDArray[np.float64]:
    """(pixels,) of a pass's samples in units of one that meets a surface. samples: (pixels,); normals: (pixels, 3),
    means over samples, those that meet nothing as zero."""
    met = np.minimum(np.linalg.norm(normals, axis=1), 1.0)
    return samples * (MISSED + (1.0 - MISSED) * met)


def _variances(
    moments: Moments, size: tuple[int, int], apart: int, inside: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(pixels,) own and shared variances of a pass. Pixels so far `apart` share no samples; the others than those
    `inside` tell nothing."""
    from scipy.ndimage import uniform_filter  # takes a moment, and is needed once a picture

    def around(values: NDArray[np.float64], weight: NDArray[np.float64], side: int) -> NDArray[np.float64]:
        """Means of values that are weighted already."""
        sides = (side, side, 0)[: values.ndim]
        return uniform_filter(values, sides) / np.maximum(uniform_filter(weight, sides), 1e-9)

    n, told = float(DECIDED_AFTER), inside.reshape(size).astype(float)
    each = np.repeat(told[..., None], 3, axis=2)
    image = moments.image.reshape(*size, 3) / n
    mean = around(each * image, each, NEAR)
    scale = each / np.sqrt(mean * mean + EPSILON)
    spread = np.maximum(moments.squares.reshape(*size, 3) - n * image * image, 0.0) / (n - 1.0)
    variance = around((spread * scale * scale).mean(axis=2), told, NEAR)
    # (A − B)²/4 is the variance of the mean, the n-th part of a pass's.
    difference = (moments.half.reshape(*size, 3) / n * 2.0 - image) * scale * np.sqrt(n)
    products = _products(difference, apart), _products(each, apart)
    shared = np.clip(around(*products, AROUND), 0.0, variance)
    own = np.maximum(variance - shared, 1e-3 * variance)
    return own.ravel(), shared.ravel()


def _products(values: NDArray[np.float64], apart: int) -> NDArray[np.float64]:
    """(h, w) sums of products of each pixel's values (h, w, 3) with those `apart` from it along rows and columns, mean
    of the channels."""
    total = np.zeros(values.shape[:2])
    for axis in (0, 1):
        if values.shape[axis] <= apart:
            continue
        here = tuple(slice(apart, None) if k == axis else slice(None) for k in (0, 1))
        there = tuple(slice(None, -apart) if k == axis else slice(None) for k in (0, 1))
        product = (values[here] * values[there]).mean(axis=2)
        for part in (here, there):
            total[part] += product
    return total


def _shared_out(own: NDArray[np.float64], shared: float, cost: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Doublings that make the product of a pass's cost and variance least."""
    root, beside, rest = np.sqrt(own / cost), BESIDE * cost.sum(), shared * len(own)
    best, chosen = (beside + cost.sum()) ** FALL * (own.sum() + rest), np.zeros(len(own), np.uint8)
    if not best > 0.0:
        return chosen
    usual = np.sqrt(np.mean(root * root))
    for unit in usual * np.geomspace(0.1, 10.0, 33):
        doublings = np.clip(np.rint(np.log2(np.maximum(root / unit, 1.0))), 0, MOST)
        times = np.exp2(doublings)
        left = (own * (EARLY + (1.0 - EARLY) / times)).sum() + rest
        product = (beside + (cost * times).sum()) ** FALL * left
        if product < best:
            best, chosen = product, doublings.astype(np.uint8)
    return chosen
