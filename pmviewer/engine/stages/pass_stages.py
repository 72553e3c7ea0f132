"""All of a pass but its picture: importance, photons, maps, and what else the eye pass looks up.

It depends on scene, settings and the number of the pass, not on the film, unless pixels have radii of their own. So the
next pass's can be made while the eye pass of this one runs (`MadeAhead`): what one of them leaves free, the end of a
stage where threads wait for the last of them or what only one thread can do, the other uses.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import Begun, WorkPool
from pmviewer.engine.radius import FirstRadii
from pmviewer.engine.stages.estimation import estimate_gathers
from pmviewer.engine.stages.importance import REFINED_PASSES, ImportanceStage
from pmviewer.engine.stages.irradiance_cache import fill_cache, recipe
from pmviewer.engine.stages.light import LightStage
from pmviewer.engine.stages.pass_data import RenderedPass, pass_data, pass_record
from pmviewer.engine.stages.pass_maps import PassMaps
from pmviewer.engine.stages.shadow_photons import ShadowStage
from pmviewer.engine.stages.thin_glass import with_thin_glass
from pmviewer.engine.stages.virtual_lights import VirtualStage
from pmviewer.engine.store import StageStore
from pmviewer.engine.tally import Tally
from pmviewer.render.camera import CameraPose
from pmviewer.settings.access import Settings

NO_RADII: Mapping[str, float] = MappingProxyType({})


class PassStages:
    """The stages of one scene with one set of settings, each of which remembers what it made for the latest pass."""

    def __init__(
        self,
        scene: OpenScene,
        settings: Settings,
        plan: Plan,
        render_camera: CameraPose,
        first: FirstRadii,
        pool: WorkPool,
        store: StageStore,
        tally: Tally,
    ) -> None:
        """render_camera: whom importance is for; first: radii of look-ups in the first pass."""
        self.settings, self.plan, self.pool, self.store, self.tally = settings, plan, pool, store, tally
        self.first = first
        scene = self._scene = with_thin_glass(scene, settings, plan)
        self.light = LightStage(scene, settings, plan, pool, store, tally)
        self.importance = ImportanceStage(scene, settings, plan, render_camera, first.global_, pool, store, tally)
        self.shadows = ShadowStage(scene, settings, pool, store, tally)
        self.virtual = VirtualStage(scene, settings, pool, store, tally)

    def run_light(self, index: int, N: int, widest: Mapping[str, float] = NO_RADII) -> PassMaps:
        """Photons and maps of pass `index` of N trajectories. widest: the largest radii in use by map, where they may
        be more than that of the pass. Raises SettingError where the photons can't fit into memory."""
        self.importance.run(0 if self.settings.photons.renew == "once" else index)
        if index > 0 and self.light.lacks_first:
            with self.tally.aside():
                self.light.run(0, N, self.first, self.importance, widest)
        return self.light.run(index, N, self.first, self.importance, widest)

    def run(
        self,
        camera: CameraPose,
        marks: NDArray[np.uint8],
        index: int,
        N: int,
        widest: Mapping[str, float] = NO_RADII,
    ) -> RenderedPass:
        """All of pass `index` but its picture, as `run_light`. marks: of the film's pixels
        (`pmviewer.engine.stages.eye.marks_of`)."""
        settings, plan, tally, pool = self.settings, self.plan, self.tally, self.pool
        maps = self.run_light(index, N, widest)
        eye = pass_record(camera, settings, plan, maps, index)
        shadows = tally.timed(pool, "shadow photons", lambda: self.shadows.run(index)) if plan.shadows else None
        scene = self._scene.flat.record
        given = pass_data(scene, eye, settings, plan, maps, shadows.record if shadows is not None else None)
        cache = virtual = estimates = None
        if plan.virtual:
            virtual = tally.timed(pool, "virtual lights", lambda: self.virtual.run(index))
            given = given._replace(virtual=virtual.record, virtual_map=virtual.photons)
        if plan.cache:
            record = recipe(settings.gather, camera, index)
            cache, counts = tally.timed(pool, "irradiance cache", lambda: fill_cache(given, record, pool))
            tally.add_cache(cache.n, cache.bytes)
            tally.add_counts(counts)
            given = given._replace(cache=cache.record)
        if plan.estimation:
            estimates, counts = tally.timed(
                pool, "gather estimation", lambda: estimate_gathers(given, settings.gather, camera, pool)
            )
            tally.add_estimates(estimates.counts)
            tally.add_counts(counts)
            given = given._replace(cache=estimates.record)
        return RenderedPass(given, maps, marks, shadows, cache, virtual, estimates)

    def can_run_early(self, index: int) -> bool:
        """Whether pass `index` can be made while the one before is rendered: nothing goes to the stage store, which
        belongs to one thread, and no stage adds to what it has."""
        plan = self.plan
        if not (plan.photons or plan.virtual) or self.settings.photons.renew == "once":
            return False
        return index >= max(self.store.passes, REFINED_PASSES) and self.pool.overlaps

    def apart(self) -> PassStages:
        """The same as they are now, to be run by another thread; what they count is theirs."""
        other = copy(self)
        other.tally = Tally()
        for name in ("light", "importance", "shadows", "virtual"):
            stage = copy(getattr(self, name))
            stage.tally = other.tally
            setattr(other, name, stage)
        return other


class MadeAhead:
    """Pass `index` in the making, while another is rendered."""

    def __init__(self, stages: PassStages, camera: CameraPose, marks: NDArray[np.uint8], index: int, N: int) -> None:
        self.index = index
        self._stages = own = stages.apart()
        self._begun: Begun[RenderedPass] = stages.pool.begin(lambda: own.run(camera, marks, index, N))

    def take(self, stages: PassStages) -> tuple[PassStages, RenderedPass]:
        """Wait for it: the stages that go on from it, with what the given ones have counted, and the pass. Raises what
        making it raises."""
        made, own = self._begun.result(), self._stages
        counted, own.tally = own.tally, stages.tally
        for stage in (own.light, own.importance, own.shadows, own.virtual):
            stage.tally = own.tally
        own.tally.merge(counted)
        return own, made

    def drop(self) -> None:
        """Nobody wants it any more."""
        self._begun.drop()
