"""Importance maps: importons, the importance at each, and look-ups in kernels (I1, I2; course guide §3.4, Christensen).

Importons are to the camera what photons are to the lights: places that the final pass looks at, each with the share Ψ
of the image's pixels that it stands for. The importance Γ at a place says how many pixels look at a unit of area there:

- screen importance: the density of the importance that arrives, ΣΨ/A over the k nearest importons, A being the area
  that they span (`pmviewer.maps.estimate.hull`): a disc over an edge would halve it, just where gather rays need the
  map most; - footprint importance: the mean of 1/A over the same importons, A being the area that one pixel sees there.

Both are in pixels per unit area, and the required density of photons is Γ·M_r/A_pix (`required_density`).

Γ is made at one importon in eight of every leaf of the kd-tree, the others take that of the nearest one that has it. A
look-up is then a search for the nearest importon on the surface's side (Christensen 1999), as far as none would be
missing by chance: what lies in the shadow of the view is not important.

The k nearest of an importon include itself, and the farthest ends the disc; both are left out of hull and sum, as are
the hull's corners. That is right in the mean for independent importons: given the disc, the others are spread in it as
importons in any disc are. Importons that lie evenly have one in every cell of the surface: the importon itself counts,
and of the corners EVEN_BOUNDARY each. For lattices that would be a half (Pick's theorem), less two for the whole.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.memory import float_of_bits, load_f4, load_u4, stack_get_i8, stack_i4, stack_put_f4
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
from pmviewer.maps.record import decode_direction, decode_directions, encode_power
from pmviewer.maps.search.kdtree import KEYS, MAX_K, RECORD, PhotonKdTree, build_kdtree, nearest
from pmviewer.maps.search.stored import ALL_CLASSES

Kind = Literal["screen", "footprint", "average"]
KINDS: tuple[Kind, ...] = ("screen", "footprint", "average")
Runner = Callable[[list[Callable[[], Any]]], list[Any]]

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
FLATNESS = np.float32(0.3)
"""Half-thickness of the discs of importons, relative to their radius."""
WIDEST = 0.25
"""Largest disc relative to the scene's radius, where importons are few."""

IMPORTON_FIELDS: list[tuple[str, Any]] = [
    ("importons", np.int32),  # 1; first, because it tells the record from that of photons
    *[(name, RECORD[name]) for name in RECORD.names or ()],
    ("reach", np.int64),  # float32 (n,): how far the importance at an importon is used
    ("weight", np.int64),  # float32 (n,): Ψ
    ("farthest", np.float32),  # the largest reach
    ("sum_radius", np.float32),  # of `importance_sum`
]
IMPORTON_DTYPE = np.dtype(IMPORTON_FIELDS, align=True)
"""What kernels see of an importance map: a kd-tree whose payload is normal, Γ and footprint importance."""
NO_IMPORTANCE = np.zeros(1, np.dtype([("none", np.int32)]))
"""Stands for an importance map where there is none."""

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32
LEAVES_A_TASK = 32


@dataclass(frozen=True, eq=False)
class Importons:
    """Importons as they were traced: `positions` (n, 3) float32; `normals` (n,) uint32, codes of
    `pmviewer.maps.record.encode_direction` of the surface on the side seen; `weights` (n,) float32, Ψ in pixels;
    `footprints` (n,) float32, importance 1/A of the pixel's footprint A, 0 where it is not known."""

    positions: NDArray[np.float32]
    normals: NDArray[np.uint32]
    weights: NDArray[np.float32]
    footprints: NDArray[np.float32]

    @property
    def n(self) -> int:
        return len(self.weights)

    @property
    def bytes(self) -> int:
        return self.positions.nbytes + self.normals.nbytes + self.weights.nbytes + self.footprints.nbytes

    @staticmethod
    def joined(parts: list[Importons]) -> Importons:
        """All importons of the parts, in order."""
        return Importons(
            np.concatenate([p.positions for p in parts] or [np.empty((0, 3), np.float32)]),
            np.concatenate([p.normals for p in parts] or [np.empty(0, np.uint32)]),
            np.concatenate([p.weights for p in parts] or [np.empty(0, np.float32)]),
            np.concatenate([p.footprints for p in parts] or [np.empty(0, np.float32)]),
        )


