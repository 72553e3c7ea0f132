"""The irradiance cache: indirect irradiance kept at few surface points and interpolated in between (R6).

A record holds a surface point x_i with its normal n_i, the irradiance E_i there, its rotational and translational
gradient (`pmviewer.maps.hemisphere`), and the distance ρ_i up to which it is used: a·R_i, with R_i the harmonic mean of
the distances to what the point sees (Ward, Rubinstein, Clear 1988), clamped to a range in pixel footprints. At x with
normal n its error is e_i = |x − x_i|/ρ_i + √(1 − n·n_i)/a. It counts where e_i < 1, with the weight 1/e_i − 1: Ward's
weight 1/(a·e_i) less its value at the rim, times a, so that records fade out. A record whose tangent plane the point
leaves is not used: |(x − x_i)·(n + n_i)/2| may be a tenth of ρ_i at most.

Records lie in a hierarchy of hashed grids: one of reach ρ is listed in all cells that its ball meets, of cells that are
at least two ρ wide and less than four, so that a look-up visits one cell a level and finds every record that counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import load_f4, load_i4
from pmviewer.kernels.random import hash3
from pmviewer.kernels.vector import add, cross, dot, scale, sub
from pmviewer.maps.photon_words import encode_direction, encode_power
from pmviewer.maps.variant import ABSENT
from pmviewer.tasks import Runner, in_turn

ROW = 32
"""Floats of a record."""
POINT, NORMAL, REACH, HARMONIC, IRRADIANCE, ROTATION, TRANSLATION, FOOTPRINT, LEVEL = 0, 3, 6, 7, 8, 11, 20, 29, 30
"""Where its parts begin: x, n, ρ, R, E, ∂E/∂rotation and ∂E/∂x (three vectors each, of red, green, blue), the size of a
pixel there, and its level in the hierarchy."""

MOST_LEVELS = 31
MOST_CELLS = 27
"""Of a level that a record reaches into: a cell is twice as wide as any reach there, and rounding may add one."""
OFF_PLANE = np.float32(0.1)
"""A point farther than so many ρ off a record's plane is on another surface."""
NEAREST = np.float32(1e-3)
"""Errors below this weigh the same."""
FEWEST_OF_PART, MOST_PARTS = 128, 32
"""Records of a task, and tasks."""

RECORD = np.dtype(
    [
        ("rows", "i8"),  # float32 (n, ROW)
        ("starts", "i8"),  # int32 (buckets + 1): first entry of each bucket
        ("entries", "i8"),  # int32: records, ascending within a bucket
        ("n", "i8"),
        ("mask", "u4"),  # buckets − 1
        ("levels", "u4"),  # bit l: level l has records
        ("cell", "f4"),  # width of the cells of level 0
        ("error", "f4"),  # a
        ("least", "f4"),  # least and largest ρ in pixel footprints
        ("most", "f4"),
        ("pixel_angle", "f4"),  # what a pixel's footprint grows by at distance 1
        ("pixel_size", "f4"),  # its footprint at distance 0
        ("rings", "i4"),  # strata of a gathered hemisphere
        ("sectors", "i4"),
    ],
    align=True,
)
"""What kernels see of a cache. The last six fields tell how records are made."""

NO_CACHE = ABSENT
"""Stands for the cache where there is none: kernels are compiled without it."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32


@dataclass(frozen=True, eq=False)
class IrradianceCache:
    """Records `rows` (n, ROW) float32 with their index; `record` is valid while this object lives."""

    rows: NDArray[np.float32]
    starts: NDArray[np.int32]
    entries: NDArray[np.int32]
    record: NDArray[np.void]

    @property
    def n(self) -> int:
        """Of records."""
        return len(self.rows)

    @property
    def bytes(self) -> int:
        """Of records and of the index by which they are found."""
        return self.rows.nbytes + self.starts.nbytes + self.entries.nbytes + self.record.nbytes


@device
def bucket_of(mask, level, cx, cy, cz):
    """The bucket, an index into the cache's `starts`, of that cell of a level."""
    return _i8(hash3(_u4(cx), _u4(cy), _u4(_u4(cz) * _u4(MOST_LEVELS + 1)) + _u4(level)) & mask)


