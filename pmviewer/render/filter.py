"""Reconstruction filters: how what lies around a pixel counts in it.

All pixels of a pass are sampled at the same place δ within them, and what was found there is shared: a pixel p is the
sum over the pixels q around it of f(q + δ − p)·L(q + δ)/S(δ), f having the integral 1 and S(δ) being the sum of these
f. δ is drawn with the density S, so that the mean over passes is the filtered picture ∫f·L; the weights of a pass add
up to 1, so that a plain wall is plain after one pass, with negative filters, too. A pixel hears of all samples that its
filter reaches: for a Gaussian of σ = ½ their noise is that of 4πσ² = 3.1 times as many samples of its own. The price is
that the noise of neighbours is alike.

At the picture's border, where samples are missing, the weights that are there are made to add up to 1.

Filters are separable, and so are places and weights. Formulas, x in pixels from the pixel's middle, r the radius beyond
which they are 0:

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

Another radius stretches the filter; a Lanczos filter has as many lobes as its radius says, and is not stretched. The
plain box is sampled within each pixel at places of its own, and shares nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.filter_samples import CELLS, OFFSETS
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


def reach_of(chosen: PixelFilter, side: float) -> int:
    """How many pixels to each side a sample counts in, wherever it lies in its own; `side` of the part that is seen."""
    return math.ceil(chosen.radius * side + 0.5) - 1


@cache
def _tables(chosen: PixelFilter, side: float) -> tuple[Float, Float]:
    """`filter_value` and `offset_cdf` where the camera sees parts of pixels of that side."""
    nodes = evaluate(chosen, np.linspace(0, chosen.radius, CELLS + 1))
    cell = chosen.radius * side / CELLS
    nodes /= cell * (2 * nodes.sum() - nodes[0] - nodes[-1])  # of both sides, by trapezoids
    offsets, reach = (np.arange(OFFSETS * _QUADRATURE) + 0.5) / (OFFSETS * _QUADRATURE) - 0.5, reach_of(chosen, side)
    distances = np.abs(offsets + np.arange(-reach, reach + 1)[:, None])
    sums = np.interp(distances, cell * np.arange(CELLS + 1), nodes, right=0.0).sum(axis=0)
    cdf = np.append(0.0, np.cumsum(np.abs(sums.reshape(OFFSETS, _QUADRATURE).mean(axis=1))))
    return nodes, cdf / cdf[-1]


@cache
def noise_share(chosen: PixelFilter) -> float:
    """Variance of a pixel over that which samples of its own would leave, where noise differs from pixel to pixel: the
    mean sum of the squares of what samples count."""
    if chosen == BOX:
        return 1.0
    reach = reach_of(chosen, 1.0)
    places = np.arange(OFFSETS * _QUADRATURE) / (OFFSETS * _QUADRATURE) - 0.5
    values = np.array([evaluate(chosen, places + k) for k in range(-reach, reach + 1)])
    sums = np.abs(values.sum(axis=0))
    along = np.divide((values**2).sum(axis=0), sums, out=np.zeros_like(sums), where=sums > 0).mean() / sums.mean()
    return float(along) ** 2


@cache
def _of_squares(chosen: PixelFilter) -> Float:
    """Weights of the means over pixels around one along an axis: those by which a sharp edge, wherever it lies, differs
    least from what the filter makes of it. None is negative if the filter never is."""
    from scipy.optimize import lsq_linear  # which no picture but a denoised one waits for

    reach = reach_of(chosen, 1.0)
    x = np.linspace(-reach - 1.0, reach + 1.0, _QUADRATURE * (2 * reach + 2) + 1)
    f = evaluate(chosen, x)
    edge = np.cumsum(f) - 0.5 * f
    edges = np.clip(x[:, None] - np.arange(-reach, reach + 1) + 0.5, 0.0, 1.0)  # of each pixel's square alone
    weights = lsq_linear(edges, edge / edge[-1], (0.0 if (f >= 0).all() else -np.inf, np.inf)).x
    return np.asarray((weights + weights[::-1]) / (2 * weights.sum()))


def filtered(image: NDArray[np.float32], chosen: PixelFilter) -> NDArray[np.float32]:
    """An image (h, w, n) of means over squares as the filter shows it, as nearly as that can be told; at the border
    what is inside counts."""
    from scipy.ndimage import convolve1d

    weights = _of_squares(chosen)
    out, whole = image.astype(np.float64), np.ones(image.shape[:2])
    for axis in (0, 1):
        out = convolve1d(out, weights, axis, mode="constant")
        whole = convolve1d(whole, weights, axis, mode="constant")
    return (out / whole[..., None]).astype(np.float32)


def set_filter(record: np.void, chosen: PixelFilter, side: float, index: int) -> None:
    """Write FILTER_FIELDS of pass `index`. A camera that sees parts of pixels, of that side, samples each for itself:
    what lies between them is not there to be shared."""
    if side < 1.0:
        chosen = BOX
    record["filter_cell"], record["filter_reach"] = chosen.radius * side / CELLS, reach_of(chosen, side)
    record["filter_value"], record["offset_cdf"] = _tables(chosen, side)
    record["filter_pass"] = index & 0xFFFFFFFF