@dataclass(frozen=True, eq=False)
class ImportanceMap:
    """An importance map. All arrays are in the order of the tree, which differs from that of the importons it was
    built from; `tree.index` tells their places there. `record` (1,) of IMPORTON_DTYPE is valid while this lives;
    `spikes`: importons whose footprint was left out. `screen` and `footprint` (n,) are both estimates, −1 where an
    importon takes another one's, and `ratio` brings the latter to the mean of the former."""

    tree: PhotonKdTree
    record: NDArray[np.void]
    reach: NDArray[np.float32]
    weights: NDArray[np.float32]
    spikes: int
    screen: NDArray[np.float32]
    footprint: NDArray[np.float32]
    ratio: float

    @property
    def n(self) -> int:
        return self.tree.n

    @property
    def bytes(self) -> int:
        return self.tree.bytes + sum(a.nbytes for a in (self.reach, self.weights, self.screen, self.footprint))

    @property
    def positions(self) -> NDArray[np.float32]:
        """(n, 3) float32, scene units."""
        n = self.n
        return np.stack([self.tree.x[:n], self.tree.y[:n], self.tree.z[:n]], axis=1)

    @property
    def normals(self) -> NDArray[np.float32]:
        """(n, 3) float32 unit normals of the surface on the side seen."""
        return decode_directions(np.ascontiguousarray(self.tree.payload[:, 0]))

    @property
    def gamma(self) -> NDArray[np.float32]:
        """(n,) float32 importance Γ in pixels per unit area."""
        return np.ascontiguousarray(self.tree.payload[:, 1]).view(np.float32)

    def gamma_of(self, kind: Kind) -> NDArray[np.float32]:
        """(n,) float32 importance by one of the estimates or their average, whichever the map uses."""
        made = np.zeros(self.n, np.float32)
        if self.n:
            number = KINDS.index(kind)
            _fill(self.record, self.screen, self.footprint, self.reach, made, number, np.float32(self.ratio))
        return made

    def cloud(self, unit: float | None = None) -> tuple[NDArray[np.float32], float]:
        """The importons as photon records (n, 6) with the normal as direction and the importance as power: red Γ, green
        screen, blue footprint importance; and the power's unit: the mean of Γ unless given."""
        gamma = self.gamma
        if unit is None:
            unit = float(gamma.mean(dtype=np.float64)) if self.n else 0.0
            unit = unit if unit > 0 else 1.0
        rows = np.zeros((self.n, 6), np.float32)
        rows[:, :3] = self.positions
        words = rows.view(np.uint32)
        words[:, 3] = self.tree.payload[:, 0] & 0xFFFFFF00
        codes = np.empty((3, self.n), np.uint32)
        for values, row in zip((gamma, self.gamma_of("screen"), self.gamma_of("footprint")), codes, strict=True):
            _encode(values / np.float32(unit), row)
        words[:, 4], words[:, 5] = codes[0] | codes[1] << 16, codes[2]
        return rows, unit


def required_density(gamma: Any, M_r: float, pixel_area: float = 1.0) -> Any:
    """Photons per unit area that importance Γ asks for: Γ·M_r/A_pix (course guide, eq. 3.2).

    gamma: number or array, in pixels per unit area; M_r: photons wanted per pixel; pixel_area: that of a pixel in the
    units of the importance emitted, 1 for importons of `pmviewer.importance`.
    """
    return gamma * (M_r / pixel_area)


# --- look-up ----------------------------------------------------------------------------------------------------------


@device
def _nearest_importon(importance, p, n):
    """Place in the tree of the nearest importon on the side of the normal n, and its squared distance; −1 without."""
    keys = stack_i4(KEYS)
    r = importance.farthest
    steepness = _f4(1.0) / (FLATNESS * FLATNESS)
    count, _ = nearest(
        importance, p[0], p[1], p[2], _i4(1), r * r, keys, True, n[0], n[1], n[2], steepness, _i4(ALL_CLASSES)
    )
    if count == 0:
        return _i8(-1), _f4(0.0)
    key = stack_get_i8(keys, _i8(0))
    return key & _i8(0xFFFFFFFF), float_of_bits(_u4(key >> 32))


@specialised
def importance_at(importance, p, n):
    """Importance Γ (float32, pixels per unit area) at the point p with unit normal n, for the normal's side.

    That of the nearest importon on this side, 0 beyond its reach: where nothing looks. `importance` is the record of
    an ImportanceMap, or that of NO_IMPORTANCE, which makes everything equally important (1).
    """
    if has(importance, "none"):
        return lambda importance, p, n: _f4(1.0)

    def at(importance, p, n):
        i, d2 = _nearest_importon(importance, p, n)
        if i < 0:
            return _f4(0.0)
        reach = load_f4(importance.reach, i)
        return load_f4(importance.payload, 3 * i + 1) if d2 <= reach * reach else _f4(0.0)

    return at