@device
def cell_of(x, width):
    """The number along one axis of the cell that x lies in."""
    return _i8(np.floor(x / width))


@kernel
def _find_buckets(rows, cell, mask, buckets, counts):
    """The distinct buckets of each record's cells into buckets (n, MOST_CELLS), how many there are into counts (n,)."""
    for i in range(len(rows)):
        level, reach = _i8(rows[i, LEVEL]), rows[i, REACH]
        width = cell * _f4(_i8(1) << level)
        n = 0
        for cx in range(cell_of(rows[i, 0] - reach, width), cell_of(rows[i, 0] + reach, width) + 1):
            for cy in range(cell_of(rows[i, 1] - reach, width), cell_of(rows[i, 1] + reach, width) + 1):
                for cz in range(cell_of(rows[i, 2] - reach, width), cell_of(rows[i, 2] + reach, width) + 1):
                    bucket = _i4(bucket_of(mask, level, cx, cy, cz))
                    known = False
                    for j in range(n):
                        known = known or buckets[i, j] == bucket
                    if not known:
                        buckets[i, n] = bucket
                        n += 1
        counts[i] = n


@kernel
def _list_entries(buckets, counts, starts, entries):
    """Where each bucket starts into starts (buckets + 1,), zeros before, and its records in ascending order into
    entries (sum of counts,)."""
    for i in range(len(counts)):
        for j in range(counts[i]):
            starts[buckets[i, j] + 1] += 1
    for b in range(len(starts) - 1):
        starts[b + 1] += starts[b]
    place = starts.copy()
    for i in range(len(counts)):
        for j in range(counts[i]):
            entries[place[buckets[i, j]]] = i
            place[buckets[i, j]] += 1


@kernel
def _choose_levels(rows, cell):
    """The level of each record into its row: cells are at least twice as wide as what it reaches, which is cut off
    where there is no such level. Returns the levels as bits; `cell`, the width at level 0, is a power of two."""
    levels = _u4(0)
    for i in range(len(rows)):
        level, width = _i8(0), cell
        while level < MOST_LEVELS - 1 and width < _f4(2.0) * rows[i, REACH]:
            level += 1
            width = width * _f4(2.0)
        rows[i, LEVEL] = _f4(level)
        rows[i, REACH] = min(rows[i, REACH], _f4(0.5) * width)
        levels = _u4(levels | _u4(_u4(1) << _u4(level)))
    return levels


