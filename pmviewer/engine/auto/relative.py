"""Variance and bias of a trial's pictures, relative to what all of them show."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.metric import EPSILON

F8 = NDArray[np.float64]
OUTLIERS = 0.0005
"""Share of the noisiest pixels that say nothing in two passes."""
PARTS = 8
"""Parts along each side of the picture whose noise is independent, more or less."""


def shown_squared(images: list[F8]) -> F8:
    """The square of what is shown, without its noise, from pictures (h, w, 3) of several seeds: the mean over their
    pairs of the products of both, of a pixel and its neighbours. By the square of its own mean a pixel that one seed in
    a hundred makes bright would vary by 2 at most with two seeds, instead of by 100."""
    n, total = len(images), np.sum(images, axis=0)
    products = (total**2 - np.sum(np.square(images), axis=0)) / (n * (n - 1))
    (h, w), framed = products.shape[:2], np.pad(products, ((1, 1), (1, 1), (0, 0)), mode="edge")
    around = sum(framed[i : i + h, j : j + w] for i in range(3) for j in range(3)) / 9
    return np.asarray(np.maximum(around, 0.0))


def variance(images: list[F8], square: F8) -> float:
    """Variance of a pass, from those of several seeds, over such a square, without the noisiest pixels. Images
    (h, w, 3)."""
    return _of_most(np.var(images, axis=0, ddof=1) / (square + EPSILON))


def nested(few: list[F8], many: list[F8], square: F8) -> float:
    """By how much the variance of pictures falls where the `few` random numbers that make part of it are continued to
    `many`, seed by seed. X being a mean of the first of them and Y that of all, cov(X, Y) = var Y, so that the mean of
    (X − Y)² is var X − var Y; all other noise is the same in both, and cancels."""
    return _of_most(np.mean([(a - b) ** 2 for a, b in zip(few, many, strict=True)], axis=0) / (square + EPSILON))


def _of_most(plane: F8) -> float:
    """The mean over pixels (h, w, 3) without the noisiest."""
    each = np.sort(plane.mean(axis=-1), axis=None)
    return float(each[: each.size - round(each.size * OUTLIERS)].mean())


def squared(images: list[F8], against: list[F8], mean: F8, size: int = 1) -> float:
    """Squared relative difference of what two ways show in the mean, in blocks of size² pixels, as far as it is
    certain."""
    return certain(*difference(images, against, mean, size))


def certain(found: float, error: float) -> float:
    """What is left of a difference with that standard error: its square less that of the error, over itself (James and
    Stein). A bound that it must pass would make those too large that happen to."""
    return found - error**2 / found if found > error else 0.0


def difference(images: list[F8], against: list[F8], mean: F8, size: int = 1) -> tuple[float, float]:
    """Likewise as it comes out, and its standard error; an even number of seeds.

    The products of the differences dᵢ, dⱼ of two seeds' passes have it as their mean, without the noise of either: it
    is their mean over all pairs. Its noise is that of what has none of it in the mean, the squares of the sums of
    either half of the seeds, (S² − T²)·2/n² (with two seeds just as much, with more a little too much); neighbouring
    pixels share photons, so that it is summed up by larger parts of the picture. What it is relative to, `mean`, may
    have been made by these seeds, but by all of them in equal shares.
    """
    d = np.stack([_blocks(a - b, size) for a, b in zip(images, against, strict=True)])
    weight = 1 / (_blocks(mean, size) ** 2 + EPSILON)
    n, total = len(d), d.sum(axis=0)
    found = float(((total**2 - (d**2).sum(axis=0)) * weight).mean()) / (n * (n - 1))
    errors2 = []
    for half in combinations(range(1, n), n // 2 - 1):
        first = d[[0, *half]].sum(axis=0)
        apart = (first**2 - (total - first) ** 2) * 2 / n**2
        noise = part_means((apart * weight).mean(axis=-1), PARTS)
        errors2.append(float((noise**2).sum()) / noise.size**2)
    return found, math.sqrt(sum(errors2) / len(errors2))


def part_means(plane: F8, count: int) -> F8:
    """Means of so many parts along each side of a plane (h, w), or as many as it has pixels: (count, count)."""
    h, w = plane.shape
    rows = [band.mean(axis=0) for band in np.array_split(plane, min(count, h), axis=0)]
    return np.array([[part.mean() for part in np.array_split(row, min(count, w))] for row in rows])


def _blocks(image: F8, size: int) -> F8:
    if size == 1:
        return image
    h, w = (max(side // size, 1) for side in image.shape[:2])
    cut = image[: h * size, : w * size]
    return cut.reshape(h, cut.shape[0] // h, w, cut.shape[1] // w, 3).mean(axis=(1, 3))
