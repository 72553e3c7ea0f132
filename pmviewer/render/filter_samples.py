"""Where samples lie within pixels, with a reconstruction filter or the plain box (`pmviewer.render.filter`)."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.dimensions import PIXEL, PIXEL_SALT
from pmviewer.kernels.random import draw4, hash3

CELLS = 128
"""Of the table of f from the middle to the radius: it is taken as straight in each."""
OFFSETS = 128
"""Of the table of the places of samples within pixels: their density is taken as constant in each."""
FILTER_FIELDS: list[tuple] = [
    ("filter_cell", "f4"),  # width of a cell in pixels
    ("filter_value", "f4", (CELLS + 1,)),  # f at the cells' ends, ∫f = 1
    ("offset_cdf", "f4", (OFFSETS + 1,)),  # of the place within pixels along an axis
    ("filter_reach", "i4"),  # how many pixels to each side a sample may count in
    ("filter_pass", "u4"),  # the pass; `index` counts the samples of mirrors one by one
]
"""Of the eye records of all filters but the plain box."""
_EVERY_PIXEL = 0xFFFFFFFF
"""In place of a pixel's number in the seed of what all pixels share."""

_f4 = np.float32
_i8 = np.int64
_u4 = np.uint32


@device
def place_of(eye, u):
    """Place within a pixel along an axis, in [0, 1], for u in [0, 1)."""
    low, high = _i8(0), _i8(OFFSETS)
    while high - low > 1:
        middle = (low + high) >> 1
        if eye.offset_cdf[middle] <= u:
            low = middle
        else:
            high = middle
    first, last = eye.offset_cdf[low], eye.offset_cdf[low + 1]
    share = _f4(0.0)
    if last > first:
        share = min((u - first) / (last - first), _f4(1.0))
    return (_f4(low) + share) * _f4(1.0 / OFFSETS)


@device
def value_at(eye, x):
    """f at x pixels from the pixel's middle."""
    place = abs(x) / eye.filter_cell
    if not place < _f4(CELLS):  # nor where a blank record has no cells
        return _f4(0.0)
    cell = _i8(place)
    share = place - _f4(cell)
    return eye.filter_value[cell] * (_f4(1.0) - share) + eye.filter_value[cell + 1] * share


@device
def sum_at(eye, place):
    """Sum of f over the samples along an axis that lie at that place in their pixels."""
    total = _f4(0.0)
    for k in range(-eye.filter_reach, eye.filter_reach + 1):
        total += value_at(eye, _f4(k) + place - _f4(0.5))
    return total


@device
def seen_at(eye, place):
    """The place in the part of a pixel that the camera sees."""
    return (place - eye.pixel_margin) / eye.pixel_side


@device
def places(eye):
    """Along both axes, where all pixels of the pass are sampled."""
    seed = hash3(eye.seed, _u4(_EVERY_PIXEL), _u4(PIXEL_SALT))
    u, v, _, _ = draw4(eye.sequence, seed, eye.filter_pass, PIXEL)
    return place_of(eye, u), place_of(eye, v)


@specialised
def place_in_pixel(eye, seed):
    """Where the pixel of that seed is sampled, in [0, 1)² for places in the part of it that the camera sees."""
    if not has(eye, "filter_value"):

        def its_own(eye, seed):
            u, v, _, _ = draw4(eye.sequence, seed, eye.index, PIXEL)
            return u, v

        return its_own

    def of_the_pass(eye, seed):
        x, y = places(eye)
        return seen_at(eye, x), seen_at(eye, y)

    return of_the_pass
