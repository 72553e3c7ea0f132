"""Density control: photons are stored up to a required density; the power of all others goes to their neighbours (I5;
Suykens and Willems 2000, §3.1; course guide §3.5.2).

A photon at x looks for the M nearest stored ones. With r_M the distance of the farthest, the density is
D_cur = M/(π·r_M²); while fewer than M are stored, it is 0. By ρ = D_cur/D_r the photon is stored or not: by the step if
ρ < 1, by the translated cosine with the probability ½(1 + cos(π·ρ/2)) below ρ = 2 and never beyond. If not, each of the
M' ≤ M neighbours that arrived on its side of the surface gets Φ/M', and the sum of all powers stays; with M' = 0 the
photon is stored after all.

Which stored photons are neighbours is said by `Around`: the M nearest in space (NEAREST, the source's), or with guards
against power that goes through thin walls or into places that matter more.

The density comes to rest above D_r: photons that fall into a gap that chance left are still stored. Where 10 to 400
arrive for one that is stored that is at about 1.3·D_r with the step and 2.2·D_r with the cosine.

**Order and threads.** Photons come in rounds. All of a round are first compared with what was stored before it, on any
number of threads: a photon that is not stored for these neighbours would not be stored with more of them either, so
that this decides. The rest is decided in order, each seeing all before it. The stored set is thus that of one photon
after another, whatever the rounds (but for a photon whose M nearest become such of the other side alone within its
round); of rounds only the neighbours that share a rejected photon's power know.

**The tree** is a kd-tree that grows: leaves of CAPACITY photons, split at the median of their longer side when full.
Powers are float64 sums; they become 16-bit codes when everything is stored (`pmviewer.maps.power`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.kernels.vector import normalize
from pmviewer.maps.record import decode_direction, decode_power

Runner = Callable[[list[Callable[[], Any]]], list[Any]]

M = 20
"""Neighbours that measure the density and share the power of a rejected photon."""
FLATNESS = np.float32(0.2)
"""Half-thickness of guarded discs relative to their radius, that of look-ups."""

CAPACITY = 16
CHUNK = 4096
"""Photons a task."""
_DEEPEST = 250
"""Subtrees that wait in a search; a tree that is deeper is searched in part."""

STEP, COSINE = 0, 1
ACCEPTANCE = ("step", "cosine")

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32
_PI = _f8(np.pi)
UNDECIDED = _i4(-1)


@dataclass(frozen=True)
class Around:
    """Which stored photons are neighbours of a place.

    guarded: only those that arrived on the place's side of the surface and lie in a disc along it, as look-ups count
    them; otherwise all, in a sphere. `contrast`: none that need more than so many times the density needed at the
    place: where important and unimportant surfaces meet, power would seep into the important ones.
    """

    guarded: bool = False
    contrast: float = math.inf

    @property
    def arguments(self) -> tuple[np.float32, ...]:
        """For kernels: weight of the squared height over the surface, what cosines exceed, and contrast."""
        steepness, least = (1 / FLATNESS**2, 0.0) if self.guarded else (0.0, -math.inf)
        return tuple(np.float32(x) for x in (steepness, least, self.contrast))


NEAREST = Around()
"""The source's: the M nearest in space."""


# In kernels a tree is a tuple of arrays: of nodes, axes int8 (−1: a leaf), planes float32, children int32 (the left
# one, the right one follows; of a leaf its number) and least float32 (no photon of the subtree needs less); of leaves,
# counts int32, members int32 (leaves, CAPACITY) and places float32 (leaves, CAPACITY, 3); of photons, words uint32
# (direction and flags) and needs float32 (required density).


