"""Filling the irradiance cache of a pass, coarse to fine, before the eye pass (R6).

Candidates are pixels on a lattice that gets finer from round to round. In a round, all candidates are looked up in the
cache as the rounds before left it, and the records made for those that it says too little about are added in the
order of pixels. Nothing depends on threads.

Every pass has a cache of its own, from its own photons and at its own places: the lattice and the places within pixels
move. The film averages the passes, and with them all that a record's noise and place do. Reaches shrink with the number
of the pass as the look-up radius does; what then lies between records is gathered as without a cache, so that in the
limit the mean is that of the plain gather.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.pool import WorkPool
from pmviewer.maps.hemisphere import strata
from pmviewer.maps.irradiance_cache import (
    IRRADIANCE,
    RECORD,
    ROW,
    IrradianceCache,
    build_cache,
    encode_records,
)
from pmviewer.maps.irradiance_limits import limit_by_neighbours, prepare_limits
from pmviewer.render.camera import CameraPose
from pmviewer.render.counts import N_COUNTS
from pmviewer.render.gather.cache_fill import fill_records
from pmviewer.render.given import PassData
from pmviewer.settings.schema import Gather
from pmviewer.tasks import Runner, in_turn

COARSEST, FINEST = 16, 4
"""Widths of the lattice in pixels, in the first and the last round."""
SHRINK = 1.0 / 6.0
"""Reaches fall with this power of the pass: as radii do with alpha = 2/3."""
BATCH_RAYS = 8192
"""Gather rays a task, at most."""
TASKS = 4
"""A thread and round, at least: the first round has few candidates, and gathers at each."""

CACHE_RAYS, MOST_CACHE_RAYS = 2, 16
"""Times the usual gather rays where no record serves, up to so many. Variance times seconds over that with 4 rays: 0.76
to 0.90 in diffuse boxes and rooms (0.68 to 0.94 with four times as many), 0.96 to 1.06 in scenes whose noise is
elsewhere (1.01 to 1.12)."""
_f4 = np.float32


def cache_rays(gather: Gather) -> int:
    """Rays of diffuse surfaces where the irradiance cache has no record for them."""
    if gather.cache_rays == "auto":
        return max(gather.rays, min(CACHE_RAYS * gather.rays, MOST_CACHE_RAYS))
    return int(gather.cache_rays)


def recipe(gather: Gather, camera: CameraPose, index: int) -> NDArray[np.void]:
    """How records are made in pass `index`: RECORD (1,) without records."""
    record = np.zeros(1, RECORD)
    shrink = (index + 1.0) ** -SHRINK
    record["error"] = gather.cache_error * shrink
    record["least"], record["most"] = gather.cache_min * shrink, gather.cache_max * shrink
    record["pixel_angle"], record["pixel_size"] = camera.pixel_angle(), camera.pixel_size()
    record["rings"], record["sectors"] = strata(gather.cache_samples)
    return record


def lattices(width: int, height: int, seed: int, index: int, side: float = 1.0) -> list[NDArray[np.int32]]:
    """Candidates of each round: pixels that no coarser lattice has, in ascending order. Where the camera sees parts of
    pixels alone, of that `side`, lattices are as wide in those."""
    coarsest = 1 << max(round(math.log2(COARSEST * side)), 0)
    rng = np.random.default_rng([seed, index])
    x0, y0 = (int(offset) for offset in rng.integers(0, coarsest, 2))
    rounds, step = [], coarsest
    while step >= max(coarsest * FINEST // COARSEST, 1):
        x, y = np.arange(-x0 % step, width, step), np.arange(-y0 % step, height, step)
        chosen = (y[:, None] * width + x).astype(np.int32)
        if step < coarsest:
            coarser = (((y + y0) % (2 * step) == 0)[:, None]) & ((x + x0) % (2 * step) == 0)
            chosen = chosen[~coarser]
        rounds.append(chosen.ravel())
        step //= 2
    return rounds


def fill_cache(given: PassData, record: NDArray[np.void], pool: WorkPool) -> tuple[IrradianceCache, NDArray[np.int64]]:
    """The cache of a pass and the rays counted; `record` is the pass's recipe."""
    given, side = given._replace(eye=_seeing_all(given.eye)), float(given.eye["pixel_side"][0])
    camera = given.eye[0]
    cache = build_cache(np.empty((0, ROW), np.float32), record)
    total = np.zeros(N_COUNTS, np.int64)
    most = max(1, BATCH_RAYS // int(record["rings"][0] * record["sectors"][0]))
    size = int(camera["width"]), int(camera["height"])
    for pixels in lattices(*size, int(camera["seed"]), int(camera["index"]), side):
        rows, made = np.empty((len(pixels), ROW), np.float32), np.empty(len(pixels), bool)
        batch = max(min(most, -(-len(pixels) // (TASKS * pool.threads))), 1)
        fill = partial(_filled, given._replace(cache=cache.record), pixels, rows, made)
        tasks = [partial(fill, first, min(first + batch, len(pixels))) for first in range(0, len(pixels), batch)]
        total += sum(pool.run(tasks), np.zeros(N_COUNTS, np.int64))
        if made.any():
            cache = _extended(cache, rows[made], pool.run)
    # Reaches have shrunk since it was indexed: narrower cells for the many look-ups of the eye pass.
    return build_cache(cache.rows, cache.record, pool.run), total


def _filled(
    given: PassData,
    pixels: NDArray[np.int32],
    rows: NDArray[np.float32],
    made: NDArray[np.bool_],
    first: int,
    last: int,
) -> NDArray[np.int64]:
    counts = np.zeros(N_COUNTS, np.int64)
    fill_records(given, pixels, rows, made, counts, first, last)
    return counts


def _seeing_all(eye: NDArray[np.void]) -> NDArray[np.void]:
    """The eye record of a camera that sees all of its pixels: records lie between the parts that are seen, too."""
    whole = eye.copy()
    whole["pixel_side"], whole["pixel_margin"] = 1.0, 0.0
    return whole


def prepare_cache(given: PassData) -> None:
    """Call every kernel of this stage once, on nothing."""
    none = np.empty((0, ROW), np.float32)
    cache = _extended(build_cache(none, np.zeros(1, RECORD)), none, in_turn)
    prepare_limits(cache)
    rows, made, counts = np.empty((0, ROW), np.float32), np.empty(0, bool), np.zeros(N_COUNTS, np.int64)
    fill_records(given._replace(cache=cache.record), np.empty(0, np.int32), rows, made, counts, 0, 0)
    cache_cloud(cache)


def _extended(cache: IrradianceCache, rows: NDArray[np.float32], run: Runner) -> IrradianceCache:
    """With records more, each limited by its neighbours."""
    together = build_cache(np.concatenate([cache.rows, rows]), cache.record, run)
    limit_by_neighbours(together, run)
    return together


def cache_cloud(cache: IrradianceCache) -> tuple[NDArray[np.float32], float]:
    """Records as photon records (n, 6) (`pmviewer.maps.record`), the normal as direction, the irradiance as power, and
    the unit of that power."""
    rows = cache.rows
    unit = float(rows[:, IRRADIANCE : IRRADIANCE + 3].mean()) if cache.n else 0.0
    unit = unit if unit > 0 else 1.0
    photons = np.zeros((cache.n, 6), np.float32)
    encode_records(rows, _f4(1.0 / unit), photons, photons.view(np.uint32))
    return photons, unit
