"""Records of the irradiance cache reach no farther than what their neighbours found allows (R6).

R_i ≤ R_j + |x_i − x_j| for each record j that lies within the reach of record i (Křivánek and others 2006): a detail
that one record found is news to those around it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from pmviewer.kernels.compile.jit import kernel
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
    rows = cache.rows
    asked = np.arange(cache.n, dtype=np.int32)
    lowest = np.full((len(parts_of(cache.n)), cache.n), np.inf, np.float32)
    for _ in range(SWEEPS):
        parts = [asked[part] for part in parts_of(len(asked))]
        tasks: list[Callable[[], Any]] = [
            partial(_lower, cache.record, rows, *given) for given in zip(parts, lowest, strict=False)
        ]
        (run if len(tasks) > 1 else in_turn)(tasks)
        lowered = np.empty(cache.n, np.int32)
        asked = lowered[: _settle(cache.record, rows, lowest[: len(parts)], lowered)]
        if not len(asked):
            break


@kernel
def _lower(caches, rows, asked, lowest):
    """The least R_j + |x_i − x_j| of the records j of `asked` within the reach of each record i, where it is less than
    R_i, into lowest (n,) float32."""
    cache = caches[0]
    for j in asked:
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
                            lowest[i] = harmonic
            levels = _u4(levels >> _u4(1))
            level += 1
            width = width * _f4(2.0)


@kernel
def _settle(caches, rows, lowest, lowered):
    """Give each record the least of what the parts of lowest (parts, n) found, all infinite afterwards, and the reach
    that belongs to it. The records into lowered (n,), ascending, and how many they are."""
    cache, count = caches[0], 0
    for i in range(len(rows)):
        harmonic = rows[i, HARMONIC]
        for part in range(len(lowest)):
            harmonic = min(harmonic, lowest[part, i])
            lowest[part, i] = _FAR
        if harmonic < rows[i, HARMONIC]:
            rows[i, HARMONIC] = harmonic
            reach = reach_of(harmonic, rows[i, FOOTPRINT], cache.error, cache.least, cache.most)
            rows[i, REACH] = min(rows[i, REACH], reach)
            lowered[count] = i
            count += 1
    return count
