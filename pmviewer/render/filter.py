"""Reconstruction filters, by sampling: a pixel's camera rays go where its filter is, more of them where it is high.

A sample so belongs to one pixel, as it does with the box: tiles and threads share nothing, and no sample is splatted
over its neighbours (filter importance sampling: Ernst, Stamminger and Greiner 2006). Where the filter is negative a
sample counts negatively: with f = ±|f| and places x drawn by |f|/∫|f|, weights ±∫|f|/∫f have the mean 1, and the mean
of weight times light is the filtered picture's. Filters are separable, and so are places and weights. The noise of
neighbouring pixels stays independent, where splatting would smear it.

Formulas, x in pixels from the pixel's middle, r the radius beyond which they are 0:

===================  =================================================================  =========
filter               f(x)                                                               radius
===================  =================================================================  =========
box                  1                                                                  ½
tent                 1 − |x|/r                                                          1
Gaussian             exp(−x²/2σ²) − exp(−r²/2σ²)                                        4σ, σ = ½
Mitchell-Netravali   the piecewise cubic of Mitchell and Netravali 1988 (8), B = C = ⅓  2
Catmull-Rom          the same with B = 0, C = ½                                         2
Lanczos              sinc(x)·sinc(x/r), sinc(x) = sin(πx)/(πx)                          3
===================  =================================================================  =========

Another radius stretches the filter; a Lanczos filter has as many lobes as its radius says, and is not stretched.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.filter_samples import CELLS
from pmviewer.scene.description import PixelFilter
from pmviewer.settings.schema import Render

Float = NDArray[np.float64]
BOX = PixelFilter("box", 0.5)
DEFAULTS: dict[str, PixelFilter] = {
    "box": BOX,
    "tent": PixelFilter("tent", 1.0),
    "Gaussian": PixelFilter("Gaussian", 2.0, (0.5,)),
    "Mitchell-Netravali": PixelFilter("Mitchell-Netravali", 2.0, (1 / 3, 1 / 3)),
    "Catmull-Rom": PixelFilter("Catmull-Rom", 2.0),
    "Lanczos": PixelFilter("Lanczos", 3.0),
}
"""The filters as their names alone say."""

_QUADRATURE = 32
"""Points by which a cell is integrated."""


def filter_of(own: PixelFilter | None, render: Render) -> PixelFilter:
    """The filter by the settings; "auto" is the file's `own`, and the box where it names none."""
    chosen = (own or BOX) if render.filter == "auto" else DEFAULTS[render.filter]
    if render.filter_radius == "auto":
        return chosen
    radius = float(render.filter_radius)
    shape = chosen.shape
    if chosen.kind == "Gaussian":
        shape = (chosen.shape[0] * radius / chosen.radius,)
    return replace(chosen, radius=radius, shape=shape)


def is_own(own: PixelFilter | None, render: Render) -> bool:
    """Whether the settings leave the file's filter as it is, or the box where it names none."""
    return filter_of(own, render) == (own or BOX)


def has_signs(eye: NDArray[np.void]) -> bool:
    """Whether samples may count negatively by the filter of an eye record (1,)."""
    return "filter_weight" in (eye.dtype.names or ()) and bool((eye[0]["filter_weight"] < 0).any())


def is_signed(chosen: PixelFilter) -> bool:
    """Whether samples may count negatively by it."""
    return bool((_table(chosen)[1] < 0).any())


def evaluate(chosen: PixelFilter, x: Float) -> Float:
    """f(x), not normalised, at places (n,) in pixels from the pixel's middle."""
    x, r = np.abs(np.asarray(x, float)), chosen.radius
    formulas: dict[str, Callable[[], Float]] = {
        "box": lambda: np.ones_like(x),
        "tent": lambda: 1 - x / r,
        "Gaussian": lambda: np.exp(-(x**2) / (2 * chosen.shape[0] ** 2)) - np.exp(-(r**2) / (2 * chosen.shape[0] ** 2)),
        "Mitchell-Netravali": lambda: _cubic(2 * x / r, *chosen.shape),
        "Catmull-Rom": lambda: _cubic(2 * x / r, 0.0, 0.5),
        "Lanczos": lambda: np.sinc(x) * np.sinc(x / r),
    }
    return np.where(x <= r, formulas[chosen.kind](), 0.0)


def _cubic(x: Float, B: float, C: float) -> Float:
    """The family of cubics of Mitchell and Netravali 1988, eq. 8, for 0 ≤ x ≤ 2."""
    inner = (12 - 9 * B - 6 * C) * x**3 + (-18 + 12 * B + 6 * C) * x**2 + (6 - 2 * B)
    outer = (-B - 6 * C) * x**3 + (6 * B + 30 * C) * x**2 + (-12 * B - 48 * C) * x + (8 * B + 24 * C)
    return np.where(x < 1, inner, outer) / 6


@cache
def _table(chosen: PixelFilter) -> tuple[Float, Float]:
    """`filter_cdf` and `filter_weight`."""
    x = (np.arange(CELLS * _QUADRATURE) + 0.5) * chosen.radius / (CELLS * _QUADRATURE)
    cells = evaluate(chosen, x).reshape(CELLS, _QUADRATURE).mean(axis=1)
    total, size = cells.sum(), np.abs(cells).sum()
    cdf = np.append(0.0, np.cumsum(np.abs(cells)) / size)
    return cdf / cdf[-1], np.where(cells < 0, -1.0, 1.0) * size / total


def set_filter(record: np.void, chosen: PixelFilter) -> None:
    """Write FILTER_FIELDS."""
    record["filter_cell"] = chosen.radius / CELLS
    record["filter_cdf"], record["filter_weight"] = _table(chosen)
