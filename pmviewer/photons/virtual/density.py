"""How densely virtual lights lie: the area that each stands for (R10, single step).

1/D at a light is estimated by A/n: A is the part on its surface of the disc out to the n-th other photon on the same
side. The mean of A/n over evenly dense photons is 1/D for any n; counting the light itself, photons of other walls, or
what the disc has beyond an edge is not (the paper's form does all three). What of the disc lies on the surface is
found by rays: along the surface to places spread over the disc, and there down onto it.

Discs end at a largest radius R. Where m < n others lie within it, the light stands for A/(m + 1), A the part of that
disc. Then the mean of D·(area) is the probability that any photon lies within R, exactly. With μ expected there it is
Σ_{m<n} e^−μ μ^m/m!·μ/(m + 1) + ∫₀^μ (a/n)·a^(n−1)e^−a/(n−1)! da = P(1 … n) + P(more than n). So gather rays count where
photons lie within R (`pmviewer.render.virtual_lights.gathered`), and weights are right with any R. Without R, a surface
that one photon in many passes reaches would count for gather rays in every pass, and weigh in that one alone.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.accel.occlusion import occluded
from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import DISC_SALT
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.kernels.surface import face, leave, surface_at
from pmviewer.kernels.vector import along, basis, dot, scale, sub
from pmviewer.maps.search.disc import Facing
from pmviewer.maps.search.k_nearest import KEYS, nearest
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.maps.virtual_lights import FLATNESS, V_GAP, V_N, V_P, V_WI

RAYS = 32
"""Places of a disc that tell how much of it lies on the surface."""
SAME_SIDE = np.float32(0.5)
"""Least cosine between the normals of a light and of what belongs to its surface."""

_f4 = np.float32
_u4 = np.uint32
_i8 = np.int64
_i4 = np.int32
_GOLDEN = _f4(math.pi * (3.0 - math.sqrt(5.0)))


@device
def _three(row, column):
    return row[column], row[column + 1], row[column + 2]


@device
def share_on_surface(scene, p, n, gap, r, turn):
    """Share of the disc of radius r around the surface point p with normal n that lies on the surface and is not cut
    off by others; `turn` in [0, 1) rotates the places that are asked."""
    s, t = basis(n)
    height = max(FLATNESS * r, _f4(2.0) * gap)
    top = along(leave(p, n, gap, n[0], n[1], n[2]), n, height)
    down = scale(n, _f4(-1.0))
    found = 0
    for j in range(RAYS):
        radius = r * _f4(math.sqrt((_f4(j) + _f4(0.5)) / _f4(RAYS)))
        phi = _f4(2.0 * math.pi) * turn + _GOLDEN * _f4(j)
        x = along(along(top, s, radius * _f4(math.cos(phi))), t, radius * _f4(math.sin(phi)))
        way = sub(x, top)
        if occluded(scene, top[0], top[1], top[2], way[0], way[1], way[2], _f4(0.0), _f4(1.0)):
            continue
        far = _f4(2.0) * height + _f4(2.0) * gap
        d, prim, u, v = closest_hit(scene, x[0], x[1], x[2], down[0], down[1], down[2], _f4(0.0), far)
        if prim >= 0:
            _, ng, _, _ = surface_at(scene, prim, u, v, x[0], x[1], x[2], down[0], down[1], down[2], d)
            if dot(face(ng, n), n) >= SAME_SIDE:
                found += 1
    return _f4(max(found, 1)) / _f4(RAYS)


@kernel
def lit_areas(scenes, trees, lights, own, k, reach, whole, out, first, last):
    """Area that each of the lights first … last−1 stands for among the photons of a map, in square scene units.

    trees: record (1,) of a kd-tree of photons; lights: float32 (n, COLUMNS); own: how many of the nearest photons of
    the map are the light itself, 1 or 0; k: others that are searched; reach: largest radius R; whole: 1 for the paper's
    form: the whole disc out to the k-th of all photons, itself counted, whatever surface they lie on; out: float32
    (n,).
    """
    scene, tree = scenes[0], trees[0]
    keys = stack_i4(KEYS)
    for i in range(first, last):
        row = lights[i]
        p, n = _three(row, V_P), face(_three(row, V_N), _three(row, V_WI))
        if whole != 0:
            count, r2 = nearest(tree, p, k, reach * reach, keys, None)
            out[i] = _f4(math.pi) * r2 / _f4(max(count, _i8(1)))
            continue
        steepness = _f4(1.0) / (FLATNESS * FLATNESS)
        count, r2 = nearest(tree, p, k + own, reach * reach, keys, Facing(n, steepness, _i4(ALL_CLASSES)))
        others = count - own
        if others < k:
            others += _i8(1)
        turn = unit_float(hash3(_u4(i), _u4(k), _u4(DISC_SALT)))
        share = share_on_surface(scene, p, n, row[V_GAP], _f4(math.sqrt(r2)), turn)
        out[i] = _f4(math.pi) * r2 * share / _f4(others)
