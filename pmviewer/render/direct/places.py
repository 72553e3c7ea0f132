"""Which lights a surface samples, and where on them (R2).

Places on an image environment are found side by side, ABREAST at once: each of the steps that find one waits for
memory, and so all wait together (`pmviewer.kernels.lights.sky_cells`). In a room that looks out on a sky of 2048 × 1024
texels that takes an eighth off a pass.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.lights.environment import sample_cell
from pmviewer.kernels.lights.light import sample_one_light
from pmviewer.kernels.lights.sky_cells import cell_between, cells_between, guide_ahead, row_of_cells
from pmviewer.kernels.lights.sky_facing import place_on_light
from pmviewer.kernels.memory import stack_get_f4, stack_get_i4, stack_put_f4, stack_put_i4
from pmviewer.kernels.random import SOBOL, draw4
from pmviewer.render.direct.choice import chosen_light

ABREAST = 8
"""Samples that are drawn at once."""
DRAWN_WORDS = 7 * ABREAST
"""int32 elements of scratch for them."""
_LIGHT, _M, _U, _V, _ROW, _LOW, _HIGH = range(0, DRAWN_WORDS, ABREAST)
"""Where in it, for each sample, are: its light; m times the density that `place_on_light` has; two numbers for a place
on the light; the row of cells of an image environment, −1 for another light; the first and the last of its cells that
the place may be in, then twice the one that it is in."""

_f4 = np.float32
_i4 = np.int32
_u4 = np.uint32
_i8 = np.int64


@device
def draw_places(scene, choice, sampler, begin, count, drawn):
    """Draw samples begin … begin + count − 1, ABREAST at most, of a choice of lights into `drawn`, DRAWN_WORDS of
    scratch."""
    for k in range(count):
        light, m, u, v, density = _drawn_light(scene, choice, begin + k, sampler)
        stack_put_i4(drawn, _LIGHT + k, _i4(light))
        stack_put_f4(drawn, _M + k, m * density)
        stack_put_f4(drawn, _U + k, u)
        stack_put_f4(drawn, _V + k, v)
    _find_cells(scene, count, drawn)


@device
def drawn_place(scene, drawn, k, x):
    """The light of sample k, its m, and its place as seen from x, as `sample_one_light` returns it; the density there
    is to be multiplied by m alone."""
    light = _i8(stack_get_i4(drawn, _LIGHT + k))
    return light, stack_get_f4(drawn, _M + k), _place(scene, drawn, k, light, x)


@device
def _drawn_light(scene, choice, s, sampler):
    """Light of sample s, its m (`chosen_light`), two numbers for a place on it, and their density (`place_on_light`).

    Samples of a pass follow one another in the sequence as passes do, so that they complement each other: n samples
    each in the first m passes are its first n·m points. Of these the first two coordinates are spread best, and a
    block of 2ⁱ falls into as many parts of the third.
    """
    n = choice[4]
    index = _u4(_u4(sampler.index) * _u4(n) + _u4(s))
    u, v, u_pick, _ = draw4(sampler.sequence, sampler.seed, index, sampler.dimension)
    if sampler.sequence == SOBOL and n & (n - 1) == 0:
        place = _f4(n) * u_pick
        s = _i8(place)
        u_pick = place - _f4(s)
    light, m = chosen_light(scene, choice, s, u_pick)
    u, v, density = place_on_light(scene, light, choice[5], u, v)
    return light, m, u, v, density


@specialised
def _find_cells(scene, count, drawn):
    """Of the samples on an image environment, which cell they are in, and their numbers within it."""
    if not has(scene, "more_lights"):

        def none(scene, count, drawn):
            pass

        return none

    def side_by_side(scene, count, drawn):
        for k in range(count):
            row = _i8(-1)
            if scene.sky_width > 0 and stack_get_i4(drawn, _LIGHT + k) == scene.environment:
                row, u = row_of_cells(scene, stack_get_f4(drawn, _U + k))
                stack_put_f4(drawn, _U + k, u)
                guide_ahead(scene, row, stack_get_f4(drawn, _V + k))
            stack_put_i4(drawn, _ROW + k, _i4(row))
        for k in range(count):
            row = _i8(stack_get_i4(drawn, _ROW + k))
            if row >= 0:
                low, high = cells_between(scene, row, stack_get_f4(drawn, _V + k))
                stack_put_i4(drawn, _LOW + k, _i4(low))
                stack_put_i4(drawn, _HIGH + k, _i4(high))
        for k in range(count):
            row = _i8(stack_get_i4(drawn, _ROW + k))
            if row >= 0:
                low, high = _i8(stack_get_i4(drawn, _LOW + k)), _i8(stack_get_i4(drawn, _HIGH + k))
                column, v = cell_between(scene, row, low, high, stack_get_f4(drawn, _V + k))
                stack_put_i4(drawn, _LOW + k, _i4(column))
                stack_put_f4(drawn, _V + k, v)

    return side_by_side


@specialised
def _place(scene, drawn, k, light, x):
    """The place of sample k, of that light, as `sample_one_light` returns it."""
    if not has(scene, "more_lights"):

        def plain(scene, drawn, k, light, x):
            return sample_one_light(scene, light, x, stack_get_f4(drawn, _U + k), stack_get_f4(drawn, _V + k))

        return plain

    def of_all(scene, drawn, k, light, x):
        u, v, row = stack_get_f4(drawn, _U + k), stack_get_f4(drawn, _V + k), _i8(stack_get_i4(drawn, _ROW + k))
        if row >= 0:
            return sample_cell(scene, light, x, row, _i8(stack_get_i4(drawn, _LOW + k)), u, v)
        return sample_one_light(scene, light, x, u, v)

    return of_all
