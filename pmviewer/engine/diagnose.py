"""Making what a frame holds only while it is shown.

Made from the maps of the latest pass, beside the film, when the display asks for it. A change of the display restarts
nothing; the session adds what is missing to the frame that is there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.inspection import Inspection, Wanted
from pmviewer.engine.inspector.pixel import pixel_report
from pmviewer.engine.inspector.watched import Watched
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.stages.convergence import convergence_plane
from pmviewer.engine.stages.eye import gather_rays_of
from pmviewer.engine.stages.importance import ImportanceStage
from pmviewer.engine.stages.light import LightStage
from pmviewer.engine.stages.pass_data import RenderedPass
from pmviewer.engine.stages.pass_maps import PassMaps
from pmviewer.engine.stages.retrace import contributions_of, fates_of, paths_of
from pmviewer.importance.view import CHANNELS as IMPORTANCE_CHANNELS
from pmviewer.importance.view import importance_view, probability_view
from pmviewer.maps.importance.importance_map import NO_IMPORTANCE
from pmviewer.maps.radiance import RadianceMap
from pmviewer.maps.radius import neighbourhood
from pmviewer.maps.search.cells import MapCells, cells_of_map
from pmviewer.maps.search.grid import PhotonGrid, build_grid
from pmviewer.maps.search.kdtree import PhotonKdTree
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.output.denoise import denoised
from pmviewer.output.diagnostic_views import DENOISED, Family
from pmviewer.photons.deposition.rules import SMALLEST_EPSILON
from pmviewer.render.camera import CameraPose
from pmviewer.render.diagnostics.density import WIDEST, counting_eye, counting_tree, density_view
from pmviewer.render.diagnostics.diagnostics import FAMILY_CHANNELS, lookup_view, radiance_view, shadow_view
from pmviewer.render.diagnostics.matter import beam_view, depth_view, slice_view
from pmviewer.render.film import Film
from pmviewer.render.filter import filter_of, filtered
from pmviewer.render.pixel_radius import OF_CAUSTIC, OF_GLOBAL
from pmviewer.render.pixel_samples import samples_by_marks
from pmviewer.render.planes import PLANES, view_of
from pmviewer.render.virtual_lights.film import WeightedFilm
from pmviewer.scene.arrays.media import media_bounds
from pmviewer.settings.access import Settings, needs_of
from pmviewer.settings.needs import Facts, unmet

TILE = 2048
MATTER: Mapping[str, tuple[str, str]] = {
    "depth in media": ("optical depth", "mean free path"),
    "beams": ("volume radius", "volume photon count"),
    "slice": ("extinction slice", "photon slice"),
}
"""Views of media by their family, in the order of the channels."""
MATTER_CHANNELS = {family: len(views) for family, views in MATTER.items()}
CELL_NEIGHBOURS = 12


@dataclass(frozen=True, eq=False)
class Looked:
    """What there is to be looked into: scene and settings, the stages behind the latest pass, and that pass itself,
    None before the first. `camera` sees the full picture; the `film` may be smaller. `watched` remembers the pixel that
    is pinned."""

    scene: OpenScene
    settings: Settings
    plan: Plan
    camera: CameraPose
    film: Film
    light: LightStage
    importance: ImportanceStage
    latest: RenderedPass | None
    watched: Watched = field(default_factory=Watched)

    @property
    def rendered(self) -> RenderedPass:
        """The latest pass, where there is one."""
        assert self.latest is not None
        return self.latest

    def required(self, name: str) -> tuple[np.float32, np.float32]:
        """Photons wanted per pixel in the map of that name, and the density wanted everywhere instead, −1 for none."""
        importance, rules = self.settings.importance, self.rendered.maps.rules
        M_r = importance.caustic_M_r if name == "caustic" else importance.M_r
        return np.float32(M_r * rules.growth), np.float32(rules.everywhere.get(name, -1.0))


def inspected(wanted: Wanted, looked: Looked, pool: WorkPool) -> Inspection:
    """What is wanted of the latest pass; nothing before the first."""
    if looked.latest is None:
        return Inspection()
    tracer, maps, importance = looked.light.tracer, looked.latest.maps, looked.importance
    return Inspection(
        replace(wanted, points=True),
        planes=diagnostic_planes(wanted, looked, pool) | (_denoised(looked, pool) if wanted.denoised else {}),
        paths=paths_of(tracer, maps, wanted.paths) if wanted.paths else None,
        gathered=gather_rays_of(looked.latest, *wanted.pixel, pool) if wanted.pixel else None,
        fates=fates_of(tracer, maps, importance, wanted.fates) if wanted.fates else None,
        lights=contributions_of(tracer, maps, importance) if wanted.lights else None,
        pixel=pixel_report(looked, wanted.pinned, partial(measures_at, looked, pool), pool) if wanted.pinned else None,
        cells=_cells(wanted.cells, maps) if wanted.cells else None,
    )


def _cells(asked: tuple[str, int, int], maps: PassMaps) -> MapCells | None:
    """Of the map that is asked for, in the latest pass."""
    name, levels, limit = asked
    made = maps.by_name.get(name)
    return None if made is None else cells_of_map(name, made.structure, levels, limit)


def measures_at(looked: Looked, pool: WorkPool, map_: str, pixel: int) -> dict[str, float]:
    """What importance says of a pixel of the film, by the name of the view; nothing without importance. Values below 0
    say that there is none."""
    if not looked.plan.importance:
        return {}

    def at(family: Family, channels: int) -> list[float]:
        out = np.empty((looked.film.width * looked.film.height, channels), np.float32)
        draw = _kernel(Wanted(family, map_), looked, out)
        pool.run([partial(draw, pixel, pixel + 1)])
        return [float(value) for value in out[pixel]]

    importance, required = at("importance", IMPORTANCE_CHANNELS)
    (achieved,) = at("density", 1)
    made = {"importance": importance, "required density": required, "achieved density": achieved}
    facts = Facts(looked.settings, looked.plan, looked.scene.traits)
    if unmet(needs_of("display.view=storing probability"), facts) is None:
        (made["storing probability"],) = at("storing", 1)
    return made


def diagnostic_planes(wanted: Wanted, looked: Looked, pool: WorkPool) -> dict[str, NDArray[np.float32]]:
    """The planes of the family that is wanted, by view; none without one."""
    if wanted.family is None:
        return {}
    if wanted.family == "virtual lights":
        return looked.film.views() if isinstance(looked.film, WeightedFilm) else {}
    if wanted.family == "convergence":
        states = convergence_plane(looked.rendered, pool.run)
        return {"caustic convergence": states.reshape(looked.film.height, looked.film.width, 1)}
    if wanted.family == "estimation":
        estimates = looked.rendered.estimates
        return estimates.views() if estimates is not None else {}
    if wanted.family == "noise":
        return noise_plane(looked.film)
    if wanted.family == "samples":
        return samples_plane(looked)
    channels = {**FAMILY_CHANNELS, **MATTER_CHANNELS, "importance": IMPORTANCE_CHANNELS, "density": 1, "storing": 1}
    planes = _drawn(looked, channels[wanted.family], lambda out: _kernel(wanted, looked, out), pool)

    def plane(*channels: int) -> NDArray[np.float32]:
        return np.ascontiguousarray(planes[list(channels)].transpose(1, 2, 0))

    if wanted.family == "look-up":
        return {"look-up radius": plane(0), "photon count": plane(1)}
    if wanted.family == "shadow rays":
        return {"shadow rays skipped": plane(0)}
    if wanted.family in MATTER:
        return {view: plane(channel) for channel, view in enumerate(MATTER[wanted.family])}
    has_required = looked.plan.importance or bool(looked.rendered.maps.rules.everywhere)
    if wanted.family == "importance":
        return (
            {"importance": plane(0), "required density": plane(1)}
            if looked.plan.importance
            else {"required density": plane(1)}
        )
    if wanted.family == "storing":
        return {"storing probability": plane(0)}
    if wanted.family == "density":
        made = {"achieved density": plane(0)}
        if has_required:
            of_importance = partial(_kernel, replace(wanted, family="importance"), looked)
            required = _drawn(looked, IMPORTANCE_CHANNELS, of_importance, pool)[1, ..., None]
            made["density ratio"] = ratio(made["achieved density"], required)
        return made
    return {"radiance photons": plane(0, 1, 2), "radiance cells": plane(3)}


def noise_plane(film: Film) -> dict[str, NDArray[np.float32]]:
    """Relative standard errors in percent; −1 before two passes and in coarse pictures."""
    errors = np.full(film.width * film.height, -1.0)
    if film.moments is not None:
        errors = np.nan_to_num(100 * film.moments.relative_errors(), nan=-1.0)
    return {"noise": errors.astype(np.float32).reshape(film.height, film.width, 1)}


def samples_plane(looked: Looked) -> dict[str, NDArray[np.float32]]:
    """Samples of the pixels in the latest pass; −1 of those that it left as they were."""
    film, rendered = looked.film, looked.rendered
    samples = np.ones(film.width * film.height, np.float32)
    if len(rendered.marks):
        samples[:] = samples_by_marks(rendered.marks, looked.plan.mirror_rays, looked.plan.edge_rays)
    if film.refined is not None and film.passes > 1:
        samples[~film.refined] = -1.0
    return {"samples a pass": samples.reshape(film.height, film.width, 1)}


def _denoised(looked: Looked, pool: WorkPool) -> dict[str, NDArray[np.float32]]:
    """The picture without its noise. What a filter shares is too much alike for the denoiser to tell it from what is
    seen: it gets each pixel's own samples, and the filter comes after it. Lights, whose edges it would blur, are as the
    filter has them."""
    planes, unshared = looked.film.planes(), looked.film.unshared()
    own = planes if unshared is None else unshared
    image, albedo, normal = (view_of(own, view) for view in ("beauty", "albedo", "normal"))
    smooth = denoised(image, albedo, normal, pool.threads)
    if unshared is not None:
        lights, own_lights = planes[..., PLANES["emission"]], unshared[..., PLANES["emission"]]
        rest = filtered(smooth - own_lights, filter_of(looked.camera.filter, looked.settings.render))
        smooth = np.maximum(lights + rest, 0.0)
    return {DENOISED: smooth}


def ratio(achieved: NDArray[np.float32], required: NDArray[np.float32]) -> NDArray[np.float32]:
    """Achieved over required density, −1 where nothing is required."""
    made = np.full_like(achieved, -1.0)
    np.divide(achieved, required, out=made, where=(required > 0) & (achieved >= 0))
    return made


def _drawn(
    looked: Looked, channels: int, kernel: Callable[[NDArray[np.float32]], Callable[[int, int], Any]], pool: WorkPool
) -> NDArray[np.float32]:
    """(channels, h, w) of what a kernel, made for its output, writes tile by tile."""
    film = looked.film
    pixels = film.width * film.height
    out = np.empty((pixels, channels), np.float32)
    draw = kernel(out)
    pool.run([partial(draw, first, min(first + TILE, pixels)) for first in range(0, pixels, TILE)])
    return np.ascontiguousarray(out.T).reshape(-1, film.height, film.width)


def cells_of(radiance: RadianceMap) -> PhotonGrid:
    """Radiance photons in a grid whose look-ups reach some dozen of them nearly everywhere."""
    photons = radiance.grid.photons
    return build_grid(photons, max(neighbourhood(photons[:, :3], CELL_NEIGHBOURS), radiance.grid.radius))


def _kernel(wanted: Wanted, looked: Looked, out: NDArray[np.float32]) -> Callable[[int, int], Any]:
    """Draws pixels first … last−1 of the family into `out`."""
    given = looked.rendered.given
    scene, eye = given.scene, given.eye
    if wanted.family == "shadow rays":
        return partial(shadow_view, scene, eye, given.choice_map, given.shadows, out)
    if wanted.family == "radiance photons":
        radiance = looked.rendered.maps.radiance
        assert radiance is not None
        cells = cells_of(radiance)
        draw = partial(radiance_view, scene, eye, given.global_map, given.radiance, cells.record, out)
        return lambda first, last: (draw(first, last), cells)  # the grid lives as long as its record is used
    if wanted.family == "depth in media":
        return partial(depth_view, scene, eye, out)
    if wanted.family in ("beams", "slice"):
        return _volume_kernel(wanted, looked, out)
    latest, asked = looked.importance.latest, looked.settings.importance
    if wanted.family == "importance":
        importance = NO_IMPORTANCE if latest is None else latest.record(wanted.map)
        return partial(importance_view, scene, eye, importance, *looked.required(wanted.map), out)
    if wanted.family == "storing":
        assert latest is not None
        f = np.float32(looked.rendered.maps.rules.f[wanted.map])
        epsilon, discard = np.float32(max(asked.epsilon, SMALLEST_EPSILON)), asked.cut_off == "discard"
        return partial(probability_view, scene, eye, latest.record(wanted.map), f, epsilon, discard, out)
    if wanted.family == "density":
        tree = counting_tree(looked.light.stored(wanted.map))
        widest = np.float32(WIDEST * looked.scene.flat.radius)
        draw = partial(density_view, scene, counting_eye(eye), tree.record, widest, out)
        return lambda first, last: (draw(first, last), tree)  # the tree lives as long as its record is used
    return _lookup_kernel(wanted.map, looked, out)


def _volume_kernel(wanted: Wanted, looked: Looked, out: NDArray[np.float32]) -> Callable[[int, int], Any]:
    """Counts volume photons around rays; of a kd-tree in a grid of its own, which lives as long as its record."""
    given, volume = looked.rendered.given, looked.rendered.maps.volume
    photons, grid = given.volume_map, None
    if volume is not None and isinstance(volume.structure, PhotonKdTree):
        traced = looked.rendered.maps.photons
        assert traced is not None
        grid = build_grid(traced.volume, volume.radius, traced.volume_unit)
        photons = grid.record
    if wanted.family == "beams":
        draw = partial(beam_view, given.scene, given.eye, photons, out)
    else:
        draw = partial(slice_view, given.scene, given.eye, photons, *_plane_of_slice(wanted, looked), out)
    return lambda first, last: (draw(first, last), grid)


def _plane_of_slice(wanted: Wanted, looked: Looked) -> tuple[np.int64, np.float32]:
    """Axis and coordinate of the slice that is wanted."""
    axis, share = wanted.slice
    low, high = media_bounds(looked.scene.scene)
    return np.int64(axis), np.float32(low[axis] + share * (high[axis] - low[axis]))


def _lookup_kernel(name: str, looked: Looked, out: NDArray[np.float32]) -> Callable[[int, int], Any]:
    given, plan = looked.rendered.given, looked.plan
    if name == "caustic":
        photons, classes, which = given.caustic_map, plan.caustic_classes, OF_CAUSTIC
    else:
        photons, classes, which = given.global_map, plan.global_classes, OF_GLOBAL
    radius, mask = given.eye[0][f"{name}_radius"], np.int32(classes & ALL_CLASSES)
    radii = looked.film.radii
    if name == "global" and not plan.shown_directly:
        radii = None  # gather rays look the map up, with the radius of the pass
    return partial(lookup_view, given.scene, given.eye, photons, radii, which, radius, mask, out)
