"""Passes one after another: the whole program without window and threads of its own.

`Renderer.step()` is one pass: photons, maps, eye pass, film. Everything in a pass is keyed by (seed, pass), so the film
after n passes does not depend on who called `step`, on threads, or on what was cached.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.cache import StageCache
from pmviewer.engine.frame import Frame, PhotonCloud, Statistics
from pmviewer.engine.memory import check_memory
from pmviewer.engine.method import Plan, plan_of
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.radius import first_radius, pass_radius
from pmviewer.engine.sites import sites_of
from pmviewer.maps.grid import PhotonGrid, build_grid
from pmviewer.maps.kdtree import build_kdtree
from pmviewer.maps.radiance import RadianceMap
from pmviewer.maps.radius import automatic_radius, largest_power, neighbourhood
from pmviewer.maps.record import DIRECT
from pmviewer.photons.lightpass import PhotonMaps, trace_pass, trajectories
from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.render.choice import CHOICES
from pmviewer.render.eye import eye_pass
from pmviewer.render.film import Film
from pmviewer.render.lookup import NO_SITES
from pmviewer.render.path import path_pass
from pmviewer.render.record import C_DROPPED, C_RAYS, C_SHADOW_RAYS, N_COUNTS, eye_record
from pmviewer.settings import Settings

CACHED_PASSES = 4
"""Photons and maps of the first passes are kept, so that a new camera or radius starts from them."""

CHOOSING_PHOTONS = 1 << 17
"""Most photons in the map that chooses lights."""

COARSE_SHRINK = 4
COARSE_PHOTONS = 40_000
COARSE_PIXELS = 160 * 160


class Renderer:
    """One scene with one set of settings. `film` holds what was rendered, `passes` how many passes that is."""

    def __init__(
        self, scene: OpenScene, settings: Settings, pool: WorkPool, cache: StageCache, version: int = 0
    ) -> None:
        """Raises SettingError when the camera is impossible or the image can't fit into memory."""
        self.scene, self.settings, self.pool, self.cache, self.version = scene, settings, pool, cache, version
        self.camera = resolve_camera(scene.scene, settings.camera)
        check_memory(self.camera.width, self.camera.height, settings.photons.N)
        self.plan: Plan = plan_of(settings, scene.traits)
        self.film = Film(self.camera.width, self.camera.height)
        self.first_radius = (
            first_radius(scene.flat, self.camera, settings.estimate, settings.render.method)
            if self.plan.photons
            else 0.0
        )
        self.emitted = self.rays = self.shadow_rays = 0
        self.choice_radius: float | None = None
        self.seconds = self.cpu_seconds = 0.0
        self.stored = {"caustic": 0, "global": 0}
        self.stored_in_pass: dict[str, int] = {}
        self.radius: dict[str, float] = {}
        self.stage_seconds: dict[str, float] = {}
        self.dropped = {"photons": 0, "samples": 0}
        self.map_bytes = self.map_photons = 0
        self._photons: PhotonMaps | None = None
        self._sites: RadianceMap | None = None

    @property
    def passes(self) -> int:
        return self.film.passes

    @property
    def finished(self) -> bool:
        """Whether a stop rule holds."""
        render = self.settings.render
        return self.passes >= render.passes or 0 < render.time_limit <= self.seconds

    def step(self) -> None:
        """Render the next pass into the film.

        Raises Cancelled, leaving the film unusable, when the pool is cancelled meanwhile.
        """
        start = time.perf_counter()
        self._pass(self.film, self.camera, self.passes, self.settings.photons.N)
        self.film.passes += 1
        self.seconds += time.perf_counter() - start

    def coarse_frame(self, serial: int) -> Frame:
        """A quick picture: a fraction of the pixels and photons, not part of the film."""
        pose = self.camera
        shrink = COARSE_SHRINK
        while pose.width * pose.height > COARSE_PIXELS * shrink * shrink:
            shrink *= 2
        small = CameraPose(**{**pose.__dict__, "width": -(-pose.width // shrink), "height": -(-pose.height // shrink)})
        film = Film(small.width, small.height)
        N = min(self.settings.photons.N, COARSE_PHOTONS)
        quick = Renderer(self.scene, self.settings, self.pool, self.cache, self.version)
        quick.first_radius = self.first_radius * min(2.0, (self.settings.photons.N / N) ** 0.25)
        quick._pass(film, small, 0, N)
        film.passes = 1
        return quick._frame(serial, film, coarse=True)

    def frame(self, serial: int) -> Frame:
        """The film as it stands."""
        return self._frame(serial, self.film, coarse=False)

    def _frame(self, serial: int, film: Film, coarse: bool) -> Frame:
        clouds = {}
        if self._photons is not None:
            clouds["global"] = PhotonCloud(self._photons.global_, self._photons.global_unit)
            clouds["caustic"] = PhotonCloud(self._photons.caustic, self._photons.caustic_unit)
        stored_in_pass = dict(self.stored_in_pass)
        if self._sites is not None:
            clouds["radiance"] = PhotonCloud(self._sites.known(), self._sites.grid.power_unit)
            stored_in_pass["radiance"] = len(clouds["radiance"].photons)
        statistics = Statistics(
            passes=film.passes,
            emitted=self.emitted,
            stored=dict(self.stored),
            stored_in_pass=stored_in_pass,
            radius=dict(self.radius),
            rays=self.rays,
            shadow_rays=self.shadow_rays,
            shadow_rays_per_pixel=self.shadow_rays / max(len(film.sums) * film.passes, 1),
            seconds=self.seconds,
            cpu_seconds=self.cpu_seconds,
            stage_seconds=dict(self.stage_seconds),
            map_bytes=self.map_bytes,
            bytes_per_photon=self.map_bytes / self.map_photons if self.map_photons else 0.0,
            dropped=dict(self.dropped),
            skipped=self.plan.skipped,
        )
        return Frame(
            serial=serial,
            version=self.version,
            coarse=coarse,
            planes=film.planes(),
            settings=self.settings,
            camera=self.camera,
            statistics=statistics,
            clouds=clouds,
            scene_name=self.scene.scene.name,
        )

    def _timed(self, stage: str, run: Callable[[], Any]) -> Any:
        before = self.pool.cpu_seconds
        result = run()
        spent = self.pool.cpu_seconds - before
        self.stage_seconds[stage] = self.stage_seconds.get(stage, 0.0) + spent
        self.cpu_seconds += spent
        return result

    def _pass(self, film: Film, camera: CameraPose, index: int, N: int) -> None:
        eye = eye_record(camera, self.settings, index)
        maps = self._maps(eye[0], index, N) if self.plan.photons else self._no_maps()
        self._timed("eye pass", lambda: self._eye_pass(eye, maps, film))

    def _photons_of(self, index: int, N: int) -> tuple[PhotonMaps, tuple]:
        settings, scene = self.settings, self.scene
        caustics = bool(self.plan.caustic_mask)
        traced, _, _ = trajectories(settings.photons, N, caustics)
        normals = self.plan.radiance
        key = ("photons", scene.uid, settings.photons, settings.render.seed, index, N, caustics, normals)

        def make() -> PhotonMaps:
            return trace_pass(
                scene.flat, settings.photons, settings.render.seed, index * traced, N, caustics, self.pool.run, normals
            )

        if index >= CACHED_PASSES:
            return make(), key
        return self.cache.get(key, make, lambda photons: photons.bytes), key

    def _maps(self, eye: np.void, index: int, N: int) -> tuple[NDArray[np.void], ...]:
        """Trace the pass's photons and build its maps; fills masks and radii into the eye record."""
        photons, key = self._timed("light pass", lambda: self._photons_of(index, N))
        self._photons = photons
        plan, estimate = self.plan, self.settings.estimate
        scene_radius = self.scene.flat.radius
        radius = pass_radius(self.first_radius, index, estimate, scene_radius)
        radii = {"caustic": radius * estimate.caustic_radius, "global": radius}
        units = {"caustic": photons.caustic_unit, "global": photons.global_unit}
        clouds = {"caustic": photons.caustic, "global": photons.global_}
        classes = {"caustic": plan.caustic_mask, "global": plan.global_classes}
        nearest = estimate.lookup == "nearest"

        def build(name: str) -> Any:
            if not classes[name]:
                return None
            chosen = of_classes(clouds[name], classes[name])
            if nearest:
                return build_kdtree(chosen, units[name]), self._max_radius(chosen, units[name])
            return build_grid(chosen, radii[name], units[name]), radii[name]

        def cached(name: str) -> Any:
            map_key = ("map", key, name, classes[name], nearest, estimate if nearest else radii[name])
            if index >= CACHED_PASSES:
                return build(name)
            return self.cache.get(map_key, lambda: build(name), lambda m: m[0].bytes if m else 0)

        built = self._timed("maps", lambda: self._build_both(cached, index))
        records = []
        self.map_bytes = self.map_photons = 0
        for name, made in zip(("caustic", "global"), built, strict=True):
            if made is None:
                records.append(self._no_map().record)
                continue
            structure, look_up_radius = made
            records.append(structure.record)
            eye[f"{name}_radius"] = look_up_radius
            self.radius[name] = look_up_radius
            self.map_bytes += structure.bytes
            self.map_photons += structure.n
        if plan.radiance:
            self._sites, eye["site_radius"] = self._timed("maps", lambda: self._build_sites(built[1], index, key))
            self.map_bytes += self._sites.bytes
        eye["caustic_mask"], eye["global_mask"] = plan.caustic_mask, plan.global_mask
        chooser = self._chooser(eye, photons, key, index)
        records.append(chooser.record)
        self._keep = built, chooser
        self.emitted += photons.emitted
        self.rays += photons.rays
        self.dropped["photons"] += photons.dropped
        self.stored_in_pass = {"caustic": len(photons.caustic), "global": len(photons.global_)}
        for name, count in self.stored_in_pass.items():
            self.stored[name] += count
        return tuple(records)

    def _build_both(self, cached: Callable[[str], Any], index: int) -> list[Any]:
        if index < CACHED_PASSES:  # the cache belongs to one thread
            return [self.pool.run([partial(cached, name)])[0] for name in ("caustic", "global")]
        return self.pool.run([partial(cached, name) for name in ("caustic", "global")])

    def _build_sites(self, built: tuple[Any, float], index: int, key: tuple) -> tuple[RadianceMap, float]:
        """Radiance photons of the pass in the global map `built`, and their cut-off radius."""
        photons, (structure, radius), settings = self._photons, built, self.settings
        assert photons is not None

        def make() -> tuple[RadianceMap, float]:
            return self.pool.run([lambda: sites_of(photons, structure, radius, settings)])[0]

        if index >= CACHED_PASSES:
            return make()
        sites_key = ("sites", key, settings.estimate, settings.gather.radiance_photons, settings.gather.cutoff, radius)
        return self.cache.get(sites_key, make, lambda made: made[0].bytes)

    def _chooser(self, eye: np.void, photons: PhotonMaps, key: tuple, index: int) -> PhotonGrid:
        """The map of this pass's direct photons that choose lights; fills rule and radius into the eye record.

        Its radius is that of the first pass: it blurs nothing, and a small one would miss lights.
        """
        if self.plan.choice == "power":
            return self._no_map(nearest=False)
        eye["choice"], eye["biased"] = CHOICES.index(self.plan.choice), self.settings.direct.biased
        asked = self.settings.direct.choice_radius

        def build() -> PhotonGrid:
            some = photons.global_[: 8 * CHOOSING_PHOTONS]  # of all classes
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
        self.choice_radius = self.radius["light choice"] = chooser.radius
        eye["choice_radius"] = chooser.radius
        return chooser

    def _no_map(self, nearest: bool | None = None) -> Any:
        """An empty map: kernels take all maps, whether or not they look them up."""
        if nearest is None:
            nearest = self.settings.estimate.lookup == "nearest"
        empty = np.empty((0, 6), np.float32)
        make = (lambda: build_kdtree(empty, 1.0)) if nearest else (lambda: build_grid(empty, 1.0, 1.0))
        return self.cache.get(("empty", nearest), make, lambda _: 0)

    def _no_maps(self) -> tuple[NDArray[np.void], ...]:
        record = self._no_map().record
        return record, record, self._no_map(nearest=False).record

    def _max_radius(self, photons: NDArray[np.float32], unit: float) -> float:
        estimate, scene_radius = self.settings.estimate, self.scene.flat.radius
        if estimate.max_radius != "auto":
            return float(estimate.max_radius) * scene_radius
        automatic = automatic_radius(estimate.k, largest_power(photons, unit), estimate.black_level)
        return min(max(automatic, estimate.floor * scene_radius), 2 * scene_radius)

    def _eye_pass(self, eye: NDArray[np.void], maps: tuple[NDArray[np.void], ...], film: Film) -> None:
        plan, settings = self.plan, self.settings
        eye[0]["direct"] = plan.direct
        eye[0]["gather_rays"] = settings.gather.rays if plan.gather else 0
        eye[0]["gather_specular"] = not settings.photons.indirect_caustics
        sites = self._sites.record if self._sites else NO_SITES
        scene = self.scene.flat.record
        pixels = len(film.sums)
        tile = tile_size(pixels, eye[0], self.pool.threads)

        def task(first: int) -> Callable[[], NDArray[np.int64]]:
            def run() -> NDArray[np.int64]:
                counts = np.zeros(N_COUNTS, np.int64)
                last = min(first + tile, pixels)
                if plan.path:
                    path_pass(scene, eye, film.sums, counts, first, last)
                else:
                    eye_pass(scene, eye, *maps, sites, film.sums, counts, first, last)
                return counts

            return run

        counts = sum(self.pool.run([task(first) for first in range(0, pixels, tile)]), np.zeros(N_COUNTS, np.int64))
        self.rays += int(counts[C_RAYS])
        self.shadow_rays += int(counts[C_SHADOW_RAYS])
        self.dropped["samples"] += int(counts[C_DROPPED])


def tile_size(pixels: int, eye: np.void, threads: int) -> int:
    """Pixels a task, so that a task takes at most some 30 ms. The picture does not depend on it."""
    keller_wald = eye["choice"] == CHOICES.index("Keller-Wald")
    light_samples = int(eye["con_samples"] + eye["noncon_samples"] if keller_wald else eye["light_samples"])
    work = 1 + int(eye["gather_rays"]) + light_samples // 4
    return max(64, min(4096 * 2 // work, -(-pixels // (4 * threads))))


def of_classes(photons: NDArray[np.float32], mask: int) -> NDArray[np.float32]:
    """The photons whose path class has its bit in the mask."""
    if mask == 0b1111 or not len(photons):
        return photons
    classes = (photons.view(np.uint32)[:, 3] >> 6) & 3
    wanted = np.array([mask >> c & 1 for c in range(4)], bool)[classes]
    return photons if wanted.all() else np.ascontiguousarray(photons[wanted])
