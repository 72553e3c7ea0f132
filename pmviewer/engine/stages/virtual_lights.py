"""The virtual lights of a pass: traced, thinned, weighed, ready for the eye pass (R10)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.method import Plan
from pmviewer.maps.virtual_lights import (
    CLAMPED,
    COLUMNS,
    ESTIMATORS,
    NO_VIRTUAL,
    OF_PATHS,
    PATHS_DTYPE,
    PRINTED,
    UNWEIGHTED,
    VIRTUAL_DTYPE,
)
from pmviewer.photons.light_pass.light_pass import Runner
from pmviewer.photons.virtual.lights import VirtualLights, virtual_lights
from pmviewer.render.film import Film
from pmviewer.render.planes import CHANNELS
from pmviewer.render.virtual_lights.film import WeightedFilm
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.settings.access import Settings

PRINTED_BIAS = {
    "printed single step": (
        "Virtual lights by the paper's printed single step: densities from whole discs and no c₁ leave the picture too "
        "bright or too dark, however many passes there are. virtual.estimator = single step converges."
    ),
    "printed full path": (
        "Virtual lights by the paper's printed full path: without 1 − s and 1/a the picture is right only where every "
        "albedo is ½ and every light visible. virtual.estimator = every vertex converges."
    ),
}
UNNORMALISED = (
    "Virtual lights without normalisation: gathering walks that leave the scene, or end where no light is visible, are "
    "taken to bring light, so that the picture stays too bright. virtual.normalisation = interpolated converges."
)
FALSE_SHADOWS = (
    "Virtual lights normalised by object: where c differs from its mean over the object, false light and shadow stay. "
    "virtual.normalisation = interpolated converges."
)


@dataclass(frozen=True, eq=False)
class VirtualStage:
    """`record` for kernels, valid while this object lives, of `lights`."""

    lights: VirtualLights
    record: NDArray[np.void]
    objects: NDArray[np.int32]


def virtual_stage(flat: FlatScene, settings: Settings, index: int, run: Runner) -> VirtualStage:
    """Trace and weigh the virtual lights of pass `index`."""
    made = virtual_lights(flat, settings.virtual, settings.photons, settings.render.seed, index, run)
    return VirtualStage(made, virtual_record(flat, settings, made.rows), flat.shape_of_prim)


def virtual_record(flat: FlatScene, settings: Settings, rows: NDArray[np.float32]) -> NDArray[np.void]:
    """The record (1,) for kernels of virtual lights (n, COLUMNS)."""
    how = settings.virtual
    estimator = ESTIMATORS.index(how.estimator)
    record = np.zeros(1, PATHS_DTYPE if estimator in OF_PATHS else VIRTUAL_DTYPE)
    r = record[0]
    r["virtual"], r["lights"], r["n"] = 1, rows.ctypes.data, len(rows)
    r["per_pixel"] = how.per_pixel or len(rows)
    r["estimator"] = estimator
    r["normalised"] = how.normalisation != "none" and estimator not in PRINTED
    r["walks"], r["max_bounces"] = how.walks, settings.photons.max_bounces
    r["clamp"] = how.clamp / flat.radius**2
    r["objects"], r["n_objects"] = flat.shape_of_prim.ctypes.data, int(flat.shape_of_prim.max(initial=-1)) + 1
    return record


def film_of(settings: Settings, plan: Plan, width: int, height: int) -> Film:
    """An empty film for the method."""
    return WeightedFilm(width, height, settings.virtual) if plan.virtual else Film(width, height)


def bias_of(settings: Settings) -> tuple[str, ...]:
    """A sentence for each reason why the picture does not converge to the right one."""
    how = settings.virtual
    if how.estimator in PRINTED_BIAS:
        return (PRINTED_BIAS[how.estimator],)
    if ESTIMATORS.index(how.estimator) in (UNWEIGHTED, CLAMPED):
        return ()
    return {"none": (UNNORMALISED,), "per object": (FALSE_SHADOWS,)}.get(how.normalisation, ())


def no_lights(settings: Settings, plan: Plan, flat: FlatScene) -> NDArray[np.void]:
    """A record without lights to compile kernels with: of the type that the method needs."""
    return virtual_record(flat, settings, np.empty((0, COLUMNS), np.float32)) if plan.virtual else NO_VIRTUAL


def virtual_kind(settings: Settings, plan: Plan) -> str:
    """Tells apart what kernels are compiled for."""
    if not plan.virtual:
        return ""
    return "paths" if ESTIMATORS.index(settings.virtual.estimator) in OF_PATHS else "lights"


def prepare_virtual(flat: FlatScene, settings: Settings) -> None:
    """Compile what traces and weighs virtual lights, and what reads the film."""
    few = settings.virtual.model_copy(update={"number": 1, "photons": 1})
    virtual_lights(flat, few, settings.photons, 0, 0, lambda tasks: [task() for task in tasks])
    film = WeightedFilm(1, 1, settings.virtual)
    film.sums[:, CHANNELS:] = 1.0
    film.planes()
