"""The deposition rules of a pass, from the settings and the pass's importance maps."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.plan import Plan
from pmviewer.engine.stages.importance import ImportanceMaps, ImportanceStage
from pmviewer.importance.importons import Rule as ImportonRule
from pmviewer.importance.importons import trace
from pmviewer.importance.rules import TESTS, automatic_f, density_beyond, density_of, probability_of
from pmviewer.kernels.dimensions import ROUNDING_SALT, TEST_RAY_SALT
from pmviewer.maps.convergence import Criterion
from pmviewer.maps.density.control import NEAREST, Around
from pmviewer.maps.density.decide import ACCEPTANCE
from pmviewer.maps.density.growing_tree import M
from pmviewer.maps.importance.importance_map import ImportanceMap
from pmviewer.maps.record import DIRECT
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.photons.deposition.rules import (
    Density,
    Deposition,
    Evaluate,
    KellerWald,
    Rule,
    constant,
    density_of_discs,
)
from pmviewer.render.record import eye_record
from pmviewer.settings.access import Settings
from pmviewer.settings.schema.importance import WITHOUT_IMPORTANCE


@dataclass(frozen=True)
class Rules:
    """The pass's `deposition` for the light pass, None where all photons are stored; `key` names it in the stage store,
    () where it is None; `notes` are sentences for the log; `required` are the functions of required density by map, for
    density control. For views: `f` of Keller and Wald by map, the constant density by map where it is required
    (`everywhere`), and the `growth` of required densities since the first pass."""

    deposition: Deposition | None = None
    key: tuple[Any, ...] = ()
    notes: tuple[str, ...] = ()
    required: dict[str, Evaluate] | None = None
    f: dict[str, float] = field(default_factory=dict)
    everywhere: dict[str, float] = field(default_factory=dict)
    growth: float = 1.0


def rules_of(
    settings: Settings, plan: Plan, importance: ImportanceStage, index: int, radii: dict[str, float], first: float
) -> Rules:
    """Rules of pass `index`. radii: look-up radii of the pass by map; first: that of the first pass.

    Required densities are those of the first pass. As the look-ups of later passes shrink, they grow with 1/r²: a
    look-up finds as many photons as before (the k nearest are fewer, in less space), and the blur by redistributed
    power vanishes with that of the look-ups.
    """
    asked = settings.importance
    if plan.deposition == "all":
        return Rules()
    maps = importance.latest
    needs_importance = plan.deposition not in WITHOUT_IMPORTANCE
    assert maps is not None or not needs_importance
    growth = (first / radii["global"]) ** 2
    seed = settings.render.seed ^ ROUNDING_SALT
    scene_radius = importance.scene.flat.radius
    key: tuple[Any, ...] = ("deposition", plan.deposition, importance.key if needs_importance else ())
    key += (maps.traced if maps is not None and needs_importance else 0,)
    notes: list[str] = []
    required: dict[str, Evaluate] = {}
    rules: dict[str, Rule | None] = {"caustic": None, "global": None}
    classes = {"caustic": plan.caustic_classes, "global": plan.global_classes}
    f: dict[str, float] = {}
    everywhere: dict[str, float] = {}
    if plan.deposition == "Keller-Wald":
        assert maps is not None
        key += (asked.epsilon, asked.cut_off, asked.f)
        if asked.f == "auto":
            f, notes = factors(settings, importance, maps)
    else:
        key += (
            asked.acceptance,
            asked.around,
            asked.contrast,
            asked.reach,
            asked.M_r,
            asked.caustic_M_r,
            asked.density,
            growth,
        )
        key += tuple(radii.values()) if plan.deposition == "constant density" and asked.density == "auto" else ()
    for name, mask in classes.items():
        if not mask:
            continue
        chosen = importance_of(maps, name) if needs_importance else None
        if plan.deposition == "Keller-Wald":
            assert chosen is not None
            factor = f[name] = f[name] if asked.f == "auto" else float(asked.f)
            rules[name] = KellerWald(
                probability_of(chosen, factor), asked.epsilon, asked.cut_off == "discard", seed + (name == "global")
            )
            continue
        around, beyond = NEAREST, None
        if asked.around == "guarded":
            around = Around(True, asked.contrast)
        if chosen is not None:
            M_r = growth * (asked.M_r if name == "global" else asked.caustic_M_r)
            required[name] = density_of(chosen, M_r)
            if asked.around == "guarded":
                beyond = density_beyond(chosen, M_r, asked.reach)
        else:
            automatic = constant_density(settings, radii[name])
            everywhere[name] = automatic if asked.density == "auto" else growth * float(asked.density)
            required[name] = constant(everywhere[name])
        acceptance = ACCEPTANCE.index(asked.acceptance)
        rules[name] = Density(required[name], acceptance, around, beyond, seed + (name == "global"))
    criterion = None
    sample = sampled_classes(plan)
    if plan.convergence:
        criterion = Criterion(plan.convergence, scene_radius, plan.caustic_classes)
        key += ("convergence", plan.convergence)
        sample |= ALL_CLASSES & ~plan.caustic_classes
    deposition = Deposition(rules["caustic"], rules["global"], classes["caustic"], classes["global"], sample, criterion)
    grown = 1.0 if plan.deposition == "Keller-Wald" else growth
    return Rules(deposition, key, tuple(notes), required or None, f, everywhere, grown)


def sampled_classes(plan: Plan) -> int:
    """Path classes (bit set) whose photons somebody counts as they arrive."""
    return (1 << DIRECT if plan.asks_photons or plan.caustic_classes else 0) | plan.guide_mask


def constant_density(settings: Settings, radius: float) -> float:
    """Photons per unit area by which a look-up of that radius finds M of them."""
    return density_of_discs(M, radius)


def importance_of(maps: ImportanceMaps | None, name: str) -> ImportanceMap:
    """The importance map for the photon map of that name."""
    assert maps is not None
    found = maps.caustic if name == "caustic" else maps.global_
    assert found is not None
    return found


def factors(
    settings: Settings, importance: ImportanceStage, maps: ImportanceMaps
) -> tuple[dict[str, float], list[str]]:
    """Keller and Wald's f for both maps, by test rays from the camera to the first surfaces that store photons."""
    s, stage = settings, importance
    direct = ImportonRule(
        caustic=False,
        global_=True,
        gather=False,
        gather_specular=False,
        corner=0.0,
        glossy=s.photons.glossy,
        max_depth=s.render.max_depth,
        pixel=stage.pixel,
    )

    def make() -> tuple[dict[str, float], list[str]]:
        eye: NDArray[np.void] = eye_record(stage.camera, s, 0)
        tests = trace(stage.scene.flat, eye, direct, s.render.seed ^ TEST_RAY_SALT, 0, TESTS, stage.pool.run).global_
        f, notes = {}, []
        for name, made in (("caustic", maps.caustic), ("global", maps.global_)):
            if made is not None:
                f[name], note = automatic_f(made, tests.positions, tests.normals)
                notes += [note] if note and note not in notes else []
        return f, notes

    return stage.store.get(("deposition f", stage.key, maps.traced), make, lambda made: 0)
