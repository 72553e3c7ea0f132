"""Where samples of a reconstruction filter lie, and what they count in the pixels around (`pmviewer.render.filter`)."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.dimensions import PIXEL, PIXEL_SALT
from pmviewer.kernels.random import draw4, hash3
from pmviewer.render.mirror_rays import OUTLINED
from pmviewer.render.planes import CHANNELS, PLANES, TERMS

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
OWN_COLUMNS = 6
"""Columns of a pixel's own samples behind those of the film: emission that pixels on outlines look for themselves, by
the filter and within the pixel."""
FEWEST = 0.1
"""Weights inside the picture from which they stand for all."""
_EVERY_PIXEL = 0xFFFFFFFF
"""In place of a pixel's number in the seed of what all pixels share."""
_TERMS_END = PLANES[TERMS[-1]].stop

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
    cell = _i8(place)
    if cell >= CELLS:
        return _f4(0.0)
    share = place - _f4(cell)
    return eye.filter_value[cell] * (_f4(1.0) - share) + eye.filter_value[cell + 1] * share


@device
def seen_at(eye, place):
    """The place in the part of a pixel that the camera sees."""
    return (place - eye.pixel_margin) / eye.pixel_side


@device
def _places(eye):
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

    def the_passs(eye, seed):
        x, y = _places(eye)
        return seen_at(eye, x), seen_at(eye, y)

    return the_passs


@kernel
def weigh_samples(eyes, out):
    """What the samples of the pass of the eye record (1,) count: out, float32 (2, 2·reach + 1), of columns and of rows,
    the pixel itself in the middle; each of both adds up to 1, or to −1."""
    eye = eyes[0]
    x, y = _places(eye)
    reach = (out.shape[1] - 1) // 2
    for axis in range(2):
        place = x if axis == 0 else y
        total = _f4(0.0)
        for k in range(-reach, reach + 1):
            out[axis, reach + k] = value_at(eye, _f4(k) + place - _f4(0.5))
            total += out[axis, reach + k]
        for k in range(2 * reach + 1):
            out[axis, k] = out[axis, k] / abs(total) if total != _f4(0.0) else _f4(k == reach)


@device
def _inside(weights, reach, place, size):
    """Sum of the weights of samples that lie in a picture of that size, of a pixel at that place along the axis."""
    total = _f4(0.0)
    for k in range(max(-reach, -place), min(reach, size - 1 - place) + 1):
        total += weights[reach + k]
    return total


@device
def _share(weights, reach, x, y, width, height):
    """What weights of columns and rows are multiplied by for the pixel (x, y), 0 where next to none are inside."""
    if reach <= x < width - reach and reach <= y < height - reach:
        return np.float64(1.0)
    inside = _inside(weights[0], reach, x, width) * _inside(weights[1], reach, y, height)
    return np.float64(1.0 / inside) if inside >= _f4(FEWEST) else np.float64(0.0)


@kernel
def share_samples(weights, marks, own, film, sizes, numbered, line, first, last):
    """Add to the pixels first … last−1 of the film what the samples around them tell.

    weights: of `weigh_samples`; marks: uint8 (pixels,) or (0,), where OUTLINED pixels have emission of their own; own:
    float64 (pixels, columns + OWN_COLUMNS), each pixel's samples of the pass; film: float64 (pixels, columns) or, with
    the terms of each pixel's own samples behind them, (pixels, columns + terms); sizes: width and height of the
    picture, and whether the film's sums are replaced; numbered: the column that is no sum but a number of which the
    highest counts, −1 for none; line: float64 as wide as the film, room for a pixel's sums. What properties of surfaces
    the pixel sees is its own.
    """
    width, height, anew = sizes
    columns = own.shape[1] - OWN_COLUMNS
    reach = (weights.shape[1] - 1) // 2
    for pixel in range(first, last):
        y, x = pixel // width, pixel % width
        for c in range(columns):
            line[c] = own[pixel, c] if _TERMS_END <= c < CHANNELS else 0.0
        share = _share(weights, reach, x, y, width, height)
        for j in range(max(-reach, -y), min(reach, height - 1 - y) + 1):
            for i in range(max(-reach, -x), min(reach, width - 1 - x) + 1):
                w = np.float64(weights[1, reach + j] * weights[0, reach + i]) * share
                if share == 0.0 and j == 0 and i == 0:
                    w = 1.0
                if w == 0.0:
                    continue
                there = pixel + j * width + i
                for c in range(_TERMS_END):
                    line[c] += w * own[there, c]
                for c in range(CHANNELS, columns):
                    line[c] += w * own[there, c]
        if numbered >= 0:
            line[numbered] = own[pixel, numbered]
        for c in range(columns, film.shape[1]):
            term = c - columns
            line[c] = own[pixel, term if term < _TERMS_END else term - _TERMS_END + CHANNELS]
        if len(marks) > 0 and marks[pixel] & OUTLINED != 0:
            for c in range(3):
                line[c] = own[pixel, columns + c]
                if film.shape[1] > columns:
                    line[columns + c] = own[pixel, columns + 3 + c]
        for c in range(film.shape[1]):
            if c == numbered:
                film[pixel, c] = line[c] if anew else max(film[pixel, c], line[c])
            elif anew:
                film[pixel, c] = line[c]
            else:
                film[pixel, c] += line[c]
