"""The light pass as the engine calls it: which trajectories a pass has follows from its number and the settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pmviewer.engine.plan import Plan
from pmviewer.engine.stages.thin_glass import thin_key
from pmviewer.photons.deposition.fates import Fates
from pmviewer.photons.deposition.rules import Deposition
from pmviewer.photons.emission.guided import Guidance, Guided, Known
from pmviewer.photons.light_pass.batch import GLOBAL_NORMALS, NO_NORMALS, Batch
from pmviewer.photons.light_pass.light_pass import guided_emission_of, joined_parts, trace_pass
from pmviewer.photons.light_pass.parts import trace_part, trace_parts
from pmviewer.photons.light_pass.paths import PhotonPaths
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.photons.light_pass.plan import PassPlan, plan_pass, trajectories
from pmviewer.photons.projection.projection import Projection
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.settings.access import Settings
from pmviewer.tasks import Runner


@dataclass(frozen=True, eq=False)
class Tracer:
    """Traces photons of one scene by one set of settings; `projection` are its projection maps, if it takes any."""

    flat: FlatScene
    settings: Settings
    plan: Plan
    projection: Projection | None
    run: Runner

    @property
    def caustics(self) -> bool:
        """Whether a caustic map is filled."""
        return bool(self.plan.caustic_classes)

    def key(self, uid: int, index: int, N: int, normals: bool) -> tuple[Any, ...]:
        """What photons of pass `index` that are all stored, wherever they fall, depend on in the scene of that uid."""
        photons, seed, thin = self.settings.photons, self.settings.render.seed, thin_key(self.settings, self.plan)
        return "photons", uid, photons, seed, thin, index, N, self.caustics, normals

    def trajectories(self, N: int, guided: Guided | None = None) -> int:
        """How many a pass of N has: those that would fill a map that is not there are left out."""
        return N if guided is not None else trajectories(self.settings.photons, N, self.caustics)[0]

    def trace(
        self,
        index: int,
        N: int,
        *,
        normals: bool = False,
        deposition: Deposition | None = None,
        guided: Guided | None = None,
        watch: PhotonPaths | Fates | None = None,
    ) -> PhotonMaps:
        """Photons of pass `index`; see `pmviewer.photons.light_pass.light_pass.trace_pass` for what is asked of them.
        Raises SettingError where they can't fit into memory."""
        settings = self.settings
        if self.plan.maps > 1 and deposition is None and watch is None:
            wanted = GLOBAL_NORMALS if normals else NO_NORMALS
            plan = self.planned(index, N, None)
            return joined_parts(plan, trace_parts(self.flat, plan, self.plan.maps, wanted, self.run))
        return trace_pass(
            self.flat,
            settings.photons,
            settings.render.seed,
            index * self.trajectories(N, guided),
            N,
            self.caustics,
            self.run,
            normals,
            projection=None if guided is not None else self.projection,
            deposition=deposition,
            guided=guided,
            watch=watch,
        )

    def trace_part(self, index: int, N: int, part: int, *, normals: bool = False) -> Batch:
        """Part `part` of the `plan.maps` parts of pass `index`, traced alone, as a worker does: a function of scene,
        settings and these numbers. Raises SettingError where the photons can't fit into memory."""
        wanted = GLOBAL_NORMALS if normals else NO_NORMALS
        return trace_part(self.flat, self.planned(index, N, None), part, self.plan.maps, wanted, self.run)

    def of_parts(self, index: int, N: int, parts: Sequence[Batch]) -> PhotonMaps:
        """What `trace` gives as pass `index`, from all of its parts in order, wherever they were traced."""
        return joined_parts(self.planned(index, N, None), parts)

    def planned(self, index: int, N: int, guided: Guided | None) -> PassPlan:
        """What `trace` traces as pass `index`."""
        settings = self.settings
        first = index * self.trajectories(N, guided)
        projection = None if guided is not None else self.projection
        args = first, N, self.caustics, projection, guided
        return plan_pass(self.flat, settings.photons, settings.render.seed, *args)

    def guided_emission(self, index: int, N: int, guidance: Guidance, before: Known | None) -> Guided | None:
        """How the photons of pass `index` leave the lights, by test photons and what is known from the passes `before`;
        None where N photons are too few to test all lights."""
        photons, seed = self.settings.photons, self.settings.render.seed
        return guided_emission_of(self.flat, photons, seed, index * N, N, self.caustics, guidance, self.run, before)
