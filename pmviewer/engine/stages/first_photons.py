"""Photons that tell radii before the first pass: of the default N, q and seed, whatever the picture's are."""

from __future__ import annotations

from typing import Any

from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.stages.projection import projection_for
from pmviewer.engine.stages.tracer import Tracer
from pmviewer.engine.store import StageStore
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.settings.access import SETTINGS, Settings
from pmviewer.tasks import Runner

TRACED = 40_000
"""Trajectories, as many as a first coarse picture has."""


def _tracer(scene: OpenScene, settings: Settings, plan: Plan, run: Runner) -> Tracer:
    """With the default N, q and seed."""
    photons = settings.photons.model_copy(update={name: SETTINGS[f"photons.{name}"].default for name in ("N", "q")})
    render = settings.render.model_copy(update={"seed": SETTINGS["render.seed"].default})
    tried = settings.model_copy(update={"photons": photons, "render": render})
    return Tracer(scene.flat, tried, plan, projection_for(scene, tried, plan), run)


def traced(
    scene: OpenScene, settings: Settings, plan: Plan, run: Runner, store: StageStore, count: int = TRACED
) -> PhotonMaps:
    """Photons of the first trajectories, all of which fill the global map."""
    tracer = _tracer(scene, settings, plan, run)
    return store.get(
        tracer.key(scene.uid, 0, count, False),
        lambda: tracer.trace(0, count),
        lambda made: made.bytes,
    )


def key_of(scene: OpenScene, settings: Settings, plan: Plan, run: Runner) -> tuple[Any, ...]:
    """What these photons depend on."""
    return _tracer(scene, settings, plan, run).key(scene.uid, 0, TRACED, False)
