"""Samples of a reconstruction filter (`pmviewer.render.filter`), drawn by the table of it in eye records."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.dimensions import OUTLINE, PIXEL, PIXEL_SALT
from pmviewer.kernels.random import draw4, hash3
from pmviewer.render.mirror_rays import OUTLINED

CELLS = 128
"""Of the table of |f| from the middle to the radius: its density is taken as constant in each."""
FILTER_FIELDS: list[tuple] = [
    ("filter_cell", "f4"),  # width of a cell in pixels
    ("filter_cdf", "f4", (CELLS + 1,)),  # ∫|f| up to each cell's end, over all of it
    ("filter_weight", "f4", (CELLS,)),  # ±∫|f|/∫f, with the sign that f has in the cell
]
"""Of the eye records of all filters but the plain box."""

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_u4 = np.uint32


@device
def _placed(eye, u):
    """Distance from the pixel's middle along an axis, drawn by |f| for u in [0, 1), and its weight."""
    side, v = _f4(1.0), _f4(2.0) * u - _f4(1.0)
    if v < _f4(0.0):
        side, v = -side, -v
    low, high = _i8(0), _i8(CELLS)
    while high - low > 1:
        middle = (low + high) >> 1
        if eye.filter_cdf[middle] <= v:
            low = middle
        else:
            high = middle
    first, last = eye.filter_cdf[low], eye.filter_cdf[low + 1]
    share = _f4(0.0)
    if last > first:
        share = min((v - first) / (last - first), _f4(1.0))
    return side * (_f4(low) + share) * eye.filter_cell, eye.filter_weight[low]


@specialised
def place_in_filter(eye, u, v):
    """Where a sample of a pixel lies, from the pixel's corner, and what it counts; None for 1. (u, v) in [0, 1)²."""
    if not has(eye, "filter_cdf"):
        return lambda eye, u, v: (u, v, None)

    def drawn(eye, u, v):
        x, a = _placed(eye, u)
        y, b = _placed(eye, v)
        return _f4(0.5) + x, _f4(0.5) + y, a * b

    return drawn


@device
def _weight(eye, seed, index, dimension):
    u, v, _, _ = draw4(eye.sequence, seed, index, dimension)
    _, _, weight = place_in_filter(eye, u, v)
    return _f8(weight)


@kernel
def add_weights(eyes, marks, weights, first, last):
    """Add what the camera rays of pixels first … last−1 count in the pass of the eye record (1,) to weights, float64
    (pixels, 2): in the first column those for emission, which pixels with the mark of outlines have of their
    own (`pmviewer.render.eye.eye_pass`), in the second those for all else."""
    eye = eyes[0]
    for pixel in range(first, last):
        seed = hash3(eye.seed, _u4(pixel), _u4(PIXEL_SALT))
        weight = _weight(eye, seed, eye.index, PIXEL)
        weights[pixel, 1] += weight
        if len(marks) > 0 and marks[pixel] & OUTLINED != 0:
            weight = 0.0
            for j in range(eye.outline_rays):
                index = _u4(eye.index * _u4(eye.outline_rays) + _u4(j))
                weight += _weight(eye, seed, index, OUTLINE) / eye.outline_rays
        weights[pixel, 0] += weight
