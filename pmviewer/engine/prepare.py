"""Compiling, or loading from the cache, the kernels that a scene and its settings need, one visible step at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pmviewer.engine.method import estimator_of, plan_of
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.radius import radii_of_pixels
from pmviewer.engine.stages.cache_stage import prepare_cache, recipe
from pmviewer.engine.stages.convergence import prepare_convergence
from pmviewer.engine.stages.guides import gather_records
from pmviewer.engine.stages.importance import prepare_importance
from pmviewer.engine.stages.projection import projection_for
from pmviewer.kernels.accel.raycast import cast_closest
from pmviewer.maps.irradiance_cache import NO_CACHE
from pmviewer.maps.radiance import build_sites
from pmviewer.maps.search.grid import build_grid
from pmviewer.maps.search.kdtree import build_kdtree
from pmviewer.maps.shadow import shadow_record
from pmviewer.maps.variant import looked_up_by
from pmviewer.photons.deposition.depositor import prepare_rules
from pmviewer.photons.emission.strata import STRATA_DTYPE
from pmviewer.photons.light_pass.trace import LIGHT_PASS_DTYPE, N_COUNTS, PhotonBuffers, empty_ledger, trace_photons
from pmviewer.photons.projection.projected import NO_PROJECTION
from pmviewer.render.camera import resolve_camera
from pmviewer.render.direct.shadow import NO_SHADOWS
from pmviewer.render.eye import eye_pass
from pmviewer.render.film import Film
from pmviewer.render.given import PassData
from pmviewer.render.lookup import NO_SITES
from pmviewer.render.path import path_pass
from pmviewer.render.pixel_radius import first_radii
from pmviewer.render.record import EYE_DTYPE
from pmviewer.render.record import N_COUNTS as N_EYE_COUNTS
from pmviewer.settings.access import Settings

Step = tuple[str, Callable[[], object]]
Tell = Callable[[str, float | None], None]

_done: set[tuple[object, ...]] = set()
"""Kernels compile for the kind of look-up and of estimate, what the gather uses, the type of the scene's record, and
with projection maps or without."""


def prepare(scene: OpenScene, settings: Settings, pool: WorkPool, tell: Tell) -> None:
    """Call each kernel that the next passes need once, on nothing. `tell(text, share)` hears of each step.

    The first start compiles (some 20 s in all), later ones load compiled code from disk.
    """
    nearest = settings.estimate.lookup == "nearest"
    plan = plan_of(settings, scene.traits)
    with_maps = projection_for(scene, settings) is not None
    kind = (
        nearest,
        plan.radiance,
        plan.directions,
        plan.corners,
        plan.shadows,
        radii_of_pixels(settings, plan),
        plan.cache,
        plan.importance,
        plan.deposition != "all",
        plan.emission != "off",
        estimator_of(settings),
        scene.flat.record.dtype,
        with_maps,
    )
    steps = [(name, step) for name, step in _steps(scene, settings, nearest) if (name, *kind) not in _done]
    for i, (name, step) in enumerate(steps):
        tell(f"preparing kernels, {i + 1} of {len(steps)}: {name}", i / len(steps))
        pool.run([step])
        _done.add((name, *kind))


def _steps(scene: OpenScene, settings: Settings, nearest: bool) -> list[Step]:
    plan = plan_of(settings, scene.traits)
    flat = scene.flat
    empty = np.zeros((1, 6), np.float32)
    photon_map = build_kdtree if nearest else lambda photons: build_grid(photons, 1.0, 1.0)
    steps: list[Step] = [("film", lambda: Film(1, 1).planes())]
    if plan.photons:
        nothing = np.empty((0, 3), np.float32)
        light_pass = np.zeros(1, LIGHT_PASS_DTYPE)
        maps = projection_for(scene, settings)
        projections = NO_PROJECTION if maps is None else maps.records
        if plan.emission != "off":
            projections = np.zeros(2, STRATA_DTYPE)
        counts, ledger = np.zeros(N_COUNTS, np.int64), empty_ledger()
        none = np.empty(0, np.float32)
        code = np.zeros(1, np.uint32)
        steps += [
            (
                "ray casting",
                lambda: cast_closest(
                    flat.record[0],
                    nothing,
                    nothing,
                    none,
                    none,
                    none,
                    np.empty(0, np.int32),
                    np.empty((0, 2), np.float32),
                ),
            ),
            (
                "light pass",
                lambda: trace_photons(
                    flat.record,
                    light_pass,
                    projections,
                    0,
                    0,
                    PhotonBuffers(empty, empty, code, code, counts, ledger),
                    None,
                ),
            ),
            ("kd-tree" if nearest else "photon grid", lambda: photon_map(empty)),
        ]
    if plan.deposition != "all" or plan.emission != "off":
        steps.append(("deposition rules", prepare_rules))
    if plan.convergence:
        steps.append(("caustic convergence", prepare_convergence))
    if plan.importance:
        camera = resolve_camera(scene.scene, settings.camera)
        steps.append(("importance", prepare_importance(scene, settings, plan, camera)))
    eye, film = np.zeros(1, EYE_DTYPE), np.zeros((1, 1))
    eye_counts = np.zeros(N_EYE_COUNTS, np.int64)
    if plan.path:
        steps.append(("path tracer", lambda: path_pass(flat.record, eye, film, eye_counts, 0, 0)))
    else:

        def compile_eye() -> None:
            built = photon_map(empty)
            record = looked_up_by(built.record, estimator_of(settings))
            sites = NO_SITES
            if plan.radiance:
                sites = build_sites(empty, np.zeros(1, np.uint32), "all", 1.0, 1.0).record
            grid = build_grid(empty, 1.0, 1.0)
            shadows = shadow_record(build_grid(empty, 1.0), 1) if plan.shadows else NO_SHADOWS
            extra = gather_records(plan, grid)
            given = PassData(flat.record, eye, record, record, grid.record, sites, NO_CACHE, shadows, *extra)
            if plan.cache:
                how = recipe(settings.gather, resolve_camera(scene.scene, settings.camera), 0)
                given = given._replace(cache=prepare_cache(given, how).record)
            radii = first_radii(1, 0.0, 0.0) if radii_of_pixels(settings, plan) else None
            eye_pass(given, np.zeros(0, np.uint8), radii, film, eye_counts, 0, 0)

        steps.append(("eye pass", compile_eye))
    return steps
