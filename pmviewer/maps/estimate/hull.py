"""Irradiance by the convex hull of the photons (E4; course guide §5.5.4).

A disc over the edge of a surface is divided by area that holds no surface: edges and corners come out too dark. Instead
divide by the area that the photons span, their convex hull in the tangent plane.

What does a photon on the boundary of the hull count? For independently scattered photons, nothing, and that is exact:
the hull is found from outside, and knowing it tells nothing about how many photons lie within. In a Poisson process of
density D they are D·area on average, whatever the hull and whatever the convex region that the photons fill, so that

    E = Σ_inside Φᵢ / area

has the right mean at edges and corners too. The same holds with the k nearest: the k−1 photons within the distance of
the k-th are such a process in its disc. Stratified photons lie more evenly, and Christensen's fifth of the boundary's
power suits them (`boundary`).

The hull is that of the photons farthest out in DIRECTIONS directions. Its corners are corners of the exact hull; what
lies between both is left out of the sum as of the area, and the argument above is the same. It needs no memory for
photons, so that a fixed radius may hold any number of them.

Fewer than FEWEST photons span too little: there the disc is used. In the middle of a surface that changes no mean, for
any number of photons: the mean of E over places of N uniform photons in a disc is exactly N/(πr²), as Σ_N p(N)·E_N = D
for all D leaves no other E_N.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import stack_get_f4, stack_get_i4, stack_i4, stack_put_f4, stack_put_i4
from pmviewer.kernels.vector import basis, dot, sub
from pmviewer.maps.estimate.neighbours import (
    BATCH_WORDS,
    FOUND_WORDS,
    SQUARED_WORDS,
    next_batch,
    place_of,
    power_of,
    search,
)

DIRECTIONS = 32
FEWEST = 8
"""Photons that it takes to make a hull."""

_HALF = DIRECTIONS // 2
_COS = np.array([math.cos(2 * math.pi * j / DIRECTIONS) for j in range(_HALF)], np.float32)
_SIN = np.array([math.sin(2 * math.pi * j / DIRECTIONS) for j in range(_HALF)], np.float32)
_U, _V = DIRECTIONS, 2 * DIRECTIONS
HULL_WORDS = 3 * DIRECTIONS
EDGE = np.float32(1e-5)
"""A photon counts as inside if it lies this share of the radius off every edge: photons of a wall project onto one."""
SMALLEST_AREA = np.float32(1e-6)

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
LOWEST = _f4(-np.inf)


@device
def in_plane(photons, place, p, s, t):
    """Coordinates of a photon in the tangent plane at p, which s and t span."""
    d = sub(place_of(photons, place), p)
    return dot(d, s), dot(d, t)


@device
def keep_farthest(farthest, hull, place, u, v):
    """Take the photon at (u, v) for each direction in which it is the farthest so far. `hull`: places, then u and v."""
    for j in range(_HALF):
        along = u * _COS[j] + v * _SIN[j]
        if along > stack_get_f4(farthest, j):
            _put(farthest, hull, j, along, place, u, v)
        if -along > stack_get_f4(farthest, _HALF + j):
            _put(farthest, hull, _HALF + j, -along, place, u, v)


@device
def _put(farthest, hull, j, along, place, u, v):
    stack_put_f4(farthest, j, along)
    stack_put_i4(hull, j, _i4(place))
    stack_put_f4(hull, _U + j, u)
    stack_put_f4(hull, _V + j, v)


@device
def corners_of(hull):
    """Drop repeated corners; returns how many are left, in order."""
    count = _i8(0)
    for j in range(DIRECTIONS):
        place = stack_get_i4(hull, j)
        if count > 0 and (stack_get_i4(hull, count - 1) == place or stack_get_i4(hull, 0) == place):
            continue
        stack_put_i4(hull, count, place)
        stack_put_f4(hull, _U + count, stack_get_f4(hull, _U + j))
        stack_put_f4(hull, _V + count, stack_get_f4(hull, _V + j))
        count += 1
    return count


@device
def _edge(hull, corners, j):
    """Corner j (u, v) and the way from it to the next."""
    following = j + 1 if j + 1 < corners else _i8(0)
    u, v = stack_get_f4(hull, _U + j), stack_get_f4(hull, _V + j)
    return u, v, stack_get_f4(hull, _U + following) - u, stack_get_f4(hull, _V + following) - v


@device
def area_of(hull, corners):
    """Area of the convex polygon of `corners` corners on the stack `hull`, by the shoelace formula about the first."""
    u0, v0 = stack_get_f4(hull, _U), stack_get_f4(hull, _V)
    twice = _f4(0.0)
    for j in range(corners):
        u, v, du, dv = _edge(hull, corners, _i8(j))
        twice += (u - u0) * dv - (v - v0) * du
    return _f4(0.5) * twice


@device
def moments_of(hull, corners):
    """Centroid (u, v) and covariance (uu, uv, vv) of the hull."""
    u0, v0 = stack_get_f4(hull, _U), stack_get_f4(hull, _V)
    area, mu, mv, uu, uv, vv = _f4(0.0), _f4(0.0), _f4(0.0), _f4(0.0), _f4(0.0), _f4(0.0)
    for j in range(1, corners - 1):
        bu, bv = stack_get_f4(hull, _U + j) - u0, stack_get_f4(hull, _V + j) - v0
        cu, cv = stack_get_f4(hull, _U + j + 1) - u0, stack_get_f4(hull, _V + j + 1) - v0
        T = _f4(0.5) * (bu * cv - bv * cu)
        area += T
        mu += T * (bu + cu)
        mv += T * (bv + cv)
        uu += T * (bu * bu + cu * cu + bu * cu)
        uv += T * (bu * bv + cu * cv + _f4(0.5) * (bu * cv + cu * bv))
        vv += T * (bv * bv + cv * cv + bv * cv)
    third, sixth = _f4(1.0 / 3.0) / area, _f4(1.0 / 6.0) / area
    mu, mv = mu * third, mv * third
    return u0 + mu, v0 + mv, uu * sixth - mu * mu, uv * sixth - mu * mv, vv * sixth - mv * mv


@device
def no_hull(farthest):
    """Begin a hull."""
    for j in range(DIRECTIONS):
        stack_put_f4(farthest, j, LOWEST)


@device
def outside_by(hull, corners):
    """How far the origin of u and v lies outside the edge that it is farthest outside of; negative inside."""
    farthest = LOWEST
    for j in range(corners):
        u, v, du, dv = _edge(hull, corners, _i8(j))
        length = np.sqrt(du * du + dv * dv)
        if length > _f4(0.0):
            farthest = max(farthest, (du * v - dv * u) / length)
    return farthest


@device
def sum_inside(photons, p, n, found, r2, scratch, hull, corners, boundary):
    """Power (red, green, blue) of the photons found inside the hull, `boundary` of that at its corners, in units of the
    map's; without corners that of all photons."""
    s, t = basis(n)
    margin = EDGE * np.sqrt(r2)
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    run, at = _i8(0), _i8(0)
    while True:
        run, at, some = next_batch(photons, found, run, at, scratch)
        if some == 0:
            break
        for j in range(some):
            place = _i8(stack_get_i4(scratch[2], j))
            weight = _f4(1.0)
            if corners > 0:
                u, v = in_plane(photons, place, p, s, t)
                weight = share_of(hull, corners, _i4(place), u, v, margin, boundary)
            if weight > _f4(0.0):
                r, g, b = power_of(photons, place)
                red += _f8(weight * r)
                green += _f8(weight * g)
                blue += _f8(weight * b)
    return red, green, blue


