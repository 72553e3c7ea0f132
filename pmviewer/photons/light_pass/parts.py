"""One part of a light pass, traced alone (M4): what one of several workers does.

The trajectories of a pass are dealt out in runs, not by turns: points of a Sobol sequence fill the lights evenly in
every run, while each second or fourth point lies in one half or quarter of them. Those that fill the global map and
those for the caustic map alone (`photons.q`) are dealt out alike, so that every part can be looked up by itself. All
powers are in units of the whole pass, and the parts together are the photons of the pass undivided.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pmviewer.photons.light_pass.batch import BATCH, Batch, Task, bounded, joined_batches, trace_batch
from pmviewer.photons.light_pass.plan import PassPlan
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.tasks import Runner


def runs_of_part(plan: PassPlan, part: int, parts: int) -> list[tuple[int, int]]:
    """Trajectories i0 … i1−1 of a part of the pass: of those that fill the global map, and of the others."""
    both = (0, plan.filling), (plan.filling, plan.traced - plan.filling)
    runs = [(first + n * part // parts, first + n * (part + 1) // parts) for first, n in both]
    return [run for run in runs if run[0] < run[1]]


def trace_part(scene: FlatScene, plan: PassPlan, part: int, parts: int, normals: int, run: Runner) -> Batch:
    """The photons of one part of a planned pass, joined: a function of its arguments alone, the same in any process.

    normals: whose surface normals are wanted (`pmviewer.photons.light_pass.batch`). Raises SettingError where the
    photons can't fit into memory.
    """
    return joined_batches(bounded(_tasks(scene, plan, part, parts, normals), BATCH * plan.most_stored, run))


def trace_parts(scene: FlatScene, plan: PassPlan, parts: int, normals: int, run: Runner) -> list[Batch]:
    """All parts of the pass, their batches over the threads together."""
    tasks = [_tasks(scene, plan, part, parts, normals) for part in range(parts)]
    batches = iter(bounded([task for some in tasks for task in some], BATCH * plan.most_stored, run))
    return [joined_batches([next(batches) for _ in some]) for some in tasks]


def cuts_of(parts: Sequence[Batch]) -> dict[str, NDArray[np.int64]]:
    """`PhotonMaps.cuts` of parts that are joined in order."""
    return {
        "caustic": np.cumsum([0, *(len(part.caustic) for part in parts)], dtype=np.int64),
        "global": np.cumsum([0, *(len(part.global_) for part in parts)], dtype=np.int64),
    }


def _tasks(scene: FlatScene, plan: PassPlan, part: int, parts: int, normals: int) -> list[Task]:
    def batch(i0: int, i1: int) -> Task:
        return lambda: trace_batch(scene, plan.record, plan.emission, i0, i1, normals)

    return [
        batch(i0, min(i0 + BATCH, end))
        for first, end in runs_of_part(plan, part, parts)
        for i0 in range(first, end, BATCH)
    ]
