"""Look-ups of importance in kernels (Christensen 1999): that of the nearest importon on the surface's side, as far as
none would be missing by chance, since what lies in the shadow of the view is not important.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.compile.specialise import absent, specialised
from pmviewer.kernels.memory import load_f4, stack_get_i8, stack_i4
from pmviewer.maps.importance.nearest_one import ROOT, nearest_one
from pmviewer.maps.search.disc import Facing
from pmviewer.maps.search.k_nearest import KEYS, nearest
from pmviewer.maps.search.stored import ALL_CLASSES

FLATNESS = np.float32(0.3)
"""Half-thickness of the discs of importons, relative to their radius."""
STEEPNESS = np.float32(np.float32(1.0) / (FLATNESS * FLATNESS))

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64


@specialised
def importance_at(importance, p, n):
    """Importance Γ (float32, pixels per unit area) at the point p with unit normal n, for the normal's side.

    That of the nearest importon on this side, of those equally far as discs go the one nearest in space, 0 outside of
    its reach: where nothing looks. `importance` is the record
    of an ImportanceMap, or that of NO_IMPORTANCE, which makes everything equally important (1).
    """
    if absent(importance):
        return lambda importance, p, n: _f4(1.0)

    def of_nearest(importance, p, n):
        r, inf = importance.farthest, _f4(np.inf)
        if importance.n == 0 or not abs(p[0]) + abs(p[1]) + abs(p[2]) < inf:
            return _f4(0.0)
        i, d2, _, _ = nearest_one(importance, p, n, STEEPNESS, ROOT, _i8(-1), r * r, inf)
        if i < 0:
            return _f4(0.0)
        reach = load_f4(importance.reach, i)
        return load_f4(importance.payload, 3 * i + 1) if d2 <= reach * reach else _f4(0.0)

    return of_nearest


@specialised
def importance_sum(importance, p, n, k):
    """ΣW (float32, pixels): importance of the k nearest importons within `sum_radius` of the point p, on the side of
    its unit normal n, for the probability of depositing a photon (Keller and Wald §2.2). k: int32, 1 … MAX_K.

    1 for the record of NO_IMPORTANCE.
    """
    if absent(importance):
        return lambda importance, p, n, k: _f4(1.0)

    def summed(importance, p, n, k):
        keys = stack_i4(KEYS)
        r = importance.sum_radius
        count, _ = nearest(importance, p, k, r * r, keys, Facing(n, STEEPNESS, _i4(ALL_CLASSES)))
        total = _f8(0.0)
        for j in range(count):
            total += _f8(load_f4(importance.weight, stack_get_i8(keys, j) & _i8(0xFFFFFFFF)))
        return _f4(total)

    return summed


@kernel
def importances(maps, points, normals, out, i0, i1):
    """Γ at points[i0:i1] (m, 3) float32 with unit normals (m, 3), into out (m,) float32."""
    importance = maps[0]
    for i in range(i0, i1):
        p = (points[i, 0], points[i, 1], points[i, 2])
        out[i] = importance_at(importance, p, (normals[i, 0], normals[i, 1], normals[i, 2]))


@kernel
def importance_sums(maps, points, normals, k, out, i0, i1):
    """ΣW of `importance_sum` at points[i0:i1] (m, 3) float32 with unit normals (m, 3), into out (m,) float32."""
    importance = maps[0]
    for i in range(i0, i1):
        p = (points[i, 0], points[i, 1], points[i, 2])
        out[i] = importance_sum(importance, p, (normals[i, 0], normals[i, 1], normals[i, 2]), _i4(k))
