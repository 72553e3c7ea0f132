"""The photons of a look-up by looking at every photon of the map: the naive twin of the searches in `maps/search`."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.record import decode_directions, decode_normals
from pmviewer.maps.search.parts import Combination
from pmviewer.maps.search.sides import SURELY

CHUNK = 1 << 20
"""Photons looked at in one go."""
_FLATTEST = 1e-3
"""As `pmviewer.maps.estimate.nearest` bounds it."""


class Disc(NamedTuple):
    """Where photons count: around p on the side of the unit normal n (both (3,) float32), on `both_sides` if asked for,
    within `flatness` times the radius of the tangent plane, of the path classes in `class_mask`, with all `flags`."""

    p: NDArray[np.float32]
    n: NDArray[np.float32]
    flatness: float
    class_mask: int
    both_sides: bool = False
    flags: int = 0


class Near(NamedTuple):
    """Photons around a place, by ascending reach: `rows` (m,) their places there, `d2` (m,) float32 squared distances,
    `reach` (m,) the least squared radius whose disc holds them, `front` (m,) whether they arrive on the side of n."""

    rows: NDArray[np.int64]
    d2: NDArray[np.float32]
    reach: NDArray[np.float32]
    front: NDArray[np.bool_]


class Chosen(NamedTuple):
    """Photons that a look-up takes: places in a `Near`, x2 (m,) the squared relative distances that kernels are asked
    with, and `factor` (m,), 1 but for the one on the rim; `radius` of the disc."""

    places: NDArray[np.int64]
    x2: NDArray[np.float64]
    factor: NDArray[np.float64]
    radius: float


class Neighbours(NamedTuple):
    """What a look-up of the `k` nearest is asked for: `largest` radius, `share` of the disc's area that it uses, what
    the farthest counts (`rim`/2 where the disc is entire), and the map's `smallest` radius. Radii in scene units."""

    k: int
    largest: float
    share: float
    rim: int
    smallest: float


def photons_near(photons: NDArray[np.float32], disc: Disc, radius: float) -> Near:
    """Those of photons (n, 6) that the disc of that radius, in scene units, holds."""
    parts: list[Any] = [_part(photons, first, disc, np.float32(radius)) for first in range(0, len(photons), CHUNK)]
    if not parts:
        none = np.zeros(0, np.float32)
        return Near(np.zeros(0, np.int64), none, none, np.zeros(0, bool))
    places, d2, reach, front = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(reach, kind="stable")
    return Near(places[order], d2[order], reach[order], front[order])


def _part(photons: NDArray[np.float32], first: int, disc: Disc, radius: np.float32) -> Near:
    rows = photons[first : first + CHUNK]
    here = np.flatnonzero(np.abs(rows[:, 0] - disc.p[0]) <= radius)
    for axis in (1, 2):
        here = here[np.abs(rows[here, axis] - disc.p[axis]) <= radius]
    rows = rows[here]
    offset = rows[:, :3] - disc.p
    d2 = (offset * offset).sum(axis=1, dtype=np.float32)
    height = offset @ disc.n
    steepness = np.float32(1.0 / max(disc.flatness, _FLATTEST) ** 2)
    reach = np.maximum(d2, steepness * height * height)
    word = np.ascontiguousarray(rows[:, 3]).view(np.uint32)
    front = decode_directions(word) @ disc.n > 0
    counts = (disc.class_mask >> ((word >> 6) & 3).astype(np.int64)) & 1 == 1
    counts &= (word & disc.flags) == disc.flags
    counts &= (d2 < radius * radius) & (reach <= radius * radius)
    if not disc.both_sides:
        m, least = decode_normals(word), math.sqrt(SURELY)
        apart = (height < 0) & ((m * offset).sum(axis=1) < -least * np.sqrt(d2))
        counts &= front & (m @ disc.n >= least) & ~apart
    return Near((first + here[counts]).astype(np.int64), d2[counts], reach[counts], front[counts])


def within(near: Near, radius: float) -> Chosen:
    """All that the disc of that radius holds."""
    r2 = np.float32(radius) * np.float32(radius)
    places = np.flatnonzero((near.d2 < r2) & (near.reach <= r2))
    return Chosen(places, near.d2[places].astype(np.float64) / float(r2), np.ones(len(places)), radius)


def nearest(near: Near, asked: Neighbours) -> Chosen:
    """The k nearest (`pmviewer.maps.estimate.nearest`)."""
    inside, on_rim, r2, part = _disc(near.reach, asked)
    factor = np.ones(len(inside))
    if part < r2:
        inside = inside[near.reach[inside] < part]
        factor = np.ones(len(inside))
    elif on_rim:
        factor[-1] = asked.rim / 2
    counted = factor > 0
    inside, factor = inside[counted], factor[counted]
    return Chosen(inside, near.reach[inside].astype(np.float64) / float(part), factor, float(np.sqrt(part)))


def nearest_of_parts(
    near: Near, cuts: NDArray[np.int64], asked: Neighbours, combination: Combination, even: bool
) -> Chosen:
    """The k nearest of each part, whose photons' rows are between two of `cuts`, with the factors and the radius by
    which they add up to what `pmviewer.maps.estimate.combined` says. even: whether the kernel is constant."""
    found = []
    for first, end in pairwise(cuts):
        here = np.flatnonzero((near.rows >= first) & (near.rows < end))
        inside, on_rim, whole_r2, used_r2 = _disc(near.reach[here], asked)
        found.append((here[inside], on_rim, float(whole_r2), float(used_r2)))
    area = float(np.mean([part for *_, part in found]))
    rims = sum(on_rim for _, on_rim, _, _ in found)
    within_discs = sum(len(rows) for rows, *_ in found) - rims
    whole = asked.share >= 1
    rim, inner = asked.rim / 2 if whole else 0.0, 1.0
    if combination == "powers and areas":
        kept = 1 - 1 / len(found)
        rim /= len(found)
        if whole and even:
            rim += kept
        elif within_discs:
            inner += kept * rims / within_discs
    places: list[NDArray[np.int64]] = []
    x2: list[NDArray[np.float64]] = []
    factors: list[NDArray[np.float64]] = []
    for rows, on_rim, r2, part in found:
        factor: NDArray[np.float64] = np.full(len(rows), inner)
        if on_rim:
            factor[-1] = rim
        if part < r2:
            factor[near.reach[rows] >= np.float32(part)] = 0
        counted = factor > 0
        places.append(rows[counted])
        x2.append(near.reach[rows[counted]].astype(np.float64) / part)
        factors.append(factor[counted] * (area / part if combination == "irradiances" else 1.0))
    return Chosen(np.concatenate(places), np.concatenate(x2), np.concatenate(factors), float(np.sqrt(area)))


def _disc(reach: NDArray[np.float32], asked: Neighbours) -> tuple[NDArray[np.int64], bool, np.float32, np.float32]:
    """The nearest by ascending `reach`, whether the last of them ends their disc, its squared radius and that of the
    share that is used."""
    bound, least = np.float32(asked.largest) ** 2, np.float32(asked.smallest) ** 2
    inside = np.flatnonzero(reach < bound)[: asked.k]
    on_rim = len(inside) == asked.k
    r2 = max(reach[inside[-1]] if on_rim else bound, least)
    return inside, on_rim, r2, min(max(np.float32(asked.share) * r2, least), r2)