@device
def _search(tree, p, n, need, around, r2, found, distances, stack_nodes, stack_bounds):
    """Up to M nearest neighbours of p with normal n, closer than sqrt(r2); their numbers into `found`, squared
    distances into `distances`. Returns their number and the squared distance of the farthest."""
    axes, planes, children, least, counts, members, places, words, needs = tree
    steepness, cosine, contrast = around
    ceiling = contrast * need
    count = _i8(0)
    farthest = _i8(0)
    waiting = _i8(0)
    node = _i8(0)
    while True:
        while axes[node] >= 0:
            side = p[_i8(axes[node])] - planes[node]
            near = _i8(children[node]) + _i8(side >= _f4(0.0))
            other = _i8(2) * _i8(children[node]) + _i8(1) - near
            if side * side < r2 and least[other] <= ceiling and waiting < _DEEPEST:
                stack_nodes[waiting] = other
                stack_bounds[waiting] = side * side
                waiting += 1
            node = near
        leaf = _i8(children[node])
        for j in range(_i8(counts[leaf]) if least[node] <= ceiling else 0):
            dx, dy, dz = places[leaf, j, 0] - p[0], places[leaf, j, 1] - p[1], places[leaf, j, 2] - p[2]
            h = n[0] * dx + n[1] * dy + n[2] * dz
            d2 = max(dx * dx + dy * dy + dz * dz, steepness * h * h)
            if d2 < r2:
                i = members[leaf, j]
                w = decode_direction(words[i])
                if n[0] * w[0] + n[1] * w[1] + n[2] * w[2] > cosine and needs[i] <= ceiling:
                    if count < M:
                        found[count], distances[count] = i, d2
                        if d2 > distances[farthest]:
                            farthest = count
                        count += 1
                    else:
                        found[farthest], distances[farthest] = i, d2
                        for k in range(count):
                            if distances[k] > distances[farthest]:
                                farthest = _i8(k)
                    if count == M:
                        r2 = distances[farthest]
        node = _i8(-1)
        while waiting > 0 and node < 0:
            waiting -= 1
            if stack_bounds[waiting] < r2:
                node = stack_nodes[waiting]
        if node < 0:
            break
    if count == 0:
        return count, _f4(0.0)
    return count, distances[farthest]


@device
def _rejected(density, need, rule, u):
    """Whether a photon is not stored at D_cur, where `need` is D_r; u: a random number."""
    rho = density / _f8(need)
    if rule == STEP:
        return not rho < _f8(1.0)
    return not (rho < _f8(2.0) and _f8(u) < _f8(0.5) * (_f8(1.0) + np.cos(_PI * rho * _f8(0.5))))


@device
def _sharers(tree, p, n, need, around, rule, u, found, distances, stack_nodes, stack_bounds):
    """How many stored photons share the power of a photon at p, in `found`; 0 where it is stored itself."""
    r2 = _f4(np.inf)
    if rule == STEP:  # M of them nearer than the disc of M at the required density
        r2 = _f4(_f8(M) / (_PI * _f8(need)))
    count, r2 = _search(tree, p, n, need, around, r2, found, distances, stack_nodes, stack_bounds)
    if count < M:
        return _i8(0)
    if r2 > _f4(0.0) and not _rejected(_f8(M) / (_PI * _f8(r2)), need, rule, u):
        return _i8(0)
    sharing = _i8(0)
    for j in range(count):
        w = decode_direction(tree[7][found[j]])
        if n[0] * w[0] + n[1] * w[1] + n[2] * w[2] > _f4(0.0):
            found[sharing] = found[j]
            sharing += 1
    return sharing


@device
def _random(seed, index):
    return unit_float(hash3(seed, _u4(index), _u4(index >> 32)))


@kernel
def _compare(tree, around, photons, normals, required, rule, seed, first, i0, i1, counts, neighbours):
    """Photons i0 … i1−1 against the tree as it is: counts[i] neighbours that share the power of photon i, which is not
    stored, or UNDECIDED."""
    found, distances = np.empty(M, np.int32), np.empty(M, np.float32)
    stack_nodes, stack_bounds = np.empty(_DEEPEST, np.int64), np.empty(_DEEPEST, np.float32)
    for i in range(i0, i1):
        p = (photons[i, 0], photons[i, 1], photons[i, 2])
        n = normalize(decode_direction(normals[i]))
        u = _random(seed, _i8(first) + _i8(i))
        count = _sharers(tree, p, n, required[i], around, rule, u, found, distances, stack_nodes, stack_bounds)
        counts[i] = count if count > 0 else UNDECIDED
        for j in range(count):
            neighbours[i, j] = found[j]


@device
def _insert(tree, size, p, i):
    """Put photon i into its leaf; size: (nodes, leaves, _) of the tree, grows by a split."""
    need = tree[8][i]
    axes, planes, children, least, counts, members, places, _, _ = tree
    node = _i8(0)
    while True:
        while axes[node] >= 0:
            least[node] = min(least[node], need)
            node = _i8(children[node]) + _i8(p[_i8(axes[node])] >= planes[node])
        leaf = _i8(children[node])
        if counts[leaf] < CAPACITY:
            least[node] = min(least[node], need) if counts[leaf] > 0 else need
            j = _i8(counts[leaf])
            members[leaf, j] = i
            places[leaf, j, 0], places[leaf, j, 1], places[leaf, j, 2] = p
            counts[leaf] += _i4(1)
            return
        _halve(tree, size, node)


