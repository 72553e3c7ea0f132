"""A frame from the film and what the stages have counted."""

from __future__ import annotations

import numpy as np

from pmviewer.engine.caveats import caveats
from pmviewer.engine.diagnose import Looked
from pmviewer.engine.energy import Energy
from pmviewer.engine.frame import Frame, PhotonCloud, Statistics
from pmviewer.engine.inspection import Inspection
from pmviewer.engine.stages.irradiance_cache import cache_cloud
from pmviewer.engine.stages.virtual_lights import bias_of, objects_of
from pmviewer.engine.tally import Tally
from pmviewer.engine.told import Told
from pmviewer.maps.irradiance_cache import REACH
from pmviewer.render.adaptive import DECIDED_AFTER
from pmviewer.render.pixel_samples import samples_by_marks, without_doublings
from pmviewer.render.virtual_lights.film import WeightedFilm


def frame_of(looked: Looked, tally: Tally, inspection: Inspection, told: Told) -> Frame:
    """The film as it stands, with the clouds of the latest pass where it was rendered here, and what is told of it.
    Serial number, version and coarseness are the caller's to set."""
    scene, light = looked.scene, looked.light
    projection, maps = light.tracer.projection, light.latest
    return Frame(
        serial=0,
        version=0,
        coarse=False,
        planes=looked.film.planes(),
        unshared=looked.film.unshared(),
        settings=looked.settings,
        camera=looked.camera,
        statistics=_statistics(looked, tally, told),
        clouds=_clouds(looked),
        projections=projection.maps if projection is not None else {},
        light_places=light.places,
        exposure=scene.exposure(looked.settings.camera.name),
        lights=maps.lights if maps is not None else None,
        scene_name=scene.scene.name,
        inspection=inspection,
    )


def _clouds(looked: Looked) -> dict[str, PhotonCloud]:
    """Points of the latest pass, by what they are."""
    clouds: dict[str, PhotonCloud] = {}
    if looked.latest is None:
        return clouds
    maps, shadows, cache = looked.latest.maps, looked.latest.shadows, looked.latest.cache
    if maps.photons is not None:
        banded = looked.plan.banded
        clouds["global"] = PhotonCloud(maps.photons.global_, maps.photons.global_unit, banded=banded)
        clouds["caustic"] = PhotonCloud(maps.photons.caustic, maps.photons.caustic_unit, banded=banded)
        if looked.plan.volume:
            clouds["volume"] = PhotonCloud(maps.photons.volume, maps.photons.volume_unit, banded=banded)
    if maps.radiance is not None:
        clouds["radiance"] = PhotonCloud(maps.radiance.known(), maps.radiance.grid.power_unit)
    if shadows is not None:
        clouds["shadow"] = PhotonCloud(shadows.photons, 1.0)
    if looked.importance.latest is not None:
        clouds["importons"] = looked.importance.latest.cloud
    if cache is not None:
        clouds["cache"] = PhotonCloud(*cache_cloud(cache), cache.rows[:, REACH].copy())
    if (virtual := looked.latest.virtual) is not None:
        lights = virtual.lights
        on, names = objects_of(looked.scene.flat, lights.rows)
        clouds["virtual"] = PhotonCloud(lights.photons, lights.power_unit, objects=on, object_names=names)
    return clouds


def _statistics(looked: Looked, tally: Tally, told: Told) -> Statistics:
    film, plan = looked.film, looked.plan
    stored_in_pass = {**tally.stored_in_pass, **told.held}
    samples = max(len(film.sums) * film.passes, 1)
    energy = tally.energy.close(plan.emission.startswith("Christensen"))
    return Statistics(
        passes=film.passes,
        emitted=tally.emitted,
        stored=dict(tally.stored),
        stored_in_pass=stored_in_pass,
        radius=dict(tally.radius),
        rays=tally.rays,
        shadow_rays=tally.shadow_rays,
        saved_rays=tally.saved_rays,
        shadow_rays_per_pixel=tally.shadow_rays / samples,
        cache_records=stored_in_pass.get("cache", 0),
        gathers_per_pixel=(tally.records + tally.gathered) / samples,
        interpolated=tally.cached / max(tally.cached + tally.gathered, 1),
        seconds=tally.seconds,
        cpu_seconds=tally.cpu_seconds,
        stage_seconds=dict(tally.stage_seconds),
        map_bytes=tally.map_bytes,
        bytes_per_photon=tally.map_bytes / tally.map_photons if tally.map_photons else 0.0,
        dropped=dict(tally.dropped),
        energy=energy,
        skipped=plan.skipped,
        estimates=dict(tally.estimates),
        clamped=film.lost if isinstance(film, WeightedFilm) else 0.0,
        importons=told.importons,
        warnings=_warnings(looked, tally, energy, told),
        deposited=dict(tally.deposited),
        workers=dict(tally.workers),
    )


def _warnings(looked: Looked, tally: Tally, energy: Energy | None, told: Told) -> tuple[str, ...]:
    """Sentences for the log."""
    plan, film = looked.plan, looked.film
    pixels, marks = len(film.sums), looked.latest.marks if looked.latest is not None else np.empty(0, np.uint8)
    before = min(film.passes, DECIDED_AFTER)
    usual, latest = (
        int(samples_by_marks(kept, plan.mirror_rays, plan.edge_rays).sum()) if len(kept) else pixels
        for kept in (without_doublings(marks), marks)
    )
    paths = before * usual + (film.passes - before) * latest
    cut = caveats(looked.settings, plan, tally, energy, looked.scene.flat.radius, pixels, film.passes, paths)
    biased = bias_of(looked.settings) if plan.virtual else ()
    return (*plan.warnings, *biased, *told.sentences, *cut)
