"""The importance maps of a pass: importons traced for the camera and the settings, before any photon.

They belong to camera and settings, not to the pass: the first pass has N importons, the next three N more each, later
ones the same as the fourth. Importons are kept, so that a pass traces the new ones alone; but which ones its maps
are made of depends on the pass's number, and on nothing that was there before.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.focus import focused
from pmviewer.engine.frame import PhotonCloud
from pmviewer.engine.immersion import immersed
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.stages.thin_glass import thin_key
from pmviewer.engine.store import StageStore
from pmviewer.engine.tally import Tally
from pmviewer.importance.importons import Rule, Traced, joined, trace
from pmviewer.maps.importance.build import build_importance
from pmviewer.maps.importance.importance_map import NO_IMPORTANCE, ImportanceMap, Importons
from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.render.record import eye_record
from pmviewer.settings.access import Settings

REFINED_PASSES = 4
"""Passes up to which importons are added."""


@dataclass(frozen=True, eq=False)
class ImportanceMaps:
    """Importance for the `caustic` and the `global_` photon map, None where that map is not looked up; `traced`
    importons they are made of. Where both maps are shown at the same places they are one and the same."""

    caustic: ImportanceMap | None
    global_: ImportanceMap | None
    traced: int

    @property
    def maps(self) -> dict[str, ImportanceMap]:
        """Those that there are, by the name of the photon map; one that serves both is the global one."""
        found = {"caustic": self.caustic, "global": self.global_}
        if self.caustic is self.global_:
            del found["caustic"]
        return {name: made for name, made in found.items() if made is not None}

    @property
    def n(self) -> int:
        """Importons stored."""
        return sum(made.n for made in self.maps.values())

    @property
    def bytes(self) -> int:
        """Of all maps, for the stage store."""
        return sum(made.bytes for made in self.maps.values())

    def record(self, name: str) -> NDArray[np.void]:
        """What kernels look up for the photon map of that name, "caustic" or "global"."""
        made = self.caustic if name == "caustic" else self.global_
        return NO_IMPORTANCE if made is None else made.record

    @cached_property
    def cloud(self) -> PhotonCloud:
        """All importons as points: Γ in pixels per unit area is their power, the light's number tells the map: 0 for
        the caustic, 1 for the global one."""
        parts, unit = [], max((made.cloud()[1] for made in self.maps.values()), default=1.0)
        for name, made in self.maps.items():
            rows, _ = made.cloud(unit)
            rows.view(np.uint32)[:, 5] |= np.uint32((name == "global") << 16)
            parts.append(rows)
        return PhotonCloud(np.concatenate(parts) if parts else np.empty((0, 6), np.float32), unit)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence for the log where importance says nothing."""
        if self.n == 0:
            return (
                f"Importance: none of {self.traced:,} importons met a surface that the picture looks photons up on, so "
                "no place is important. Does the camera look into the scene, and not at mirrors alone?",
            )
        for name, made in self.maps.items():
            if made.n == 0:
                return (f"Importance: none of {self.traced:,} importons reached a place that uses the {name} map.",)
        return ()


