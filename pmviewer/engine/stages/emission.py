"""Guided emission of a pass (I6): from settings and the pass's importance maps to its light pass."""

from __future__ import annotations

from typing import Any

import numpy as np

from pmviewer.engine.plan import Plan
from pmviewer.engine.stages.deposition import Rules, importance_of, sampled_classes
from pmviewer.engine.stages.importance import ImportanceStage
from pmviewer.engine.stages.tracer import Tracer
from pmviewer.importance.rules import full_importance, relative_importance
from pmviewer.kernels.dimensions import ROUNDING_SALT, SCATTERED_SALT
from pmviewer.maps.importance.build import build_importance
from pmviewer.maps.importance.importance_map import ImportanceMap, Importons
from pmviewer.maps.power import luminances
from pmviewer.maps.record import CAUSTIC, DIRECT
from pmviewer.photons.deposition.rules import Deposition, Homogeneous, Rule
from pmviewer.photons.emission.guided import Guidance, Guided, Known
from pmviewer.photons.emission.scattered import FIRST
from pmviewer.photons.emission.tested import Sought
from pmviewer.photons.emission.window import Window, window_of
from pmviewer.photons.light_pass.light_pass import scattered_photons
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.settings.access import Settings

MOST_SCATTERED = 1 << 15
"""Importons that are scattered on."""
SCATTERED_NEIGHBOURS = 50
LEAST = 0.2
"""Importance of places for storing photons: look-ups at the border of what is seen reach across it."""


def emission_key(settings: Settings, plan: Plan, importance: ImportanceStage) -> tuple[Any, ...]:
    """What guided emission depends on besides the pass and the light pass's own settings; () while it is off."""
    maps, asked = importance.latest, settings.importance
    if plan.emission == "off" or maps is None:
        return ()
    key = "emission", plan.emission, importance.key, maps.traced, asked.tests, asked.important
    return (*key, asked.caustic_M_r / asked.M_r)


def guidance_of(settings: Settings, plan: Plan, importance: ImportanceStage) -> Guidance | None:
    """What the pass's photons are sent for; None where nothing is important.

    A photon of the caustic map counts as many as more of it are wanted (`importance.caustic_M_r` over `M_r`).
    """
    maps, asked = importance.latest, settings.importance
    if plan.emission == "off" or maps is None or maps.n == 0:
        return None
    sought, window, first = [], None, 1 << DIRECT | 1 << CAUSTIC
    if classes := plan.caustic_classes:
        made = importance_of(maps, "caustic")
        weight = asked.caustic_M_r / asked.M_r if plan.global_classes else 1.0
        evaluate = relative_importance(made, full_importance(made))
        sought.append(Sought("caustic", evaluate, classes, classes, weight))
    if classes := plan.global_classes:
        made = importance_of(maps, "global")
        full, further = full_importance(made), _scattered(settings, importance, made)
        sought.append(Sought("global", relative_importance(made, full), classes & first, classes))
        sought.append(Sought("global", relative_importance(further, full, np.inf), first, 0))
        window = _window(importance, further, full)
    return Guidance(plan.emission, sought, asked.tests, asked.important, window)


def _window(importance: ImportanceStage, further: ImportanceMap, full: float) -> Window | None:
    """Importance to photons that go on, by boxes: relative to `full`, as test photons meet it."""
    assert importance.latest is not None
    if not (further.n and full > 0):
        return None

    def make() -> Window:
        return window_of(further.positions, further.normals, further.gamma / np.float32(full))

    key = "importance by boxes", importance.key, importance.settings.photons, importance.latest.traced
    return importance.store.get(key, make, lambda made: made.bytes)


def _scattered(settings: Settings, importance: ImportanceStage, made: ImportanceMap) -> ImportanceMap:
    """Importance to photons that are scattered on: of the importons of the map, and how many are wanted of them."""
    stage, scene = importance, importance.scene.flat
    assert stage.latest is not None

    def make() -> ImportanceMap:
        places = np.empty((made.n, 7), np.float32)
        places[:, :3], places[:, 3:6] = made.positions, made.normals
        mean = float(made.weights.mean()) if made.n else 1.0
        places[:, 6] = FIRST * made.weights / mean
        places = np.ascontiguousarray(places[:: -(-made.n // MOST_SCATTERED)] if made.n else places)
        photons, normals = np.empty((0, 6), np.float32), np.empty(0, np.uint32)
        if len(places):
            seed = settings.render.seed ^ SCATTERED_SALT
            photons, normals = scattered_photons(scene, settings.photons, seed, places, stage.pool.run)
        weights = np.empty(len(photons), np.float32)
        luminances(photons.view(np.uint32), weights)
        weights *= np.float32(mean * made.n / max(len(places), 1))
        positions = np.ascontiguousarray(photons[:, :3])
        further = Importons(positions, normals, weights, np.zeros(len(photons), np.float32))
        return build_importance(further, "screen", scene.radius, SCATTERED_NEIGHBOURS, False, stage.pool.run)

    key = "scattered importance", stage.key, settings.photons, stage.latest.traced
    return stage.store.get(key, make, lambda map_: map_.bytes)


def guided_photons(
    tracer: Tracer, guidance: Guidance, rules: Rules, index: int, N: int, before: Known | None
) -> PhotonMaps | None:
    """The light pass of N trajectories with guided emission; None where they are too few to test all lights. `before`
    is what the passes before know.

    Without deposition rules, those of Christensen's emission are used with it (`Homogeneous`).
    """
    guided = tracer.guided_emission(index, N, guidance, before)
    if guided is None:
        return None
    deposition = rules.deposition or storage(guidance, guided, tracer.settings, tracer.plan)
    return tracer.trace(index, N, deposition=deposition, guided=guided)


def storage(guidance: Guidance, guided: Guided, settings: Settings, plan: Plan) -> Deposition:
    """The rules of Christensen's emission; Peter and Pietrek's stores all photons."""
    rules: dict[str, Rule] = {}
    if guidance.variant != "Peter-Pietrek":
        for goal in guidance.sought:
            if goal.places:
                seed = settings.render.seed ^ ROUNDING_SALT ^ (goal.photons == "global")
                rules[goal.photons] = Homogeneous(goal.importance, LEAST, guided.smallest, seed)
    classes = plan.caustic_classes, plan.global_classes
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
