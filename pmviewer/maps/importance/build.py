"""Building importance maps: the importance at importons from those around each.

The k nearest of an importon include itself, and the farthest ends the disc; both are left out of hull and sum, as are
the hull's corners. That is right in the mean for independent importons: given the disc, the others are spread in it as
importons in any disc are. Importons that lie evenly have one in every cell of the surface: the importon itself counts,
and of the corners EVEN_BOUNDARY each. For lattices that would be a half (Pick's theorem), less two for the whole.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import load_f4, load_u4, stack_get_i8, stack_i4, stack_put_f4
from pmviewer.kernels.vector import basis, normalize
from pmviewer.maps.estimate.hull import (
    DIRECTIONS,
    EDGE,
    FEWEST,
    HULL_WORDS,
    LOWEST,
    SMALLEST_AREA,
    area_of,
    corners_of,
    in_plane,
    keep_farthest,
    share_of,
)
from pmviewer.maps.importance.importance_map import (
    IMPORTON_DTYPE,
    KINDS,
    OF_TWIN,
    ImportanceMap,
    Importons,
    Kind,
    fill_gamma,
    twin_of,
)
from pmviewer.maps.importance.look_up import STEEPNESS
from pmviewer.maps.photon_words import decode_direction
from pmviewer.maps.search.disc import Facing
from pmviewer.maps.search.k_nearest import KEYS, MAX_K, nearest
from pmviewer.maps.search.kdtree import RECORD, build_kdtree
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.tasks import Runner, in_turn

NEIGHBOURS = 200
"""Importons that an estimate averages over: a smooth importance matters more than a sharp one (course guide §3.4.1)."""
SPIKE = 100.0
"""Footprints so many times smaller than the mean are left out (course guide §3.7.1)."""
SHARE = 8
"""One importon in so many has its importance computed."""
EVEN_BOUNDARY = np.float32(0.28)
"""What corners of the hull of evenly spread importons count: measured for scrambled Sobol points in the image, whose
estimates are then right within one percent for 50, 200 and 800 neighbours."""
CLEAR = 8.0
"""A place without an importon in an area where so many are expected is one that nothing looks at (e⁻⁸ by chance)."""
EVEN_CLEAR = 6.0
"""The same for importons that lie evenly: the largest empty disc among 20,000 Owen-scrambled Sobol points has room for
4.6; discs on slanted surfaces are ellipses there."""
WIDEST = 0.25
"""Largest disc relative to the scene's radius, where importons are few."""

LEAVES_A_TASK = 32

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32


@kernel
def _estimate(maps, k, widest, even, first, end, screen, footprint, reach, discs):
    """Both importances at one importon in SHARE of the leaves first … end−1, OF_TWIN at the others; `even` as for
    `build_importance`. screen, footprint, reach, discs: float32 (n,), the last the radii of the discs."""
    tree = maps[0]
    scratch = (stack_i4(KEYS), stack_i4(DIRECTIONS), stack_i4(HULL_WORDS))
    for leaf in range(first, end):
        begin, stop = (tree.n * leaf) >> tree.depth, (tree.n * (leaf + 1)) >> tree.depth
        for i in range(begin, stop):
            screen[i] = OF_TWIN
        for i in range(begin, stop):
            n = normalize(decode_direction(load_u4(tree.payload, 3 * i)))
            if (i - begin) % SHARE != 0 and twin_of(tree, n, screen, begin, i) >= 0:
                continue
            screen[i], footprint[i], reach[i], discs[i] = _importance_of(tree, _i8(i), n, k, widest, even, scratch)


@device
def _importance_of(tree, i, n, k, widest, even, scratch):
    """Screen and footprint importance at importon i with normal n, how far it is used, and the radius of the disc of
    its k nearest. scratch: KEYS, DIRECTIONS and HULL_WORDS words."""
    boundary, clear = (EVEN_BOUNDARY, _f8(EVEN_CLEAR)) if even else (_f4(0.0), _f8(CLEAR))
    keys, _, hull = scratch
    p = (load_f4(tree.x, i), load_f4(tree.y, i), load_f4(tree.z, i))
    count, r2 = nearest(tree, p, k, widest * widest, keys, Facing(n, STEEPNESS, _i4(ALL_CLASSES)))
    rim = _farthest(keys, count) if count == k else _i8(-1)
    r2 = max(r2, tree.smallest_radius * tree.smallest_radius)
    s, t = basis(n)
    corners, area = _spanned(tree, i, rim, p, s, t, count, r2, scratch)
    total, known, inverse, within = _f8(0.0), _f8(0.0), _f8(0.0), _f8(0.0)
    margin = EDGE * _f4(math.sqrt(r2))
    for j in range(count):
        other = stack_get_i8(keys, j) & _i8(0xFFFFFFFF)
        w = _f8(load_f4(tree.weight, other))
        if other == i and even:
            total += w
        elif other != i and other != rim:
            inside = _f4(1.0)
            if corners > 0:
                a, b = in_plane(tree, other, p, s, t)
                inside = share_of(hull, corners, _i4(other), a, b, margin, boundary)
            total += _f8(inside) * w
            within += _f8(inside)
        of_pixel = load_f4(tree.payload, 3 * other + 2)
        if of_pixel > _f4(0.0):
            known += w
            inverse += w * _f8(of_pixel)
    of_footprints = _f4(inverse / known) if known > 0.0 else _f4(0.0)
    reach = _f4(math.sqrt(min(_f8(r2), clear * _f8(area) / (math.pi * max(within, 1.0)))))
    return _f4(total / _f8(area)), of_footprints, reach, _f4(math.sqrt(r2))


