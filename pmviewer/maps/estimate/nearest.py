"""The disc of a k-nearest look-up, and how it shrinks from pass to pass (E1, E6).

Where photons are scattered independently, let Λ(r) be how many a disc of radius r holds on average. The radius R of the
k-th makes Λ(R) a gamma variate of order k, whatever the density around the place, and given R the k−1 inner photons are
independent and have the density of the place. So for any share s of the disc's area

    E[ Σ_{d² < s·R²} Φᵢ / (π·s·R²) ] = E[ (k−1)/Λ(R) · L(√s·R) ],   E[(k−1)/Λ(R)] = 1,

L(r) being the mean of flux per area over a disc of radius r: a mean of the estimates of fixed radii √s·R. The same
holds where fewer than k lie within the largest radius, with that for R and their number for k−1 (the martingale
N(r)/Λ(r) stops at one or the other). It holds for any weights by place, direction and distance, so for kernels and
BSDFs too.

The bias is therefore that of radius √s·R. A pass's R has a least size, that of the fewest photons that make a disc; s
has none. Pass i should use the share sᵢ = rᵢ²/r₁² of the first pass's area, as look-ups of fixed radius do. Half of
that it gains by fewer photons, kᵢ = max(√sᵢ·k, FEWEST), searched in at most kᵢ/k of the largest area, half by the share
sᵢ·k/kᵢ of their disc. The variance of an estimate is about 1/((k−2)·s) of its mean's square.

What the k-th photon counts where the disc is entire is the rule of `pmviewer.maps.estimate.estimate`; a part of the
disc does not hold it. That is exact for independent photons, and less and less wrong for stratified ones the smaller
the part: what they lack within R, they lack along the rim (so the shrinking is not all left to k).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import bits_of_float, stack_get_i8, stack_put_i8
from pmviewer.maps.search.disc import Facing
from pmviewer.maps.search.k_nearest import nearest

FEWEST = 16
"""Least number of neighbours that passes shrink k to: those of a leaf, so that fewer would cost as much."""

_FLATTEST = np.float32(1e-3)
"""The flattest disc: a flatness of nothing would leave out photons by rounding."""

_f4 = np.float32
_i8 = np.int64


class Neighbours(NamedTuple):
    """The k nearest photons that an estimate takes.

    k: int32, 2 … MAX_K; max_radius: float32, finite, how far they are at most; rim: int32, RIM_LEFT_OUT, RIM_HALF or
    RIM_WHOLE of `pmviewer.maps.estimate.estimate`, what the farthest counts; share: float32, the part of the disc's
    area in which photons count, 1 for all.
    """

    k: Any
    max_radius: Any
    rim: Any
    share: Any


def shrunk(k: int, s: float) -> tuple[int, float]:
    """Neighbours that a pass looks up, and the share of their disc's area in which it counts them, when it should use
    the share `s` ≤ 1 of the area that k photons fill."""
    neighbours = max(math.ceil(math.sqrt(s) * k), min(k, FEWEST))
    return neighbours, s * k / neighbours


@device
def nearest_disc(tree, place, neighbours, keys):
    """Search the disc of the k nearest photons around a place, and keep the share of its area.

    Parameters
    ----------
    tree: record of a PhotonKdTree.
    place: a `pmviewer.maps.search.disc.Place`; neighbours: a `Neighbours`, whose rim does not matter here.
    keys: pointer to `KEYS` int32 of scratch, which receives the photons as `pmviewer.maps.search.k_nearest.nearest`
        leaves them.

    Returns
    -------
    Number of photons inside (int64); the place in the tree of the photon on the rim (int64, −1 without one); the
    squared radius of the disc, or of the part of it (float32).
    """
    flatness = max(place.flatness, _FLATTEST)
    facing = Facing(place.n, _f4(1.0) / (flatness * flatness), place.class_mask)
    k, largest = neighbours.k, neighbours.max_radius * neighbours.max_radius
    count, r2 = nearest(tree, place.p, k, largest, keys, facing)
    rim = _i8(-1)
    if count == k:
        last = _i8(0)
        for j in range(1, count):
            if stack_get_i8(keys, j) > stack_get_i8(keys, last):
                last = _i8(j)
        rim = stack_get_i8(keys, last) & _i8(0xFFFFFFFF)
        count -= 1
        stack_put_i8(keys, last, stack_get_i8(keys, count))
    least = tree.smallest_radius * tree.smallest_radius
    r2 = max(r2, least)
    part = max(neighbours.share * r2, least)
    if part < r2:
        r2, rim = part, _i8(-1)
        outside = _i8(bits_of_float(part)) << 32
        inside = _i8(0)
        for j in range(count):
            key = stack_get_i8(keys, j)
            if key < outside:
                stack_put_i8(keys, inside, key)
                inside += 1
        count = inside
    return count, rim, r2
