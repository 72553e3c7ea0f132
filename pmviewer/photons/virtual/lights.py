"""The virtual lights of a pass: traced in batches, thinned to the number asked for, weighed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.dimensions import VIRTUAL_SALT
from pmviewer.kernels.random import INDEPENDENT, SOBOL
from pmviewer.maps.virtual_lights import (
    BEAM,
    COLUMNS,
    ESTIMATORS,
    OF_DENSITY,
    OF_PATHS,
    PRINTED_SINGLE,
    SINGLE,
    V_PHI,
    V_Q,
)
from pmviewer.photons.bounces import most_bounces
from pmviewer.photons.virtual.choice import as_photons, choice_probabilities, chosen, in_media
from pmviewer.photons.virtual.flight import C_DROPPED, C_RAYS, C_STORED, N_COUNTS
from pmviewer.photons.virtual.sided import SidedTree
from pmviewer.photons.virtual.single_step import Candidates, Density, Weighed, weigh_as_printed, weigh_by_density
from pmviewer.photons.virtual.trace import TRACE_DTYPE, trace_virtual_lights
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.settings.access import Photons, Virtual

Float = NDArray[np.float32]
Runner = Callable[[list[Callable[[], Any]]], list[Any]]

BATCH = 2048
"""Trajectories a task: fixed, so that the result does not depend on the number of threads."""
SPARE = 2
"""Trajectories for each light where nobody asks for their density: chosen among more, they are less of a family."""
LEAST = 3200
"""Least trajectories that whole paths are chosen from: their weights differ much, as 1/cosθ of the first segment, and a
choice by weight among few leaves ΣG the noise of those."""
MOST = 500_000
"""Most trajectories that passes grow to of their own accord."""
FEWEST = 2
"""Least order of cells that passes shrink to."""


@dataclass(frozen=True, eq=False)
class VirtualLights:
    """`rows` (n, COLUMNS) float32, see `pmviewer.maps.virtual_lights`, with power in watts and q complete but for what
    depends on the point that is lit; `photons` (n, 6) float32 the same as photon records in units of `power_unit`;
    `beams` (n, k, BEAM) of those that stand for photons around them (`pmviewer.photons.virtual.beams`), k may be 0;
    `tree` of the photons that tell their density, None where they do so themselves, closer than `reach`;
    `candidates` that they were chosen from, of `emitted` trajectories; `rays` cast, candidates `dropped`."""

    rows: Float
    photons: Float
    beams: Float
    power_unit: float
    tree: SidedTree | None
    reach: float
    candidates: int
    emitted: int
    rays: int
    dropped: int

    @property
    def n(self) -> int:
        """Lights that were chosen."""
        return len(self.rows)

    @property
    def bytes(self) -> int:
        """For the stage store."""
        return self.rows.nbytes + self.photons.nbytes + self.beams.nbytes + (self.tree.bytes if self.tree else 0)


def trajectories(virtual: Virtual, index: int) -> int:
    """Trajectories of pass `index`.

    A cell of the order k blurs the density by its area, and no number of passes mends that. So both its k and its area
    shrink: k with the cube root of the passes down to FEWEST, while the map's photons grow with it up to MOST.
    """
    if _grows(virtual):
        return max(
            min(round(virtual.photons * (index + 1) ** (1 / 3)), max(MOST, virtual.photons)), SPARE * virtual.number
        )
    few = SPARE * virtual.number
    return max(few, LEAST) if ESTIMATORS.index(virtual.estimator) in OF_PATHS else few


def neighbours(virtual: Virtual, index: int) -> int:
    """Photons that a place of a surface belongs to in pass `index` (`pmviewer.photons.virtual.density`)."""
    return max(round(virtual.k / (index + 1) ** (1 / 3)), min(virtual.k, FEWEST)) if _grows(virtual) else virtual.k


def _first_index(virtual: Virtual, index: int) -> int:
    """Trajectories of all passes before `index`."""
    if not _grows(virtual):
        return index * trajectories(virtual, 0)
    return sum(trajectories(virtual, i) for i in range(index))


def _grows(virtual: Virtual) -> bool:
    return ESTIMATORS.index(virtual.estimator) == SINGLE and virtual.density == "photon map"


def virtual_lights(
    scene: FlatScene, virtual: Virtual, photons: Photons, seed: int, index: int, run: Runner
) -> VirtualLights:
    """The virtual lights of pass `index`, chosen from P candidates (`pmviewer.photons.virtual.choice`). Open scenes
    have fewer candidates than trajectories, and may have fewer than the lights asked for."""
    N, estimator = trajectories(virtual, index), ESTIMATORS.index(virtual.estimator)
    record = np.zeros(1, TRACE_DTYPE)
    sequence = SOBOL if photons.sequence == "sobol" else INDEPENDENT
    own = (seed ^ VIRTUAL_SALT) & 0xFFFFFFFF
    most = most_bounces(photons, scene.has_media)
    record[0] = (own, _first_index(virtual, index), sequence, most, photons.glossy, estimator)
    results = run([partial(_batch, scene, record, i0, min(i0 + BATCH, N)) for i0 in range(0, N, BATCH)])
    found = np.concatenate([r[0] for r in results])
    rows = np.concatenate([r[1] for r in results])
    counts = sum((r[2] for r in results), np.zeros(N_COUNTS, np.int64))
    of_map = _grows(virtual)
    probabilities = choice_probabilities(rows, estimator, scene.radius if of_map else None)
    kept, share = chosen(probabilities, min(virtual.number, len(rows)), np.random.default_rng([own, index]).random())
    lights = np.ascontiguousarray(rows[kept])
    unit = scene.total_luminance / N
    lights[:, V_PHI : V_PHI + 3] *= (unit * share)[:, None]
    weighed = Weighed(None, 2 * scene.radius, np.empty((len(lights), 0, BEAM), np.float32))
    if estimator in OF_PATHS:
        lights[:, V_Q] *= share / np.float32(N)
    elif estimator in OF_DENSITY and not in_media(lights).all():
        candidates = Candidates(found, rows, kept, share, unit)
        if estimator == PRINTED_SINGLE:
            weigh_as_printed(candidates, lights, virtual.k, run)
        else:
            density = Density(of_map, neighbours(virtual, index), photons.glossy)
            weighed = weigh_by_density(scene, candidates, lights, density, run)
    return VirtualLights(
        rows=lights,
        photons=as_photons(found[kept], share),
        beams=weighed.beams,
        power_unit=unit,
        tree=weighed.tree,
        reach=weighed.reach,
        candidates=len(rows),
        emitted=N,
        rays=int(counts[C_RAYS]),
        dropped=int(counts[C_DROPPED]),
    )


def _batch(scene: FlatScene, record: NDArray[np.void], i0: int, i1: int) -> tuple[Float, Float, NDArray[np.int64]]:
    """Candidates of the trajectories i0 … i1−1, resumed with fresh buffers whenever one is full."""
    total = np.zeros(N_COUNTS, np.int64)
    photons, lights = [], []
    most = int(record[0]["max_bounces"])
    while i0 < i1:
        capacity = 5 * (i1 - i0) + 2 * most
        found, rows = np.empty((capacity, 6), np.float32), np.zeros((capacity, COLUMNS), np.float32)
        counts = np.zeros(N_COUNTS, np.int64)
        i0 = trace_virtual_lights(scene.record, record, i0, i1, found, rows, counts)
        photons.append(found[: counts[C_STORED]].copy())
        lights.append(rows[: counts[C_STORED]].copy())
        total += counts
    return np.concatenate(photons), np.concatenate(lights), total
