"""The light pass and the maps made from it: what each pass of the renderer begins with."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.cache import StageCache
from pmviewer.engine.method import Plan, estimator_of
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.radius import pass_neighbours, pass_radius
from pmviewer.engine.stages.deposition import Rules, rules_of
from pmviewer.engine.stages.emission import emission_key, guidance_of, guided_photons, note_of, storage
from pmviewer.engine.stages.guides import GUIDING_PHOTONS, guide_grid, guide_radius
from pmviewer.engine.stages.importance import ImportanceStage
from pmviewer.engine.stages.projection import projection_for
from pmviewer.engine.stages.sites import median_radius, sites_of
from pmviewer.engine.tally import Tally
from pmviewer.importance.lights import importance_of_lights
from pmviewer.maps.radiance import RadianceMap
from pmviewer.maps.radius import automatic_radius, largest_power, neighbourhood
from pmviewer.maps.record import DIRECT, in_classes
from pmviewer.maps.search.grid import PhotonGrid, build_grid
from pmviewer.maps.search.kdtree import PhotonKdTree, build_kdtree
from pmviewer.maps.variant import looked_up_by
from pmviewer.photons.deposition.fates import Fates
from pmviewer.photons.deposition.rules import Deposition
from pmviewer.photons.emission.guided import Guided, Known
from pmviewer.photons.emission.light_importance import LightImportance
from pmviewer.photons.light_pass.light_pass import guided_emission_of, trace_pass
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.photons.light_pass.plan import trajectories
from pmviewer.render.direct.choice import CHOICES
from pmviewer.scene.arrays.flatten import LUMINANCE
from pmviewer.scene.light_places import light_places
from pmviewer.settings.access import Settings

CACHED_PASSES = 4
"""Photons and maps of the first passes are kept, so that a new camera or radius starts from them."""

SHOWN_TRAJECTORIES = 50_000
"""Most that are traced to show how important lights are."""
CHOOSING_PHOTONS = 1 << 17
"""Most photons in the map that chooses lights."""


class LightStage:
    """Photons and maps of one scene with one set of settings. The attributes without underscore are of the latest pass:
    `photons`, radiance photons `sites`, `guides` of gather rays, the deposition `rules`, `traced`, the (pass, N) of
    its light pass, `emission`, the importance of the lights with guided emission, `known`, the pass and
    what test photons told it so far, and `notes` for the log; `places` (n, 3) are the lights', None without importance.
    """

    def __init__(
        self, scene: OpenScene, settings: Settings, plan: Plan, pool: WorkPool, cache: StageCache, tally: Tally
    ) -> None:
        self.scene, self.settings, self.plan = scene, settings, plan
        self.pool, self.cache, self.tally = pool, cache, tally
        self.projection = projection_for(scene, settings)
        self.choice_radius: float | None = None
        self.guide_radius: float | None = None
        self.photons: PhotonMaps | None = None
        self.sites: RadianceMap | None = None
        self.guides: PhotonGrid | None = None
        self.rules = Rules()
        self.traced: tuple[int, int] | None = None
        self.emission: LightImportance | None = None
        self.places = light_places(scene.flat) if plan.importance else None
        self.notes: tuple[str, ...] = ()
        self.known: tuple[int, Known] | None = None
        self._before: Known | None = None

    def run(
        self,
        eye: np.void,
        index: int,
        N: int,
        first_radius: float,
        importance: ImportanceStage,
        widest: Mapping[str, float] = MappingProxyType({}),
    ) -> tuple[NDArray[np.void], ...]:
        """Trace the photons of pass `index` and build its maps; fills masks and radii into the eye record. `importance`
        has run for this pass; `widest` are the largest radii in use by map, where they may be more than that of the
        pass.

        Returns the records of caustic map, global map and the map that chooses lights.
        """
        if not self.plan.photons:
            record = looked_up_by(self._no_map().record, estimator_of(self.settings))
            return record, record, self._no_map(nearest=False).record
        # Photons that are kept are those of the first pass, at its radius.
        kept = self.settings.photons.renew == "once"
        maps = self._maps(eye, 0 if kept else index, N, first_radius, importance, widest)
        if not (kept and index > 0):
            assert self.photons is not None
            self.tally.add_photons(self.photons, self.scene.flat.total_luminance)
        return maps

    def stored(self, name: str) -> NDArray[np.float32]:
        """Photons of the latest pass in the map of that name, "caustic" or "global": those of the path classes that are
        looked up."""
        if self.photons is None:
            return np.empty((0, 6), np.float32)
        if name == "caustic":
            return of_classes(self.photons.caustic, self.plan.caustic_classes)
        return of_classes(self.photons.global_, self.plan.global_classes)

    def fates(self, count: int, importance: ImportanceStage) -> NDArray[np.float32] | None:
        """What became of the photons of the first `count` trajectories of the latest pass
        (`pmviewer.photons.deposition.fates`). None where all are stored."""
        deposition = self.rules.deposition
        if self.traced is None:
            return None
        guided, guidance = None, guidance_of(self.settings, self.plan, importance)
        if guidance is not None:  # again: its test photons are gone
            index, N = self.traced
            photons, seed, caustics = self.settings.photons, self.settings.render.seed, bool(self.plan.caustic_classes)
            scene, run = self.scene.flat, self.pool.run
            guided = guided_emission_of(scene, photons, seed, index * N, N, caustics, guidance, run, self._before)
            if deposition is None and guided is not None:
                deposition = storage(guidance, guided, self.settings, self.plan)
        if deposition is None:
            return None
        fates = Fates(count)
        self._trace(*self.traced, deposition, fates, guided)
        return fates.cloud()

    def importance_of_lights(self, importance: ImportanceStage) -> LightImportance | None:
        """How much of the picture each light lights, by new photons that are forgotten. None without importance, and
        with guided emission, which knows."""
        maps, plan, flat = importance.latest, self.plan, self.scene.flat
        if self.traced is None or maps is None or self.emission is not None:
            return None
        direct = 0 if plan.gather or not plan.global_classes else 1 << DIRECT
        of_global = plan.global_classes | direct
        everything = Deposition(None, None, plan.caustic_classes, of_global)
        photons = self._trace(self.traced[0], min(self.traced[1], SHOWN_TRAJECTORIES), everything)
        arrived = []
        if maps.caustic is not None and plan.caustic_classes:
            arrived.append((photons.caustic, photons.caustic_normals, photons.caustic_unit, maps.caustic))
        if maps.global_ is not None and of_global:
            arrived.append((photons.global_, photons.normals, photons.global_unit, maps.global_))
        return importance_of_lights(flat.light_names, flat.light_power @ LUMINANCE, arrived, self.pool.run)

    def _trace(
        self, index: int, N: int, deposition: Deposition, fates: Fates | None = None, guided: Guided | None = None
    ) -> PhotonMaps:
        """The light pass again, for showing something of it."""
        settings, caustics = self.settings, bool(self.plan.caustic_classes)
        traced, _, _ = trajectories(settings.photons, N, caustics)
        if guided is not None:
            traced = N
        return trace_pass(
            self.scene.flat,
            settings.photons,
            settings.render.seed,
            index * traced,
            N,
            caustics,
            self.pool.run,
            projection=None if guided is not None else self.projection,
            deposition=deposition,
            guided=guided,
            watch=fates,
        )

    def _timed(self, stage: str, run: Callable[[], Any]) -> Any:
        return self.tally.timed(self.pool, stage, run)

    def _photons_of(self, index: int, N: int, importance: ImportanceStage) -> tuple[PhotonMaps, tuple]:
        """The photons of a pass by the deposition rules, and what names them in the cache."""
        settings, scene = self.settings, self.scene
        caustics = bool(self.plan.caustic_classes)
        traced, _, _ = trajectories(settings.photons, N, caustics)
        normals = self.plan.radiance or (self.plan.corners and settings.estimate.lookup == "nearest")
        key = (
            "photons",
            scene.uid,
            settings.photons,
            settings.render.seed,
            index,
            N,
            caustics,
            normals,
            *self.rules.key,
            *emission_key(settings, self.plan, importance),
        )

        def make() -> PhotonMaps:
            guidance = guidance_of(settings, self.plan, importance)
            if guidance is not None:
                before = self.known[1] if self.known and self.known[0] == index - 1 else None
                guided = guided_photons(guidance, self.rules, settings, self.plan, importance, index, N, before)
                if guided is not None:
                    return guided
            return trace_pass(
                scene.flat,
                settings.photons,
                settings.render.seed,
                index * traced,
                N,
                caustics,
                self.pool.run,
                normals,
                self.projection,
                deposition=self.rules.deposition,
            )

        if index >= CACHED_PASSES:
            return make(), key
        return self.cache.get(key, make, lambda photons: photons.bytes), key

    def _maps(
        self,
        eye: np.void,
        index: int,
        N: int,
        first_radius: float,
        importance: ImportanceStage,
        widest: Mapping[str, float],
    ) -> tuple[NDArray[np.void], ...]:
        plan, estimate = self.plan, self.settings.estimate
        scene_radius = self.scene.flat.radius
        radius = pass_radius(first_radius, index, estimate, scene_radius)
        radii = {"caustic": radius * estimate.caustic_radius, "global": radius}
        reach = {name: max(r, widest.get(name, 0.0)) for name, r in radii.items()}
        if plan.deposition != "all":
            self.rules = rules_of(self.settings, plan, importance, index, radii, first_radius)
        photons, key = self._timed("light pass", lambda: self._photons_of(index, N, importance))
        self.traced = index, N
        self.photons = photons
        self.emission = None
        self._before = self.known[1] if self.known and self.known[0] == index - 1 else None
        if photons.guided is not None:
            self.emission = photons.guided.lights
            self.known = index, photons.guided.known
        guidance = guidance_of(self.settings, plan, importance)
        self.notes = (*self.rules.notes, *note_of(plan, photons, guidance))
        units = {"caustic": photons.caustic_unit, "global": photons.global_unit}
        clouds = {"caustic": photons.caustic, "global": photons.global_}
        classes = {"caustic": plan.caustic_classes, "global": plan.global_classes}
        nearest = estimate.lookup == "nearest"
        eye["k"], eye["share"] = pass_neighbours(index, estimate)

        def build(name: str) -> Any:
            if not classes[name]:
                return None
            chosen = of_classes(clouds[name], classes[name])
            if nearest:
                brightest = self._brightest(name, chosen, units[name])
                return build_kdtree(chosen, units[name]), self._max_radius(brightest, int(eye["k"]))
            return build_grid(chosen, reach[name], units[name]), radii[name]

        def cached(name: str) -> Any:
            map_key = (
                "map",
                key,
                name,
                classes[name],
                nearest,
                *((estimate,) if nearest else (radii[name], reach[name])),
            )
            if index >= CACHED_PASSES:
                return build(name)
            return self.cache.get(map_key, lambda: build(name), lambda m: m[0].bytes if m else 0)

        built = self._timed("maps", lambda: self._build_both(cached, index))
        records, estimator = [], estimator_of(self.settings)
        self.tally.map_bytes = self.tally.map_photons = 0
        for name, made in zip(("caustic", "global"), built, strict=True):
            if made is None:
                records.append(looked_up_by(self._no_map().record, estimator))
                continue
            structure, look_up_radius = made
            records.append(looked_up_by(structure.record, estimator))
            eye[f"{name}_radius"] = look_up_radius
            self.tally.radius[name] = look_up_radius
            self.tally.map_bytes += structure.bytes
            self.tally.map_photons += structure.n
        if plan.radiance:
            self.sites, eye["site_radius"] = self._timed("maps", lambda: self._build_sites(eye, built[1], index, key))
            self.tally.map_bytes += self.sites.bytes
        if plan.guided_rays:
            self.guides = self._timed(
                "maps", lambda: self.pool.run([lambda: self._build_guides(photons, key, index)])[0]
            )
            eye["guided_rays"], eye["guide_mask"] = plan.guided_rays, plan.guide_mask
            self.guide_radius = self.tally.radius["guides"] = self.guides.radius
            self.tally.map_bytes += self.guides.bytes
        if plan.corners:
            eye["corner"] = self.settings.gather.secondary * self._typical_radius(eye, photons, *built[1])
        eye["caustic_mask"], eye["global_mask"] = plan.caustic_mask, plan.global_mask
        eye["direct_mask"], eye["global_caustics"] = plan.direct_mask, plan.global_caustics
        eye["unfound"] = plan.unfound
        chooser = self._chooser(eye, photons, key, index)
        records.append(chooser.record)
        self._keep = built, chooser
        return tuple(records)

    def _build_both(self, cached: Callable[[str], Any], index: int) -> list[Any]:
        if index < CACHED_PASSES:  # the cache belongs to one thread
            return [self.pool.run([partial(cached, name)])[0] for name in ("caustic", "global")]
        return self.pool.run([partial(cached, name) for name in ("caustic", "global")])

    def _build_sites(self, eye: np.void, built: tuple[Any, float], index: int, key: tuple) -> tuple[RadianceMap, float]:
        """Radiance photons of the pass in the global map `built`, and their cut-off radius."""
        photons, (structure, radius), settings = self.photons, built, self.settings
        assert photons is not None

        def make() -> tuple[RadianceMap, float]:
            return self.pool.run([lambda: sites_of(photons, structure, radius, settings, eye)])[0]

        if index >= CACHED_PASSES:
            return make()
        sites_key = ("sites", key, settings.estimate, settings.gather.radiance_photons, settings.gather.cutoff, radius)
        return self.cache.get(sites_key, make, lambda made: made[0].bytes)

    def _build_guides(self, photons: PhotonMaps, key: tuple, index: int) -> PhotonGrid:
        """The pass's photons that guide gather rays, with the radius of the first pass: it blurs nothing."""
        asked = self.settings.gather.guide_radius

        def build() -> PhotonGrid:
            some = of_classes(as_arrived(photons)[: 2 * GUIDING_PHOTONS], self.plan.guide_mask)
            radius = self.guide_radius or guide_radius(some, asked, self.scene.flat.radius)
            return guide_grid(some, photons.global_unit, radius)

        if index >= CACHED_PASSES:
            return build()
        guides_key = ("guides", key, self.plan.guide_mask, asked, self.guide_radius)
        return self.cache.get(guides_key, build, lambda grid: grid.bytes)

    def _typical_radius(self, eye: np.void, photons: PhotonMaps, structure: Any, radius: float) -> float:
        """Of look-ups in the global map: that of the pass, or the median of k-nearest ones."""
        if isinstance(structure, PhotonKdTree):
            return median_radius(photons, structure, radius, eye)
        return radius

    def _chooser(self, eye: np.void, photons: PhotonMaps, key: tuple, index: int) -> PhotonGrid:
        """The map of this pass's direct photons that choose lights; fills rule and radius into the eye record.

        Its radius is that of the first pass: it blurs nothing, and a small one would miss lights.
        """
        if self.plan.choice == "power":
            return self._no_map(nearest=False)
        eye["choice"], eye["biased"] = CHOICES.index(self.plan.choice), self.settings.direct.biased
        asked = self.settings.direct.choice_radius

        def build() -> PhotonGrid:
            some = as_arrived(photons)[: 8 * CHOOSING_PHOTONS]  # of all classes
            primary = of_classes(some, 1 << DIRECT)[:CHOOSING_PHOTONS]
            if self.choice_radius is None:
                scene_radius = self.scene.flat.radius
                relative = neighbourhood(primary[:, :3]) / scene_radius if asked == "auto" else float(asked)
                self.choice_radius = min(max(relative, 1e-4), 1.0) * scene_radius
            return build_grid(primary, self.choice_radius, photons.global_unit)

        def make() -> PhotonGrid:
            if index >= CACHED_PASSES:
                return build()
            return self.cache.get(("light choice", key, asked, self.choice_radius), build, lambda grid: grid.bytes)

        chooser = self._timed("maps", lambda: self.pool.run([make])[0])
        self.choice_radius = self.tally.radius["light choice"] = chooser.radius
        eye["choice_radius"] = chooser.radius
        return chooser

    def _no_map(self, nearest: bool | None = None) -> Any:
        """An empty map: kernels take all maps, whether or not they look them up."""
        if nearest is None:
            nearest = self.settings.estimate.lookup == "nearest"
        empty = np.empty((0, 6), np.float32)
        make = (lambda: build_kdtree(empty, 1.0)) if nearest else (lambda: build_grid(empty, 1.0, 1.0))
        return self.cache.get(("empty", nearest), make, lambda _: 0)

    def _brightest(self, name: str, photons: NDArray[np.float32], unit: float) -> float:
        """Luminance of the brightest photon of a map, in watts. Of photons stored with a probability it is that before:
        those that grew stand for many that are not there, and k of them don't meet in a disc that matters."""
        assert self.photons is not None
        if self.photons.guided is not None and self.plan.deposition in ("all", "Keller-Wald"):
            return unit  # that of photons that leave by power: the few strong ones are not where the camera looks
        if self.plan.deposition == "Keller-Wald":
            return self.photons.deposited[name].largest_arrived
        return largest_power(photons, unit)

    def _max_radius(self, brightest: float, k: int) -> float:
        """Of a search for k photons, as many as the pass takes."""
        estimate, scene_radius = self.settings.estimate, self.scene.flat.radius
        if estimate.max_radius != "auto":
            return float(estimate.max_radius) * scene_radius * math.sqrt(k / estimate.k)
        automatic = automatic_radius(k, brightest, estimate.black_level)
        return min(max(automatic, estimate.floor * scene_radius), 2 * scene_radius)


def as_arrived(photons: PhotonMaps) -> NDArray[np.float32]:
    """Global photons of the pass for those who count photons: no rule has thinned them."""
    return photons.sample if photons.deposited else photons.global_


def of_classes(photons: NDArray[np.float32], mask: int) -> NDArray[np.float32]:
    """The photons whose path class has its bit in the mask."""
    wanted = in_classes(photons, mask)
    return photons if wanted is None else np.ascontiguousarray(photons[wanted])