@specialised
def importance_sum(importance, p, n, k):
    """ΣW (float32, pixels): importance of the k nearest importons within `sum_radius` of the point p, on the side of
    its unit normal n, for the probability of depositing a photon (Keller and Wald §2.2). k: int32, 1 … MAX_K.

    1 for the record of NO_IMPORTANCE.
    """
    if has(importance, "none"):
        return lambda importance, p, n, k: _f4(1.0)

    def summed(importance, p, n, k):
        keys = stack_i4(KEYS)
        r = importance.sum_radius
        steepness = _f4(1.0) / (FLATNESS * FLATNESS)
        count, _ = nearest(
            importance, p[0], p[1], p[2], k, r * r, keys, True, n[0], n[1], n[2], steepness, _i4(ALL_CLASSES)
        )
        total = _f8(0.0)
        for j in range(count):
            total += _f8(load_f4(importance.weight, stack_get_i8(keys, j) & _i8(0xFFFFFFFF)))
        return _f4(total)

    return summed


@kernel
def importances(maps, points, normals, out, i0, i1):
    """Γ at points[i0:i1] (m, 3) float32 with unit normals (m, 3), into out (m,) float32."""
    importance = maps[0]
    for i in range(i0, i1):
        p = (points[i, 0], points[i, 1], points[i, 2])
        out[i] = importance_at(importance, p, (normals[i, 0], normals[i, 1], normals[i, 2]))


@kernel
def nearest_importances(maps, points, gamma, distances, i0, i1):
    """Γ of the importons nearest to points[i0:i1] (m, 3) float32, whatever their side and reach, into gamma (m,)
    float32, and how far they are into distances (m,) float32; 0 and infinite without any."""
    importance = maps[0]
    keys, zero = stack_i4(KEYS), _f4(0.0)
    for i in range(i0, i1):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        count, _ = nearest(
            importance, x, y, z, _i4(1), _f4(np.inf), keys, False, zero, zero, zero, zero, _i4(ALL_CLASSES)
        )
        gamma[i], distances[i] = zero, _f4(np.inf)
        if count > 0:
            key = stack_get_i8(keys, _i8(0))
            gamma[i] = load_f4(importance.payload, 3 * (key & _i8(0xFFFFFFFF)) + 1)
            distances[i] = _f4(math.sqrt(float_of_bits(_u4(key >> 32))))


@kernel
def importance_sums(maps, points, normals, k, out, i0, i1):
    """ΣW of `importance_sum` at points[i0:i1] (m, 3) float32 with unit normals (m, 3), into out (m,) float32."""
    importance = maps[0]
    for i in range(i0, i1):
        p = (points[i, 0], points[i, 1], points[i, 2])
        out[i] = importance_sum(importance, p, (normals[i, 0], normals[i, 1], normals[i, 2]), _i4(k))


@kernel
def _encode(values, codes):
    for i in range(len(values)):
        codes[i] = encode_power(values[i])


# --- construction -----------------------------------------------------------------------------------------------------


@kernel
def _estimate(maps, k, widest, even, first, end, screen, footprint, reach, discs):
    """Both importances at one importon in SHARE of the leaves first … end−1, −1 at the others; `even` as for
    `build_importance`."""
    boundary, clear = (EVEN_BOUNDARY, _f8(EVEN_CLEAR)) if even else (_f4(0.0), _f8(CLEAR))
    tree = maps[0]
    keys, farthest, hull = stack_i4(KEYS), stack_i4(DIRECTIONS), stack_i4(HULL_WORDS)
    steepness = _f4(1.0) / (FLATNESS * FLATNESS)
    for leaf in range(first, end):
        begin, stop = (tree.n * leaf) >> tree.depth, (tree.n * (leaf + 1)) >> tree.depth
        for i in range(begin, stop):
            screen[i] = _f4(-1.0)
        for i in range(begin, stop):
            n = normalize(decode_direction(load_u4(tree.payload, 3 * i)))
            if (i - begin) % SHARE != 0 and _twin(tree, n, screen, begin, i) >= 0:
                continue
            x, y, z = load_f4(tree.x, i), load_f4(tree.y, i), load_f4(tree.z, i)
            count, r2 = nearest(
                tree, x, y, z, k, widest * widest, keys, True, n[0], n[1], n[2], steepness, _i4(ALL_CLASSES)
            )
            rim, far = _i8(-1), _i8(-1)
            if count == k:
                for j in range(count):
                    if stack_get_i8(keys, j) > far:
                        far = stack_get_i8(keys, j)
                        rim = far & _i8(0xFFFFFFFF)
            r2 = max(r2, tree.smallest_radius * tree.smallest_radius)
            total, known, inverse, within = _f8(0.0), _f8(0.0), _f8(0.0), _f8(0.0)
            p = (x, y, z)
            s, t = basis(n)
            for j in range(DIRECTIONS):
                stack_put_f4(farthest, j, LOWEST)
            for j in range(count):
                other = stack_get_i8(keys, j) & _i8(0xFFFFFFFF)
                if other != i and other != rim:
                    a, b = in_plane(tree, other, p, s, t)
                    keep_farthest(farthest, hull, other, a, b)
            area, corners = _f4(math.pi) * r2, _i8(0)
            if count >= FEWEST:
                corners = corners_of(hull)
                spanned = area_of(hull, corners)
                if spanned > SMALLEST_AREA * r2:
                    area = spanned
                else:
                    corners = _i8(0)
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
            screen[i] = _f4(total / _f8(area))
            footprint[i] = _f4(inverse / known) if known > 0.0 else _f4(0.0)
            discs[i] = _f4(math.sqrt(r2))
            reach[i] = _f4(math.sqrt(min(_f8(r2), clear * _f8(area) / (math.pi * max(within, 1.0)))))


