"""Variance and bias of a trial's pictures, relative to the mean of all of them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.metric import EPSILON

F8 = NDArray[np.float64]
OUTLIERS = 0.0005
"""Share of the noisiest pixels that say nothing in two passes."""
CERTAIN = 2.0
"""Standard errors from which a bias stands out of the noise."""


def variance(images: list[F8], mean: F8) -> float:
    """Relative variance of a pass, from those of two seeds, without the noisiest pixels. Images (h, w, 3)."""
    each = np.sort(_relative((images[0] - images[1]) ** 2 / 2, mean), axis=None)
    return float(each[: each.size - round(each.size * OUTLIERS)].mean())


def squared(images: list[F8], against: list[F8], mean: F8, size: int = 1) -> float:
    """Squared relative difference of what two ways show in the mean, in blocks of size² pixels; 0 where it does not
    stand out of the noise. The product of the differences of two independent pairs of passes has it as its mean,
    without the noise of either."""
    first, second = (_blocks(a - b, size) for a, b in zip(images, against, strict=True))
    products = _relative(first * second, _blocks(mean, size))
    found, error = float(products.mean()), float(products.std()) / math.sqrt(products.size)
    return found if found > CERTAIN * error else 0.0


def _relative(squares: F8, mean: F8) -> F8:
    return (squares / (mean**2 + EPSILON)).mean(axis=-1)


def _blocks(image: F8, size: int) -> F8:
    if size == 1:
        return image
    h, w = (max(side // size, 1) for side in image.shape[:2])
    cut = image[: h * size, : w * size]
    return cut.reshape(h, cut.shape[0] // h, w, cut.shape[1] // w, 3).mean(axis=(1, 3))
