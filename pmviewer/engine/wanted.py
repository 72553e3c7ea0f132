"""What the display asks of a pass: by the settings, as far as the plan makes it."""

from __future__ import annotations

from dataclasses import replace

from pmviewer.engine.inspection import Wanted
from pmviewer.engine.method import Plan
from pmviewer.output.diagnostic_views import DIAGNOSTICS
from pmviewer.settings.access import Settings

OF_A_MAP = ("look-up", "importance", "density", "storing")
"""Families of views that show one of the maps."""


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