@device
def _twin(tree, n, screen, begin, end):
    """The nearest of importons begin … end−1 to importon `end` that has its importance and a similar normal n; −1
    without."""
    x, y, z = load_f4(tree.x, end), load_f4(tree.y, end), load_f4(tree.z, end)
    best, least = _i8(-1), _f4(np.inf)
    for i in range(begin, end):
        if screen[i] < _f4(0.0):
            continue
        m = normalize(decode_direction(load_u4(tree.payload, 3 * i)))
        if m[0] * n[0] + m[1] * n[1] + m[2] * n[2] > _f4(0.9):
            dx, dy, dz = load_f4(tree.x, i) - x, load_f4(tree.y, i) - y, load_f4(tree.z, i) - z
            d2 = dx * dx + dy * dy + dz * dz
            if d2 < least:
                least, best = d2, _i8(i)
    return best


@kernel
def _fill(maps, screen, footprint, reach, gamma, kind, ratio):
    """Γ of all importons from the two estimates; those without one take the nearest one's of their leaf."""
    tree = maps[0]
    for leaf in range(_i8(1) << tree.depth):
        begin, stop = (tree.n * leaf) >> tree.depth, (tree.n * (leaf + 1)) >> tree.depth
        for i in range(begin, stop):
            j = _i8(i)
            if screen[i] < _f4(0.0):
                n = normalize(decode_direction(load_u4(tree.payload, 3 * i)))
                j = _twin(tree, n, screen, begin, i)
                reach[i] = reach[j]
            if kind == 0:
                gamma[i] = screen[j]
            elif kind == 1:
                gamma[i] = ratio * footprint[j]
            else:
                gamma[i] = _f4(0.5) * (screen[j] + ratio * footprint[j])


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


def _in_turn(tasks: list[Callable[[], Any]]) -> list[Any]:
    return [task() for task in tasks]


def build_importance(
    importons: Importons,
    kind: Kind,
    scene_radius: float,
    neighbours: int = NEIGHBOURS,
    even: bool = False,
    run: Runner = _in_turn,
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
    record["importons"] = 1
    record["reach"], record["weight"] = reach.ctypes.data, weights.ctypes.data
    widest = np.float32(WIDEST * scene_radius)
    leaves = 1 << int(tree.record["depth"][0]) if n else 0

    def task(first: int) -> Callable[[], None]:
        end = min(first + LEAVES_A_TASK, leaves)
        return lambda: _estimate(record, np.int32(k), widest, even, first, end, screen, footprint, reach, discs)

    run([task(first) for first in range(0, leaves, LEAVES_A_TASK)])
    ratio = 0.0
    if n:
        made = screen >= 0
        typical, of_pixels = float(screen[made].mean(dtype=np.float64)), float(footprint[made].mean(dtype=np.float64))
        ratio = typical / of_pixels if of_pixels > 0 else 0.0
        gamma = tree.payload[:, 1].view(np.float32)
        _fill(record, screen, footprint, reach, gamma, KINDS.index(kind), np.float32(ratio))
        record["farthest"], record["sum_radius"] = reach.max(), np.median(discs[made])
    return ImportanceMap(tree, record, reach, weights, spikes, screen, footprint, ratio)
