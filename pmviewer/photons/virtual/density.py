"""How densely virtual lights lie: the area that each stands for (R10, single step).

Each place of a surface belongs to the n nearest photons of its side of the surface, 1/n of it to each. A light stands
for what belongs to it, its cell of the Voronoi diagram of order n over n. Cells share surfaces out whatever the density
of photons is, so that weights agree in the mean with gather rays, which count where a place belongs to some photon: up
to what the lit point sees differently across a cell. Discs out to the n-th other photon, A/n, share surfaces out where
photons lie evenly alone: beside a shadow, those of the dark end at the light, and what they leave out no weight has.

Places belong to photons closer than a largest radius R alone: with m < n of these, 1/m to each. Without R, a surface
that one photon in many passes reaches would count for gather rays in every pass, and weigh in that one alone.

A cell is measured by lines through places of the photon's tangent plane, denser near it, along its normal: every
surface on a line that lies within R counts if it belongs to the photon, asked as gather rays ask it
(`pmviewer.maps.together`, `pmviewer.render.virtual_lights.gathered`). Places that something hides from the photon
belong to it for neither.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.accel.opacity import over_opacity
from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import DISC_SALT
from pmviewer.kernels.memory import load_i4, stack_get_i8, stack_i4
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.kernels.surface import face
from pmviewer.kernels.vector import along, basis, scale
from pmviewer.maps.search.disc import Facing
from pmviewer.maps.search.k_nearest import KEYS, nearest
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.maps.together import beside
from pmviewer.maps.virtual_lights import FLATNESS, V_GAP, V_N, V_P, V_WI

PLACES = 16
"""Places that a cell is measured by."""
MORE = 3
"""Photons beyond those of a cell's order that tell how wide it will be."""
MOST_SURFACES = 16
"""That a line through a place is followed through."""
NEXT = np.float32(1e-4)
"""How far beyond a surface the next one is looked for, relative to half the line's length."""
LEAST = np.float32(1 / 64)
"""Least area of a cell relative to what it is expected to be. No place that was asked may belong to a photon that is
alone on a small surface, and its light would weigh nothing."""

_f4 = np.float32
_u4 = np.uint32
_i8 = np.int64
_i4 = np.int32
_GOLDEN = _f4(math.pi * (3.0 - math.sqrt(5.0)))
_STEEPNESS = _f4(1.0) / (FLATNESS * FLATNESS)


@device
def _three(row, column):
    return row[column], row[column + 1], row[column + 2]


@device
def share_of(tree, p, n, order, reach, photon, keys):
    """What belongs to the photon of the place p of a surface with the normal n: 1/m if it is one of the m ≤ `order`
    nearest, else 0."""
    count, _ = nearest(tree, p, order, reach * reach, keys, Facing(n, _STEEPNESS, _i4(ALL_CLASSES)))
    for j in range(count):
        if load_i4(tree.index, stack_get_i8(keys, j) & _i8(0xFFFFFFFF)) == photon:
            return _f4(1.0) / _f4(count)
    return _f4(0.0)


@device
def _share_along(scene, tree, o, light, height, order, reach, glossy, photon, keys):
    """The sum of `share_of` over all surfaces on the line through o along the normal of the `light` (place, normal,
    gap), no farther from o than `height`, that lie beside the light: by the area there over that of the tangent plane,
    and over the opacity of what rays pass in part."""
    n = light[1]
    top, down = along(o, n, height), scale(n, _f4(-1.0))
    total, start = _f4(0.0), _f4(0.0)
    for _ in range(MOST_SURFACES):
        t, prim, u, v = closest_hit(scene, top[0], top[1], top[2], down[0], down[1], down[2], start, _f4(2.0) * height)
        if prim < 0:
            break
        cos, p, ng = beside(scene, (prim, u, v, top, down, t), light, glossy)
        if cos > _f4(0.0):
            share = share_of(tree, p, ng, order, reach, photon, keys) / cos
            total += over_opacity(scene, prim, u, v, p, (share, share, share))[0]
        start = t + NEXT * height
    return total


@kernel
def cells(scenes, trees, lights, photons, order, reach, glossy, out, first, last):
    """Area of the cell of each of the lights first … last−1 among the photons of a map, in square scene units.

    trees: record (1,) of a kd-tree of photons that know their surface's normal; lights: float32 (n, COLUMNS); photons:
    int32 (n,), the photon of the map that each of them is; order: of the cells, 1 …; reach: largest radius R;
    glossy: roughness from which photons are stored for gloss; out: float32 (n,).
    """
    scene, tree = scenes[0], trees[0]
    keys = stack_i4(KEYS)
    widest = _f4(math.pi) * reach * reach
    for i in range(first, last):
        row = lights[i]
        p, n, gap = _three(row, V_P), face(_three(row, V_N), _three(row, V_WI)), row[V_GAP]
        count, r2 = nearest(tree, p, order + MORE, reach * reach, keys, Facing(n, _STEEPNESS, _i4(ALL_CLASSES)))
        each = _f4(math.pi) * r2 / _f4(max(count - 1, _i8(1)))
        middle = min(_f4(order) * each, widest)
        s, t = basis(n)
        turn = unit_float(hash3(_u4(i), _u4(order), _u4(DISC_SALT)))
        shift = unit_float(hash3(_u4(i), _u4(order) + _u4(0x10000), _u4(DISC_SALT)))
        total = _f4(0.0)
        for j in range(PLACES):
            u = (_f4(j) + shift) / _f4(PLACES) * (widest / (middle + widest))
            area = middle * u / (_f4(1.0) - u)
            radius = _f4(math.sqrt(area / _f4(math.pi)))
            phi = _f4(2.0 * math.pi) * turn + _GOLDEN * _f4(j)
            x = along(along(p, s, radius * _f4(math.cos(phi))), t, radius * _f4(math.sin(phi)))
            height = _f4(math.sqrt(max(reach * reach - radius * radius, _f4(0.0)))) + _f4(2.0) * gap
            sparse = (middle + area) * (middle + area) / middle
            total += sparse * _share_along(scene, tree, x, (p, n, gap), height, order, reach, glossy, photons[i], keys)
        out[i] = max(total * (widest / (middle + widest)) / _f4(PLACES), LEAST * middle / _f4(order))


@kernel
def whole_discs(trees, lights, k, out):
    """The paper's form: of each of the lights (n, COLUMNS) the whole disc out to the k-th of all photons of a kd-tree,
    itself counted, whatever surface they lie on, over k: float32 (n,), in square scene units."""
    tree = trees[0]
    keys = stack_i4(KEYS)
    for i in range(len(lights)):
        count, r2 = nearest(tree, _three(lights[i], V_P), k, _f4(np.inf), keys, None)
        out[i] = _f4(math.pi) * r2 / _f4(max(count, _i8(1)))
