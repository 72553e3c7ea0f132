"""Making what a frame holds only while it is shown.

Made from the maps of the latest pass, beside the film, when the display asks for it. A change of the display restarts
nothing; the session adds what is missing to the frame that is there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.inspection import Wanted
from pmviewer.engine.method import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.stages.convergence import convergence_plane
from pmviewer.engine.stages.deposition import Rules
from pmviewer.engine.stages.importance import ImportanceMaps
from pmviewer.importance.view import CHANNELS as IMPORTANCE_CHANNELS
from pmviewer.importance.view import importance_view, probability_view
from pmviewer.maps.importance.importance_map import NO_IMPORTANCE
from pmviewer.maps.radiance import RadianceMap
from pmviewer.maps.radius import neighbourhood
from pmviewer.maps.search.grid import PhotonGrid, build_grid
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.output.diagnostic_views import DIAGNOSTICS
from pmviewer.photons.deposition.rules import SMALLEST_EPSILON
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.render.diagnostics.density import WIDEST, counting_eye, counting_tree, density_view
from pmviewer.render.diagnostics.diagnostics import FAMILY_CHANNELS, lookup_view, shadow_view, site_view
from pmviewer.render.pixel_radius import OF_CAUSTIC, OF_GLOBAL
from pmviewer.settings.access import Importance, Settings

TILE = 2048
OF_A_MAP = ("look-up", "importance", "density", "storing")
"""Families of views that show one of the maps."""
CELL_NEIGHBOURS = 12
Record = NDArray[np.void]


@dataclass(frozen=True)
class Looked:
    """What the latest pass looked up, for kernels: the scene's and the eye's record and those of all maps."""

    scene: Record
    eye: Record
    caustic: Record
    global_: Record
    choice: Record
    sites: Record
    shadows: Record
    radiance: RadianceMap | None
    """What the record `sites` belongs to."""
    width: int
    height: int
    importance: ImportanceMaps | None = None
    how: Importance = field(default_factory=Importance)
    rules: Rules = field(default_factory=Rules)
    photons: PhotonMaps | None = None
    """The pass's photons, and by which rules they were stored."""
    stored: Callable[[str], NDArray[np.float32]] = lambda name: np.empty((0, 6), np.float32)
    """The photons of the map of that name."""
    scene_radius: float = 1.0
    radii: NDArray[np.float32] | None = None
    """Look-up radii of the pixels, where they have their own."""

    def required(self, name: str) -> tuple[np.float32, np.float32]:
        """Photons wanted per pixel in the map of that name, and the density wanted everywhere instead, −1 for none."""
        M_r = self.how.caustic_M_r if name == "caustic" else self.how.M_r
        return np.float32(M_r * self.rules.growth), np.float32(self.rules.everywhere.get(name, -1.0))


def wanted_of(settings: Settings, plan: Plan, pixel: tuple[int, int] | None = None) -> Wanted:
    """What these settings show of what this plan makes, with `pixel` the one whose gather rays were asked for; what
    can't be shown is not asked for."""
    view = settings.display.view
    wanted = Wanted()
    if view in DIAGNOSTICS and refused_view(view, plan) is None:
        family = DIAGNOSTICS[view].family
        wanted = Wanted(family, looked_map(settings, plan) if family in OF_A_MAP else "")
    if settings.overlays.paths.show and plan.photons:
        wanted = replace(wanted, paths=settings.overlays.paths.count)
    if settings.overlays.fates.show and judges(plan):
        wanted = replace(wanted, fates=settings.overlays.fates.count)
    if settings.overlays.lights.show and plan.importance:
        wanted = replace(wanted, lights=True)
    if settings.overlays.gather.show and plan.gather:
        wanted = replace(wanted, pixel=pixel)
    return wanted


def judges(plan: Plan) -> bool:
    """Whether a rule decides which photons are stored."""
    return plan.deposition != "all" or plan.emission not in ("off", "Peter-Pietrek")


def looked_map(settings: Settings, plan: Plan) -> str:
    """The map whose look-ups are shown: the one asked for, or the other where there is only that."""
    if settings.display.map == "caustic" and plan.caustic_classes:
        return "caustic"
    return "global" if plan.global_classes else "caustic"


def refused_view(view: str, plan: Plan) -> str | None:
    """Why a diagnostic view has nothing to show, None if it has."""
    family = DIAGNOSTICS[view].family
    if family == "look-up" and not plan.photons:
        return "Nothing is looked up: this method uses no photons, or no surface stores them."
    if family in ("importance", "density", "storing", "convergence") and not plan.photons:
        return "No photons are stored: this method uses none, or no surface stores them."
    if view in ("required density", "density ratio"):
        if not plan.importance and plan.deposition != "constant density":
            return "Only with importance (importance.map) or constant density (importance.deposition)."
    elif family == "importance" and not plan.importance:
        return "Only with importance (importance.map)."
    if family == "storing" and plan.deposition != "Keller-Wald":
        return "Only with the deposition rule 'Keller-Wald' (importance.deposition)."
    if family == "convergence" and not plan.convergence:
        return "Only with density control of a caustic map, and its criterion (importance.convergence)."
    if family == "shadow rays" and not plan.shadows:
        return "Only with shadow photons (direct.shadow_photons)."
    if family == "radiance photons" and not plan.radiance:
        return "Only with the method 'gather' and radiance photons (gather.radiance_photons)."
    return None


