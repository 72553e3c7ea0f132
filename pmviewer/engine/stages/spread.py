"""How far apart photons lie in what the camera sees, and radii of the first pass that follow from it.

An automatic radius goes with the pixels. Where a map is shown directly that is right as long as it holds photons: a
small room in a large scene, one lamp for a hundred of them, or the little sun that comes through the windows of a car,
is dots on black for minutes. So look-ups are wider there, by as much as places that the camera sees need for some
photons of a pass. But not by more than that is good for: a photon that can't be seen from where it is looked up lies
behind a wall, and its light would leak. relMSE after 3 CPU seconds with global look-ups 2 and 4 times as wide, over
that with the usual ones: office 0.33, 0.19; rooms_10x10 0.30, 0.19; skylight_room 0.40, 0.34; colonnade 0.47, 0.58;
door_slit, whose door leaks, 0.42, 1.35. Of caustics, after 4: car_cabin 0.23, 0.08; cognac 0.65, 0.60; three_glasses
0.70, 0.73; cornell_glossy 0.78, 0.80; cornell_caustic 0.94, 2.1; three_balls 1.03, 1.43.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.radius import FirstRadii, first_radius, rounded, seen_from
from pmviewer.engine.stages.first_photons import TRACED, traced
from pmviewer.engine.stages.free_paths import free_paths
from pmviewer.engine.stages.light_maps import of_classes
from pmviewer.engine.store import StageStore
from pmviewer.render.camera import CameraPose
from pmviewer.render.closest_hits import closest_hits
from pmviewer.render.mirrored import mark_mirrors, mirrors_of
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.settings.access import SETTINGS, Settings
from pmviewer.tasks import Runner

HELD, CAUSTIC_HELD = 8, 4
"""Photons of a pass of the default N that look-ups hold in half of the places, and those of caustics around half of
their photons: these lie where their light is bright, and its outlines are sharp. Both are smaller than what was best
after 3 and 4 seconds in most of the scenes above, as the bias stays for long."""
MOST = 32.0
"""Times the usual radius."""
LARGEST = 0.1
"""Radius relative to the scene."""
CAUSTIC_SHARE = 0.5
"""Radius of look-ups of caustics, relative to the usual one."""
FEW_TRACED, PLAIN, FEWEST_PLACES, BEHIND = 5_000, 1.5, 64, 0.1
"""Trajectories that are enough where they tell that photons lie close: radii of so many times the usual ones at most,
from so many places, walls near this share of them. Of eighteen scenes seven need no more and begin 16 ms of CPU time
sooner, with the radii that the larger number tells, or a step of them wider."""
NEAREST = 4
"""Photons that are looked at around each place."""
LEAKING = 0.3
"""Share of them that may lie behind something."""
TABLE = 1 << 15
"""Distances that are known at a time."""
PROBES = 12
"""Places along each side of the picture, and the square root of the photons of caustics that are looked around."""
SHORT = 0.05
"""Of the way between a place and a photon, what is left out at either end, for surfaces are not flat."""


def radii_of_first_pass(
    scene: OpenScene, settings: Settings, plan: Plan, camera: CameraPose, run: Runner, store: StageStore
) -> FirstRadii:
    """Photons are traced for them where automatic radii may be too small, without importance, whatever N, q and seed
    are: these change the noise of a picture, not its look-ups. The store keeps them.

    Raises Cancelled as `run` does."""
    estimate, flat = settings.estimate, scene.flat
    paths = 0.0
    if plan.volume and estimate.free_paths == "auto":
        paths = free_paths(scene, settings, plan, run, store)
    usual = first_radius(flat, camera, estimate, plan.gather)
    asked = estimate.caustic_radius
    caustic = usual * (CAUSTIC_SHARE if asked == "auto" else asked)
    if estimate.radius != "auto" or plan.nearest:
        return FirstRadii(usual, usual, caustic, paths)
    shown = 0 if plan.gather else plan.shown_directly
    looked_up = plan.caustic_classes if asked == "auto" else 0
    if not (shown or looked_up):
        return FirstRadii(usual, usual, caustic, paths)
    for count in (FEW_TRACED, TRACED):
        photons = traced(scene, settings, plan, run, store, count)
        seen = around = NOT_ASKED
        if shown:
            seen = _seen(scene, camera, settings, of_classes(photons.global_, shown)[:, :3], count)
        if looked_up:
            around = _around(camera, of_classes(photons.caustic, looked_up)[:, :3], count)
        if seen.is_plain(usual) and around.is_plain(caustic):
            break
    return FirstRadii(usual, _widened(usual, seen.radius, flat), _widened(caustic, around.radius, flat), paths)


def _widened(usual: float, wanted: float, flat: FlatScene) -> float:
    """The wanted radius in steps, no narrower than the usual one and within bounds."""
    return usual * rounded(min(max(wanted / usual, 1.0), MOST, max(LARGEST * flat.radius / usual, 1.0)))


@dataclass(frozen=True)
class Wanted:
    """The radius that holds photons, 0 where nothing can be told, from so many `places`; `behind`: share of those where
    walls decided about it."""

    radius: float
    places: int
    behind: float = 0.0

    def is_plain(self, usual: float) -> bool:
        """Whether more photons would tell hardly anything else."""
        return self.places >= FEWEST_PLACES and self.behind <= BEHIND and self.radius <= PLAIN * usual


UNKNOWN, NOT_ASKED = Wanted(0.0, 0), Wanted(0.0, FEWEST_PLACES)


def _around(camera: CameraPose, photons: NDArray[np.float32], traced: int) -> Wanted:
    """The radius that holds photons around half of those (n, 3) that lie in the picture, seen or in what is seen
    through; 0 where nothing can be told."""
    x, y, depth = camera.project(photons).T
    inside = (depth > 0) & (x > 0) & (x < camera.width) & (y > 0) & (y < camera.height)
    places = photons[inside]
    if len(photons) <= NEAREST or not len(places):
        return UNKNOWN
    middle = photons.mean(axis=0)
    places = places[np.argsort(_lots(places), kind="stable")[: PROBES**2]]
    _, distances = _nearest((places - middle).astype(np.float64), photons - middle, NEAREST + 1)  # one is itself
    return Wanted(float(np.median(_holding(CAUSTIC_HELD, distances[:, -1], traced))), len(places))


def _lots(photons: NDArray[np.float32]) -> NDArray[np.uint32]:
    """A number for each photon (n, 3) by where it is alone: those that stay when something else moves are drawn again,
    and the radius stays."""
    x, y, z = np.ascontiguousarray(photons, np.float32).view(np.uint32).T
    mixed = (x * np.uint32(0x9E3779B1)) ^ (y * np.uint32(0x85EBCA77)) ^ (z * np.uint32(0xC2B2AE3D))
    return (mixed ^ (mixed >> np.uint32(15))) * np.uint32(0x2C1B3C6D)


def _holding(held: int, distances: NDArray[np.float64], traced: int) -> NDArray[np.float64]:
    """Radii that hold so many photons of a pass, from distances to the NEAREST-th of those traced."""
    expected = held * traced / SETTINGS["photons.N"].default
    return distances * np.sqrt(expected / NEAREST)


def _seen(
    scene: OpenScene, camera: CameraPose, settings: Settings, photons: NDArray[np.float32], traced: int
) -> Wanted:
    """The radius that holds photons in half of the places that the camera sees, from photons (n, 3); 0 where nothing
    can be told."""
    flat = scene.flat
    origins, directions, t, prims = seen_from(flat, camera, PROBES)
    mirrors = mirrors_of(flat, settings.photons.glossy)
    marks = np.zeros(len(prims), np.uint8)
    if mirrors.any():
        mark_mirrors(flat.record, prims, mirrors, marks)
    stored = marks == 0
    if len(photons) < NEAREST or not stored.any():
        return UNKNOWN
    directions, t = directions[stored].astype(np.float64), t[stored, None]
    places = origins[stored] + directions * t
    near, distances = _nearest(places - flat.center, photons - flat.center.astype(np.float32), NEAREST)
    starts = places[:, None] - directions[:, None] * (SHORT * distances[..., None])
    hidden = _hidden(flat.record, starts, photons[near])
    radii = _holding(HELD, distances[:, -1], traced)
    leaks = hidden.cumsum(axis=1) > LEAKING * np.arange(1, NEAREST + 1)
    first = distances[np.arange(len(leaks)), leaks.argmax(axis=1)]
    nearer = leaks.any(axis=1) & (first < radii)
    return Wanted(float(np.median(np.where(nearer, first, radii))), len(places), float(nearer.mean()))


def _nearest(
    places: NDArray[np.float64], photons: NDArray[np.float32], k: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Of the photons (m, 3) the k nearest to each place (n, 3), in order: numbers and distances (n, k)."""
    near, rows = np.empty((len(places), k), np.int64), np.arange(len(places))
    columns, size = photons.T.astype(np.float64), max(TABLE // len(photons), 1)
    half = 0.5 * (columns**2).sum(axis=0)
    for first in range(0, len(places), size):
        part = rows[first : first + size]
        apart = half - places[part] @ columns  # (|p - x|² - |x|²)/2, small beside both: not of single precision
        for j in range(k):
            near[part, j] = apart.argmin(axis=1)
            apart[part - first, near[part, j]] = np.inf
    return near, np.linalg.norm(photons[near] - places[:, None], axis=2)


def _hidden(record: NDArray[np.void], starts: NDArray[np.float64], ends: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Whether something stands between starts and ends (n, k, 3), as (n, k)."""
    ways = (ends - starts).reshape(-1, 3)
    lengths = np.maximum(np.linalg.norm(ways, axis=1), 1e-30)
    prims = closest_hits(record[0], starts.reshape(-1, 3), ways / lengths[:, None], (1 - SHORT) * lengths).prims
    return (prims >= 0).reshape(starts.shape[:2])
