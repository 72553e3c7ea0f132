"""Guided emission of a pass (I6): from settings and the pass's importance maps to its light pass."""

from __future__ import annotations

from typing import Any

from pmviewer.engine.deposition import SEED, Rules, importance_of, sampled_classes
from pmviewer.engine.importance import ImportanceStage
from pmviewer.engine.method import Plan
from pmviewer.importance.rules import relative_importance
from pmviewer.photons.deposition import Deposition, Homogeneous, Rule
from pmviewer.photons.guided import Guidance, Guided, Known
from pmviewer.photons.lightpass import PhotonMaps, guided_emission_of, trace_pass
from pmviewer.photons.tested import Sought
from pmviewer.settings import Settings


def emission_key(settings: Settings, plan: Plan, importance: ImportanceStage) -> tuple[Any, ...]:
    """What guided emission depends on besides the pass and the light pass's own settings; () while it is off."""
    maps, how = importance.latest, settings.importance
    if plan.emission == "off" or maps is None:
        return ()
    key = "emission", plan.emission, importance.key, maps.traced, how.tests, how.important, how.epsilon
    return (*key, how.caustic_M_r / how.M_r)


def guidance_of(settings: Settings, plan: Plan, importance: ImportanceStage) -> Guidance | None:
    """What the pass's photons are sent for; None where nothing is important.

    A photon of the caustic map counts as many as more of it are wanted (`importance.caustic_M_r` over `M_r`).
    """
    maps, how = importance.latest, settings.importance
    if plan.emission == "off" or maps is None or maps.n == 0:
        return None
    sought = {}
    for name, classes in (("caustic", plan.caustic_mask), ("global", plan.global_classes)):
        if classes:
            weight = how.caustic_M_r / how.M_r if name == "caustic" and plan.global_classes else 1.0
            sought[name] = Sought(relative_importance(importance_of(maps, name)), classes, weight)
    return Guidance(plan.emission, sought, how.tests, how.important)


def guided_photons(
    guidance: Guidance,
    rules: Rules,
    settings: Settings,
    plan: Plan,
    importance: ImportanceStage,
    index: int,
    N: int,
    before: Known | None,
) -> PhotonMaps | None:
    """The light pass of N trajectories with guided emission; None where they are too few to test all lights. `before`
    is what the passes before know.

    Without deposition rules, those of Christensen's emission are used with it (`Homogeneous`).
    """
    scene, run, photons = importance.scene.flat, importance.pool.run, settings.photons
    seed, caustics = settings.render.seed, bool(plan.caustic_mask)
    guided = guided_emission_of(scene, photons, seed, index * N, N, caustics, guidance, run, before)
    if guided is None:
        return None
    deposition = rules.deposition or storage(guidance, guided, settings, plan)
    return trace_pass(scene, photons, seed, index * N, N, caustics, run, deposition=deposition, guided=guided)


def storage(guidance: Guidance, guided: Guided, settings: Settings, plan: Plan) -> Deposition:
    """The rules of Christensen's emission; Peter and Pietrek's stores all photons."""
    rules: dict[str, Rule] = {}
    if guidance.variant != "Peter-Pietrek":
        for name, goal in guidance.sought.items():
            seed = settings.render.seed ^ SEED ^ (name == "global")
            rules[name] = Homogeneous(goal.importance, settings.importance.epsilon, guided.smallest, seed)
    classes = plan.caustic_mask, plan.global_classes
    return Deposition(rules.get("caustic"), rules.get("global"), *classes, sampled_classes(plan))


def note_of(plan: Plan, photons: PhotonMaps, guidance: Guidance | None) -> tuple[str, ...]:
    """Sentences for the log about the emission of a pass."""
    if photons.guided is not None:
        return photons.guided.notes
    if plan.emission == "off" or guidance is None:
        return ()
    return (
        f"Guided emission: {photons.emitted:,} photons are too few to test all lights, so they leave by power. More "
        "photons (photons.N) or fewer test photons (importance.tests) are needed.",
    )
