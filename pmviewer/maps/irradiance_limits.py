"""Records of the irradiance cache reach no farther than what their neighbours found allows (R6).

R_i ≤ R_j + |x_i − x_j| for each record j that lies within the reach of record i (Křivánek and others 2006): a detail
that one record found is news to those around it.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import load_i4
from pmviewer.kernels.vector import dot, sub
from pmviewer.maps.irradiance_cache import (
    FOOTPRINT,
    HARMONIC,
    REACH,
    IrradianceCache,
    bucket_of,
    cell_of,
    parts_of,
    reach_of,
)
from pmviewer.tasks import Runner, in_turn

SWEEPS = 16
"""Most rounds; the later ones ask few records."""
_f4 = np.float32
_i8 = np.int64
_u4 = np.uint32
_FAR = np.float32(np.inf)


def limit_by_neighbours(cache: IrradianceCache, run: Runner = in_turn) -> None:
    """Enforce it. The cache's rows are changed; its index stays valid, for reaches only shrink.

    All records look at once, at what the sweep before has left, and later sweeps ask only those that it lowered: the
    result does not depend on how `run` shares the tasks.
    """
    rows, n = cache.rows, cache.n
    asked, parts = np.arange(n, dtype=np.int32), parts_of(n)
    lowest, found = np.full((len(parts), n), np.inf, np.float32), np.empty((len(parts), n), np.int32)
    lowered = np.empty((2, n), np.int32)
    sweep = 0
    while sweep < SWEEPS and len(parts := parts_of(len(asked))) > 1:
        counts = run(
            [partial(_lower, cache.record, rows, asked[part], lowest[k], found[k]) for k, part in enumerate(parts)]
        )
        into = lowered[sweep % 2]
        asked = into[: _settle(cache.record, rows, lowest, found, np.array(counts), into)]
        sweep += 1
    _sweep_on(cache.record, rows, asked, lowest[0], found[0], lowered, sweep, SWEEPS)


def prepare_limits(cache: IrradianceCache) -> None:
    """Call every kernel of this once, on a cache without records."""
    none, nobody = np.empty(0, np.float32), np.empty(0, np.int32)
    _lower(cache.record, cache.rows, nobody, none, nobody)
    _settle(cache.record, cache.rows, none[None], nobody[None], np.zeros(0, np.int64), nobody)
    limit_by_neighbours(cache)


@device
def _ask(cache, rows, j, lowest, found, count):
    """R_j + |x_i − x_j| into lowest (n,) for each record i within whose reach record j is, where it is less than R_i
    and than what is there. Those that had nothing there into found (n,) from `count` on; returns how many it has."""
    p = (rows[j, 0], rows[j, 1], rows[j, 2])
    levels, width = cache.levels, cache.cell
    level = _i8(0)
    while levels != _u4(0):
        if levels & _u4(1) != _u4(0):
            bucket = bucket_of(cache.mask, level, cell_of(p[0], width), cell_of(p[1], width), cell_of(p[2], width))
            for at in range(load_i4(cache.starts, bucket), load_i4(cache.starts, bucket + 1)):
                i = load_i4(cache.entries, at)
                d = sub(p, (rows[i, 0], rows[i, 1], rows[i, 2]))
                distance = _f4(math.sqrt(dot(d, d)))
                if distance < rows[i, REACH]:
                    harmonic = rows[j, HARMONIC] + distance
                    if harmonic < rows[i, HARMONIC] and harmonic < lowest[i]:
                        if lowest[i] == _FAR:
                            found[count] = i
                            count += 1
                        lowest[i] = harmonic
        levels = _u4(levels >> _u4(1))
        level += 1
        width = width * _f4(2.0)
    return count


@device
def _take(cache, rows, lowest, found, lowered, count):
    """Give each record of `found` the distance that lowest (n,) has for it, infinite afterwards, if it is less, and the
    reach that belongs to it. The records that were not yet lowered into `lowered` from `count` on; returns how many it
    has."""
    for i in found:
        if lowest[i] < rows[i, HARMONIC]:
            rows[i, HARMONIC] = lowest[i]
            reach = reach_of(lowest[i], rows[i, FOOTPRINT], cache.error, cache.least, cache.most)
            rows[i, REACH] = min(rows[i, REACH], reach)
            lowered[count] = i
            count += 1
        lowest[i] = _FAR
    return count


@kernel
def _lower(caches, rows, asked, lowest, found):
    """`_ask` the records `asked`."""
    count = 0
    for j in asked:
        count = _ask(caches[0], rows, j, lowest, found, count)
    return count


@kernel
def _settle(caches, rows, lowest, found, counts, lowered):
    """`_take` what parts 0 … len(counts)−1 of lowest, found (parts, n) have, each its first counts[part] records. A
    record may be in several."""
    count = 0
    for part in range(len(counts)):
        for k in range(counts[part]):
            i = found[part, k]
            for other in range(part + 1, len(counts)):
                lowest[part, i] = min(lowest[part, i], lowest[other, i])
                lowest[other, i] = _FAR
        count = _take(caches[0], rows, lowest[part], found[part, : counts[part]], lowered, count)
    return count


@kernel
def _sweep_on(caches, rows, asked, lowest, found, lowered, sweep, sweeps):
    """Sweeps `sweep` … sweeps−1, or until none lowers any record; lowest, found (n,), lowered (2, n)."""
    cache = caches[0]
    while sweep < sweeps and len(asked) > 0:
        count = 0
        for j in asked:
            count = _ask(cache, rows, j, lowest, found, count)
        into = lowered[sweep % 2]
        asked = into[: _take(cache, rows, lowest, found[:count], into, 0)]
        sweep += 1
