"""Whether photons fill their convex hull evenly (E3, E4).

Over the edge of a surface, or of what a light reaches, photons lie to one side of a disc and yet are evenly spread
where they lie. Then nothing is wrong with the place but the area of the disc, and that of the hull is right. In even
light the N photons inside the hull are independent and uniform in it, so that, with the hull's centroid m and
covariance C, δ = C^(−½)·(x − m) has mean 0 and covariance 1: Σδ/√N has the length 3 or more with probability 0.011, and
the mean of δ² is 2 with a variance of 4/3 (disc), 8/5 (parallelogram) or 12/5 (triangle), over N.

Photons that crowd in some part of their hull do not fill it evenly, and neither is a place that lies outside of it on
the surface that they light.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import stack_get_i4
from pmviewer.kernels.vector import basis
from pmviewer.maps.estimate.hull import (
    EDGE,
    in_plane,
    moments_of,
    outside_by,
    share_of,
    spanned_hull,
)
from pmviewer.maps.estimate.neighbours import next_batch

ALARM = 3.0
"""Standard deviations by which moments tell an uneven spread from chance."""
GAP = np.float32(2.0)
"""How far outside the hull a place may lie, in mean distances of photons: at an edge the last photons lie so far in."""

_ALARM2 = np.float32(ALARM * ALARM)
_SPREAD = np.float32(2.4)
"""Variance of δ², that of a triangle."""
_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_ZERO = _f4(0.0)


@device
def evenly_filled_hull(photons, p, n, found, r2, scratch, hull):
    """Corners (int64) and area (float32) of the hull of the photons that `pmviewer.maps.estimate.neighbours.search`
    found around p, where they fill it evenly and p lies in it or next to it; otherwise 0 corners.

    hull: HULL_WORDS words, which receive it; scratch: as for `search`.
    """
    corners, area = spanned_hull(photons, p, n, found, r2, scratch, hull)
    if corners == 0:
        return _i8(0), _ZERO
    s, t = basis(n)
    mu, mv, uu, uv, vv = moments_of(hull, corners)
    det = uu * vv - uv * uv
    if not det > _ZERO:
        return _i8(0), _ZERO
    inverse = _f4(1.0) / det
    margin = EDGE * np.sqrt(r2)
    inside, du, dv, q = _i8(0), _ZERO, _ZERO, _ZERO
    run, at = _i8(0), _i8(0)
    while True:
        run, at, some = next_batch(photons, found, run, at, scratch)
        if some == 0:
            break
        for j in range(some):
            place = _i8(stack_get_i4(scratch[2], j))
            u, v = in_plane(photons, place, p, s, t)
            if share_of(hull, corners, _i4(place), u, v, margin, _ZERO) > _ZERO:
                inside += 1
                u, v = u - mu, v - mv
                du += u
                dv += v
                q += (vv * u * u - _f4(2.0) * uv * u * v + uu * v * v) * inverse - _f4(2.0)
    N = _f4(inside)
    offset2 = (vv * du * du - _f4(2.0) * uv * du * dv + uu * dv * dv) * inverse
    if not (inside > 0 and offset2 <= _ALARM2 * N and q * q <= _ALARM2 * _SPREAD * N):
        return _i8(0), _ZERO
    if outside_by(hull, corners) > GAP * np.sqrt(area / N):
        return _i8(0), _ZERO
    return corners, area