@device
def _halve(tree, size, node):
    """Split a full leaf at the median of its longest side."""
    axes, planes, children, least, counts, members, places, _, needs = tree
    leaf = _i8(children[node])
    axis, extent = _i8(0), _f4(-1.0)
    for a in range(3):
        low, high = places[leaf, 0, a], places[leaf, 0, a]
        for j in range(1, CAPACITY):
            low, high = min(low, places[leaf, j, a]), max(high, places[leaf, j, a])
        if high - low > extent:
            axis, extent = _i8(a), high - low
    for j in range(1, CAPACITY):  # insertion sort along the axis
        k = _i8(j)
        while k > 0 and places[leaf, k - 1, axis] > places[leaf, k, axis]:
            for a in range(3):
                x = places[leaf, k, a]
                places[leaf, k, a] = places[leaf, k - 1, a]
                places[leaf, k - 1, a] = x
            x = members[leaf, k]
            members[leaf, k] = members[leaf, k - 1]
            members[leaf, k - 1] = x
            k -= 1
    half = CAPACITY // 2
    new = _i8(size[1])
    size[1] += 1
    for j in range(half, CAPACITY):
        members[new, j - half] = members[leaf, j]
        for a in range(3):
            places[new, j - half, a] = places[leaf, j, a]
    counts[leaf], counts[new] = _i4(half), _i4(CAPACITY - half)
    left = _i8(size[0])
    size[0] += 2
    least[left], least[left + 1] = _f4(np.inf), _f4(np.inf)
    for j in range(half):
        least[left] = min(least[left], needs[members[leaf, j]])
    for j in range(CAPACITY - half):
        least[left + 1] = min(least[left + 1], needs[members[new, j]])
    axes[left], axes[left + 1] = np.int8(-1), np.int8(-1)
    children[left], children[left + 1] = _i4(leaf), _i4(new)
    axes[node], planes[node], children[node] = np.int8(axis), places[new, 0, axis], _i4(left)


@kernel
def _settle(
    tree, around, size, stored, powers, photons, words, normals, required, rule, seed, first, counts, neighbours, kept
):
    """Decide the photons that `_compare` left open, in order, and hand out the power of the others.

    stored: (capacity, 6) uint32 rows of the photons stored, in order; powers: float64 (capacity, 3); size: int64 (3,),
    nodes, leaves and photons stored; kept: bool, receives which of these are stored. Returns how many were rejected.
    """
    own_words, own_needs = tree[7], tree[8]
    found, distances = np.empty(M, np.int32), np.empty(M, np.float32)
    stack_nodes, stack_bounds = np.empty(_DEEPEST, np.int64), np.empty(_DEEPEST, np.float32)
    rejected = _i8(0)
    for i in range(len(photons)):
        red = _f8(decode_power(words[i, 4] & _u4(0xFFFF)))
        green = _f8(decode_power(words[i, 4] >> _u4(16)))
        blue = _f8(decode_power(words[i, 5] & _u4(0xFFFF)))
        count = _i8(counts[i])
        if count != UNDECIDED:
            for j in range(count):
                found[j] = neighbours[i, j]
        else:
            p = (photons[i, 0], photons[i, 1], photons[i, 2])
            n = normalize(decode_direction(normals[i]))
            u = _random(seed, _i8(first) + _i8(i))
            count = _sharers(tree, p, n, required[i], around, rule, u, found, distances, stack_nodes, stack_bounds)
            if count == 0:
                new = size[2]
                for w in range(6):
                    stored[new, w] = words[i, w]
                own_words[new], own_needs[new] = words[i, 3], required[i]
                powers[new, 0], powers[new, 1], powers[new, 2] = red, green, blue
                _insert(tree, size, p, _i4(new))
                size[2] += 1
                kept[i] = True
                continue
        kept[i] = False
        rejected += 1
        share = _f8(1.0) / _f8(count)
        for j in range(count):
            k = found[j]
            powers[k, 0] += red * share
            powers[k, 1] += green * share
            powers[k, 2] += blue * share
    return rejected


def needs_of(required: NDArray[np.float32]) -> NDArray[np.float32]:
    """Required densities (n,) that can be divided by: what is not a number, or not positive, counts as next to none."""
    return np.clip(np.nan_to_num(required, nan=0.0, posinf=1e30), 1e-30, 1e30, dtype=np.float32)


