"""A photon's trajectory by where it was stored: the light pass is traced again until it stores a photon there (V4).

A pass is the same whenever it is traced, photon by photon. Batches are traced again until one stores a photon at just
that place, then halves of it, and the trajectory that is left once more with its path written down. Nothing is kept
beside a map for that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.photons.light_pass.batch import BATCH, trace_batch
from pmviewer.photons.light_pass.paths import PhotonPaths, empty_paths
from pmviewer.photons.light_pass.plan import PassPlan
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.tasks import Runner

TOGETHER = 8
"""Batches that are traced between two looks at what they stored."""


def trajectory_at(scene: FlatScene, plan: PassPlan, position: NDArray[np.float32], run: Runner) -> int | None:
    """Number in the pass of the trajectory that stores a photon at exactly `position` (3,); None if none does, as with
    the test photons of guided emission."""

    def stores(i0: int, i1: int) -> bool:
        batch = trace_batch(scene, plan.record, plan.emission, i0, i1)
        return any(bool((rows[:, :3] == position).all(axis=1).any()) for rows in (batch.caustic, batch.global_))

    def task(i0: int) -> tuple[int, bool]:
        return i0, stores(i0, min(i0 + BATCH, plan.traced))

    for first in range(0, plan.traced, TOGETHER * BATCH):
        starts = range(first, min(first + TOGETHER * BATCH, plan.traced), BATCH)
        held = [i0 for i0, found in run([lambda i0=i0: task(i0) for i0 in starts]) if found]  # type: ignore[misc]
        if not held:
            continue
        i0, i1 = held[0], min(held[0] + BATCH, plan.traced)
        while i1 - i0 > 1:
            middle = (i0 + i1) // 2
            found = run([lambda i0=i0, middle=middle: stores(i0, middle)])[0]  # type: ignore[misc]
            i0, i1 = (i0, middle) if found else (middle, i1)
        return i0
    return None


def path_of(scene: FlatScene, plan: PassPlan, trajectory: int, run: Runner) -> PhotonPaths:
    """The path of one trajectory of the pass, as the only one of its `PhotonPaths`."""
    if plan.guided is not None:  # its strata count trajectories: room for all before it, which stays untouched
        paths = empty_paths(trajectory + 1, scene.radius)
        run([lambda: trace_batch(scene, plan.record, plan.emission, trajectory, trajectory + 1, paths=paths)])
        return PhotonPaths(paths.vertices[-1:].copy(), paths.counts[-1:].copy(), paths.reach, plan.global_unit)
    record = plan.record.copy()
    record["first_index"] += trajectory
    record["global_trajectories"] = 1 if trajectory < plan.filling else 0
    paths = empty_paths(1, scene.radius)
    run([lambda: trace_batch(scene, record, plan.emission, 0, 1, paths=paths)])
    return PhotonPaths(paths.vertices, paths.counts, paths.reach, plan.global_unit)
