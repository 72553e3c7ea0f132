"""Final gather estimation of a pass, before the eye pass (R7; course guide §6.3.2).

The pass's own camera samples are traced, pixels where the surface breaks off are critical, and on a grid of the others
full gathers are made. Where harmonic mean distances and normals allow it, tiles of the grid are interpolated, else
divided, corners of the parts gathering in their turn. The eye pass gathers as usual wherever there is no estimate.

Every pass has a grid of its own, moved by an offset, and its own photons and directions, all keyed by (seed, pass). The
film averages them. The error that interpolation may make, the width of the grid and the share of the smallest tiles
that are interpolated whatever their error shrink with the number of the pass as look-up radii do, so that in the limit
the mean is that of the plain gather. Rounds go from coarse to fine; in each, what is gathered depends on the rounds
before alone, and nothing on threads.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.pool import WorkPool
from pmviewer.engine.stages.reprojection import KnownHits
from pmviewer.maps.hemisphere import strata
from pmviewer.render.camera import CameraPose
from pmviewer.render.counts import N_COUNTS
from pmviewer.render.gather.estimation import ESTIMATE, ESTIMATES, SAMPLE, TOLD, gather_samples, trace_samples
from pmviewer.render.gather.tiles import (
    CRITICAL,
    GATHERED,
    INTERPOLATED,
    LEFT,
    NO_RECEIVER,
    SAFE,
    ask_corners,
    divide_tiles,
    mark_safe,
)
from pmviewer.render.given import PassData
from pmviewer.settings.schema import Gather

SHRINK = 1.0 / 6.0
"""Errors and widths fall with this power of the pass: as radii do with alpha = 2/3."""
NARROWEST = 2
"""Width in pixels below which there is nothing to interpolate."""
BATCH_RAYS = 8192
"""Gather rays a task."""
TILE = 4096
"""Pixels a task."""


@dataclass(frozen=True, eq=False)
class Estimates:
    """Of one pass. `record`: ESTIMATES (1,), valid while this object lives; `plane`: float32 (pixels, ESTIMATE); `mask`
    and `how`: uint8 (h, w), see `pmviewer.render.gather.tiles`; `level`: uint8 (h, w), how often the tile was divided
    in which a pixel was interpolated or for which it gathered; `sparse`: full gathers of the undivided grid; `told`:
    float32 (pixels, TOLD), the share of reprojected directions of what was interpolated, too; `known`: what gathers
    have found, where they are reprojected."""

    record: NDArray[np.void]
    plane: NDArray[np.float32]
    mask: NDArray[np.uint8]
    how: NDArray[np.uint8]
    level: NDArray[np.uint8]
    sparse: int
    told: NDArray[np.float32]
    known: KnownHits | None = None

    @property
    def counts(self) -> dict[str, int]:
        """Pixels by what they are (`safe`, `critical`, `other`) and by how safe ones get their light (`gathered`,
        `interpolated`, `left` to the eye pass); with reprojection, what `KnownHits.counts` tells."""
        safe = self.mask == SAFE
        reprojected = {} if self.known is None else self.known.counts
        return {
            "safe": int(safe.sum()),
            "critical": int((self.mask == CRITICAL).sum()),
            "other": int((self.mask == NO_RECEIVER).sum()),
            "sparse": self.sparse,
            "gathered": int((self.how == GATHERED).sum()),
            "interpolated": int((self.how == INTERPOLATED).sum()),
            "left": int((safe & (self.how == LEFT)).sum()),
            **reprojected,
        }

    def views(self) -> dict[str, NDArray[np.float32]]:
        """Planes (h, w, 1) by view (`pmviewer.output.diagnostic_views`), below 0 where there is nothing."""
        nothing = self.mask == NO_RECEIVER
        mask = np.where(nothing, -1.0, self.mask == SAFE)
        points = np.where(nothing, -1.0, self.how)
        level = np.where(self.how == LEFT, -1.0, self.level)
        planes = {"estimation mask": mask, "gathered points": points, "subdivision level": level}
        if self.known is not None:
            share = 100 * self.told[:, 2].reshape(self.how.shape)
            planes["reprojected share"] = np.where(self.how == LEFT, -1.0, share)
        return {name: np.ascontiguousarray(plane[..., None], np.float32) for name, plane in planes.items()}


def shrink_of(index: int) -> float:
    """By which errors and widths have shrunk in pass `index`."""
    return float((index + 1.0) ** -SHRINK)


def grid_lines(size: int, width: int, offset: int) -> NDArray[np.int32]:
    """Where the lines of the grid are: every `width` pixels from `offset` on, and at both edges of the image."""
    lines = np.arange(offset % width, size, width)
    return np.unique(np.concatenate([[0], lines, [size - 1]])).astype(np.int32)


def first_tiles(width: int, height: int, spacing: int, seed: int, index: int) -> NDArray[np.int32]:
    """Tiles (n, 4) of the undivided grid of pass `index`, whose offset follows from (seed, pass)."""
    x_offset, y_offset = (int(offset) for offset in np.random.default_rng([seed, index]).integers(0, spacing, 2))
    xs, ys = grid_lines(width, spacing, x_offset), grid_lines(height, spacing, y_offset)
    x0, y0 = np.meshgrid(xs[:-1] if len(xs) > 1 else xs, ys[:-1] if len(ys) > 1 else ys)
    x1, y1 = np.meshgrid(xs[1:] if len(xs) > 1 else xs, ys[1:] if len(ys) > 1 else ys)
    return np.stack([x0, y0, x1, y1], axis=-1).reshape(-1, 4).astype(np.int32)


def blank_estimates() -> NDArray[np.void]:
    """A record (1,) without contents."""
    return np.zeros(1, ESTIMATES)


def estimate_gathers(
    given: PassData, gather: Gather, camera: CameraPose, pool: WorkPool
) -> tuple[Estimates, NDArray[np.int64]]:
    """The estimates of a pass and the counts of its kernels (`pmviewer.render.counts`)."""
    eye = given.eye[0]
    width, height, seed, index = (int(eye[name]) for name in ("width", "height", "seed", "index"))
    shrink, pixels = shrink_of(index), width * height
    plane = np.zeros((pixels, ESTIMATE), np.float32)
    record = blank_estimates()
    record["estimates"] = plane.ctypes.data
    record["pixel_angle"], record["pixel_size"] = camera.pixel_angle(), camera.pixel_size()
    record["rings"], record["sectors"] = strata(gather.estimation_samples)
    given = given._replace(cache=record)
    samples = np.empty((pixels, SAMPLE), np.float32)
    counts = _parallel(pool, pixels, TILE, partial(trace_samples, given, samples))
    mask = np.empty((height, width), np.uint8)
    cosine, step = np.float32(math.cos(math.radians(gather.estimation_normals))), np.float32(gather.estimation_step)
    marked = partial(mark_safe, samples, np.int64(width), np.int64(height), cosine, step, mask.reshape(-1))
    pool.run([partial(marked, first, min(first + TILE, pixels)) for first in range(0, pixels, TILE)])
    told, level = np.zeros((pixels, TOLD), np.float32), np.zeros((height, width), np.uint8)
    how = np.full((height, width), LEFT, np.uint8)
    unsafe = np.zeros((height + 1, width + 1), np.int32)
    np.cumsum(np.cumsum(mask != SAFE, axis=0), axis=1, out=unsafe[1:, 1:])
    spacing = max(NARROWEST, round(gather.estimation_spacing * shrink))
    tiles = first_tiles(width, height, spacing, seed, index)
    rule = _rule(gather, shrink, seed, index)
    batch = max(1, BATCH_RAYS // int(record["rings"][0] * record["sectors"][0]))
    depth = sparse = 0
    known = KnownHits(given, samples, gather, spacing, shrink) if gather.reprojection == "on" else None
    while len(tiles):
        wanted = np.zeros((height, width), np.uint8)
        pool.run([partial(ask_corners, tiles, unsafe, how, wanted)])
        corners = np.flatnonzero(wanted).astype(np.int32)
        if known is not None:
            counts += known.gather(given, corners, plane, told, pool)
        else:
            gathered = partial(gather_samples, given, corners, samples, plane, told)
            counts += _parallel(pool, len(corners), batch, gathered)
        good = corners[plane[corners, 3] > 0]
        how.reshape(-1)[good], level.reshape(-1)[good] = GATHERED, depth
        sparse += len(good) if depth == 0 else 0
        parts = np.empty((4 * len(tiles), 4), np.int32)
        divided = partial(divide_tiles, tiles, unsafe, samples, plane, told, how, level, depth, rule, parts)
        tiles = parts[: pool.run([divided])[0]]
        depth += 1
    return Estimates(record, plane, mask, how, level, sparse, told, known), counts


def _rule(gather: Gather, shrink: float, seed: int, index: int) -> tuple[float, float, int, float, int]:
    """See `divide_tiles`."""
    key = int(np.random.default_rng([seed, index, 1]).integers(0, 2**32))
    return gather.estimation_error * shrink, gather.estimation_contrast, gather.estimation_smallest, shrink, key


def _parallel(pool: WorkPool, n: int, batch: int, kernel: Any) -> NDArray[np.int64]:
    """kernel(counts, first, last) over 0 … n−1 in batches; the sum of the counts."""

    def task(first: int) -> Any:
        def run() -> NDArray[np.int64]:
            counts = np.zeros(N_COUNTS, np.int64)
            kernel(counts, first, min(first + batch, n))
            return counts

        return run

    return sum(pool.run([task(first) for first in range(0, n, batch)]), np.zeros(N_COUNTS, np.int64))


def prepare_estimation(given: PassData) -> None:
    """Call every kernel of this stage once, on nothing."""
    given = given._replace(cache=blank_estimates())
    samples, plane, told = (np.zeros((1, columns), np.float32) for columns in (SAMPLE, ESTIMATE, TOLD))
    counts, tiles = np.zeros(N_COUNTS, np.int64), np.empty((0, 4), np.int32)
    trace_samples(given, samples, counts, 0, 0)
    mark_safe(samples, np.int64(1), np.int64(1), np.float32(0), np.float32(0), np.zeros(1, np.uint8), 0, 0)
    how, unsafe = np.zeros((1, 1), np.uint8), np.zeros((2, 2), np.int32)
    ask_corners(tiles, unsafe, how, how)
    gather_samples(given, np.empty(0, np.int32), samples, plane, told, counts, 0, 0)
    divide_tiles(tiles, unsafe, samples, plane, told, how, how, 0, (0.0, 0.0, 2, 1.0, 0), tiles)
