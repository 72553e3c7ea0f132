"""Sampling an image environment for a surface: by luminance times the cosine, nearly (product importance sampling).

`pmviewer.kernels.lights.environment` maps the unit square to directions with the image's luminance as density. Here the
square is bent before: it is cut into SIDE × SIDE cells, all of one power, and a table has for each cell what light from
there counts on a surface that faces a direction n, the mean of max(n·wi, 0) over the cell. Numbers of the square fall
into cells by these shares, row by row and column by column, so that well-spread numbers stay well spread; the density
of a direction is that of the image times the share of its cell over 1/SIDE². A part FLOOR of the shares is the same for
all cells: nothing that a lobe may reflect is left out, and no sample counts for more than cos/FLOOR times the mean.
There is a table for each of FACINGS × FACINGS cells of an octahedral map of normals
(`pmviewer.scene.arrays.sky_facing`), and others where little of the sky is seen (`pmviewer.kernels.lights.sky_seen`).
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.lights.environment import cell_of_square, image_pdf
from pmviewer.kernels.lights.light import one_light_pdf
from pmviewer.kernels.lights.sky_seen import seen_table
from pmviewer.kernels.lights.sky_square import SIDE, TABLE, facing_cell
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.table import find_interval
from pmviewer.kernels.vector import dot, scale

FACINGS = 16
FLOOR = 0.05

_f4 = np.float32
_i8 = np.int64
_LAST = _f4(0.99999994)


@specialised
def facing_sky(scene, choice, p, ng, ns):
    """The choice of lights (`pmviewer.render.direct.choice`) of a surface at p whose lobes reflect light from the side
    of its geometric normal ng: the sky is sampled for that, by cosines with the shading normal ns or −ns."""
    if not has(scene, "more_lights"):
        return lambda scene, choice, p, ng, ns: choice

    def facing(scene, choice, p, ng, ns):
        lights, known, mass, rest, samples, table = choice
        if scene.sky_facings != 0:
            side = _f4(-1.0) if dot(ng, ns) < _f4(0.0) else _f4(1.0)
            n = scale(ns, side)
            table = seen_table(scene, p, n)
            if table == 0:
                table = scene.sky_facings + facing_cell(n, FACINGS) * _i8(4 * TABLE)
        return lights, known, mass, rest, samples, table

    return facing


@device
def _between(address, count, first, u):
    """Which of the cumulative numbers from `first` on u falls to, u stretched to [0, 1), and the share."""
    k = find_interval(address, count, first, u)
    low = _f4(0.0) if k == 0 else load_f4(address, first + k - 1)
    share = load_f4(address, first + k) - low
    return k, min((u - low) / share, _LAST), share


@specialised
def place_on_light(scene, light, table, u, v):
    """Two numbers for a place on the light from two of [0, 1)², and what their density is there; `table`: the last
    entry of a choice of lights."""
    if not has(scene, "more_lights"):
        return lambda scene, light, table, u, v: (u, v, _f4(1.0))

    def bent(scene, light, table, u, v):
        if table == 0 or light != scene.environment:
            return u, v, _f4(1.0)
        row, u, of_row = _between(table, _i8(SIDE), _i8(0), u)
        column, v, of_cell = _between(table, _i8(SIDE), _i8(SIDE) + row * _i8(SIDE), v)
        inv = _f4(1.0 / SIDE)
        density = of_row * of_cell * _f4(SIDE * SIDE)
        return min((_f4(row) + u) * inv, _LAST), min((_f4(column) + v) * inv, _LAST), density

    return bent


@device
def _share(table, first, k):
    low = _f4(0.0) if k == 0 else load_f4(table, first + k - 1)
    return load_f4(table, first + k) - low


@specialised
def seen_light_pdf(scene, light, table, x, hit, wi, L):
    """Density per solid angle with which light samples at x would have chosen the direction wi, in which a ray met the
    light (`hit`), or the sky, and its radiance L; `table`: the last entry of the choice of lights."""
    if not has(scene, "more_lights"):
        return lambda scene, light, table, x, hit, wi, L: one_light_pdf(scene, light, x, hit.p, hit.ng, wi)

    def seen(scene, light, table, x, hit, wi, L):
        if light != scene.environment or scene.sky_facings == 0:
            return one_light_pdf(scene, light, x, hit.p, hit.ng, wi)
        pdf = image_pdf(scene, light, L)
        if table != 0:
            row, column = cell_of_square(scene, light, wi, _i8(SIDE))
            shares = _share(table, _i8(0), row) * _share(table, _i8(SIDE) + row * _i8(SIDE), column)
            pdf *= shares * _f4(SIDE * SIDE)
        return pdf

    return seen
