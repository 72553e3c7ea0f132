"""Irradiance with differential checking (E3; Jensen & Christensen 1995; course guide §2.3.2 and §5.5.3).

While the disc around a point grows, an estimate in even light changes at random; near the edge of a surface or of a
caustic it follows a trend, darker and darker or brighter and brighter. The disc stops growing where a trend begins.

First it is asked whether there is a trend at all: in even light the photons' mean offset from the point is zero and
their mean squared relative distance a half, each with a known spread. Photons that lie to one side (the edge of a
surface or of a caustic) or crowd at the middle or the rim (a spot, a ring) by more than ALARM standard deviations
raise the alarm; else the whole disc is used and nothing is lost. On alarm the disc is found by intersecting confidence
intervals (Goldenshluger & Nemirovski 1997): the density of the cⱼ photons in each of LEVELS discs of areas aⱼ growing
by √2 lies in cⱼ/aⱼ ± TRUST·√cⱼ/aⱼ; the largest disc is taken whose interval still meets those of all smaller ones.

To stop where the photons happen to fit would favour bright or dark places. So the photons are parted into FOLDS by a
hash of their position, and the disc in which a fold is summed is decided by all the others. For independently scattered
photons the estimate then is one of a fixed radius, exact in the mean under even light whatever the rule. Where nothing
stops them, the folds add up to the plain disc estimate.

At the edge itself half of every disc is off the surface, and no radius helps. So where there is a trend it is first
asked whether the photons fill their convex hull evenly (`pmviewer.maps.estimate.evenness`). If so the place is at an
edge and the light is even: what the photons span is the right area, and the estimate that of
`pmviewer.maps.estimate.hull`, of all photons.

Counts are compared, not powers: roulette keeps powers equal, and counts are colour-blind only where lights of the same
luminance meet.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import bits_of_float, stack_get_f4, stack_get_i4, stack_i4, stack_put_f4, stack_put_i4
from pmviewer.kernels.random import hash3
from pmviewer.kernels.vector import basis, dot, scale, sub
from pmviewer.maps.estimate.evenness import evenly_filled_hull
from pmviewer.maps.estimate.filters import filter_disc_mean, filter_weight
from pmviewer.maps.estimate.hull import HULL_WORDS, sum_inside
from pmviewer.maps.estimate.neighbours import (
    BATCH_WORDS,
    FOUND_WORDS,
    SQUARED_WORDS,
    WIDTH,
    next_batch,
    place_of,
    power_of,
    search,
)

LEVELS = 17
"""Discs that are compared; the smallest has 1/256 of the area."""
FOLDS = 8
FEWEST = 4
"""Photons in the smallest disc that is taken."""
ALARM = 3.0
"""Standard deviations by which the photons' moments tell a trend from chance."""
TRUST = np.float32(0.5)
"""Half-width of the confidence intervals in standard deviations: on alarm, few photons are better than dark ones."""

_ALARM_OFFSET = np.float32(ALARM * ALARM / 4.0)
"""Along each axis, an offset in the unit disc has variance 1/4."""
_ALARM_SPREAD = np.float32(ALARM * ALARM / 12.0)
"""The squared distance is uniform in [0, 1]: variance 1/12."""
_COUNT_WORDS = (FOLDS + 1) * LEVELS
_SUM = FOLDS * LEVELS
_MOMENT_WORDS = 3 * (FOLDS + 1)
_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32


@device
def _level(x2):
    """The smallest disc that holds a photon at squared relative distance x2."""
    level = _f4(LEVELS - 1) + np.ceil(_f4(2.0) * np.log2(x2))
    return _i8(min(max(level, _f4(0.0)), _f4(LEVELS - 1)))


@device
def _area_share(level):
    """Area of a disc relative to that of the largest."""
    return _f4(2.0) ** (_f4(0.5) * _f4(level - (LEVELS - 1)))


