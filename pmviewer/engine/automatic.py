"""What settings that are automatic came to in the latest pass, in the settings' own units, for whoever shows them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pmviewer.engine.diagnose import Looked
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.radius import FirstRadii
from pmviewer.engine.stages.irradiance_cache import cache_rays
from pmviewer.engine.stages.pass_data import RenderedPass
from pmviewer.engine.stages.radiance_photons import AUTOMATIC_CUTOFF, AUTOMATIC_CUTOFF_NEAREST
from pmviewer.maps.search.grid import PhotonGrid
from pmviewer.photons.bounces import most_bounces
from pmviewer.render.pixel_samples import EDGED


def automatic_values(looked: Looked, first: FirstRadii) -> dict[str, Any]:
    """By the full names of settings, whether or not they are automatic now; what isn't used is left out.

    first: radii of the first pass, in scene units; they stay the same from pass to pass.
    """
    plan, settings, radius = looked.plan, looked.settings, looked.scene.flat.radius
    found: dict[str, Any] = {"light.rig": _rig(looked.scene), "render.lights": "hidden" if plan.hides else "shown"}
    if plan.photons:
        found["estimate.lookup"] = "nearest" if plan.nearest else "radius"
        found["estimate.k"] = plan.neighbours
        found["estimate.radius"] = first.global_ / radius
        automatic = settings.estimate.radius == "auto"
        found["estimate.caustic_radius"] = first.caustic / (first.usual if automatic else first.global_)
        if first.free_paths > 0:
            found["estimate.free_paths"] = first.free_paths
        found["photons.max_bounces"] = most_bounces(settings.photons, plan.media)
        found["photons.projection"] = "off" if looked.light.tracer.projection is None else "on"
    if not plan.path:
        found["render.mirror_rays"], found["render.edge_rays"] = plan.mirror_rays, _edge_rays(looked)
    if plan.cache:
        found["gather.cache_rays"] = cache_rays(settings.gather)
    found["direct.choice"] = plan.choice
    found["direct.samples"] = plan.light_samples
    if looked.latest is not None:
        found |= _of_maps(looked.latest, plan, radius)
    return found


def _edge_rays(looked: Looked) -> int:
    """Of pixels with edges; 1 where these are so many that none has more."""
    marks = looked.latest.marks if looked.latest is not None else np.zeros(0, np.uint8)
    return looked.plan.edge_rays if (marks & EDGED).any() else 1


def _of_maps(latest: RenderedPass, plan: Plan, radius: float) -> dict[str, Any]:
    """Of a pass, in a scene of that bounding-sphere radius."""
    maps, found = latest.maps, dict[str, Any]()
    widest = [made.radius for made in maps.by_name.values() if not isinstance(made.structure, PhotonGrid)]
    if widest:
        shrunk = math.sqrt(maps.neighbours * maps.parts / plan.neighbours)
        found["estimate.max_radius"] = max(widest) / shrunk / radius
    if maps.chooser is not None:
        found["direct.choice_radius"] = maps.chooser.radius / radius
    if maps.guides is not None:
        found["gather.guide_radius"] = maps.guides.radius / radius
    if latest.shadows is not None:
        found["direct.shadow_radius"] = latest.shadows.grid.radius / radius
    if maps.radiance is not None:
        found["gather.cutoff"] = AUTOMATIC_CUTOFF_NEAREST if plan.nearest else AUTOMATIC_CUTOFF
    rules = maps.rules
    if rules.f:
        found["importance.f"] = next(iter(rules.f.values()))
    if rules.everywhere:
        found["importance.density"] = max(rules.everywhere.values()) / rules.growth
    return found


def _rig(scene: OpenScene) -> str:
    """Which lights the scene got: the file's alone, or a studio's."""
    content, lit = scene.content, scene.scene
    if content is None or (len(content.shapes), len(content.lights)) == (len(lit.shapes), len(lit.lights)):
        return "file"
    return "studio" if scene.arrangement.rig == "auto" else scene.arrangement.rig
