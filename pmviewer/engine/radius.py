"""The radius of the first pass when the user gives none, and the radius of every pass from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.estimate.nearest import shrunk
from pmviewer.maps.radius import automatic_volume_radius, progressive_radius
from pmviewer.render.camera import CameraPose
from pmviewer.render.closest_hits import closest_hits
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.scene.medium import Medium
from pmviewer.settings.access import SETTINGS, Estimate

FOOTPRINTS, GATHER_FOOTPRINTS = 4.0, 3.0
"""Radius in pixel footprints: maps shown directly need a calm estimate; gather rays average it anyway, so that theirs
can be sharper and darken corners less."""
FREE_PATHS = 0.5
"""Largest radius of look-ups in media, in mean free paths, where photons are dense enough."""
PROBES = 24
STEPS = 4
"""Automatic radii in each doubling: they are rounded, so that a small camera move keeps the maps of the view before."""


@dataclass(frozen=True)
class FirstRadii:
    """Of look-ups in the first pass, in scene units or relative to the scene: in the `global_` map and the `caustic`
    one, and the `usual` one, by pixels alone, which those in media go with. In these it is so many `free_paths` at
    most; 0 where that is not automatic, or nothing is looked up in media."""

    usual: float
    global_: float
    caustic: float
    free_paths: float = 0.0

    def scaled(self, factor: float) -> FirstRadii:
        """All of them so many times as wide."""
        return FirstRadii(factor * self.usual, factor * self.global_, factor * self.caustic, self.free_paths)

    def values(self, estimate: Estimate) -> dict[str, float]:
        """The settings that stand for these radii, which are relative to the scene, as numbers; `estimate` has what
        media have."""
        found = {"estimate.radius": self.global_, "estimate.caustic_radius": self.caustic / self.global_}
        if self.usual != self.global_:
            found["estimate.volume_radius"] = estimate.volume_radius * self.usual / self.global_
        if self.free_paths > 0:
            found["estimate.free_paths"] = self.free_paths
        return {name: within(name, value) for name, value in found.items()}


NO_RADII = FirstRadii(0.0, 0.0, 0.0)


def mean_radii(radii: Sequence[FirstRadii]) -> FirstRadii:
    """Their geometric mean."""
    parts = np.array([astuple(one) for one in radii])
    logs = np.log(parts, where=parts > 0, out=np.full(parts.shape, -np.inf))
    return FirstRadii(*(float(mean) for mean in np.exp(logs.mean(axis=0))))


def within(name: str, value: float) -> float:
    """The value, or the nearest that the setting of that name may have."""
    info = SETTINGS[name]
    return min(max(value, info.lower or 0.0), info.upper or math.inf)


def rounded(radius: float) -> float:
    """To the steps of automatic radii."""
    return float(2.0 ** (round(STEPS * math.log2(radius)) / STEPS))


def seen_from(
    scene: FlatScene, camera: CameraPose, probes: int
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.int32]]:
    """What rays through so many places along each side of the picture meet: origins and directions (n, 3), distances
    and primitives (n,) of those that meet something."""
    u = (np.arange(probes) + 0.5) / probes
    x, y = (g.reshape(-1) for g in np.meshgrid(u * camera.width, u * camera.height))
    hits = closest_hits(scene.record[0], *camera.rays(x, y))
    met = hits.prims >= 0
    return hits.origins[met], hits.directions[met], hits.t[met], hits.prims[met]


def typical_distance(scene: FlatScene, camera: CameraPose) -> float:
    """Median distance from the eye to what it sees; the scene's radius where it sees nothing."""
    _, _, hits, _ = seen_from(scene, camera, PROBES)
    return float(np.median(hits)) if len(hits) else scene.radius


def first_radius(scene: FlatScene, camera: CameraPose, estimate: Estimate, gather: bool) -> float:
    """Radius of pass 0 in scene units, with a final gather or without. The automatic one goes with the pixels
    alone (`pmviewer.engine.stages.spread` has what follows from the photons)."""
    if estimate.radius != "auto":
        return float(estimate.radius) * scene.radius
    footprint = camera.pixel_size() or typical_distance(scene, camera) * camera.pixel_angle()
    wanted = (GATHER_FOOTPRINTS if gather else FOOTPRINTS) * footprint / scene.radius
    wanted = min(max(wanted, 1e-4), 0.1)
    return rounded(wanted) * scene.radius


def _shrunk(index: int, estimate: Estimate) -> float:
    """The radius of pass `index` over that of the first."""
    return progressive_radius(1.0, index + 1, estimate.alpha, delay=estimate.delay)


def pass_neighbours(index: int, estimate: Estimate, first: int, maps: int = 1) -> tuple[int, float]:
    """Neighbours that a k-nearest look-up of pass `index` searches in each of so many maps, and the share of their
    disc's area that it uses: in all the share r²ᵢ/r²₁ of the area that the `first` pass fills
    (`pmviewer.maps.estimate.nearest`). Several maps are asked for equally many, for two at least."""
    s = _shrunk(index, estimate) ** 2
    if maps == 1:
        return shrunk(first, s)
    k = maps * max(math.ceil(first / maps), 2)
    in_each = max(math.ceil(shrunk(k, s)[0] / maps), 2)
    return in_each, s * k / (in_each * maps)


def volume_neighbours(index: int, estimate: Estimate) -> tuple[int, float]:
    """Neighbours in media in pass `index`, and the share of their ball's volume that they count in: the bias goes with
    r², so that their volume shrinks with (r²ᵢ/r²₁)^1.5."""
    return shrunk(estimate.volume_k, _shrunk(index, estimate) ** 3)


def pass_radius(first: float, index: int, estimate: Estimate, scene_radius: float) -> float:
    """Radius of pass `index` (E6), never below the floor."""
    return max(first * _shrunk(index, estimate), estimate.floor * scene_radius)


def free_paths(first: FirstRadii, index: int, estimate: Estimate) -> float:
    """Largest radius of look-ups in a medium in pass `index`, in its mean free paths."""
    automatic = first.free_paths or FREE_PATHS
    return (automatic if estimate.free_paths == "auto" else estimate.free_paths) * _shrunk(index, estimate)


def volume_radius(radius: float, paths: float, estimate: Estimate, media: Sequence[Medium]) -> float:
    """Largest radius of look-ups in media in a pass whose other look-ups have `radius`, in scene units: so many free
    `paths` at most."""
    longest = max((m.free_path for m in media if max(m.albedo) > 0), default=math.inf)
    return min(radius * estimate.volume_radius, paths * longest)


def widest_in_media(
    brightest: float, k: int, estimate: Estimate, media: Sequence[Medium], scene_radius: float
) -> float:
    """Largest radius of a search for k photons in media whose `brightest` has that luminance in watts (M3), in scene
    units; in each medium its free paths may set a smaller one."""
    thinnest = min((m.most_scattering for m in media if m.most_scattering > 0), default=math.inf)
    automatic = automatic_volume_radius(k, brightest, thinnest, estimate.black_level)
    return min(max(automatic, estimate.floor * scene_radius), 2 * scene_radius)
