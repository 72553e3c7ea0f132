"""What pixels found in a pass is shared with those around them, by the filter (`pmviewer.render.filter`).

All pixels are sampled at the same place within them, so that samples count the same in a pixel as in any other: a pass
has one small table of weights, a row for each axis. What a column of pixels has by the weights of rows is added up
once, and serves all pixels of a row that look that far: 10 samples a pixel in place of 25 where the reach is 2.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.render.filter_samples import places, sum_at, value_at
from pmviewer.render.pixel_samples import OUTLINED
from pmviewer.render.planes import CHANNELS, TERMS_END

OWN_COLUMNS = 6
"""Columns of a pixel's own samples behind those of the film: emission that pixels on outlines look for themselves, by
the filter and within the pixel."""
FEWEST = 0.1
"""Weights inside the picture from which they stand for all."""

_f4 = np.float32


@kernel
def weigh_samples(eyes, out):
    """What the samples of the pass of the eye record (1,) count: out, float32 (2, 2·reach + 1), of columns and of rows,
    the pixel itself in the middle; each of both adds up to 1, or to −1."""
    eye = eyes[0]
    x, y = places(eye)
    reach = (out.shape[1] - 1) // 2
    for axis in range(2):
        place = x if axis == 0 else y
        total = sum_at(eye, place)
        for k in range(-reach, reach + 1):
            value = value_at(eye, _f4(k) + place - _f4(0.5))
            out[axis, reach + k] = value / abs(total) if total != _f4(0.0) else _f4(k == 0)


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


@device
def _add_up_column(weights, own, x, y, width, height, columns, out):
    """out: the samples of column x around row y, by the weights of rows, those outside of the picture missing.

    The loops over a sample's numbers stand here and in `share_samples`: as a function of their own they took 1.5 times
    as long.
    """
    reach = (weights.shape[1] - 1) // 2
    for c in range(columns):
        out[c] = 0.0
    for j in range(max(-reach, -y), min(reach, height - 1 - y) + 1):
        w, there = np.float64(weights[1, reach + j]), (y + j) * width + x
        if w != 0.0:
            for c in range(TERMS_END):
                out[c] += w * own[there, c]
            for c in range(CHANNELS, columns):
                out[c] += w * own[there, c]


@kernel
def share_samples(weights, marks, own, film, sizes, numbered, line, beside, first, last):
    """Add to the pixels first … last−1 of the film what the samples around them tell.

    weights: of `weigh_samples`; marks: uint8 (pixels,) or (0,), where OUTLINED pixels have emission of their own; own:
    float64 (pixels, columns + OWN_COLUMNS), each pixel's samples of the pass; film: float64 (pixels, columns) or, with
    the terms of each pixel's own samples behind them, (pixels, columns + terms); sizes: width and height of the
    picture, and whether the film's sums are replaced; numbered: the column that is no sum but a number of which the
    highest counts, −1 for none; line: float64 as wide as the film, room for a pixel's sums; beside: float64
    (2·reach + 1, columns), room for those of columns of pixels. What properties of surfaces the pixel sees is its own.
    """
    width, height, anew = sizes
    columns = own.shape[1] - OWN_COLUMNS
    reach = (weights.shape[1] - 1) // 2
    side, ready = 2 * reach + 1, 0  # columns before `ready` are added up, each at its place modulo `side`
    for pixel in range(first, last):
        y, x = pixel // width, pixel % width
        if pixel == first or x == 0:
            ready = max(x - reach, 0)
        while ready <= min(x + reach, width - 1):
            _add_up_column(weights, own, ready, y, width, height, columns, beside[ready % side])
            ready += 1
        share = _share(weights, reach, x, y, width, height)
        for c in range(columns):
            line[c] = own[pixel, c] if TERMS_END <= c < CHANNELS or share == 0.0 else 0.0
        for i in range(max(-reach, -x), min(reach, width - 1 - x) + 1):
            w, there = np.float64(weights[0, reach + i]) * share, (x + i) % side
            if w != 0.0:
                for c in range(TERMS_END):
                    line[c] += w * beside[there, c]
                for c in range(CHANNELS, columns):
                    line[c] += w * beside[there, c]
        if numbered >= 0:
            line[numbered] = own[pixel, numbered]
        for c in range(columns, film.shape[1]):
            term = c - columns
            line[c] = own[pixel, term if term < TERMS_END else term - TERMS_END + CHANNELS]
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
