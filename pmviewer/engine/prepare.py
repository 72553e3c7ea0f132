"""Compiling the kernels that a scene and its settings need, or loading them from the kernel cache, one visible step at
a time.

A step calls a kernel for nothing, with records of the types that the passes will use; these types are its key, so that
none is called twice for the same.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.method import plan_of, radii_of_pixels
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.stages.convergence import prepare_convergence
from pmviewer.engine.stages.estimation import prepare_estimation
from pmviewer.engine.stages.importance import prepare_importance
from pmviewer.engine.stages.irradiance_cache import prepare_cache
from pmviewer.engine.stages.pass_data import blank_eye, blank_pass
from pmviewer.engine.stages.projection import projection_for
from pmviewer.engine.stages.reprojection import prepare_reprojection
from pmviewer.engine.stages.thin_glass import thin_record, with_thin_glass
from pmviewer.engine.stages.virtual_lights import prepare_virtual
from pmviewer.kernels.accel.raycast import cast_closest
from pmviewer.maps.search.grid import build_grid
from pmviewer.maps.search.kdtree import build_kdtree
from pmviewer.photons.deposition.depositor import prepare_rules
from pmviewer.photons.emission.scattered import scattered_record
from pmviewer.photons.emission.stratified import STRATA_DTYPE
from pmviewer.photons.emission.tested import prepare_weighing
from pmviewer.photons.light_pass.ledger import N_COUNTS, empty_ledger
from pmviewer.photons.light_pass.trace import LIGHT_PASS_DTYPE, PhotonBuffers, trace_photons
from pmviewer.photons.projection.projected import NO_PROJECTION
from pmviewer.render.closest_hits import no_hits
from pmviewer.render.counts import N_COUNTS as N_EYE_COUNTS
from pmviewer.render.edges import mark_crossed
from pmviewer.render.eye import eye_pass
from pmviewer.render.film import Film
from pmviewer.render.mirrored import mark_mirrors
from pmviewer.render.moments import prepare_moments
from pmviewer.render.path import path_pass
from pmviewer.render.pixel_radius import first_radii
from pmviewer.render.share import OWN_COLUMNS, share_samples, weigh_samples
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import Settings
from pmviewer.settings.needs import Facts

Tell = Callable[[str, float | None], None]

_done: set[Hashable] = set()
"""Keys of the steps that this process has been through."""


@dataclass(frozen=True, eq=False)
class Step:
    """A call that compiles what it runs. `text` names it to the user."""

    text: str
    call: Callable[..., object]
    arguments: tuple[Any, ...] = ()

    @property
    def key(self) -> Hashable:
        """What kernels are compiled for: the function and the types of what it is given."""
        return f"{self.call.__module__}.{self.call.__qualname__}", types_of(self.arguments)

    @property
    def is_kept(self) -> bool:
        """Whether nothing is left to compile, as far as can be told without a call."""
        told = getattr(self.call, "is_kept", None)
        return told is not None and bool(told(*self.arguments))

    def run(self) -> None:
        """Make the call."""
        self.call(*self.arguments)


def types_of(argument: Any) -> Hashable:
    """The type that kernels see: of arrays that of their elements and their dimensions, of tuples that of each part, of
    a scene that of its record."""
    if isinstance(argument, np.ndarray | np.void):
        return argument.dtype, argument.ndim
    if isinstance(argument, tuple):
        return tuple(types_of(part) for part in argument)
    if isinstance(argument, OpenScene):
        return argument.flat.record.dtype
    return type(argument).__name__


def prepare(scene: OpenScene, settings: Settings, pool: WorkPool, tell: Tell) -> None:
    """Call each kernel that the next passes need once, on nothing. `tell(text, share)` hears of each step.

    The first start compiles (some 20 s in all), later ones load compiled code from disk.
    """
    steps = [step for step in steps_of(scene, settings) if step.key not in _done]
    for i, step in enumerate(steps):
        tell(f"preparing kernels, {i + 1} of {len(steps)}: {step.text}", i / len(steps))
        pool.run([step.run])
        _done.add(step.key)


def steps_of(scene: OpenScene, settings: Settings) -> list[Step]:
    """What passes of this scene with these settings run, in the order in which they run it."""
    plan = plan_of(settings, scene.traits)
    steps = [Step("film", lambda: Film(1, 1).planes())]
    if plan.moments:
        steps.append(Step("moments", prepare_moments))
    if plan.importance:
        steps.append(Step("importance", prepare_importance, (with_thin_glass(scene, settings, plan), settings)))
    if plan.photons:
        steps += _light_steps(scene, settings, plan)
    if plan.virtual:
        steps.append(Step("virtual lights", prepare_virtual, (scene, settings)))
    return [*steps, *eye_steps(scene.flat.record, scene.traits, settings, plan)]


def _light_steps(scene: OpenScene, settings: Settings, plan: Plan) -> list[Step]:
    record, photons = thin_record(scene.flat.record, settings, plan), np.zeros((1, 6), np.float32)
    steps = [_casting(scene.flat.record)]
    light_pass, codes = np.zeros(1, LIGHT_PASS_DTYPE), np.zeros(1, np.uint32)
    in_media = photons if plan.media else None
    out = PhotonBuffers(photons, photons, codes, codes, np.zeros(N_COUNTS, np.int64), empty_ledger(), in_media)
    maps = projection_for(scene, settings, plan)
    emissions = [("light pass", NO_PROJECTION if maps is None else maps.records)]
    if plan.emission != "off":
        emissions = [
            ("light pass", np.zeros(2, STRATA_DTYPE)),
            ("light pass from surfaces", scattered_record(np.empty((0, 7), np.float32))),
        ]
        steps.append(Step("test photons", prepare_weighing))
    steps += [
        Step(text, trace_photons, (record, light_pass, emission, 0, 0, out, None)) for text, emission in emissions
    ]
    if plan.deposition != "all" or plan.emission != "off":
        steps.append(Step("deposition rules", prepare_rules))
    if plan.convergence:
        steps.append(Step("caustic convergence", prepare_convergence))
    if plan.nearest or (plan.volume and settings.estimate.in_media == "nearest"):
        steps.append(Step("kd-tree", build_kdtree, (photons, 1.0)))
    return [*steps, grid_step()]


def _casting(record: NDArray[np.void]) -> Step:
    o, d, *hits = no_hits()
    ends = np.empty(0, np.float32)
    return Step("ray casting", cast_closest, (record[0], o, d, ends, ends, *hits))


def _filter_steps(eye: NDArray[np.void], marks: NDArray[np.uint8]) -> list[Step]:
    weights, own = np.zeros((2, 1), np.float32), np.zeros((1, 1 + OWN_COLUMNS))
    shared = weights, marks, own, np.zeros((1, 1)), (1, 1, False), -1, np.zeros(1), np.zeros((1, 1)), 0, 0
    return [Step("filter", weigh_samples, (eye, weights)), Step("filter", share_samples, shared)]


def grid_step() -> Step:
    """What every light pass ends with."""
    return Step("photon grid", build_grid, (np.zeros((1, 6), np.float32), 1.0, 1.0))


def eye_steps(record: NDArray[np.void], traits: SceneTraits, settings: Settings, plan: Plan) -> list[Step]:
    """What the eye pass runs for a scene with such a `record`, whose contents don't count."""
    film, counts = np.zeros((1, 1)), np.zeros(N_EYE_COUNTS, np.int64)
    eye, marks = blank_eye(settings, plan), np.zeros(0, np.uint8)
    steps = _filter_steps(eye, marks) if plan.filtered else []
    if plan.mirror_rays > 1:
        none = np.empty(0, np.int32), np.zeros(0, bool), np.zeros(0, np.uint8)
        steps += [_casting(record), Step("mirrors", mark_mirrors, (record, *none))]
    if plan.edge_rays > 1:
        squares = np.empty((0, 4), np.int64), np.empty(0, bool)
        steps += [_casting(record), Step("edges", mark_crossed, (record, no_hits(), *squares))]
    record = thin_record(record, settings, plan)
    if plan.path:
        return [*steps, Step("path tracer", path_pass, (record, eye, film, counts, 0, 0))]
    given = blank_pass(record, settings, plan)
    if plan.cache:
        steps.append(Step("irradiance cache", prepare_cache, (given,)))
    if plan.estimation:
        steps.append(Step("gather estimation", prepare_estimation, (given,)))
    if plan.reprojection:
        steps.append(Step("gather reprojection", prepare_reprojection, (given,)))
    radii = first_radii(1, 0.0, 0.0) if radii_of_pixels(Facts(settings, plan, traits)) else None
    return [*steps, Step("camera pass", eye_pass, (given, marks, radii, film, counts, 0, 0))]
