"""What the light stage will do in a pass, decided before its first photon."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pmviewer.engine.plan import Plan
from pmviewer.engine.radius import FirstRadii, free_paths, pass_neighbours, pass_radius, volume_radius
from pmviewer.engine.stages.deposition import Rules, rules_of
from pmviewer.engine.stages.importance import ImportanceStage
from pmviewer.settings.access import Settings


@dataclass(frozen=True, eq=False)
class LightPlan:
    """Pass `index` of N trajectories: radii of look-ups by map in scene units, how far its maps have to `reach` (the
    largest radius in use), how many nearest photons are looked up in each of so many `maps` and in which `share` of
    their disc's area they count, whether photons need the `normals` of their surfaces, the deposition `rules`, and
    whether the results are `kept` in the stage store."""

    index: int
    N: int
    radii: Mapping[str, float]
    reach: Mapping[str, float]
    free_paths: float
    neighbours: int
    share: float
    normals: bool
    rules: Rules
    maps: int
    kept: bool


def light_plan(
    settings: Settings,
    plan: Plan,
    importance: ImportanceStage,
    index: int,
    N: int,
    first: FirstRadii,
    widest: Mapping[str, float],
) -> LightPlan:
    """For pass `index`, for which `importance` has run. first: radii of the first pass; widest: the largest in
    use by map, where they may be more than those of the pass."""
    estimate = settings.estimate
    usual, radius = (
        pass_radius(r, index, estimate, importance.scene.flat.radius) for r in (first.usual, first.global_)
    )
    paths = free_paths(first, index, estimate)
    radii = {
        "caustic": radius * first.caustic / first.global_,
        "global": radius,
        "volume": volume_radius(usual, paths, estimate, importance.scene.scene.media),
    }
    reach = {name: max(r, widest.get(name, 0.0)) for name, r in radii.items()}
    rules = Rules()
    if plan.deposition != "all":
        rules = rules_of(settings, plan, importance, index, radii, first.global_)
    normals = plan.radiance or (plan.corners and plan.nearest)
    neighbours = pass_neighbours(index, estimate, plan.neighbours, plan.maps)
    kept = index < importance.store.passes
    return LightPlan(index, N, radii, reach, paths, *neighbours, normals, rules, plan.maps, kept)
