"""Test photons (I6): traced into every stratum of emission, with the importance that each one met.

They are photons like all others, of power 1 and with random numbers of their own, so that they may also be stored.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.dimensions import TEST_PHOTON_SALT
from pmviewer.kernels.random import hash3
from pmviewer.maps.photon_words import decode_powers
from pmviewer.maps.power import write_power
from pmviewer.maps.record import in_classes
from pmviewer.photons.emission.strata import Strata, table_of
from pmviewer.photons.light_pass import batch as light_pass
from pmviewer.photons.light_pass.ledger import C_DROPPED, C_RAYS, N_COUNTS, empty_ledger
from pmviewer.tasks import Runner

Float = NDArray[np.float32]
Codes = NDArray[np.uint32]
Evaluate = Callable[[Float, Codes], Float]

_f4 = np.float32
_u4 = np.uint32


@dataclass(frozen=True)
class Sought:
    """What photons of one map are for: `importance` of the places where they arrive. It counts `weight` for what a test
    photon met if the path class is one of `classes` (bit set), and for what is important if it is one of `places`."""

    photons: str
    importance: Evaluate
    classes: int
    places: int
    weight: float = 1.0


@dataclass(frozen=True, eq=False)
class Batch:
    """Test photons first … end−1 of one set: photons (n, 6) and normals (n,) of both maps, the photons' light being
    their trajectory's number, modulo 2¹⁶."""

    first: int
    end: int
    caustic: tuple[Float, Codes]
    global_: tuple[Float, Codes]


@dataclass(frozen=True, eq=False)
class Tested:
    """One set of test photons, h of each stratum; number i is of stratum i modulo the strata. `met` (n,): the
    importance that each one met, summed over the places and all that was sought; `most` (n,): the largest importance of
    a place; `batches` are what they would store, `rays` cast."""

    met: NDArray[np.float64]
    most: NDArray[np.float64]
    batches: list[Batch]
    rays: int
    dropped: int

    @property
    def n(self) -> int:
        """Test photons of the set."""
        return len(self.met)


TraceBatch = Callable[[NDArray[np.void], int, int, int, int], light_pass.Batch]
"""(table, seed, first, end, of so many) → a batch of the light pass with the normals of both maps' photons."""


def trace_tests(
    strata: Strata,
    each: int,
    fold: int,
    seed: int,
    size: int,
    trace: TraceBatch,
    sought: Sequence[Sought],
    run: Runner,
) -> Tested:
    """`each` test photons of every stratum, in batches of `size`; see `Tested`."""
    table, n = table_of(strata, None, None), each * strata.n
    own = int((seed ^ TEST_PHOTON_SALT) + 0x9E3779B9 * (fold + 1)) & 0xFFFFFFFF

    def task(first: int) -> Callable[[], tuple[Batch, NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]]:
        end = min(first + size, n)

        def work() -> tuple[Batch, NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
            batch = trace(table.records, own, first, end, n)
            met, most = np.zeros(end - first), np.zeros(end - first)
            photons = {
                "caustic": (batch.caustic, batch.caustic_normals),
                "global": (batch.global_, batch.global_normals),
            }
            for goal in sought:
                _meet(*photons[goal.photons], goal, first, met, most)
            return Batch(first, end, photons["caustic"], photons["global"]), met, most, batch.counts

        return work

    results = run([task(first) for first in range(0, n, size)])
    counts = sum((r[3] for r in results), np.zeros(N_COUNTS, np.int64))
    met, most = (np.concatenate([np.zeros(0), *[r[i] for r in results]]) for i in (1, 2))
    return Tested(met, most, [r[0] for r in results], int(counts[C_RAYS]), int(counts[C_DROPPED]))


def _meet(
    photons: Float, normals: Codes, goal: Sought, first: int, met: NDArray[np.float64], most: NDArray[np.float64]
) -> None:
    """Add what trajectories first … met with these photons."""
    wanted = in_classes(photons, goal.classes | goal.places)
    if wanted is not None:
        photons, normals = np.ascontiguousarray(photons[wanted]), normals[wanted]
    if not len(photons):
        return
    values = goal.importance(photons[:, :3], normals).astype(np.float64)
    words = photons.view(np.uint32)
    which, path_class = (words[:, 5] >> 16).astype(np.int64) - (first & 0xFFFF), words[:, 3] >> 6 & 3
    counts, places = goal.classes >> path_class & 1, goal.places >> path_class & 1
    met += goal.weight * np.bincount(which, values * counts, len(met))
    np.maximum.at(most, which, values * places)


@kernel
def _weigh(words, normals, first, factor, light, seed, out, out_normals):
    """Photons (n, 6), seen as uint32, with their trajectory's light and its factor for their power into out (n, 6),
    those of factor 0 left out. factor, light: (m,) of the trajectories from `first` on. Returns how many."""
    count = np.int64(0)
    for i in range(len(words)):
        which = np.int64(words[i, 5] >> _u4(16)) - np.int64(first & 0xFFFF)
        f = _f4(factor[which])
        if not f > _f4(0.0):
            continue
        for w in range(5):
            out[count, w] = words[i, w]
        out[count, 5] = _u4((words[i, 5] & _u4(0xFFFF)) | _u4(_u4(light[which]) << _u4(16)))
        red, green, blue = decode_powers(words[i, 4], words[i, 5])
        write_power(out, count, f * red, f * green, f * blue, hash3(seed, _u4(first), _u4(i)))
        out_normals[count] = normals[i]
        count += 1
    return count


def weighed(tested: Tested, strata: Strata, factor: NDArray[np.float64], seed: int) -> list[light_pass.Task]:
    """The test photons' batches to be stored with powers `factor` (n,), 0 for those that are not; as the light pass
    makes batches, so that whatever it does with those it can do with these."""

    def task(batch: Batch) -> light_pass.Task:
        def work() -> light_pass.Batch:
            numbers = np.arange(batch.first, batch.end)
            light = np.ascontiguousarray(strata.light[numbers % strata.n])
            chosen = []
            for photons, normals in (batch.caustic, batch.global_):
                out, out_normals = np.empty((len(photons), 6), np.uint32), np.empty(len(photons), np.uint32)
                words, some = photons.view(np.uint32), np.ascontiguousarray(factor[numbers])
                n = _weigh(words, normals, batch.first, some, light, np.uint32(seed & 0xFFFFFFFF), out, out_normals)
                chosen.append((out[:n].view(np.float32).copy(), out_normals[:n].copy()))
            counts, ledger = np.zeros(N_COUNTS, np.int64), empty_ledger()
            (caustics, caustic_normals), (globals_, global_normals) = chosen
            return light_pass.Batch(caustics, globals_, counts, ledger, global_normals, caustic_normals)

        return work

    return [task(batch) for batch in tested.batches]


def prepare_weighing() -> None:
    """Compile what weighs test photons, by weighing none."""
    words, codes = np.empty((0, 6), np.uint32), np.empty(0, np.uint32)
    _weigh(words, codes, 0, np.empty(0), np.empty(0, np.int32), np.uint32(0), words, codes)
