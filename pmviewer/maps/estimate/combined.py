"""Look-ups in a map of M parts (M4; course guide §5.6): k/M nearest photons of each part instead of k of one map.

Part m brings the power P_m, in units of the whole, within the radius r_m. Added as irradiances, Σ P_m/(π·r_m²), they
have the noise of few photons: each has the relative variance 1/(κ − 2), κ = k/M, and where the k-th photons count
whole each is too bright by 1/(κ − 1), however many there are. The course guide therefore divides the sum of the powers
by the mean area,

    E = (M/π) · Σ P_m / Σ r_m².

Why that is better, and how much: where photons are scattered independently with n on average a unit of area in all
parts, the areas times n/M are gamma variates of order κ, and their sum is one of order M·κ, which is that of the k-th
photon of one map. So this estimate has the very distribution of one map's: the variance 1/(k − 2), and too bright by
1/(k − 1) with all photons counted.

Exactly right in the mean are k − 1 of the k photons, in one map and in M: one of the M photons that end discs has to be
left out, not all of them, which would be too dark by (M − 1)/(k − 1). Nobody knows which, so each counts (M − 1)/M, and
1/M by the rule of `pmviewer.maps.estimate.estimate`. Where the search of some parts ends at the largest radius, without
a k-th photon, that is too dark by less than half a percent for κ = 6 (4 % for κ = 2); where all do, it is exact again.
Where photons on the rim have other weights than those inside (filters, parts of a disc), what they stand for is added
to those inside.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, specialised
from pmviewer.kernels.memory import float_of_bits, stack_get_i8, stack_i4
from pmviewer.maps.estimate.filters import CONSTANT, filter_disc_mean, filter_weight
from pmviewer.maps.estimate.glossy import scattered_power
from pmviewer.maps.estimate.nearest import Neighbours, nearest_disc
from pmviewer.maps.search.k_nearest import KEYS
from pmviewer.maps.search.parts import IRRADIANCES, part_of
from pmviewer.maps.search.stored import stored_power

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32
_PI = _f8(np.pi)


class Found(NamedTuple):
    """What a look-up found in one part: float64 sums of the powers inside (red, green, blue) with their filter's
    weights, and of that on the rim; int64 photons `inside` the whole disc, `counted` of them in the share that is used,
    and `rims`, 1 where a photon ends the disc, else 0; the squared radius of the share, float32."""

    inner: Any
    on_rim: Any
    inside: Any
    counted: Any
    rims: Any
    r2: Any


class Lobe(NamedTuple):
    """How photons are reflected: arguments of `pmviewer.maps.estimate.glossy.scattered_power`."""

    n: Any
    b: Any
    group: Any
    flags: Any
    wo: Any


@specialised
def _power(tree, place, lobe):
    """What the photon at a place of a tree brings: its power, or what a `Lobe` makes of it."""
    if absent(lobe):
        return lambda tree, place, lobe: stored_power(tree, place)
    return lambda tree, place, lobe: scattered_power(tree, place, lobe.n, lobe.b, lobe.group, lobe.flags, lobe.wo)


@device
def _look(tree, place, neighbours, weighting, lobe, keys):
    """A look-up in one tree, as `Found`."""
    kind, cone_k = weighting
    whole = Neighbours(neighbours.k, neighbours.max_radius, neighbours.rim, _f4(1.0))
    inside, rim_place, r2 = nearest_disc(tree, place, whole, keys)
    part = max(neighbours.share * r2, tree.smallest_radius * tree.smallest_radius)
    if part < r2:
        r2 = part
    inverse_r2 = _f4(1.0) / r2
    red, green, blue = _f8(0.0), _f8(0.0), _f8(0.0)
    counted = _i8(0)
    for j in range(inside):
        key = stack_get_i8(keys, j)
        d2 = float_of_bits(_u4(key >> 32))
        if neighbours.share < _f4(1.0) and not d2 < r2:
            continue
        r, g, b = _power(tree, key & _i8(0xFFFFFFFF), lobe)
        w = filter_weight(kind, cone_k, d2 * inverse_r2)
        red += _f8(w * r)
        green += _f8(w * g)
        blue += _f8(w * b)
        counted += 1
    on_rim, rims = (_f8(0.0), _f8(0.0), _f8(0.0)), _i8(0)
    if rim_place >= 0:
        r, g, b = _power(tree, rim_place, lobe)
        on_rim, rims = (_f8(r), _f8(g), _f8(b)), _i8(1)
    return Found((red, green, blue), on_rim, inside, counted, rims, r2)


@device
def _added(to, values, factor):
    """Sums (red, green, blue) with others times a factor."""
    return to[0] + factor * values[0], to[1] + factor * values[1], to[2] + factor * values[2]


@device
def combined(parts, place, neighbours, weighting, lobe):
    """Irradiance, or radiance by a lobe, from the nearest photons of each part.

    Parameters
    ----------
    parts: record of a PhotonParts.
    place: a `pmviewer.maps.search.disc.Place`.
    neighbours: a `pmviewer.maps.estimate.nearest.Neighbours`; its k is that of each part.
    weighting: a `pmviewer.maps.estimate.filters.Filter`.
    lobe: a `Lobe`, or None for irradiance.

    Returns
    -------
    (red, green, blue) float32 in W per unit area, or per unit area and steradian; number of photons int32, those on the
    rims included; radius float32 of the disc of the mean area.
    """
    keys = stack_i4(KEYS)
    kind, cone_k = weighting
    whole = not neighbours.share < _f4(1.0)
    rim = _f8(_f4(0.5) * _f4(neighbours.rim) * filter_weight(kind, cone_k, _f4(1.0))) if whole else _f8(0.0)
    black = (_f8(0.0), _f8(0.0), _f8(0.0))
    inner, on_rims = black, black
    area, inside, counted, rims = _f8(0.0), _i8(0), _i8(0), _i8(0)
    for m in range(parts.parts):
        found = _look(part_of(parts, m), place, neighbours, weighting, lobe, keys)
        r2 = _f8(found.r2)
        one = _f8(1.0) / r2 if parts.combine == IRRADIANCES else _f8(1.0)
        inner, on_rims = _added(inner, found.inner, one), _added(on_rims, found.on_rim, one)
        area += r2
        inside += found.inside
        counted += found.counted
        rims += found.rims
    factor, unit = _f8(1.0), _f8(1.0)
    if parts.combine != IRRADIANCES:
        unit = _f8(parts.parts) / area
        kept = _f8(1.0) - _f8(1.0) / _f8(parts.parts)
        rim /= _f8(parts.parts)
        if whole and kind == CONSTANT:
            rim += kept
        elif inside > 0:
            factor += kept * _f8(rims) / _f8(inside)
    E = _added((factor * inner[0], factor * inner[1], factor * inner[2]), on_rims, rim)
    scale = unit * _f8(parts.power_unit) / (_f8(filter_disc_mean(kind, cone_k)) * _PI)
    if whole:
        counted += rims
    radius = np.sqrt(_f4(area / _f8(parts.parts)))
    return (_f4(E[0] * scale), _f4(E[1] * scale), _f4(E[2] * scale)), _i4(counted), radius