def diagnostic_planes(wanted: Wanted, looked: Looked, plan: Plan, pool: WorkPool) -> dict[str, NDArray[np.float32]]:
    """The planes of the family that is wanted, by view; none without one."""
    if wanted.family is None:
        return {}
    if wanted.family == "convergence":
        assert looked.photons is not None
        pixels = looked.width * looked.height
        states = convergence_plane(looked.scene, looked.eye, pixels, looked.photons, looked.rules, pool.run)
        return {"caustic convergence": states.reshape(looked.height, looked.width, 1)}
    channels = {**FAMILY_CHANNELS, "importance": IMPORTANCE_CHANNELS, "density": 1, "storing": 1}
    planes = _drawn(looked, channels[wanted.family], lambda out: _kernel(wanted, looked, plan, out), pool)

    def plane(*channels: int) -> NDArray[np.float32]:
        return np.ascontiguousarray(planes[list(channels)].transpose(1, 2, 0))

    if wanted.family == "look-up":
        return {"look-up radius": plane(0), "photon count": plane(1)}
    if wanted.family == "shadow rays":
        return {"shadow rays skipped": plane(0)}
    has_required = plan.importance or bool(looked.rules.everywhere)
    if wanted.family == "importance":
        return (
            {"importance": plane(0), "required density": plane(1)}
            if plan.importance
            else {"required density": plane(1)}
        )
    if wanted.family == "storing":
        return {"storing probability": plane(0)}
    if wanted.family == "density":
        made = {"achieved density": plane(0)}
        if has_required:
            of_importance = partial(_kernel, replace(wanted, family="importance"), looked, plan)
            required = _drawn(looked, IMPORTANCE_CHANNELS, of_importance, pool)[1, ..., None]
            made["density ratio"] = ratio(made["achieved density"], required)
        return made
    return {"radiance photons": plane(0, 1, 2), "radiance cells": plane(3)}


def ratio(achieved: NDArray[np.float32], required: NDArray[np.float32]) -> NDArray[np.float32]:
    """Achieved over required density, −1 where nothing is required."""
    made = np.full_like(achieved, -1.0)
    np.divide(achieved, required, out=made, where=(required > 0) & (achieved >= 0))
    return made


def _drawn(
    looked: Looked, channels: int, kernel: Callable[[NDArray[np.float32]], Callable[[int, int], Any]], pool: WorkPool
) -> NDArray[np.float32]:
    """(channels, h, w) of what a kernel, made for its output, writes tile by tile."""
    pixels = looked.width * looked.height
    out = np.empty((pixels, channels), np.float32)
    draw = kernel(out)
    pool.run([partial(draw, first, min(first + TILE, pixels)) for first in range(0, pixels, TILE)])
    return np.ascontiguousarray(out.T).reshape(-1, looked.height, looked.width)


def cells_of(sites: RadianceMap) -> PhotonGrid:
    """Radiance photons in a grid whose look-ups reach some dozen of them nearly everywhere."""
    photons = sites.grid.photons
    return build_grid(photons, max(neighbourhood(photons[:, :3], CELL_NEIGHBOURS), sites.grid.radius))


def _kernel(wanted: Wanted, looked: Looked, plan: Plan, out: NDArray[np.float32]) -> Callable[[int, int], Any]:
    if wanted.family == "shadow rays":
        return partial(shadow_view, looked.scene, looked.eye, looked.choice, looked.shadows, out)
    if wanted.family == "radiance photons":
        assert looked.radiance is not None
        cells = cells_of(looked.radiance)
        draw = partial(site_view, looked.scene, looked.eye, looked.global_, looked.sites, cells.record, out)
        return lambda first, last: (draw(first, last), cells)  # the grid lives as long as its record is used
    by_caustic = wanted.map == "caustic"
    if wanted.family == "importance":
        importance = NO_IMPORTANCE if looked.importance is None else looked.importance.record(wanted.map)
        return partial(importance_view, looked.scene, looked.eye, importance, *looked.required(wanted.map), out)
    if wanted.family == "storing":
        assert looked.importance is not None
        importance, how = looked.importance.record(wanted.map), looked.how
        f, epsilon = np.float32(looked.rules.f[wanted.map]), np.float32(max(how.epsilon, SMALLEST_EPSILON))
        discard = how.cut_off == "discard"
        return partial(probability_view, looked.scene, looked.eye, importance, f, epsilon, discard, out)
    if wanted.family == "density":
        tree = counting_tree(looked.stored(wanted.map))
        widest = np.float32(WIDEST * looked.scene_radius)
        draw = partial(density_view, looked.scene, counting_eye(looked.eye), tree.record, widest, out)
        return lambda first, last: (draw(first, last), tree)  # the tree lives as long as its record is used
    radius = looked.eye[0]["caustic_radius" if by_caustic else "global_radius"]
    mask = np.int32((plan.caustic_classes if by_caustic else plan.global_classes) & ALL_CLASSES)
    photons = looked.caustic if by_caustic else looked.global_
    radii, which = looked.radii, OF_CAUSTIC if by_caustic else OF_GLOBAL
    if not (by_caustic or plan.shown_directly):
        radii = None  # gather rays look the map up, with the radius of the pass
    return partial(lookup_view, looked.scene, looked.eye, photons, radii, which, radius, mask, out)
