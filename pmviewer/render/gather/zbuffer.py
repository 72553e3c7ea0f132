"""Known hit points seen from another point: a z-buffer over its hemisphere (R8; course guide §6.3.3).

The hemisphere is cut as a gather cuts it (`pmviewer.maps.hemisphere`), into rings and sectors of equal projected area,
and every cell into sub × sub parts by the same rule. The buffer keeps the nearest hit of each part. A hit stands for
the patch of surface that its cell showed to the point that gathered it. Seen from another point, the patch covers

a = (r²/(cos θ · cos θ'))_there · (cos θ · cos θ'/r²)_here

cells, θ being the angle at the point and θ' that at the hit: more than one where the hit comes nearer. So many parts
are covered around its direction, by a disc, divided by the number of points whose hits are plotted, as they see the
same surfaces: together they then fill the hemisphere about once.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.vector import dot, luminance, scale, sub

_f4 = np.float32
_f8 = np.float64
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
FLAT = 0.1
"""Two hits lie on one surface if neither is farther off the plane of the other than this share of its distance."""
LEAST_COVER = 0.25
"""Share of a cell's parts that hits must cover."""


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
def _vector(row, at):
    return row[at], row[at + 1], row[at + 2]


@device
def clear(depth, owner):
    """Nothing is seen in any part."""
    depth[:] = _INF
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
    hit = hits[row]
    d, z = _vector(hit, PLACE), _INF
    if hit[WAY] < _INF:
        d = sub(d, view.x)
        z = _f4(math.sqrt(dot(d, d)))
        if not z > _f4(0.0):
            return
        d = scale(d, _f4(1.0) / z)
    cos = dot(d, view.n)
    if not (cos > _f4(0.0) and dot(d, view.face) > _f4(0.0)):  # below the horizon
        return
    who = _i4(row) if hit[USABLE] > _f4(0.0) else _i4(HIDING - row)
    cells = _f4(1.0)
    if z < _INF:
        facing = -dot(d, _vector(hit, FACE))
        if facing <= _f4(0.0):  # seen from behind
            who = _i4(HIDING - row)
        cells = hit[PATCH] * cos * abs(facing) / (z * z)
        if not cells < _f4(COARSEST):
            who, cells = _i4(HIDING - row), _f4(COARSEST)
    rings, sectors = view.rings * view.parts, view.sectors * view.parts
    x, y = dot(d, view.s), dot(d, view.t)
    radius2 = min(x * x + y * y, _f4(1.0))
    phi = _f4(math.atan2(y, x)) * (_f4(sectors) / _TURN)
    phi = phi if phi >= _f4(0.0) else phi + _f4(sectors)
    J, K = min(_i8(radius2 * _f4(rings)), _i8(rings - 1)), min(_i8(phi), _i8(sectors - 1))
    _put(depth, owner, J + rings * K, z, who)
    covered = cells * _f4(view.parts * view.parts) / _f4(points)
    if covered > _f4(1.0):
        _disc(rings, sectors, math.sqrt(radius2), phi, covered, (z, who), depth, owner)


@device
def _disc(rings, sectors, radius, phi, covered, what, depth, owner):
    """Enter (z, who) into the parts whose middles lie in a disc of the area of `covered` parts around a direction.

    radius: sine of its angle to the normal; phi: its azimuth in sectors.
    """
    z, who = what
    reach2 = covered / (_f4(rings) * _f4(sectors))
    reach = _f4(math.sqrt(reach2))
    inner, outer = max(radius - reach, _f4(0.0)), min(radius + reach, _f4(1.0))
    J0, J1 = _i8(inner * inner * _f4(rings)), min(_i8(outer * outer * _f4(rings)), _i8(rings - 1))
    for J in range(J0, J1 + 1):
        r2 = (_f4(J) + _f4(0.5)) / _f4(rings)
        r = _f4(math.sqrt(r2))
        if r + radius <= reach:
            K0, K1 = _i8(0), _i8(sectors - 1)
        else:
            c = (r2 + radius * radius - reach2) / (_f4(2.0) * r * radius)
            if c >= _f4(1.0):
                continue
            half = _f4(math.acos(max(c, _f4(-1.0)))) * (_f4(sectors) / _TURN)
            K0, K1 = _i8(math.ceil(phi - half - _f4(0.5))), _i8(math.floor(phi + half - _f4(0.5)))
        for K in range(K0, K1 + 1):
            around = K + sectors if K < 0 else (K - sectors if K >= sectors else K)
            _put(depth, owner, J + rings * around, z, who)


