"""Passes one after another: the whole program without window and threads of its own.

`Renderer.step()` is one pass: photons, maps, eye pass, film. Everything in a pass is keyed by (seed, pass), so the film
after n passes does not depend on who called `step`, on threads, or on what was cached.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.cache import StageCache
from pmviewer.engine.caveats import caveats
from pmviewer.engine.diagnose import Looked, diagnostic_planes, wanted_of
from pmviewer.engine.exposure import metered
from pmviewer.engine.frame import Frame, PhotonCloud, Statistics
from pmviewer.engine.inspection import Inspection, Wanted
from pmviewer.engine.memory import check_memory
from pmviewer.engine.method import Plan, plan_of
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.radius import first_radius, radii_of_pixels
from pmviewer.engine.stages.cache_stage import cache_cloud, fill_cache, recipe
from pmviewer.engine.stages.guides import gather_records
from pmviewer.engine.stages.importance import ImportanceStage
from pmviewer.engine.stages.light_stage import CACHED_PASSES, LightStage
from pmviewer.engine.stages.shadows import ShadowMap, shadows_of
from pmviewer.engine.tally import Tally
from pmviewer.maps.importance.importance_map import NO_IMPORTANCE
from pmviewer.maps.irradiance_cache import NO_CACHE, REACH, IrradianceCache
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.light_pass.paths import PhotonPaths, empty_paths
from pmviewer.photons.light_pass.plan import trajectories
from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.render.direct.choice import CHOICES
from pmviewer.render.direct.outline import outline_pixels
from pmviewer.render.direct.shadow import NO_SHADOWS
from pmviewer.render.eye import eye_pass
from pmviewer.render.film import Film
from pmviewer.render.free_camera import resolve_view
from pmviewer.render.gather.gather_points import POINT_COLUMNS, gather_points
from pmviewer.render.given import PassData
from pmviewer.render.lookup import NO_SITES
from pmviewer.render.path import path_pass
from pmviewer.render.pixel_radius import OF_CAUSTIC, OF_GLOBAL, RADIUS, first_radii, shrink
from pmviewer.render.record import (
    N_COUNTS,
    eye_record,
)
from pmviewer.settings.access import Settings

MOST_POINTS = 1024
"""Most gather rays of a pixel that are told of."""

COARSE_SHRINK = 4
COARSE_PHOTONS = 40_000
COARSE_PIXELS = 160 * 160


class Renderer:
    """One scene with one set of settings. `film` holds what was rendered, `passes` how many passes that is.

    `render_camera` decides importance, stored photons and radii, `camera` what the film shows: the same unless the free
    camera is on.
    """

    def __init__(
        self, scene: OpenScene, settings: Settings, pool: WorkPool, cache: StageCache, version: int = 0
    ) -> None:
        """Raises SettingError when the camera is impossible or the image can't fit into memory."""
        self.scene, self.settings, self.pool, self.cache, self.version = scene, settings, pool, cache, version
        self.render_camera = resolve_camera(scene.scene, settings.camera)
        self.camera = resolve_view(scene.scene, settings, scene.flat.center, scene.flat.radius)
        check_memory(self.camera.width, self.camera.height, settings.photons.N)
        self.plan: Plan = plan_of(settings, scene.traits)
        self.film = Film(self.camera.width, self.camera.height)
        self.first_radius = (
            first_radius(scene.flat, self.render_camera, settings.estimate, self.plan.gather)
            if self.plan.photons
            else 0.0
        )
        self.tally = Tally()
        self.light = LightStage(scene, settings, self.plan, pool, cache, self.tally)
        self.importance = ImportanceStage(
            scene, settings, self.plan, self.render_camera, self.first_radius, pool, cache, self.tally
        )
        self._cache: IrradianceCache | None = None
        self._shadows: ShadowMap | None = None
        self._last: tuple[NDArray[np.void], tuple[NDArray[np.void], ...]] | None = None

    @property
    def passes(self) -> int:
        return self.film.passes

    @property
    def finished(self) -> bool:
        """Whether a stop rule holds."""
        render = self.settings.render
        return self.passes >= render.passes or 0 < render.time_limit <= self.tally.seconds

    def step(self) -> None:
        """Render the next pass into the film.

        Raises Cancelled, leaving the film unusable, when the pool is cancelled meanwhile.
        """
        start = time.perf_counter()
        self._pass(self.film, self.camera, self.passes, self.settings.photons.N)
        self.film.passes += 1
        self.tally.seconds += time.perf_counter() - start

    def coarse_frame(self, serial: int, wanted: Wanted | None = None) -> Frame:
        """A quick picture: a fraction of the pixels and photons, not part of the film. `wanted` as for `frame`."""
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
        if self.scene.scene.exposure is None:
            self.scene.exposures.setdefault(self.settings.camera.name, metered(film.planes()))
        wanted = replace(wanted or wanted_of(self.settings, self.plan), pixel=None)  # its pixels are others
        return quick._frame(serial, film, True, wanted)

    def frame(self, serial: int, wanted: Wanted | None = None) -> Frame:
        """The film as it stands, with what the display wants to know of the latest pass (None: by the settings)."""
        return self._frame(serial, self.film, False, wanted)

    def inspect(self, wanted: Wanted) -> Inspection:
        """What is wanted of the latest pass. The film stays as it is."""
        return self._inspect(wanted, self.film)

    def _inspect(self, wanted: Wanted, film: Film) -> Inspection:
        if self._last is None:
            return Inspection()
        eye, (caustic, global_, choice) = self._last
        sites = self.light.sites.record if self.light.sites else NO_SITES
        shadows = self._shadows.record if self._shadows else NO_SHADOWS
        scene = self.scene.flat.record
        size = film.width, film.height
        looked = Looked(
            scene,
            eye,
            caustic,
            global_,
            choice,
            sites,
            shadows,
            self.light.sites,
            *size,
            self.importance.latest,
            self.settings.importance,
            self.light.rules,
            self.light.photons,
            self.light.stored,
            self.scene.flat.radius,
            film.radii,
        )
        planes = diagnostic_planes(wanted, looked, self.plan, self.pool)
        paths = self._paths(wanted.paths) if wanted.paths else None
        gathered = self.gather_points(*wanted.pixel) if wanted.pixel else None
        fates = self.light.fates(wanted.fates, self.importance) if wanted.fates else None
        lights = self.light.importance_of_lights(self.importance) if wanted.lights else None
        return Inspection(wanted, planes, paths, gathered, fates, lights)

    def _paths(self, count: int) -> PhotonPaths | None:
        """Where the first photons of the latest pass went."""
        if self.light.traced is None:
            return None
        index, N = self.light.traced
        settings, caustics = self.settings, bool(self.plan.caustic_classes)
        traced, _, _ = trajectories(settings.photons, N, caustics)
        guided = self.light.photons.guided if self.light.photons else None
        if guided is not None:
            traced = N
        paths = empty_paths(min(count, traced if guided is None else guided.n), self.scene.flat.radius)
        photons = trace_pass(
            self.scene.flat,
            settings.photons,
            settings.render.seed,
            index * traced,
            N,
            caustics,
            self.pool.run,
            projection=self.light.projection,
            watch=paths,
            guided=guided,
        )
        return replace(paths, power_unit=photons.global_unit)

    def _frame(self, serial: int, film: Film, coarse: bool, wanted: Wanted | None) -> Frame:
        clouds = {}
        if self.light.photons is not None:
            clouds["global"] = PhotonCloud(self.light.photons.global_, self.light.photons.global_unit)
            clouds["caustic"] = PhotonCloud(self.light.photons.caustic, self.light.photons.caustic_unit)
        stored_in_pass = dict(self.tally.stored_in_pass)
        if self.light.sites is not None:
            clouds["radiance"] = PhotonCloud(self.light.sites.known(), self.light.sites.grid.power_unit)
            stored_in_pass["radiance"] = len(clouds["radiance"].photons)
        if self._shadows is not None:
            clouds["shadow"] = PhotonCloud(self._shadows.photons, 1.0)
            stored_in_pass["shadow"] = len(self._shadows.photons)
        if self.importance.latest is not None:
            clouds["importons"] = self.importance.latest.cloud
            stored_in_pass["importons"] = self.importance.latest.n
        if self._cache is not None:
            clouds["cache"] = PhotonCloud(*cache_cloud(self._cache), self._cache.rows[:, REACH].copy())
            stored_in_pass["cache"] = self._cache.n
        samples = max(len(film.sums) * film.passes, 1)
        energy = self.tally.energy.close(self.plan.emission.startswith("Christensen"))
        statistics = Statistics(
            passes=film.passes,
            emitted=self.tally.emitted,
            stored=dict(self.tally.stored),
            stored_in_pass=stored_in_pass,
            radius=dict(self.tally.radius),
            rays=self.tally.rays,
            shadow_rays=self.tally.shadow_rays,
            saved_rays=self.tally.saved_rays,
            shadow_rays_per_pixel=self.tally.shadow_rays / samples,
            cache_records=self._cache.n if self._cache else 0,
            gathers_per_pixel=(self.tally.records + self.tally.gathered) / samples,
            interpolated=self.tally.cached / max(self.tally.cached + self.tally.gathered, 1),
            seconds=self.tally.seconds,
            cpu_seconds=self.tally.cpu_seconds,
            stage_seconds=dict(self.tally.stage_seconds),
            map_bytes=self.tally.map_bytes,
            bytes_per_photon=self.tally.map_bytes / self.tally.map_photons if self.tally.map_photons else 0.0,
            dropped=dict(self.tally.dropped),
            energy=energy,
            skipped=self.plan.skipped,
            importons=self.importance.latest.traced if self.importance.latest else 0,
            warnings=(
                *self._warnings(),
                *caveats(self.settings, self.tally, energy, self.scene.flat.radius, len(film.sums), film.passes),
            ),
            deposited=dict(self.tally.deposited),
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
            projections=self.light.projection.maps if self.light.projection is not None else {},
            light_places=self.light.places,
            exposure=self.scene.exposure(self.settings.camera.name),
            lights=self.light.emission,
            scene_name=self.scene.scene.name,
            inspection=self._inspect(wanted or wanted_of(self.settings, self.plan), film),
        )

    def _warnings(self) -> tuple[str, ...]:
        """Sentences for the log."""
        latest = self.importance.latest
        unimportant: tuple[str, ...] = ()
        if latest is not None and latest.n and self.plan.deposition in ("Keller-Wald", "density control"):
            unimportant = tuple(
                f"{self.plan.deposition}: none of the {books.arrived:,} photons that arrived for the {name} map in "
                "this pass is in an important place. Does light reach what the camera sees?"
                for name, books in self.tally.deposited.items()
                if books.important == 0 and latest.record(name).dtype != NO_IMPORTANCE.dtype
            )
        return (*self.plan.warnings, *(latest.warnings if latest else ()), *self.light.notes, *unimportant)

    def _pass(self, film: Film, camera: CameraPose, index: int, N: int) -> None:
        eye = eye_record(camera, self.settings, index)
        self.importance.run(0 if self.settings.photons.renew == "once" else index)
        widest = self._radii_of_pixels(film, index)
        maps = self.light.run(eye[0], index, N, self.first_radius, self.importance, widest)
        self._set_gather(eye[0])
        if self.plan.shadows:
            self._shadows = self.tally.timed(self.pool, "shadow photons", lambda: self._shadow_map(index))
        if self.plan.cache:
            self.tally.timed(self.pool, "irradiance cache", lambda: self._fill_cache(eye, maps, camera, index))
        self.tally.timed(self.pool, "eye pass", lambda: self._eye_pass(eye, maps, film))
        self._last = eye, maps

    def _radii_of_pixels(self, film: Film, index: int) -> dict[str, float]:
        """Gives the pixels the radii of pass `index`; returns the largest by map. None without the rule."""
        if not radii_of_pixels(self.settings, self.plan):
            return {}
        estimate = self.settings.estimate
        if film.radii is None:
            film.radii = first_radii(len(film.sums), estimate.caustic_radius * self.first_radius, self.first_radius)
        else:
            shrink(film.radii, estimate.alpha, estimate.floor * self.scene.flat.radius)
        caustic, global_ = (float(film.radii[:, RADIUS + which].max()) for which in (OF_CAUSTIC, OF_GLOBAL))
        return {"caustic": caustic, "global": global_ if self.plan.shown_directly else 0.0}

    def _shadow_map(self, index: int) -> ShadowMap:
        """The shadow photons of pass `index`; those of the first where one photon map serves all passes."""
        if self.settings.photons.renew == "once":
            if self._shadows is not None:
                return self._shadows
            index = 0
        direct, glossy, seed = self.settings.direct, self.settings.photons.glossy, self.settings.render.seed
        make = partial(shadows_of, self.scene.flat, direct, glossy, seed, index, self.pool.run)
        shape = direct.shadow_N, direct.shadow_fewest, direct.shadow_radius
        key = ("shadows", self.scene.uid, seed, index, *shape, glossy)
        made = make() if index >= CACHED_PASSES else self.cache.get(key, make, lambda shadows: shadows.bytes)
        self.tally.rays += made.rays
        return made

    def _given(self, eye: NDArray[np.void], maps: tuple[NDArray[np.void], ...]) -> PassData:
        """The pass as the eye pass is given it; maps: caustic, global, and the one that chooses lights."""
        sites = self.light.sites.record if self.light.sites else NO_SITES
        shadows = self._shadows.record if self._shadows else NO_SHADOWS
        cache = self._cache.record if self._cache else NO_CACHE
        extra = gather_records(self.plan, self.light.guides)
        caustic_map, global_map, choice_map = maps
        found = caustic_map, global_map, choice_map, sites, cache, shadows
        return PassData(self.scene.flat.record, eye, *found, *extra)

    def gather_points(self, x: int, y: int) -> NDArray[np.float32]:
        """The gather rays of a pixel in the last pass, (n, POINT_COLUMNS), see `pmviewer.render.gather.gather_points`.

        None with methods that don't gather, before the first pass, and for pixels outside the image.
        """
        camera = self.camera
        inside = 0 <= x < camera.width and 0 <= y < camera.height
        if self._last is None or not self.plan.gather or not inside:
            return np.empty((0, POINT_COLUMNS), np.float32)
        eye, maps = self._last
        rows = np.empty((MOST_POINTS, POINT_COLUMNS), np.float32)
        pixel, counts = np.int64(y * camera.width + x), np.zeros(N_COUNTS, np.int64)

        def replay() -> int:
            return gather_points(self._given(eye, maps), pixel, counts, rows)

        return rows[: self.pool.run([replay])[0]].copy()

    def _set_gather(self, eye: np.void) -> None:
        eye["direct"], eye["followed_direct"] = self.plan.direct, self.plan.followed_direct
        eye["indirect_caustics"] = self.settings.photons.indirect_caustics
        eye["gather_rays"] = self.settings.gather.rays if self.plan.gather else 0
        eye["gather_specular"] = not self.settings.photons.indirect_caustics

    def _fill_cache(
        self, eye: NDArray[np.void], maps: tuple[NDArray[np.void], ...], camera: CameraPose, index: int
    ) -> None:
        how = recipe(self.settings.gather, camera, index)
        self._cache, counts = fill_cache(self._given(eye, maps), how, self.pool)
        self.tally.map_bytes += self._cache.bytes
        self.tally.records += self._cache.n
        self.tally.add_counts(counts)

    def _eye_pass(self, eye: NDArray[np.void], maps: tuple[NDArray[np.void], ...], film: Film) -> None:
        plan = self.plan
        given = self._given(eye, maps)
        outline = self._outline(film.width, film.height)
        pixels = len(film.sums)
        tile = tile_size(pixels, eye[0], self.pool.threads)

        def task(first: int) -> Callable[[], NDArray[np.int64]]:
            def run() -> NDArray[np.int64]:
                counts = np.zeros(N_COUNTS, np.int64)
                last = min(first + tile, pixels)
                if plan.path:
                    path_pass(given.scene, eye, film.sums, counts, first, last)
                else:
                    eye_pass(given, outline, film.radii, film.sums, counts, first, last)
                return counts

            return run

        counts = sum(self.pool.run([task(first) for first in range(0, pixels, tile)]), np.zeros(N_COUNTS, np.int64))
        self.tally.add_counts(counts)

    def _outline(self, width: int, height: int) -> NDArray[np.uint8]:
        """Pixels on the outline of a light, where the eye pass looks for emission with rays of its own."""
        if self.settings.render.outline_rays == 0 or self.plan.path:
            return np.zeros(0, np.uint8)
        camera = self.camera
        if (width, height) != (camera.width, camera.height):
            camera = replace(camera, width=width, height=height)
        key = ("outline", self.scene.uid, camera)
        return self.cache.get(key, lambda: outline_pixels(self.scene.scene, camera), lambda pixels: pixels.nbytes)


def tile_size(pixels: int, eye: np.void, threads: int) -> int:
    """Pixels a task, so that a task takes at most some 30 ms. The picture does not depend on it."""
    keller_wald = eye["choice"] == CHOICES.index("Keller-Wald")
    light_samples = int(eye["con_samples"] + eye["noncon_samples"] if keller_wald else eye["light_samples"])
    work = 1 + int(eye["gather_rays"]) + light_samples // 4
    return max(64, min(4096 * 2 // work, -(-pixels // (4 * threads))))
