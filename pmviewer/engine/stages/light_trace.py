"""The photons of a pass, and what follows from them before any map is built."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

from pmviewer.engine.stages.emission import emission_key, guidance_of, guided_photons, note_of
from pmviewer.engine.stages.importance import ImportanceStage
from pmviewer.engine.stages.light_plan import LightPlan
from pmviewer.engine.stages.tracer import Tracer
from pmviewer.photons.emission.guided import Guidance, Known
from pmviewer.photons.light_pass.photon_maps import PhotonMaps


@dataclass(frozen=True, eq=False)
class TracedPass:
    """Photons by the deposition rules, the `key` that names them in the stage store, and sentences for the log."""

    photons: PhotonMaps
    key: tuple[Any, ...]
    notes: tuple[str, ...]


def traced_pass(tracer: Tracer, light: LightPlan, importance: ImportanceStage, before: Known | None) -> TracedPass:
    """The photons that are planned, from the stage store where it has them. `before` is what guided emission knows from
    earlier passes."""
    settings, plan, index, N = tracer.settings, tracer.plan, light.index, light.N
    key = (
        *tracer.key(importance.scene.uid, index, N, light.normals),
        *light.rules.key,
        *emission_key(settings, plan, importance),
    )

    @cache
    def guidance() -> Guidance | None:
        return guidance_of(settings, plan, importance)

    def make() -> PhotonMaps:
        goal = guidance()
        guided = None if goal is None else guided_photons(tracer, goal, light.rules, index, N, before)
        if guided is not None:
            return guided
        return tracer.trace(index, N, normals=light.normals, deposition=light.rules.deposition)

    photons = importance.store.get(key, make, lambda made: made.bytes) if light.kept else make()
    notes = note_of(plan, photons, guidance() if photons.guided is None else None)
    return TracedPass(photons, key, (*light.rules.notes, *notes))
