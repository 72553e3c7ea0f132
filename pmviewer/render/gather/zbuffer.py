"""Known hit points seen from another point: a z-buffer over its hemisphere (R8; course guide §6.3.3).

The hemisphere is cut as a gather cuts it (`pmviewer.maps.hemisphere`), into rings and sectors of equal projected area,
and every cell into sub × sub parts by the same rule. The buffer keeps the nearest hit of each part. A hit stands for
the patch of surface that its cell showed to the point that gathered it. Seen from another point, the patch covers

a = (r²/(cos θ · cos θ'))_there · (cos θ · cos θ'/r²)_here

cells, θ being the angle at the point and θ' that at the hit: more than one where the hit comes nearer. So many parts
are covered around its direction, by a square, divided by the number of points whose hits are plotted, as they see the
same surfaces: together they then fill the hemisphere about once.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.vector import dot, scale, sub

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_INF = _f4(np.inf)
_TURN = _f4(2.0 * math.pi)

HIT = 12
"""Floats of a known hit."""
PLACE, FACE, LIGHT, PATCH, WAY, USABLE = 0, 3, 6, 9, 10, 11
"""Where its parts begin: the hit point, or the direction of a ray that met nothing; the geometric normal on the side
that was hit; the radiance that it sends; r²/(cos θ · cos θ'), the patch that it stands for; how far it was, inf where
the ray met nothing; 1 where its radiance holds in all directions, else 0."""
EMPTY = -1
"""Of a part that no hit covers. Hits whose radiance holds are told by their row, those that only hide others by
`HIDING` − row."""
HIDING = -2
COARSEST = 4.0
"""A hit that would cover more cells than this hides what is behind it, and tells no radiance."""
WIDEST = 64.0
"""A hit hides no more cells than this. Near surfaces whose hits covered less than they do here would have holes,
through which darkness or light from far behind them comes."""


class Hemisphere(NamedTuple):
    """Of a point `x`: its shading normal n with tangents s and t, the geometric normal `face` on the same side; rings
    and sectors of the gather, and how finely its cells are divided."""

    x: Any
    n: Any
    face: Any
    s: Any
    t: Any
    rings: Any
    sectors: Any
    parts: Any


@device
def _vector(rows, row, at):
    return rows[row, at], rows[row, at + 1], rows[row, at + 2]


@device
def clear(owner):
    """Nothing is seen in any part."""
    owner[:] = _i4(EMPTY)


@device
def _put(depth, owner, at, z, who):
    """Into a part if it is empty or what is there lies farther off."""
    if owner[at] == EMPTY or z < depth[at]:
        depth[at], owner[at] = z, who


@device
def plot(view, hits, row, points, depth, owner):
    """Enter the known hit `row` of `hits`, float32 (n, HIT), as one of those of `points` points.

    depth, owner: float32 and int32 (parts of all cells,), part (J, K) at J + rings·parts·K.
    """
    d, z = _vector(hits, row, PLACE), _INF
    if hits[row, WAY] < _INF:
        d = sub(d, view.x)
        z = _f4(math.sqrt(dot(d, d)))
        if not z > _f4(0.0):
            return
        d = scale(d, _f4(1.0) / z)
    cos = dot(d, view.n)
    if not (cos > _f4(0.0) and dot(d, view.face) > _f4(0.0)):  # below the horizon
        return
    who = _i4(row) if hits[row, USABLE] > _f4(0.0) else _i4(HIDING - row)
    cells = _f4(1.0)
    if z < _INF:
        facing = -dot(d, _vector(hits, row, FACE))
        if facing <= _f4(0.0):  # seen from behind
            who = _i4(HIDING - row)
        cells = hits[row, PATCH] * cos * abs(facing) / (z * z)
        if not cells < _f4(COARSEST):
            who = _i4(HIDING - row)
            cells = cells if cells < _f4(WIDEST) else _f4(WIDEST)  # also where it is no number
    rings, sectors = view.rings * view.parts, view.sectors * view.parts
    x, y = dot(d, view.s), dot(d, view.t)
    radius2 = min(x * x + y * y, _f4(1.0))
    phi = _f4(math.atan2(y, x)) * (_f4(sectors) / _TURN)
    phi = phi if phi >= _f4(0.0) else phi + _f4(sectors)
    J, K = min(_i8(radius2 * _f4(rings)), _i8(rings - 1)), min(_i8(phi), _i8(sectors - 1))
    _put(depth, owner, J + rings * K, z, who)
    covered = cells * _f4(view.parts * view.parts) / _f4(points)
    if covered > _f4(1.0):
        _spread(rings, sectors, _f4(math.sqrt(radius2)), phi, covered, (z, who), (depth, owner))


@device
def _spread(rings, sectors, radius, phi, covered, what, buffer):
    """Enter (z, who) into a square of the area of `covered` parts around a direction, cut along rings and sectors.

    radius: sine of its angle to the normal; phi: its azimuth in sectors.
    """
    z, who = what
    depth, owner = buffer
    side = _f4(math.sqrt(covered * _f4(math.pi) / (_f4(rings) * _f4(sectors))))  # the unit disc is all of them
    half = _f4(0.5) * side
    inner, outer = max(radius - half, _f4(0.0)), min(radius + half, _f4(1.0))
    J0, J1 = _i8(inner * inner * _f4(rings) + _f4(0.5)), _i8(outer * outer * _f4(rings) + _f4(0.5))
    width = half / max(radius, half) * (_f4(sectors) / _TURN)
    K0, K1 = _i8(np.floor(phi - width + _f4(0.5))), _i8(np.floor(phi + width + _f4(0.5)))
    for K in range(K0, min(K1, K0 + sectors)):
        at = rings * (K + sectors if K < 0 else (K - sectors if sectors <= K else K))
        for J in range(J0, min(J1, rings)):
            _put(depth, owner, at + J, z, who)


@device
def _see(view, j, k, hits, cover, depth, owner, cells, here):
    """Mean radiance and harmonic mean distance of the parts of cell (j, k) into the row `here` of `cells`; returns
    whether enough is known."""
    high = view.rings * view.parts
    first = _i8(j) * view.parts + high * (_i8(k) * view.parts)
    covered = 0
    red, green, blue, inverse = _f4(0.0), _f4(0.0), _f4(0.0), _f4(0.0)
    for b in range(view.parts):
        for a in range(view.parts):
            at = first + a + high * b
            who = owner[at]
            if who == EMPTY:
                continue
            if who <= HIDING:
                return False
            L = _vector(hits, who, LIGHT)
            red, green, blue = red + L[0], green + L[1], blue + L[2]
            inverse += _f4(1.0) / depth[at]
            covered += 1
    if covered == 0 or _f4(covered) < cover * _f4(view.parts * view.parts):
        return False
    share = _f4(1.0) / _f4(covered)
    cells[here, 0], cells[here, 1], cells[here, 2] = red * share, green * share, blue * share
    cells[here, 3] = _f4(covered) / inverse if inverse > _f4(0.0) else _INF
    cells[here, 4] = (_f4(j) + _f4(0.5)) / _f4(view.rings)
    return True


@device
def resolve(view, hits, cover, depth, owner, cells, known):
    """Fill the rows of `cells` (see `pmviewer.maps.hemisphere.irradiance_and_gradients`) that hits tell enough about.

    A cell has to be shot where they cover less than the share `cover` of it, and where one of them only hides. Nothing
    looks at radiance: to gather anew where hits differ would favour what most of them show. known: bool (cells,),
    filled in. Returns how many are known.
    """
    count = 0
    for k in range(view.sectors):
        for j in range(view.rings):
            here = j + view.rings * k
            known[here] = _see(view, j, k, hits, cover, depth, owner, cells, here)
            count += 1 if known[here] else 0
    return count
