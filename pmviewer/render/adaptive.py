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

import math

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
EIGHTHS, LEVELS = 8, 80
"""Levels an octave, and of ten octaves."""
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
    """(pixels,) own and shared variances of a pass, means of the channels. Pixels so far `apart` share no samples; the
    others than those `inside` tell nothing."""
    from scipy.ndimage import uniform_filter  # takes a moment, and is needed once a picture

    n, told = float(DECIDED_AFTER), inside.reshape(size).astype(float)

    def around(weighted: NDArray[np.float64], weights: NDArray[np.float64], side: int) -> NDArray[np.float64]:
        return uniform_filter(weighted, side) / np.maximum(uniform_filter(weights, side), 1e-9)

    variance, products = np.zeros(size), np.zeros(size)
    for c in range(3):  # one after another, for the memory's sake
        image = moments.image[:, c].reshape(size) / n
        scale = told / (around(told * image, told, NEAR) ** 2 + EPSILON) / 3.0
        squares = moments.squares[:, c].reshape(size)
        variance += np.maximum(squares - n * image * image, 0.0) / (n - 1.0) * scale
        # (A − B)²/4 is the variance of the mean, the n-th part of a pass's.
        half = moments.half[:, c].reshape(size) * (2.0 / n)
        products += _products((half - image) * np.sqrt(n * scale), apart)
    variance = around(variance, told, NEAR)
    shared = np.clip(around(products, _products(told, apart), AROUND), 0.0, variance)
    own = np.maximum(variance - shared, 1e-3 * variance)
    return own.ravel(), shared.ravel()


def _products(values: NDArray[np.float64], apart: int) -> NDArray[np.float64]:
    """(h, w) sums of products of each pixel's value with those of the pixels `apart` from it along rows and columns."""
    total = np.zeros(values.shape)
    for axis in (0, 1):
        if values.shape[axis] <= apart:
            continue
        here = tuple(slice(apart, None) if k == axis else slice(None) for k in (0, 1))
        there = tuple(slice(None, -apart) if k == axis else slice(None) for k in (0, 1))
        product = values[here] * values[there]
        for part in (here, there):
            total[part] += product
    return total


def _shared_out(own: NDArray[np.float64], shared: float, cost: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Doublings that make the product of a pass's cost and variance least: of pixels whose √(own/cost) is that of an
    eighth of an octave alike."""
    beside, rest = BESIDE * cost.sum(), shared * len(own)
    most = float((own / cost).max(initial=0.0))
    if not most > 0.0:
        return np.zeros(len(own), np.uint8)
    levels = np.arange(-LEVELS, 1)
    level = np.rint(0.5 * EIGHTHS * np.log2(np.maximum(own / (cost * most), 1e-30)))
    level = (np.maximum(level, -LEVELS) + LEVELS).astype(np.int64)
    costs, owns = (np.bincount(level, of, len(levels)) for of in (cost, own))
    best, chosen = math.inf, np.zeros(len(levels), np.uint8)
    for unit in range(EIGHTHS, -LEVELS, -1):  # the level that gets no more than usual; none at first
        doublings = np.clip(np.rint((levels - unit) / EIGHTHS), 0, MOST)
        times = np.exp2(doublings)
        left = (owns * (EARLY + (1.0 - EARLY) / times)).sum() + rest
        product = (beside + (costs * times).sum()) ** FALL * left
        if product < best:
            best, chosen = product, doublings.astype(np.uint8)
    return chosen[level]