class ImportanceStage:
    """Importance maps of one scene, camera and settings, with the radius of look-ups in the first pass (scene units);
    `latest` is that of the latest pass, None while off."""

    def __init__(
        self,
        scene: OpenScene,
        settings: Settings,
        plan: Plan,
        camera: CameraPose,
        first_radius: float,
        pool: WorkPool,
        store: StageStore,
        tally: Tally,
    ) -> None:
        self.scene, self.settings, self.plan, self.camera = scene, settings, plan, camera
        self.first_radius = first_radius
        self.pool, self.store, self.tally = pool, store, tally
        self.latest: ImportanceMaps | None = None
        self._parts: list[Traced] = []

    @property
    def key(self) -> tuple:
        """What the importance depends on besides the pass; () while it is off."""
        if not self.plan.importance:
            return ()
        s, p = self.settings, self.plan
        chosen = s.importance.map, s.importance.N, s.importance.neighbours
        gather = p.gather, s.gather.secondary if p.corners else 0.0
        rule = (
            bool(p.caustic_classes),
            bool(p.global_classes),
            s.photons.indirect_caustics,
            s.photons.glossy,
            self.pixel,
        )
        glass = thin_key(s, p)
        return (self.scene.uid, self.camera, s.render.seed, s.render.max_depth, chosen, gather, rule, glass)

    @property
    def pixel(self) -> tuple[int, int] | None:
        """The only pixel (x, y) whose importance is asked for, None for the whole image."""
        chosen = self.settings.importance
        if chosen.of == "image":
            return None
        width, height = self.camera.width, self.camera.height
        return min(int(chosen.x * width), width - 1), min(int(chosen.y * height), height - 1)

    def run(self, index: int) -> None:
        """Bring `latest` to pass `index`."""
        if not self.plan.importance:
            return
        count = min(index + 1, REFINED_PASSES)
        if self.latest is not None and self.latest.traced == count * self.settings.importance.N:
            return
        self.latest = self.tally.timed(self.pool, "importance", lambda: self._maps(count))

    def _rule(self) -> Rule:
        plan, s = self.plan, self.settings
        return Rule(
            caustic=plan.gather and bool(plan.caustic_classes),
            global_=True,
            gather=plan.gather,
            gather_specular=not s.photons.indirect_caustics,
            corner=s.gather.secondary * self.first_radius if plan.corners else 0.0,
            glossy=s.photons.glossy,
            max_depth=s.render.max_depth,
            unfound=plan.unfound,
            pixel=self.pixel,
        )

    def _maps(self, count: int) -> ImportanceMaps:
        s, plan, N = self.settings, self.plan, self.settings.importance.N
        rule = self._rule()
        key = ("importance", self.key, rule)
        eye = eye_record(self.camera, s, 0)
        while len(self._parts) < count:
            number = len(self._parts)
            first = number * N

            def more(first: int = first) -> Traced:
                return trace(self.scene.flat, eye, rule, s.render.seed, first, N, self.pool.run)

            part = self.store.get((*key, "importons", first), more, lambda made: made.bytes)
            self._parts.append(part)
            with self.tally.once(f"importons {number}", number):
                self.tally.rays += part.rays
                if part.dropped:
                    self.tally.dropped["importons"] = part.dropped

        def build() -> ImportanceMaps:
            pixels = 1 if self.pixel is not None else self.camera.width * self.camera.height
            caustic, global_ = joined(self._parts[:count], pixels)
            both = self._build(global_, even=not plan.gather)
            if not plan.gather:
                return ImportanceMaps(both if plan.caustic_classes else None, both, count * N)
            return ImportanceMaps(self._build(caustic, even=True) if plan.caustic_classes else None, both, count * N)

        return self.store.get((*key, "maps", count), build, lambda made: made.bytes)

    def _build(self, importons: Importons, even: bool) -> ImportanceMap:
        chosen = self.settings.importance
        assert chosen.map != "off"
        return build_importance(importons, chosen.map, self.scene.flat.radius, chosen.neighbours, even, self.pool.run)


def prepare_importance(scene: OpenScene, settings: Settings) -> None:
    """Compile, or load, what the stage runs, by running it on next to nothing."""
    pool = WorkPool(1)
    try:
        few = settings.model_copy(update={"importance": settings.importance.model_copy(update={"N": 4})})
        camera = immersed(scene.flat, focused(scene.flat, resolve_camera(scene.scene, settings.camera)))
        plan = plan_of(settings, scene.traits)
        stage = ImportanceStage(scene, few, plan, camera, 0.0, pool, StageStore(0), Tally())
        stage.run(0)
        one = np.ones(1, np.float32)
        build_importance(Importons(np.zeros((1, 3), np.float32), np.zeros(1, np.uint32), one, one), "screen", 1.0)
    finally:
        pool.close()
