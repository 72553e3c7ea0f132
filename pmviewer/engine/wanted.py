"""What the display asks of a pass: by the settings, as far as the plan makes it."""

from __future__ import annotations

from dataclasses import replace

from pmviewer.engine.inspection import Wanted
from pmviewer.engine.inspector.report import Pinned
from pmviewer.engine.plan import Plan
from pmviewer.output.diagnostic_views import DENOISED, DIAGNOSTICS
from pmviewer.settings.access import Settings, get, needs_of
from pmviewer.settings.needs import Facts, unmet
from pmviewer.settings.schema.display import MAP_VIEWS, SLICE_VIEWS

POINTS = "caustic", "global", "volume", "radiance", "cache", "shadow", "virtual", "importons"
"""Overlays of points of the latest pass."""


def wanted_of(facts: Facts, pixel: tuple[int, int] | None = None, pinned: Pinned | None = None) -> Wanted:
    """What the settings show of what the plan makes, with `pixel` the one whose gather rays were asked for and what is
    `pinned`; what can't be shown is not asked for."""
    settings: Settings = facts.settings
    view, overlays = settings.display.view, settings.overlays

    def shown(overlay: str) -> bool:
        path = f"overlays.{overlay}.show"
        return get(settings, path) and unmet(needs_of(path), facts) is None

    wanted = Wanted(pinned=pinned, points=any(map(shown, POINTS)))
    if view in DIAGNOSTICS and unmet(needs_of(f"display.view={view}"), facts) is None:
        map_ = looked_map(settings, facts.plan) if view in MAP_VIEWS else ""
        wanted = replace(wanted, family=DIAGNOSTICS[view].family, map=map_)
        if view in SLICE_VIEWS:
            wanted = replace(wanted, slice=("xyz".index(settings.display.slice_axis), settings.display.slice))
    if view == DENOISED and unmet(needs_of(f"display.view={view}"), facts) is None:
        wanted = replace(wanted, denoised=True)
    if shown("paths"):
        wanted = replace(wanted, paths=overlays.paths.count)
    if shown("fates"):
        wanted = replace(wanted, fates=overlays.fates.count)
    if shown("lights"):
        wanted = replace(wanted, lights=True)
    if shown("cells"):
        cells = overlays.cells
        wanted = replace(wanted, cells=(divided_map(cells.map, facts.plan), cells.levels, cells.limit))
    if shown("gather"):
        wanted = replace(wanted, pixel=pixel)
    return wanted


def looked_map(settings: Settings, plan: Plan) -> str:
    """The map whose look-ups are shown: the one asked for, or the other where there is only that."""
    if settings.display.map == "caustic" and plan.caustic_classes:
        return "caustic"
    return "global" if plan.global_classes else "caustic"


def divided_map(asked: str, plan: Plan) -> str:
    """The map whose cells are shown: the one asked for, or the first that there is."""
    there = {"global": plan.global_classes, "caustic": plan.caustic_classes, "volume": plan.volume}
    return asked if there[asked] else next((name for name, made in there.items() if made), asked)