@device
def _fold(photons, place):
    """The fold that a photon belongs to."""
    x, y, z = place_of(photons, place)
    return _i8(hash3(_u4(bits_of_float(x)), _u4(bits_of_float(y)), _u4(bits_of_float(z))) & _u4(FOLDS - 1))


@device
def _trend(moments, counts, fold):
    """Whether the photons of all other folds are out of balance. `moments`: offset u, v and squared distance from ½,
    relative to the disc, summed over each fold, then over all."""
    m, total = 3 * fold, 3 * FOLDS
    u = stack_get_f4(moments, total) - stack_get_f4(moments, m)
    v = stack_get_f4(moments, total + 1) - stack_get_f4(moments, m + 1)
    q = stack_get_f4(moments, total + 2) - stack_get_f4(moments, m + 2)
    inside = _i4(0)
    for level in range(LEVELS):
        inside += stack_get_i4(counts, _SUM + level) - stack_get_i4(counts, fold * LEVELS + level)
    return u * u + v * v > _ALARM_OFFSET * _f4(inside) or q * q > _ALARM_SPREAD * _f4(inside)


@device
def _add_moments(moments, fold, u, v, q):
    m = 3 * fold
    stack_put_f4(moments, m, stack_get_f4(moments, m) + u)
    stack_put_f4(moments, m + 1, stack_get_f4(moments, m + 1) + v)
    stack_put_f4(moments, m + 2, stack_get_f4(moments, m + 2) + q)


@device
def _trusted(counts, fold):
    """The largest disc without a trend, by the photons of all other folds. `counts`: photons of each fold in each ring,
    then of all folds."""
    low, high = _f4(-np.inf), _f4(np.inf)
    inside, chosen = _i4(0), _i8(-1)
    for level in range(LEVELS):
        inside += stack_get_i4(counts, _SUM + level) - stack_get_i4(counts, fold * LEVELS + level)
        if inside < FEWEST:
            continue
        per_area = _f4(1.0) / _area_share(level)
        width = TRUST * np.sqrt(_f4(inside))
        low = max(low, (_f4(inside) - width) * per_area)
        high = min(high, (_f4(inside) + width) * per_area)
        if low > high:
            break
        chosen = _i8(level)
    return chosen if chosen >= 0 else _i8(LEVELS - 1)


@device
def _discs(photons, eye, radius, p, n, class_mask, scratch, areas, hull):
    """Search, and decide the disc of each fold: `areas` (FOLDS words) receives their areas relative to the largest.
    Returns what `search` does, and corners and area of the photons' hull where that explains the trends."""
    counts, moments = stack_i4(_COUNT_WORDS), stack_i4(_MOMENT_WORDS)
    for j in range(_MOMENT_WORDS):
        stack_put_f4(moments, j, _f4(0.0))
    s, t = basis(n)
    for j in range(_COUNT_WORDS):
        stack_put_i4(counts, j, _i4(0))
    found, r2, rim = search(photons, eye, radius, p, n, class_mask, scratch)
    inverse_r2 = _f4(1.0) / r2
    inverse_r = np.sqrt(inverse_r2)
    run, at = _i8(0), _i8(0)
    while True:
        run, at, some = next_batch(photons, found, run, at, scratch)
        if some == 0:
            break
        for j in range(some):
            place = _i8(stack_get_i4(scratch[2], j))
            x2 = stack_get_f4(scratch[2], WIDTH + j) * inverse_r2
            level, fold = _level(x2), _fold(photons, place)
            d = scale(sub(place_of(photons, place), p), inverse_r)
            u, v = dot(d, s), dot(d, t)
            _add_moments(moments, fold, u, v, x2 - _f4(0.5))
            _add_moments(moments, _i8(FOLDS), u, v, x2 - _f4(0.5))
            ring = LEVELS * fold + level
            stack_put_i4(counts, ring, stack_get_i4(counts, ring) + _i4(1))
            stack_put_i4(counts, _SUM + level, stack_get_i4(counts, _SUM + level) + _i4(1))
    trends = _i8(0)
    for fold in range(FOLDS):
        level = _i8(LEVELS - 1)
        if _trend(moments, counts, fold):
            trends += 1
            level = _trusted(counts, fold)
        stack_put_f4(areas, fold, _area_share(level))
    corners, area = _i8(0), _f4(0.0)
    if trends > 0:
        corners, area = evenly_filled_hull(photons, p, n, found, r2, scratch, hull)
    return found, r2, rim, corners, area


