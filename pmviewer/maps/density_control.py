"""Density control: photons are stored up to a required density; the power of all others goes to their neighbours (I5;
Suykens and Willems 2000; course guide §3.5.2).

A photon at x looks for the M nearest stored ones that a look-up there would count: those that arrived on its side of
the surface, in a flattened disc. With r_M the distance of the farthest, the density is D_cur = M/(π·r_M²). By ρ =
D_cur/D_r the photon is stored or not; if not, each of the M' ≤ M neighbours found gets Φ/M', and the sum of all powers
stays. Without neighbours it is stored.

Neighbours that need more than CONTRAST times the density that x needs don't count at all: where important and
unimportant surfaces meet, or a thin wall parts them, power would seep into the important ones.

**Order and threads.** Photons come in rounds. All of a round are first compared with what was stored before it, on any
number of threads: a photon that is not stored for these neighbours would not be stored with more of them either, so
that this decides. The rest is decided in order, each seeing all before it. The stored set is thus exactly that of one
photon after another, whatever the rounds; of rounds only the neighbours that share a rejected photon's power know.

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

from pmviewer.kernels.jit import device, kernel
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.kernels.vector import normalize
from pmviewer.maps.record import decode_direction, decode_power

Runner = Callable[[list[Callable[[], Any]]], list[Any]]

M = 20
"""Neighbours that measure the density and share the power of a rejected photon."""
SETTLES = (1.33, 2.2)
"""Where the densities of the two rules come to rest, relative to D_r in ρ: a photon is still stored where chance left a
gap between others, with the cosine up to ρ = 2. Thresholds are lowered by as much, so that the density settles at D_r
(measured where 10 to 400 photons arrive for one that is stored: within 4 % with the step, 10 % with the cosine)."""
FLATNESS = np.float32(0.2)
"""Half-thickness of the discs relative to their radius, that of look-ups."""
CONTRAST = np.float32(4.0)
"""Neighbours that need so many times the density needed here are of no concern."""
SPARSEST = 10.0
"""Area of the disc searched with the cosine, relative to that of M photons at the required density: of photons that
come to a tenth of it, 98 % are stored."""

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


# In kernels a tree is a tuple of arrays: of nodes, axes int8 (−1: a leaf), planes float32, children int32 (the left
# one, the right one follows; of a leaf its number) and least float32 (no photon of the subtree needs less); of leaves,
# counts int32, members int32 (leaves, CAPACITY) and places float32 (leaves, CAPACITY, 3); of photons, words uint32
# (direction and flags) and needs float32 (required density).


@device
def _search(tree, p, n, need, r2, most, found, distances, stack_nodes, stack_bounds):
    """Up to `most` nearest stored photons that count at p with normal n, closer than sqrt(r2); their numbers into
    `found`, squared distances into `distances`. Returns their number and the squared distance of the farthest."""
    axes, planes, children, least, counts, members, places, words, needs = tree
    steepness = _f4(1.0) / (FLATNESS * FLATNESS)
    ceiling = CONTRAST * need
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
                if n[0] * w[0] + n[1] * w[1] + n[2] * w[2] > _f4(0.0) and needs[i] <= ceiling:
                    if count < most:
                        found[count], distances[count] = i, d2
                        if d2 > distances[farthest]:
                            farthest = count
                        count += 1
                    else:
                        found[farthest], distances[farthest] = i, d2
                        for k in range(count):
                            if distances[k] > distances[farthest]:
                                farthest = _i8(k)
                    if count == most:
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
def _rejected(count, r2, reach2, need, rule, u):
    """Whether a photon with that many neighbours, the farthest at sqrt(r2), is not stored. More neighbours never turn a
    rejected photon into a stored one."""
    if count == 0:
        return False
    if rule == STEP:
        return count == M  # M of them nearer than the disc of M at the required density
    area = _PI * _f8(r2 if count == M else reach2)
    rho = _f8(count) / (area * _f8(need))
    if not rho < _f8(2.0):
        return True
    return not _f8(u) < _f8(0.5) * (_f8(1.0) + np.cos(_PI * rho * _f8(0.5)))


@device
def _reach2(need, rule):
    """Squared radius of the disc searched at a required density."""
    wanted = _f8(M) / (_PI * _f8(need))
    if rule == COSINE:
        wanted *= _f8(SPARSEST)
    return _f4(wanted)


@device
def _random(seed, index):
    return unit_float(hash3(seed, _u4(index), _u4(index >> 32)))


@kernel
def _compare(tree, photons, words, normals, required, rule, seed, first, i0, i1, counts, neighbours):
    """Photons i0 … i1−1 against the tree as it is: counts[i] neighbours that share the power of photon i, which is not
    stored, or UNDECIDED."""
    found, distances = np.empty(M, np.int32), np.empty(M, np.float32)
    stack_nodes, stack_bounds = np.empty(_DEEPEST, np.int64), np.empty(_DEEPEST, np.float32)
    for i in range(i0, i1):
        p = (photons[i, 0], photons[i, 1], photons[i, 2])
        n = normalize(decode_direction(normals[i]))
        reach2 = _reach2(required[i], rule)
        count, r2 = _search(tree, p, n, required[i], reach2, M, found, distances, stack_nodes, stack_bounds)
        counts[i] = UNDECIDED
        if _rejected(count, r2, reach2, required[i], rule, _random(seed, _i8(first) + _i8(i))):
            counts[i] = count
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
def _settle(tree, size, stored, powers, photons, words, normals, required, rule, seed, first, counts, neighbours, kept):
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
            reach2 = _reach2(required[i], rule)
            count, r2 = _search(tree, p, n, required[i], reach2, M, found, distances, stack_nodes, stack_bounds)
            if not _rejected(count, r2, reach2, required[i], rule, _random(seed, _i8(first) + _i8(i))):
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


def needs_of(required: NDArray[np.float32], rule: int, farthest: float) -> NDArray[np.float32]:
    """Density (n,) at which storing stops where `required` (n,) are to be reached; `rule` and `farthest` as for
    DensityControl."""
    least = np.float32(M / (math.pi * farthest**2))
    needs = np.where(np.isnan(required), np.float32(0), required) / np.float32(SETTLES[rule])
    return np.clip(needs, least, np.float32(1e30), dtype=np.float32)


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

    def __init__(self, rule: int, farthest: float, seed: int) -> None:
        """rule: STEP or COSINE; farthest: no photon's power moves farther than this (sqrt(SPARSEST) times that with the
        cosine), in scene units: where less than M photons in such a disc are required, so many are stored."""
        self.rule, self.seed = np.int32(rule), np.uint32(seed & 0xFFFFFFFF)
        self.farthest = farthest
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
        needs = needs_of(required, int(self.rule), self.farthest)
        counts = np.full(n, UNDECIDED, np.int32)
        self._reserve(self.stored + n)
        neighbours = np.empty((n, M), np.int32)
        first = np.int64(self.arrived)

        def compare(i0: int) -> Callable[[], None]:
            i1 = min(i0 + CHUNK, n)
            return lambda: _compare(
                self._tree, photons, words, normals, needs, self.rule, self.seed, first, i0, i1, counts, neighbours
            )

        if self.stored:
            run([compare(i0) for i0 in range(0, n, CHUNK)])
        before = self.stored
        rows = self._stored, self._powers
        settle = run(
            [
                lambda: _settle(
                    self._tree,
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
            required=(self._tree[8][:n] * np.float32(SETTLES[self.rule])) if n else np.empty(0, np.float32),
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
