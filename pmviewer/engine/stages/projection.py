"""Which projection maps (T7) a scene and its settings use, made once and kept with the scene."""

from __future__ import annotations

from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.photons.light_pass.plan import trajectories
from pmviewer.photons.projection.aim import MOST_LIGHTS
from pmviewer.photons.projection.projection import Projection, projection_of
from pmviewer.settings.access import Settings


def projection_for(scene: OpenScene, settings: Settings, plan: Plan | None = None) -> Projection | None:
    """The maps for these settings, and their plan if it is at hand; None where photons start everywhere."""
    wanted, plan = settings.photons.projection, plan or plan_of(settings, scene.traits)
    if wanted == "off" or not plan.photons or plan.emission != "off":
        return None
    if wanted == "auto" and len(scene.flat.light_names) > MOST_LIGHTS:
        return None
    traced, filling, _ = trajectories(settings.photons, settings.photons.N, bool(plan.caustic_classes))
    key = (wanted, traced > filling)
    if key not in scene.projections:
        confined = not scene.traits.lit_media
        made = projection_of(
            scene.flat, wanted == "on", traced > filling, confined, wanted == "on" or scene.traits.aims
        )
        useful = made.surface_power > 0 and (made.spares or (wanted == "on" and confined))  # else no photon would start
        scene.projections[key] = made if useful else None
    return scene.projections[key]
