"""The virtual lights of a pass: traced, thinned, weighed, ready for the eye pass (R10)."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.store import StageStore
from pmviewer.engine.tally import Tally
from pmviewer.maps.variant import with_mark
from pmviewer.maps.virtual_lights import (
    CLAMPED,
    ESTIMATORS,
    NO_VIRTUAL,
    OF_PATHS,
    PATHS_DTYPE,
    PRINTED,
    TREE_FIELDS,
    UNWEIGHTED,
    V_PRIM,
    VIRTUAL_DTYPE,
)
from pmviewer.photons.bounces import most_bounces
from pmviewer.photons.virtual.lights import VirtualLights, neighbours, virtual_lights
from pmviewer.photons.virtual.sided import SIDED_RECORD
from pmviewer.photons.virtual.tree import light_tree
from pmviewer.render.film import Film
from pmviewer.render.planes import CHANNELS, MEDIA_CHANNELS
from pmviewer.render.virtual_lights.film import WeightedFilm
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.settings.access import Settings, Virtual

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
class VirtualMap:
    """`record` for kernels of `lights`, valid while this object and the scene live."""

    lights: VirtualLights
    record: NDArray[np.void]
    tree: NDArray[np.float32] | None = None
    """Of `pmviewer.photons.virtual.tree`, where pixels choose by it."""

    @property
    def photons(self) -> NDArray[np.void]:
        """The record (1,) for kernels of the photons that the lights are chosen from, as `blank_photons` without."""
        return self.lights.tree.record if self.lights.tree is not None else blank_photons(self.record.dtype)

    @property
    def bytes(self) -> int:
        """For the stage store."""
        return self.lights.bytes + (self.tree.nbytes if self.tree is not None else 0)


class VirtualStage:
    """The virtual lights of one scene with one set of settings; `latest` are those of the latest pass, None before the
    first."""

    def __init__(self, scene: OpenScene, settings: Settings, pool: WorkPool, store: StageStore, tally: Tally) -> None:
        self.scene, self.settings, self.pool, self.store, self.tally = scene, settings, pool, store, tally
        self.latest: VirtualMap | None = None

    def run(self, index: int) -> VirtualMap:
        """Those of pass `index`; those of the first where one photon map serves all passes."""
        s = self.settings
        if s.photons.renew == "once":
            if self.latest is not None:
                return self.latest
            index = 0
        traced = s.photons.max_bounces, s.photons.glossy, s.photons.sequence
        key = ("virtual lights", self.scene.uid, s.render.seed, index, s.virtual, *traced)
        keep = index < self.store.passes
        made: VirtualMap = (
            self.store.get(key, lambda: self._make(index), lambda m: m.bytes) if keep else self._make(index)
        )
        with self.tally.once("virtual lights") if s.photons.renew == "once" else nullcontext():
            self.tally.rays += made.lights.rays
            self.tally.dropped["photons"] += made.lights.dropped
        self.latest = made
        return made

    def _make(self, index: int) -> VirtualMap:
        s, flat = self.settings, self.scene.flat
        lights = virtual_lights(flat, s.virtual, s.photons, s.render.seed, index, self.pool.run)
        tree = None
        if by_tree(s.virtual):
            tree = self.pool.run([lambda: light_tree(lights.rows, ESTIMATORS.index(s.virtual.estimator), flat.radius)])[
                0
            ]
        record = virtual_record(flat, s, lights.rows, tree, lights.beams)
        if lights.tree is not None:
            record["k"], record["reach"] = neighbours(s.virtual, index) + 1, lights.reach
            bring = s.virtual.density == "photon map" and not flat.has_media
            record["gather_rays"] = s.virtual.gather_rays if bring else 0
        return VirtualMap(lights, record, tree)


def virtual_dtype(virtual: Virtual) -> np.dtype:
    """Type of the record of virtual lights for that estimator and choice."""
    dtype = PATHS_DTYPE if ESTIMATORS.index(virtual.estimator) in OF_PATHS else VIRTUAL_DTYPE
    return with_mark(dtype, "descent", TREE_FIELDS) if virtual.choice == "light tree" else dtype


def blank_photons(dtype: np.dtype) -> NDArray[np.void]:
    """The record (1,) of no photons of the type that goes with a record of virtual lights: one for all estimators that
    are compiled alike."""
    return NO_VIRTUAL if "paths" in (dtype.names or ()) else np.zeros(1, SIDED_RECORD)


def by_tree(virtual: Virtual) -> bool:
    """Whether pixels choose some of the lights by a tree over them. The type of the record doesn't depend on numbers,
    so that sliders compile nothing."""
    return virtual.choice == "light tree" and 0 < virtual.per_pixel < virtual.number


def virtual_record(
    flat: FlatScene,
    settings: Settings,
    rows: NDArray[np.float32],
    tree: NDArray[np.float32] | None = None,
    beams: NDArray[np.float32] | None = None,
) -> NDArray[np.void]:
    """The record (1,) for kernels of virtual lights (n, COLUMNS), and of the tree over them by which pixels choose."""
    virtual = settings.virtual
    estimator = ESTIMATORS.index(virtual.estimator)
    record = np.zeros(1, virtual_dtype(virtual))
    r = record[0]
    r["virtual"], r["lights"], r["n"] = 1, rows.ctypes.data, len(rows)
    if beams is not None:
        r["beams"], r["each"] = beams.ctypes.data, beams.shape[1]
    r["per_pixel"] = virtual.per_pixel or len(rows)
    r["estimator"] = estimator
    r["normalised"] = virtual.normalisation != "none" and estimator not in PRINTED
    r["walks"], r["max_bounces"] = virtual.walks, most_bounces(settings.photons, flat.has_media)
    r["clamp"] = virtual.clamp / flat.radius**2
    if tree is not None:
        r["descent"], r["tree"], r["leaves"] = 1, tree.ctypes.data, len(tree) // 2
    r["objects"], r["n_objects"] = flat.shape_of_prim.ctypes.data, int(flat.shape_of_prim.max(initial=-1)) + 1
    return record


def objects_of(flat: FlatScene, rows: NDArray[np.float32]) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """The objects (n,) that virtual lights (n, COLUMNS) lie on, and their names: the scene's shapes in their order, and
    behind them one for all instances and one for media."""
    shapes = flat.owner.shapes
    prims = np.ascontiguousarray(rows[:, V_PRIM]).view(np.int32).astype(np.int64)
    stored = (prims >= 0) & (prims < len(flat.shape_of_prim))
    numbers = np.full(len(rows), len(shapes), np.int64)
    numbers[stored] = np.minimum(flat.shape_of_prim[prims[stored]], len(shapes))
    numbers[prims < 0] = len(shapes) + 1
    return numbers, (*(shape.name for shape in shapes), "instances", "media")


def lights_asked(record: NDArray[np.void]) -> int:
    """Virtual lights that a pixel asks for in a pass with that record, 0 without."""
    return int(min(record[0]["per_pixel"], record[0]["n"])) if "virtual" in (record.dtype.names or ()) else 0


def film_of(settings: Settings, plan: Plan, width: int, height: int) -> Film:
    """An empty film for the method."""
    channels = MEDIA_CHANNELS if plan.media else CHANNELS
    if plan.virtual:
        return WeightedFilm(width, height, settings.virtual, channels)
    return Film(width, height, channels=channels, unshared=plan.filtered)


def bias_of(settings: Settings) -> tuple[str, ...]:
    """A sentence for each reason why the picture does not converge to the right one."""
    virtual = settings.virtual
    if virtual.estimator in PRINTED_BIAS:
        return (PRINTED_BIAS[virtual.estimator],)
    if ESTIMATORS.index(virtual.estimator) in (UNWEIGHTED, CLAMPED):
        return ()
    return {"none": (UNNORMALISED,), "per object": (FALSE_SHADOWS,)}.get(virtual.normalisation, ())


def prepare_virtual(scene: OpenScene, settings: Settings) -> None:
    """Compile what traces and weighs virtual lights, and what reads the film: of all estimators."""
    all_of_it = {"estimator": "single step", "density": "photon map", "normalisation": "interpolated"}
    few = settings.virtual.model_copy(update=all_of_it | {"number": 1, "photons": 1})
    virtual_lights(scene.flat, few, settings.photons, 0, 0, lambda tasks: [task() for task in tasks])
    film = WeightedFilm(1, 1, few)
    film.sums[:, CHANNELS:] = 1.0
    film.planes()
