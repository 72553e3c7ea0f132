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

Powers are float64 sums; they become 16-bit codes when everything is stored (`pmviewer.maps.power`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.memory import aligned_empty, stack_get_i8, stack_i4
from pmviewer.kernels.vector import normalize
from pmviewer.maps.density.compare import Placed, compare, place
from pmviewer.maps.density.decide import Control, farthest, sharing
from pmviewer.maps.density.groups import Groups, groups_of
from pmviewer.maps.density.growing_tree import (
    CAPACITY,
    KEYS,
    LEAF_WORDS,
    WAITING,
    GrowingTree,
    Limits,
    M,
    SearchScratch,
    grown,
    insert,
    reserved,
    search,
)
from pmviewer.maps.density.shares import ROW, add_share, hand_out, share_of
from pmviewer.maps.density.together import AMONG_WORDS
from pmviewer.maps.photon_words import decode_direction
from pmviewer.tasks import Runner

FLATNESS = np.float32(0.2)
"""Half-thickness of guarded discs relative to their radius, that of look-ups."""
CHUNK = 4096
"""Photons a task."""

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64


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
    def limits(self) -> Limits:
        """For kernels."""
        return Limits(self.guarded, _f4(1 / FLATNESS**2 if self.guarded else 0.0), _f4(self.contrast))


NEAREST = Around()
"""The source's: the M nearest in space."""


class Arrivals(NamedTuple):
    """The photons of a round: (n, 6) float32 and the same as uint32 `words`; normals (n,) uint32 codes; needs (n,)
    float32, required densities; first, int64, photons that arrived before."""

    photons: Any
    words: Any
    normals: Any
    needs: Any
    first: Any


class Stored(NamedTuple):
    """The photons stored, in order: rows (capacity, 6) uint32, needs (capacity,) float32, powers (capacity, ROW)
    float64 of `shares`; size int64 (3,): nodes and leaves of the tree, photons stored."""

    rows: Any
    needs: Any
    powers: Any
    size: Any


@kernel
def _settle(trees, control, arrivals, stored, rows, undecided, kept):
    """Decide the photons that `compare` left open, in order, and hand out the power of those that are not stored.

    stored: a `Stored`, filled, whose rows are at the address `rows`; undecided, kept: (n,) bool, the latter receives
    which of these are stored.
    """
    tree, words, size, powers = trees[0], arrivals.words, stored.size, stored.powers
    sums = powers.ctypes.data
    scratch = SearchScratch(stack_i4(KEYS), stack_i4(WAITING), stack_i4(4), stack_i4(4), stack_i4(8))
    leaf_scratch = stack_i4(LEAF_WORDS), stack_i4(CAPACITY)
    for i in range(len(words)):
        if not undecided[i]:
            continue
        p, need, index = place(arrivals, i), arrivals.needs[i], _i8(arrivals.first) + i
        n, r2 = normalize(decode_direction(arrivals.normals[i])), farthest(control, need, index)
        count, r2 = search(tree, p, n, need, control.limits, r2, scratch)
        count = sharing(control, n, need, index, rows, count, r2, scratch)
        r, g, b = share_of(words, i, max(count, _i8(1)))
        if count == 0:
            new = size[2]
            for w in range(6):
                stored.rows[new, w] = words[i, w]
            stored.needs[new] = need
            powers[new, 0], powers[new, 1], powers[new, 2] = r, g, b
            insert(tree, size, p, need, words[i, 3], _i4(new), leaf_scratch)
            size[2] += 1
            kept[i] = True
            continue
        for j in range(count):
            add_share(sums, stack_get_i8(scratch.keys, j) & _i8(0xFFFFFFFF), r, g, b)


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
        """rule: STEP or COSINE of `pmviewer.maps.density.decide`."""
        self.control = Control(np.int32(rule), np.uint32(seed & 0xFFFFFFFF), around.limits)
        self.size = np.array([1, 1, 0], np.int64)
        self.arrived = self.redistributed = 0
        self.kept = np.zeros(0, bool)
        """Which photons of the latest round are stored."""
        self._rows = np.empty((0, 6), np.uint32)
        self._normals: list[NDArray[np.uint32]] = []
        self._powers = np.empty((0, ROW), np.float64)
        self._needs = np.empty(0, np.float32)
        self._tree: GrowingTree | None = None

    @property
    def stored(self) -> int:
        """Photons in the map so far."""
        return int(self.size[2])

    def groups(self, photons: NDArray[np.float32], normals: NDArray[np.uint32], run: Runner) -> Groups:
        """Photons (n, 6) of a round with their normal codes (n,) by places among those stored: near ones together."""
        return groups_of(self._reserve(self.stored + len(photons)), int(self.size[1]), photons, normals, CHUNK, run)

    def add(
        self,
        photons: NDArray[np.float32],
        normals: NDArray[np.uint32],
        required: NDArray[np.float32],
        run: Runner,
        groups: Groups | None = None,
    ) -> None:
        """One round: photons (n, 6) with normal codes (n,) and the densities required at them (n,), in photons per unit
        area; what is not a number counts as 0. `groups` of them, if they are known."""
        n = len(photons)
        self.kept = kept = np.zeros(n, bool)
        if n == 0:
            return
        photons = np.ascontiguousarray(photons, np.float32)
        arrivals = Arrivals(photons, photons.view(np.uint32), normals, needs_of(required), np.int64(self.arrived))
        tree = self._reserve(self.stored + n)
        rows = self._rows.ctypes.data
        undecided = np.ones(n, bool)
        if self.stored:
            undecided = self._compared(tree, arrivals, groups or self.groups(photons, normals, run), run)
        before, stored = self.stored, Stored(self._rows, self._needs, self._powers, self.size)
        run([lambda: _settle(tree.record, self.control, arrivals, stored, rows, undecided, kept)])
        self.arrived += n
        self._normals.append(normals[kept])
        assert self.stored - before == np.count_nonzero(kept)
        self.redistributed += n - (self.stored - before)

    def _compared(self, tree: GrowingTree, arrivals: Arrivals, groups: Groups, run: Runner) -> NDArray[np.bool_]:
        """Compare a round's photons with what was stored before it. Those that are not stored hand out their power in
        the order of the groups: near ones have the same neighbours. Returns which are still undecided, (n,)."""
        order = groups.order
        rows, n = self._rows.ctypes.data, len(order)
        placed = Placed(order, groups.photons, groups.normals, arrivals.needs[order], arrivals.first)
        counts, neighbours = np.empty(n, np.int32), np.empty((n, M), np.int32)

        def some(g0: int, g1: int) -> None:
            candidates = aligned_empty((AMONG_WORDS,), np.float32)
            at = candidates.ctypes.data
            compare(tree.record, self.control, placed, groups.starts, rows, g0, g1, at, counts, neighbours)

        run([partial(some, *part) for part in groups.parts(CHUNK)])
        run([lambda: hand_out(groups.photons.view(np.uint32), counts, neighbours, self._powers)])
        undecided = np.empty(n, bool)
        undecided[order] = counts == 0
        return undecided

    def result(self) -> Controlled:
        """The map as it stands; the arrays are this object's own."""
        n = self.stored
        return Controlled(
            photons=self._rows[:n].view(np.float32),
            normals=np.concatenate([np.empty(0, np.uint32), *self._normals]),
            powers=np.ascontiguousarray(self._powers[:n, :3]),
            required=self._needs[:n],
            redistributed=self.redistributed,
        )

    def _reserve(self, photons: int) -> GrowingTree:
        """The tree, with room for so many photons, and a half more, so that copying stays rare."""
        room = len(self._rows)
        if self._tree is None or photons > room:
            photons = max(photons, room + room // 2)
            self._tree = reserved(self._tree, self.size, photons)
            arrays = self._rows, self._needs, self._powers
            self._rows, self._needs, self._powers = (grown(a, self.stored, photons) for a in arrays)
        return self._tree