@device
def share_of(hull, corners, place, u, v, margin, boundary):
    """What the photon at (u, v) counts: 1 inside, `boundary` at a corner, nothing outside."""
    weight = _f4(1.0)
    for j in range(corners):
        if stack_get_i4(hull, j) == place:
            return boundary
        cu, cv, du, dv = _edge(hull, corners, _i8(j))
        if not du * (v - cv) - dv * (u - cu) > margin * (abs(du) + abs(dv)):
            weight = _f4(0.0)
    return weight


@device
def spanned_hull(photons, p, n, found, r2, scratch, hull):
    """Corners and area of the hull of the photons found, which goes into `hull` (HULL_WORDS words); 0 and 0 of too few
    photons or next to no area. scratch: as for `search`."""
    farthest = stack_i4(DIRECTIONS)
    no_hull(farthest)
    s, t = basis(n)
    run, at, total = _i8(0), _i8(0), _i8(0)
    while True:
        run, at, some = next_batch(photons, found, run, at, scratch)
        if some == 0:
            break
        total += some
        for j in range(some):
            place = _i8(stack_get_i4(scratch[2], j))
            u, v = in_plane(photons, place, p, s, t)
            keep_farthest(farthest, hull, place, u, v)
    if total < FEWEST:
        return _i8(0), _f4(0.0)
    corners = corners_of(hull)
    area = area_of(hull, corners)
    if not area > SMALLEST_AREA * r2:
        return _i8(0), _f4(0.0)
    return corners, area


@device
def hull_irradiance(photons, eye, radius, p, n, class_mask):
    """Irradiance (red, green, blue) in W per unit area at p with normal n, see `pmviewer.render.lookup.irradiance`."""
    scratch = (stack_i4(FOUND_WORDS), stack_i4(SQUARED_WORDS), stack_i4(BATCH_WORDS))
    hull = stack_i4(HULL_WORDS)
    found, r2, _ = search(photons, eye, radius, p, n, class_mask, scratch)
    corners, area = spanned_hull(photons, p, n, found, r2, scratch, hull)
    red, green, blue = sum_inside(photons, p, n, found, r2, scratch, hull, corners, eye.boundary)
    if corners == 0:
        area = _f4(math.pi) * r2
    unit = _f8(photons.power_unit) / _f8(area)
    return _f4(red * unit), _f4(green * unit), _f4(blue * unit)
