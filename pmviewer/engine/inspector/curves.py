"""Kernels of the density estimate in NumPy, and an estimate against its radius for each of them (E2)."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.inspector.report import Curves, Float

STEPS, FEWEST_STEPS = 64, 12
MOST_WORK = 1 << 24
"""Photons times radii: where photons are many, curves have fewer points."""
WIDER = 2.0
"""Curves end at so many times the radius of the look-up."""
NARROWER = 16.0
"""And begin at this part of it."""
_ALPHA, _BETA = 0.918, 1.953
_EDGE = 1 - math.exp(-_BETA)

Weight = Callable[[Float, float], Float]
WEIGHTS: dict[str, Weight] = {
    "constant": lambda x2, k: np.ones_like(x2),
    "cone": lambda x2, k: 1 - np.sqrt(x2) / k,
    "gaussian": lambda x2, k: _ALPHA * (1 - (1 - np.exp(-_BETA * x2 / 2)) / _EDGE),
    "simpson": lambda x2, k: (1 - x2) ** 2,
    "epanechnikov": lambda x2, k: 1 - x2,
}
"""w(x²) as the table in `pmviewer.maps.estimate.filters` has them."""


def disc_mean(kernel: str, cone_k: float) -> float:
    """∫₀¹ 2x·w(x) dx."""
    means = {
        "constant": 1.0,
        "cone": 1 - 2 / (3 * cone_k),
        "gaussian": _ALPHA * (1 - (1 - 2 / _BETA * (1 - math.exp(-_BETA / 2))) / _EDGE),
        "simpson": 1 / 3,
        "epanechnikov": 0.5,
    }
    return means[kernel]


def curves_of(
    d2: NDArray[np.float32], reach: NDArray[np.float32], brings: Float, radius: float, cone_k: float
) -> Curves:
    """Of photons with squared distances d2 (m,) that a disc holds from the squared radius `reach` (m,) on, ascending,
    each of which brings that luminance times area (m,): at most 64 radii around `radius`, in scene units."""
    steps = min(STEPS, max(FEWEST_STEPS, MOST_WORK // max(len(d2), 1)))
    radii = radius * np.geomspace(1 / NARROWER, WIDER, steps)
    radii = np.sort(np.append(radii[:-1], radius))
    count = np.searchsorted(reach, radii.astype(np.float32) ** 2, side="right").astype(np.int64)
    L = {name: np.zeros(len(radii)) for name in WEIGHTS}
    for i, (r, m) in enumerate(zip(radii.tolist(), count.tolist(), strict=True)):
        x2 = np.minimum(d2[:m].astype(np.float64) / r**2, 1.0)
        for name, weight in WEIGHTS.items():
            L[name][i] = weight(x2, cone_k) @ brings[:m] / (disc_mean(name, cone_k) * math.pi * r**2)
    return Curves(radii, count, L)
