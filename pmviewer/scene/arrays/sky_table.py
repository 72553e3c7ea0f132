"""Distribution of a lat-long image over directions; the formulas are in `pmviewer.kernels.lights.environment`."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import LUMINANCE

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
PER_STEP = 8
"""Cells in a step of a guide, in the mean."""


@dataclass(frozen=True)
class SkyTable:
    """Cumulative shares of `rows` (h − 1,) and of `cells` (h − 1, w) within each row; `guide` (h − 1, steps): where the
    shares of a row begin that are not below k/steps, or one before; `total` is ∫ luminance dω."""

    rows: Float32
    cells: Float32
    guide: NDArray[np.int32]
    total: float


def _edges(height: int) -> tuple[Float64, Float64]:
    """For each row of cells, the solid angle per turn that its upper and its lower edge's values stand for: (h − 1,),
    ∫ (1 − t)·sin θ dθ and ∫ t·sin θ dθ over the row."""
    step = math.pi / (height - 1)
    upper = step * np.arange(height - 1)
    # Midpoint forms: differences of cosines lose all digits near the poles.
    middle, half = upper + step / 2, step / 2
    whole = 2 * np.sin(middle) * math.sin(half)
    # ∫ (t − ½)·sin θ dθ over the row, with x = θ − middle: cos(middle)·∫ x sin x dx / step.
    tilt = np.cos(middle) * 2 * (math.sin(half) - half * math.cos(half)) / step
    return whole / 2 - tilt, whole / 2 + tilt


def _cells(values: Float64) -> Float64:
    """∫ dω over each cell, (h − 1, w), of values (h, w) interpolated between texel centres."""
    above, below = _edges(len(values))
    pairs = (values + np.roll(values, -1, axis=1)) / 2
    return (pairs[:-1] * above[:, None] + pairs[1:] * below[:, None]) * (2 * math.pi / values.shape[1])


def sky_integral(pixels: Float32) -> Float64:
    """∫ L dω over all directions, (3,), of an image (h, w, 3)."""
    above, below = _edges(len(pixels))
    rows = pixels.astype(np.float64).sum(axis=1)
    return (rows[:-1] * above[:, None] + rows[1:] * below[:, None]).sum(axis=0) * (2 * math.pi / pixels.shape[1])


def sky_table(pixels: Float32) -> SkyTable:
    """The table of an image (h, w, 3) that is not black."""
    cells = np.cumsum(_cells(pixels.astype(np.float64) @ LUMINANCE), axis=1)
    sums = cells[:, -1]
    rows = np.cumsum(sums)
    # A black row is never picked; any table will do.
    shares = (cells / np.where(sums > 0, sums, 1.0)[:, None]).astype(np.float32)
    return SkyTable((rows / rows[-1]).astype(np.float32), shares, _guide(shares), float(rows[-1]))


def _guide(shares: Float32) -> NDArray[np.int32]:
    """Of `SkyTable`: so many steps that a few shares lie between two of them, and are read from one line of memory
    where a search through the row would read a line a step."""
    steps = max(shares.shape[1] // PER_STEP, 1)
    asked = np.arange(steps) / steps * (1 - 2.0**-20)  # kernels compute k in float32
    guide = np.empty((len(shares), steps), np.int32)
    for row, found in zip(shares, guide, strict=True):
        found[:] = np.searchsorted(row, asked, side="right")
    return np.minimum(guide, shares.shape[1] - 1)
