"""The photons of a look-up by looking at every photon of the map: the naive twin of the searches in `maps/search`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.record import decode_directions

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
        counts &= front
    return Near((first + here[counts]).astype(np.int64), d2[counts], reach[counts], front[counts])


def within(near: Near, radius: float) -> Chosen:
    """All that the disc of that radius holds."""
    r2 = np.float32(radius) * np.float32(radius)
    places = np.flatnonzero((near.d2 < r2) & (near.reach <= r2))
    return Chosen(places, near.d2[places].astype(np.float64) / float(r2), np.ones(len(places)), radius)


def nearest(near: Near, k: int, largest: float, share: float, rim: int, smallest: float) -> Chosen:
    """The k nearest within `largest`, in the `share` of their disc's area; the farthest counts rim/2 where the disc is
    entire (`pmviewer.maps.estimate.nearest`). Radii in scene units."""
    bound, least = np.float32(largest) ** 2, np.float32(smallest) ** 2
    inside = np.flatnonzero(near.reach < bound)[:k]
    r2, factor = bound, np.ones(len(inside))
    if len(inside) == k:
        r2 = near.reach[inside[-1]]
        factor[-1] = rim / 2
    r2 = max(r2, least)
    part = max(np.float32(share) * r2, least)
    if part < r2:
        inside = inside[near.reach[inside] < part]
        r2, factor = part, np.ones(len(inside))
    counted = factor > 0
    inside, factor = inside[counted], factor[counted]
    return Chosen(inside, near.reach[inside].astype(np.float64) / float(r2), factor, float(np.sqrt(r2)))