@device
def _farthest(keys, count):
    """Place of the farthest of `count` > 0 neighbours."""
    far = _i8(-1)
    for j in range(count):
        far = max(far, stack_get_i8(keys, j))
    return far & _i8(0xFFFFFFFF)


@device
def _spanned(tree, i, rim, p, s, t, count, r2, scratch):
    """Corners and area of the hull of the neighbours of importon i but itself and that on the rim, in the plane through
    p that s and t span; no corners and the area of the disc where they are too few or span next to nothing."""
    keys, farthest, hull = scratch
    for j in range(DIRECTIONS):
        stack_put_f4(farthest, j, LOWEST)
    for j in range(count):
        other = stack_get_i8(keys, j) & _i8(0xFFFFFFFF)
        if other != i and other != rim:
            a, b = in_plane(tree, other, p, s, t)
            keep_farthest(farthest, hull, other, a, b)
    if count >= FEWEST:
        corners = corners_of(hull)
        spanned = area_of(hull, corners)
        if spanned > SMALLEST_AREA * r2:
            return corners, spanned
    return _i8(0), _f4(math.pi) * r2


def _drop_spikes(footprints: NDArray[np.float32]) -> int:
    """Set footprint importances (n,) that are spikes to 0, until the mean of the others calls none of them one; returns
    how many."""
    dropped = 0
    while (known := footprints > 0).any():
        spiky = footprints > SPIKE * footprints[known].mean(dtype=np.float64)
        if not spiky.any():
            break
        dropped += int(spiky.sum())
        footprints[spiky] = 0
    return dropped


def build_importance(
    importons: Importons,
    kind: Kind,
    scene_radius: float,
    neighbours: int = NEIGHBOURS,
    even: bool = False,
    run: Runner = in_turn,
) -> ImportanceMap:
    """The importance map of importons, the same for any number of threads of `run`.

    even: whether they lie evenly on surfaces, as those that come from well distributed places of the image without a
    random choice of direction do; else they are taken for independent ones.

    kind: "screen" Γ_scr, "footprint" Γ_pix·⟨Γ_scr⟩/⟨Γ_pix⟩, or "average", half of the sum of both (course guide
    §3.4.3). Footprints are brought to the mean of the screen importance, ⟨⟩ over importons, in either case, so that one
    M_r fits all: after a diffuse bounce a pixel sees half of the room, and 1/A alone would ask for a photon there.

    Footprints SPIKE times smaller than the mean are left out of Γ_pix. That mean is the harmonic one, that of the
    densities asked for: the arithmetic one belongs to a few grazing paths, and all that is near would be a spike.
    """
    n, k = importons.n, int(min(max(neighbours, 3), MAX_K))
    usable = np.isfinite(importons.footprints) & (importons.footprints > 0)
    footprints = np.where(usable, importons.footprints, np.float32(0))
    spikes = _drop_spikes(footprints)
    photons = np.zeros((n, 6), np.float32)
    photons[:, :3] = importons.positions
    photons.view(np.uint32)[:, 3] = importons.normals
    photons[:, 5] = footprints
    tree = build_kdtree(photons)
    weights = np.ascontiguousarray(importons.weights[tree.index], np.float32)
    reach, discs, screen, footprint = (np.zeros(n, np.float32) for _ in range(4))
    record = np.zeros(1, IMPORTON_DTYPE)
    for name in RECORD.names or ():
        record[name] = tree.record[name]
    record["normals"] = 1
    record["reach"], record["weight"] = reach.ctypes.data, weights.ctypes.data
    widest = np.float32(WIDEST * scene_radius)
    leaves = 1 << int(tree.record["depth"][0]) if n else 0

    def task(first: int) -> Callable[[], None]:
        end = min(first + LEAVES_A_TASK, leaves)
        return lambda: _estimate(record, np.int32(k), widest, even, first, end, screen, footprint, reach, discs)

    run([task(first) for first in range(0, leaves, LEAVES_A_TASK)])
    ratio = 0.0
    if n:
        own = screen >= 0
        typical, of_pixels = float(screen[own].mean(dtype=np.float64)), float(footprint[own].mean(dtype=np.float64))
        ratio = typical / of_pixels if of_pixels > 0 else 0.0
        gamma = tree.payload[:, 1].view(np.float32)
        fill_gamma(record, screen, footprint, reach, gamma, KINDS.index(kind), np.float32(ratio))
        record["farthest"], record["sum_radius"] = reach.max(), np.median(discs[own])
    return ImportanceMap(tree, record, reach, weights, spikes, screen, footprint, ratio)
