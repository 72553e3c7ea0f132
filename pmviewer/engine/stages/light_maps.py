"""The maps of a pass, from its photons."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.radius import volume_neighbours, widest_in_media
from pmviewer.engine.stages.gather_guides import GUIDING_PHOTONS, guide_grid, guide_radius
from pmviewer.engine.stages.light_plan import LightPlan
from pmviewer.engine.stages.light_trace import TracedPass
from pmviewer.engine.stages.pass_maps import Carried, LookUpMap, PassMaps, Structure
from pmviewer.engine.stages.radiance_photons import median_radius, radiance_photons_of
from pmviewer.engine.store import StageStore
from pmviewer.maps.first import first_in_classes
from pmviewer.maps.radiance import RadianceMap
from pmviewer.maps.radius import automatic_radius, largest_power, neighbourhood
from pmviewer.maps.record import DIRECT, in_classes
from pmviewer.maps.search.grid import PhotonGrid, build_grid, grid_steps
from pmviewer.maps.search.kdtree import PhotonKdTree, build_kdtree
from pmviewer.maps.search.parts import parts_of
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.settings.access import Settings
from pmviewer.tasks import Steps, in_steps, in_turn, one_step

CHOOSING_PHOTONS = 1 << 17
"""Most photons in the map that chooses lights."""
PIECES = 4
"""Tasks a thread into which building a map is divided."""
Float = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class MapBuilder:
    """Builds the maps of one scene with one set of settings, on the threads of `pool`; those of the first passes go to
    the stage store."""

    scene: OpenScene
    settings: Settings
    plan: Plan
    pool: WorkPool
    store: StageStore

    def without_photons(self, index: int, N: int) -> PassMaps:
        """For a method that looks nothing up."""
        return PassMaps(index, N, *self._empty)

    def maps(self, light: LightPlan, traced: TracedPass, carried: Carried) -> PassMaps:
        """All maps of the pass. Radii of guides and light choice are kept from pass to pass: they blur nothing."""
        plan, photons = self.plan, traced.photons
        makes: list[Callable[[], Any]] = [
            lambda: self._guides(light, traced, carried.guides),
            lambda: self._volume(light, traced) if plan.volume else None,
        ]
        if light.kept:  # the stage store belongs to one thread
            caustic, global_ = self._photon_maps(light, traced)
            guides, volume = (make() for make in makes)
            chooser = self._kept_chooser(light, traced, carried.chooser)
        else:
            both = [
                self._photon_map(light, photons, name, PIECES * self.pool.threads) for name in ("caustic", "global")
            ]
            choosing = self._chooser(light, traced, carried.chooser)
            steps = [*both, choosing, *(one_step(make) for make in makes)]
            caustic, global_, chooser, guides, volume = in_steps(steps, self.pool.run)
        radiance, reach = None, 0.0
        if plan.radiance:
            assert global_ is not None
            radiance, reach = self._radiance(light, traced, global_)
        corner = 0.0
        if plan.corners:
            assert global_ is not None
            corner = self.settings.gather.secondary * self._typical_radius(light, photons, global_)
        return PassMaps(
            light.index,
            light.N,
            *self._empty,
            photons=photons,
            rules=light.rules,
            notes=traced.notes,
            known_before=carried.known,
            caustic=caustic,
            global_=global_,
            neighbours=light.neighbours,
            parts=light.maps,
            share=light.share,
            radiance=radiance,
            radiance_reach=reach,
            guides=guides,
            corner=corner,
            chooser=chooser,
            volume=volume,
            free_paths=light.free_paths,
        )

    @cached_property
    def _empty(self) -> tuple[Structure, PhotonGrid]:
        none = np.empty((0, 6), np.float32)
        grid = self.store.get(("empty", "radius"), lambda: build_grid(none, 1.0, 1.0), lambda _: 0)
        if self.plan.nearest:
            tree = self.store.get(("empty", "nearest"), lambda: build_kdtree(none, 1.0), lambda _: 0)
            return (parts_of([tree]) if self.plan.maps > 1 else tree), grid
        return grid, grid

    def _kept(self, light: LightPlan, key: tuple[Any, ...], make: Callable[[], Any], size: Callable[[Any], int]) -> Any:
        """What `make` returns. That of passes that are kept is made on a thread of the pool; of others whoever asks is
        on one."""
        if light.kept:
            return self.pool.run([lambda: self.store.get(key, make, size)])[0]
        return make()

    # caustic and global map ------------------------------------------------------------------------------------------

    def _photon_maps(self, light: LightPlan, traced: TracedPass) -> tuple[LookUpMap | None, LookUpMap | None]:
        found = []
        for name in ("caustic", "global"):
            make = partial(_in_turn, partial(self._photon_map, light, traced.photons, name, 1))
            key = "map", traced.key, name, self._classes(name), self._look_up_key(light, name)
            found.append(self._kept(light, key, make, lambda made: made.structure.bytes if made else 0))
        return found[0], found[1]

    def _look_up_key(self, light: LightPlan, name: str) -> tuple[Any, ...]:
        if self.plan.nearest:
            return ("nearest", self.settings.estimate, light.maps)
        return "radius", light.radii[name], light.reach[name]

    def _classes(self, name: str) -> int:
        return self.plan.caustic_classes if name == "caustic" else self.plan.global_classes

    def _photon_map(self, light: LightPlan, photons: PhotonMaps, name: str, pieces: int) -> Steps[LookUpMap | None]:
        """In steps of up to so many tasks."""
        classes = self._classes(name)
        if not classes:
            return None
        if self.plan.nearest:
            return (yield from one_step(lambda: self._photon_tree(light, photons, name, classes)))
        stored, unit = _stored(photons, name)
        return LookUpMap((yield from grid_steps(stored, light.reach[name], unit, pieces, classes)), light.radii[name])

    def _photon_tree(self, light: LightPlan, photons: PhotonMaps, name: str, classes: int) -> LookUpMap:
        """For the nearest photons, whole or in parts."""
        stored, unit = _stored(photons, name)
        chosen = of_classes(stored, classes)
        brightest = self._brightest(name, photons, chosen, unit)
        widest = self._max_radius(brightest, light.neighbours * light.maps)
        if light.maps == 1:
            return LookUpMap(build_kdtree(chosen, unit), widest)
        parts = (of_classes(part, classes) for part in photons.parts(name))
        return LookUpMap(parts_of([build_kdtree(part, unit) for part in parts]), widest)

    def _brightest(self, name: str, photons: PhotonMaps, chosen: Float, unit: float) -> float:
        """Luminance of the brightest photon of a map, in watts. Of photons stored with a probability it is that before:
        those that grew stand for many that are not there, and k of them don't meet in a disc that matters."""
        if photons.guided is not None and self.plan.deposition in ("all", "Keller-Wald"):
            return unit  # that of photons that leave by power: the few strong ones are not where the camera looks
        if self.plan.deposition == "Keller-Wald":
            return photons.deposited[name].largest_arrived
        return largest_power(chosen, unit)

    def _max_radius(self, brightest: float, k: int) -> float:
        """Of a search for k photons, as many as the pass takes."""
        estimate, scene_radius = self.settings.estimate, self.scene.flat.radius
        if estimate.max_radius != "auto":
            return float(estimate.max_radius) * scene_radius * math.sqrt(k / self.plan.neighbours)
        automatic = automatic_radius(k, brightest, estimate.black_level)
        return min(max(automatic, estimate.floor * scene_radius), 2 * scene_radius)

    def _typical_radius(self, light: LightPlan, photons: PhotonMaps, global_: LookUpMap) -> float:
        """Of look-ups in the global map: that of the pass, or the median of k-nearest ones."""
        if not isinstance(global_.structure, PhotonGrid):
            return median_radius(photons, global_.structure, global_.radius, self.settings.estimate, light)
        return global_.radius

    def _volume(self, light: LightPlan, traced: TracedPass) -> LookUpMap:
        """The pass's photons in media."""
        photons, radius, estimate = traced.photons, light.radii["volume"], self.settings.estimate
        step = 0.0 if estimate.in_media == "beam" else estimate.march_step * radius
        if estimate.in_media == "nearest":
            k, _ = volume_neighbours(light.index, estimate)
            brightest = largest_power(photons.volume, photons.volume_unit)
            widest = widest_in_media(brightest, k, estimate, self.scene.scene.media, self.scene.flat.radius)
            tree = partial(build_kdtree, photons.volume, photons.volume_unit)
            return LookUpMap(self._kept(light, ("volume tree", traced.key), tree, _bytes), widest, step)
        make = partial(build_grid, photons.volume, radius, photons.volume_unit)
        return LookUpMap(self._kept(light, ("volume", traced.key, radius), make, _bytes), radius, step)

    # beside them -----------------------------------------------------------------------------------------------------

    def _radiance(self, light: LightPlan, traced: TracedPass, global_: LookUpMap) -> tuple[RadianceMap, float]:
        """Radiance photons of the pass in the global map, and the distance up to which they are used."""
        gather, estimate = self.settings.gather, self.settings.estimate
        key = "radiance photons", traced.key, estimate, gather.radiance_photons, gather.cutoff, global_.radius
        make = partial(radiance_photons_of, traced.photons, global_, self.settings, light)
        if not light.kept:
            return self.pool.run([make])[0]
        return self._kept(light, key, make, lambda made: made[0].bytes)

    def _guides(self, light: LightPlan, traced: TracedPass, radius: float | None) -> PhotonGrid | None:
        """The pass's photons that guide gather rays, None where none do."""
        if not self.plan.guided_rays:
            return None
        asked, photons = self.settings.gather.guide_radius, traced.photons

        def build() -> PhotonGrid:
            some = of_classes(as_arrived(photons)[: 2 * GUIDING_PHOTONS], self.plan.guide_mask)
            return guide_grid(some, photons.global_unit, radius or guide_radius(some, asked, self.scene.flat.radius))

        return self._kept(light, ("guides", traced.key, self.plan.guide_mask, asked, radius), build, _bytes)

    def _kept_chooser(self, light: LightPlan, traced: TracedPass, radius: float | None) -> PhotonGrid | None:
        if not self.plan.asks_photons:
            return None
        make = partial(_in_turn, partial(self._chooser, light, traced, radius))
        return self._kept(light, ("light choice", traced.key, self.settings.direct.choice_radius, radius), make, _bytes)

    def _chooser(self, light: LightPlan, traced: TracedPass, radius: float | None) -> Steps[PhotonGrid | None]:
        """The pass's direct photons that choose lights, None where they don't. A small radius would miss lights."""
        if not self.plan.asks_photons:
            return None
        photons, scene_radius = traced.photons, self.scene.flat.radius
        primary = yield from one_step(lambda: _direct(photons))
        if radius is None:
            asked = self.settings.direct.choice_radius
            relative = neighbourhood(primary[:, :3]) / scene_radius if asked == "auto" else float(asked)
            radius = min(max(relative, 1e-4), 1.0) * scene_radius
        return (yield from grid_steps(primary, radius, photons.global_unit, PIECES * self.pool.threads))


def _direct(photons: PhotonMaps) -> Float:
    """The first photons that came from lights straight."""
    some = as_arrived(photons)[: 8 * CHOOSING_PHOTONS]  # of all classes
    return first_in_classes(some, 1 << DIRECT, CHOOSING_PHOTONS)


def _in_turn(steps: Callable[[], Steps[Any]]) -> Any:
    """On the thread that asks."""
    return in_steps([steps()], in_turn)[0]


def _stored(photons: PhotonMaps, name: str) -> tuple[Float, float]:
    """Photons of the caustic or global map, and their unit of power."""
    if name == "caustic":
        return photons.caustic, photons.caustic_unit
    return photons.global_, photons.global_unit


def _bytes(grid: PhotonGrid | PhotonKdTree) -> int:
    return grid.bytes


def as_arrived(photons: PhotonMaps) -> Float:
    """Global photons of the pass for those who count photons: no rule has thinned them."""
    return photons.sample if photons.deposited else photons.global_


def of_classes(photons: Float, mask: int) -> Float:
    """The photons whose path class has its bit in the mask."""
    wanted = in_classes(photons, mask)
    return photons if wanted is None else np.ascontiguousarray(photons[wanted])