# --- the map being filled -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Controlled:
    """What density control made of a map's photons: `photons` (n, 6) float32 as in `pmviewer.maps.record`, whose power
    words are to be replaced by those of `powers` (n, 3) float64 in units of the map's power; `normals` (n,) codes;
    `required` (n,) float32 required densities; `redistributed` photons that are not stored."""

    photons: NDArray[np.float32]
    normals: NDArray[np.uint32]
    powers: NDArray[np.float64]
    required: NDArray[np.float32]
    redistributed: int


class DensityControl:
    """A map that is filled round by round. The result depends on the photons and their order, on the rounds hardly
    (see above), and not at all on threads."""

    def __init__(self, rule: int, around: Around, seed: int) -> None:
        """rule: STEP or COSINE."""
        self.rule, self.seed = np.int32(rule), np.uint32(seed & 0xFFFFFFFF)
        self.around = around.arguments
        self.size = np.array([1, 1, 0], np.int64)
        self.arrived = self.redistributed = 0
        self.kept = np.zeros(0, bool)
        """Which photons of the latest round are stored."""
        self._stored = np.empty((0, 6), np.uint32)
        self._normals: list[NDArray[np.uint32]] = []
        self._powers = np.empty((0, 3), np.float64)
        self._tree: tuple[NDArray[Any], ...] = ()

    @property
    def stored(self) -> int:
        return int(self.size[2])

    def add(
        self, photons: NDArray[np.float32], normals: NDArray[np.uint32], required: NDArray[np.float32], run: Runner
    ) -> None:
        """One round: photons (n, 6) with normal codes (n,) and the densities required at them (n,), in photons per unit
        area; what is not a number counts as 0."""
        n = len(photons)
        self.kept = kept = np.zeros(n, bool)
        if n == 0:
            return
        photons = np.ascontiguousarray(photons, np.float32)
        words = photons.view(np.uint32)
        needs = needs_of(required)
        counts = np.full(n, UNDECIDED, np.int32)
        self._reserve(self.stored + n)
        neighbours = np.empty((n, M), np.int32)
        first = np.int64(self.arrived)

        def compare(i0: int) -> Callable[[], None]:
            i1 = min(i0 + CHUNK, n)
            how = self.rule, self.seed, first
            return lambda: _compare(self._tree, self.around, photons, normals, needs, *how, i0, i1, counts, neighbours)

        if self.stored:
            run([compare(i0) for i0 in range(0, n, CHUNK)])
        before = self.stored
        rows = self._stored, self._powers
        settle = run(
            [
                lambda: _settle(
                    self._tree,
                    self.around,
                    self.size,
                    *rows,
                    photons,
                    words,
                    normals,
                    needs,
                    self.rule,
                    self.seed,
                    first,
                    counts,
                    neighbours,
                    kept,
                )
            ]
        )
        self.redistributed += settle[0]
        self.arrived += n
        self._normals.append(normals[kept])
        assert self.stored - before == int(kept.sum())

    def result(self) -> Controlled:
        """The map as it stands; the arrays are this object's own."""
        n = self.stored
        return Controlled(
            photons=self._stored[:n].view(np.float32),
            normals=np.concatenate([np.empty(0, np.uint32), *self._normals]),
            powers=self._powers[:n],
            required=self._tree[8][:n] if n else np.empty(0, np.float32),
            redistributed=self.redistributed,
        )

    def _reserve(self, photons: int) -> None:
        """Room for so many photons, with a half more, so that copying stays rare."""
        have = len(self._stored)
        if photons <= have:
            return
        photons = max(photons, have + have // 2)
        leaves = 2 + photons // (CAPACITY // 2)  # halves of a split leaf are never emptier than this
        axes, planes, children, least, counts, members, places, words, needs = self._tree or (
            np.full(1, -1, np.int8),
            np.zeros(1, np.float32),
            np.zeros(1, np.int32),
            np.zeros(1, np.float32),
            np.zeros(1, np.int32),
            np.zeros((1, CAPACITY), np.int32),
            np.zeros((1, CAPACITY, 3), np.float32),
            np.zeros(0, np.uint32),
            np.zeros(0, np.float32),
        )
        nodes = 2 * leaves
        self._tree = (
            *(_grown(a, nodes) for a in (axes, planes, children, least)),
            *(_grown(a, leaves) for a in (counts, members, places)),
            *(_grown(a, photons) for a in (words, needs)),
        )
        self._stored, self._powers = _grown(self._stored, photons), _grown(self._powers, photons)


def _grown(array: NDArray[Any], n: int) -> NDArray[Any]:
    """A copy with n rows, zero beyond the old ones."""
    made = np.zeros((n, *array.shape[1:]), array.dtype)
    made[: len(array)] = array
    return made