def parts_of(n: int) -> list[slice]:
    """So many records in parts for tasks, at least one."""
    parts = max(1, min(MOST_PARTS, n // FEWEST_OF_PART))
    return [slice(n * k // parts, n * (k + 1) // parts) for k in range(parts)]


def build_cache(rows: NDArray[np.float32], like: NDArray[np.void], run: Runner = in_turn) -> IrradianceCache:
    """Index records (n, ROW), whose levels are filled in; `like` is a RECORD (1,) that tells how records are made.
    `run` does tasks."""
    rows = np.ascontiguousarray(rows, np.float32)
    record = like.copy()
    n = len(rows)
    cell = 2.0 ** math.ceil(math.log2(2.0 * float(rows[:, REACH].min()))) if n else 1.0
    levels = _choose_levels(rows, _f4(cell))
    mask = (1 << max(4, (4 * n).bit_length())) - 1
    buckets, counts = np.empty((n, MOST_CELLS), np.int32), np.empty(n, np.int32)
    tasks: list[Callable[[], Any]] = [
        partial(_find_buckets, rows[part], _f4(cell), _u4(mask), buckets[part], counts[part]) for part in parts_of(n)
    ]
    (run if len(tasks) > 1 else in_turn)(tasks)
    starts, entries = np.zeros(mask + 2, np.int32), np.empty(int(counts.sum()), np.int32)
    _list_entries(buckets, counts, starts, entries)
    record["rows"], record["starts"], record["entries"] = rows.ctypes.data, starts.ctypes.data, entries.ctypes.data
    record["n"], record["mask"], record["cell"] = n, mask, cell
    record["levels"] = levels
    return IrradianceCache(rows, starts, entries, record)


@device
def _load3(row, at):
    return load_f4(row, at), load_f4(row, at + 1), load_f4(row, at + 2)


@device
def interpolate(cache, p, n):
    """Irradiance (red, green, blue) at the point p with unit normal n, the sum of the weights of the records that it
    was made from, 0 where there is none, and the mean ρ of these."""
    total = (_f4(0.0), _f4(0.0), _f4(0.0))
    weights, reaches = _f4(0.0), _f4(0.0)
    levels, width = cache.levels, cache.cell
    inv_error = _f4(1.0) / cache.error
    level = _i8(0)
    while levels != _u4(0):
        if levels & _u4(1) != _u4(0):
            bucket = bucket_of(cache.mask, level, cell_of(p[0], width), cell_of(p[1], width), cell_of(p[2], width))
            for at in range(load_i4(cache.starts, bucket), load_i4(cache.starts, bucket + 1)):
                row = cache.rows + _i8(load_i4(cache.entries, at)) * _i8(4 * ROW)
                if load_f4(row, LEVEL) != _f4(level):
                    continue
                d = sub(p, _load3(row, POINT))
                reach = load_f4(row, REACH)
                d2 = dot(d, d)
                if not d2 < reach * reach:
                    continue
                m = _load3(row, NORMAL)
                error = _f4(math.sqrt(d2)) / reach
                error += _f4(math.sqrt(max(_f4(1.0) - dot(n, m), _f4(0.0)))) * inv_error
                if not error < _f4(1.0) or abs(dot(d, add(n, m))) > _f4(2.0) * OFF_PLANE * reach:
                    continue
                weight = _f4(1.0) / max(error, NEAREST) - _f4(1.0)
                turned = cross(m, n)
                E = (
                    _extrapolated(row, _i8(0), turned, d),
                    _extrapolated(row, _i8(1), turned, d),
                    _extrapolated(row, _i8(2), turned, d),
                )
                total = add(total, scale(E, weight))
                weights += weight
                reaches += weight * reach
        levels = _u4(levels >> _u4(1))
        level += 1
        width = width * _f4(2.0)
    if weights > _f4(0.0):
        total, reaches = scale(total, _f4(1.0) / weights), reaches / weights
    return total, weights, reaches


@device
def _extrapolated(row, channel, turned, d):
    """A record's irradiance carried on by its gradients, never negative."""
    E = load_f4(row, IRRADIANCE + channel)
    E += dot(turned, _load3(row, ROTATION + _i8(3) * channel)) + dot(d, _load3(row, TRANSLATION + _i8(3) * channel))
    return max(E, _f4(0.0))


@kernel
def interpolate_all(caches, points, normals, E, weights):
    """`interpolate` at points, normals (n, 3) float32 into E (n, 3) and weights (n,)."""
    for i in range(len(points)):
        p = (points[i, 0], points[i, 1], points[i, 2])
        n = (normals[i, 0], normals[i, 1], normals[i, 2])
        (E[i, 0], E[i, 1], E[i, 2]), weights[i], _ = interpolate(caches[0], p, n)


@device
def reach_of(harmonic, footprint, error, least, most):
    """ρ of a record: a·R between `least` and `most` pixel footprints."""
    return min(max(error * harmonic, least * footprint), most * footprint)


@kernel
def encode_records(rows, scale_E, photons, words):
    """Records (n, ROW) as photon records (n, 6) (see `pmviewer.maps.record`), float32 and their uint32 view `words`.

    The normal becomes the direction, scale_E times the irradiance the power."""
    for i in range(len(rows)):
        for axis in range(3):
            photons[i, axis] = rows[i, axis]
        words[i, 3] = encode_direction(rows[i, 3], rows[i, 4], rows[i, 5])
        red, green = encode_power(rows[i, 8] * scale_E), encode_power(rows[i, 9] * scale_E)
        words[i, 4] = _u4(_u4(green << _u4(16)) | red)
        words[i, 5] = encode_power(rows[i, 10] * scale_E)
