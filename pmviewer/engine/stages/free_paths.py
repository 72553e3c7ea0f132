"""How many free paths look-ups in media are wide at most, in the first pass.

Half of one, which is next to nothing in wax or milk: a pixel there has no photon for minutes. Beams go up to two free
paths where there are few; their discs lie along the boundary (`pmviewer.maps.estimate.beam`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.radius import FREE_PATHS, rounded
from pmviewer.engine.stages.first_photons import TRACED, key_of, traced
from pmviewer.engine.store import StageStore
from pmviewer.settings.access import SETTINGS, Settings
from pmviewer.tasks import Runner

HELD_IN_MEDIA, MOST_PATHS = 32, 2.0
"""Photons of a pass of the default N that a beam as long as a free path holds in half of the places where photons are,
and the most free paths that its radius is: two cost 0.3 % of a wax bunny's light, four 2 %."""
MOST_COUNTED = 50_000
"""Photons in media that are counted for that, spread over all of them."""


def free_paths(scene: OpenScene, settings: Settings, plan: Plan, run: Runner, store: StageStore) -> float:
    """Free paths that the radius of look-ups in media is at most."""
    media = [medium for medium in scene.scene.media if max(medium.albedo) > 0]
    path = min((medium.free_path for medium in media), default=math.inf)
    if settings.estimate.in_media != "beam" or not all(math.isfinite(medium.free_path) for medium in media):
        return FREE_PATHS
    key = "free paths", *key_of(scene, settings, plan, run)
    found: float = store.get(
        key, lambda: paths_for(traced(scene, settings, plan, run, store).volume, path), lambda _: 0
    )
    return found


def paths_for(photons: NDArray[np.float32], path: float) -> float:
    """The same for photons (n, 6) of TRACED trajectories where free paths are that long, in scene units."""
    side, step = 2.0 * path, -(-len(photons) // MOST_COUNTED) or 1
    photons = photons[::step]
    x, y, z = np.floor(photons[:, :3].T.astype(np.float64) / side).astype(np.int64)
    cells = (x * 73856093) ^ (y * 19349663) ^ (z * 83492791)  # few share one (Teschner et al. 2003)
    _, cell, counts = np.unique(cells, return_inverse=True, return_counts=True)
    beside = np.median(counts[cell] - 1.0) if len(photons) else 0.0
    density = step * beside / side**3 * SETTINGS["photons.N"].default / TRACED
    if not density > 0:
        return MOST_PATHS
    return rounded(min(max(math.sqrt(HELD_IN_MEDIA / (math.pi * density * path)) / path, FREE_PATHS), MOST_PATHS))