@device
def _first_part(view, j, k):
    return _i8(j) * view.parts + view.rings * view.parts * (_i8(k) * view.parts)


@device
def _see(view, j, k, hits, depth, owner, cells):
    """Mean radiance and harmonic mean distance of the parts of cell (j, k) into its row of `cells`; returns the row of
    the nearest hit, EMPTY where the cell has to be shot."""
    first, high = _first_part(view, j, k), view.rings * view.parts
    covered, nearest, least = 0, _i8(EMPTY), _INF
    red, green, blue, inverse = _f4(0.0), _f4(0.0), _f4(0.0), _f4(0.0)
    for b in range(view.parts):
        for a in range(view.parts):
            at = first + a + high * b
            who = owner[at]
            if who == EMPTY:
                continue
            if who <= HIDING:
                return _i8(EMPTY)
            L = _vector(hits[who], LIGHT)
            red, green, blue = red + L[0], green + L[1], blue + L[2]
            inverse += _f4(1.0) / depth[at]
            covered += 1
            if nearest == EMPTY or depth[at] < least:
                nearest, least = _i8(who), depth[at]
    if covered == 0 or _f4(covered) < _f4(LEAST_COVER) * _f4(view.parts * view.parts):
        return _i8(EMPTY)
    row, share = cells[j + view.rings * k], _f4(1.0) / _f4(covered)
    row[0], row[1], row[2] = red * share, green * share, blue * share
    row[3] = _f4(covered) / inverse if inverse > _f4(0.0) else _INF
    row[4] = (_f4(j) + _f4(0.5)) / _f4(view.rings)
    return nearest


@device
def _on_one_surface(a, b, far):
    """Whether hit b goes on where hit a is, `far` being how far a is seen."""
    if not (a[WAY] < _INF and b[WAY] < _INF):
        return not (a[WAY] < _INF or b[WAY] < _INF)
    d = sub(_vector(b, PLACE), _vector(a, PLACE))
    most = _f4(FLAT) * far
    return abs(dot(d, _vector(a, FACE))) <= most and abs(dot(d, _vector(b, FACE))) <= most


@device
def _contradicts(view, j, k, hits, depth, owner, front, threshold):
    """Whether a cell shows, beside its nearest hit `front`, another surface of another radiance."""
    first, high = _first_part(view, j, k), view.rings * view.parts
    near = hits[front]
    Y, far = luminance(_vector(near, LIGHT)), _INF
    for b in range(view.parts):
        for a in range(view.parts):
            if owner[first + a + high * b] == front:
                far = min(far, depth[first + a + high * b])
    for b in range(view.parts):
        for a in range(view.parts):
            who = owner[first + a + high * b]
            if who == EMPTY or who == front:
                continue
            other = hits[who]
            if abs(luminance(_vector(other, LIGHT)) - Y) > threshold and not _on_one_surface(near, other, far):
                return True
    return False


@device
def resolve(view, hits, contrast, depth, owner, cells, known):
    """Fill the rows of `cells` (see `pmviewer.maps.hemisphere.irradiance_and_gradients`) that hits tell enough about.

    A cell has to be shot where they cover too little of it, where one of them only hides, and where two of them lie on
    different surfaces and differ in luminance by more than `contrast` times the mean of the known cells. known: int64
    (cells,), the nearest hit's row or EMPTY, filled in. Returns how many are known.
    """
    total, count = _f4(0.0), 0
    for k in range(view.sectors):
        for j in range(view.rings):
            here = j + view.rings * k
            known[here] = _see(view, j, k, hits, depth, owner, cells)
            if known[here] != EMPTY:
                total += luminance((cells[here, 0], cells[here, 1], cells[here, 2]))
                count += 1
    threshold = contrast * total / _f4(max(count, 1))
    for k in range(view.sectors):
        for j in range(view.rings):
            here = j + view.rings * k
            if known[here] != EMPTY and _contradicts(view, j, k, hits, depth, owner, known[here], threshold):
                known[here] = EMPTY
                count -= 1
    return count