@device
def checked_irradiance(photons, eye, radius, p, n, class_mask):
    """Irradiance (red, green, blue) in W per unit area at p with normal n, see `pmviewer.render.lookup.irradiance`."""
    scratch = (stack_i4(FOUND_WORDS), stack_i4(SQUARED_WORDS), stack_i4(BATCH_WORDS))
    areas, hull = stack_i4(FOLDS), stack_i4(HULL_WORDS)
    found, r2, rim, corners, spanned = _discs(photons, eye, radius, p, n, class_mask, scratch, areas, hull)
    if corners > 0:
        red, green, blue = sum_inside(photons, p, n, found, r2, scratch, hull, corners, eye.boundary)
        unit = _f8(photons.power_unit) / _f8(spanned)
        return _f4(red * unit), _f4(green * unit), _f4(blue * unit)
    inverse_r2 = _f4(1.0) / r2
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    run, at = _i8(0), _i8(0)
    while True:
        run, at, some = next_batch(photons, found, run, at, scratch)
        if some == 0:
            break
        for j in range(some):
            place = _i8(stack_get_i4(scratch[2], j))
            x2 = stack_get_f4(scratch[2], WIDTH + j) * inverse_r2
            area = stack_get_f4(areas, _fold(photons, place))
            if x2 > area:
                continue
            weight = filter_weight(eye.filter, eye.cone_k, x2 / area) / area
            r, g, b = power_of(photons, place)
            red += _f8(weight * r)
            green += _f8(weight * g)
            blue += _f8(weight * b)
    if rim >= 0 and stack_get_f4(areas, _fold(photons, rim)) >= _f4(1.0):
        r, g, b = power_of(photons, rim)
        weight = _f4(0.5) * _f4(eye.rim) * filter_weight(eye.filter, eye.cone_k, _f4(1.0))
        red += _f8(weight * r)
        green += _f8(weight * g)
        blue += _f8(weight * b)
    unit = _f8(photons.power_unit) / (_f8(filter_disc_mean(eye.filter, eye.cone_k)) * _f8(math.pi) * _f8(r2))
    return _f4(red * unit), _f4(green * unit), _f4(blue * unit)


@device
def reach(photons, eye, radius, p, n, class_mask):
    """Radius of the disc with the mean area of all folds' discs, and photons that are summed; both float32."""
    scratch = (stack_i4(FOUND_WORDS), stack_i4(SQUARED_WORDS), stack_i4(BATCH_WORDS))
    areas, hull = stack_i4(FOLDS), stack_i4(HULL_WORDS)
    found, r2, rim, corners, _ = _discs(photons, eye, radius, p, n, class_mask, scratch, areas, hull)
    inverse_r2 = _f4(1.0) / r2
    mean = _f4(0.0)
    for fold in range(FOLDS):
        if corners > 0:  # all photons of the disc
            stack_put_f4(areas, fold, _f4(1.0))
        mean += stack_get_f4(areas, fold) * _f4(1.0 / FOLDS)
    total = _i8(0)
    run, at = _i8(0), _i8(0)
    while True:
        run, at, some = next_batch(photons, found, run, at, scratch)
        if some == 0:
            break
        for j in range(some):
            place = _i8(stack_get_i4(scratch[2], j))
            if stack_get_f4(scratch[2], WIDTH + j) * inverse_r2 <= stack_get_f4(areas, _fold(photons, place)):
                total += 1
    if rim >= 0 and stack_get_f4(areas, _fold(photons, rim)) >= _f4(1.0):
        total += 1
    return np.sqrt(mean * r2), _f4(total)
