"""The light pass again, for showing something of it: photon paths, fates, and what each light contributes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.stages.emission import guidance_of, storage
from pmviewer.engine.stages.importance import ImportanceStage
from pmviewer.engine.stages.pass_maps import PassMaps
from pmviewer.engine.stages.tracer import Tracer
from pmviewer.importance.lights import importance_of_lights
from pmviewer.maps.record import DIRECT
from pmviewer.photons.deposition.fates import Fates
from pmviewer.photons.deposition.rules import Deposition
from pmviewer.photons.emission.light_importance import LightImportance
from pmviewer.photons.light_pass.paths import PhotonPaths, empty_paths
from pmviewer.scene.arrays.flatten import LUMINANCE

SHOWN_TRAJECTORIES = 50_000
"""Most that are traced to show how important lights are."""


def paths_of(tracer: Tracer, maps: PassMaps, count: int) -> PhotonPaths | None:
    """Where the first `count` photons of the pass went; None without photons."""
    if maps.photons is None:
        return None
    guided = maps.photons.guided
    most = tracer.trajectories(maps.N) if guided is None else guided.n
    paths = empty_paths(min(count, most), tracer.flat.radius)
    photons = tracer.trace(maps.index, maps.N, guided=guided, watch=paths)
    return replace(paths, power_unit=photons.global_unit)


def fates_of(tracer: Tracer, maps: PassMaps, importance: ImportanceStage, count: int) -> NDArray[np.float32] | None:
    """What became of the photons of the first `count` trajectories of the pass
    (`pmviewer.photons.deposition.fates`). None where all are stored."""
    if maps.photons is None:
        return None
    deposition, guided = maps.rules.deposition, None
    guidance = guidance_of(tracer.settings, tracer.plan, importance)
    if guidance is not None:  # again: its test photons are gone
        guided = tracer.guided_emission(maps.index, maps.N, guidance, maps.known_before)
        if deposition is None and guided is not None:
            deposition = storage(guidance, guided, tracer.settings, tracer.plan)
    if deposition is None:
        return None
    fates = Fates(count)
    tracer.trace(maps.index, maps.N, deposition=deposition, watch=fates, guided=guided)
    return fates.cloud()


def contributions_of(tracer: Tracer, maps: PassMaps, importance: ImportanceStage) -> LightImportance | None:
    """How much of the picture each light lights, by new photons that are forgotten. None without importance, and with
    guided emission, which knows."""
    found, plan, flat = importance.latest, tracer.plan, tracer.flat
    if maps.photons is None or found is None or maps.photons.guided is not None:
        return None
    direct = 0 if plan.gather or not plan.global_classes else 1 << DIRECT
    of_global = plan.global_classes | direct
    everything = Deposition(None, None, plan.caustic_classes, of_global)
    photons = tracer.trace(maps.index, min(maps.N, SHOWN_TRAJECTORIES), deposition=everything)
    arrived = []
    if found.caustic is not None and plan.caustic_classes:
        arrived.append((photons.caustic, photons.caustic_normals, photons.caustic_unit, found.caustic))
    if found.global_ is not None and of_global:
        arrived.append((photons.global_, photons.normals, photons.global_unit, found.global_))
    return importance_of_lights(flat.light_names, flat.light_power @ LUMINANCE, arrived, tracer.run)
