"""The light stage: what each pass of the renderer begins with. It plans, traces photons, and builds maps from them."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.radius import FirstRadii
from pmviewer.engine.stages.importance import ImportanceStage
from pmviewer.engine.stages.light_maps import MapBuilder, of_classes
from pmviewer.engine.stages.light_plan import light_plan
from pmviewer.engine.stages.light_trace import traced_pass
from pmviewer.engine.stages.pass_maps import Carried, PassMaps
from pmviewer.engine.stages.projection import projection_for
from pmviewer.engine.stages.tracer import Tracer
from pmviewer.engine.store import StageStore
from pmviewer.engine.tally import Tally
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.scene.light_places import light_places
from pmviewer.settings.access import Settings


class LightStage:
    """Photons and maps of one scene with one set of settings: `latest` are those of the latest pass, which alone is
    remembered; `places` (n, 3) are the middles of the lights, None without importance."""

    def __init__(
        self, scene: OpenScene, settings: Settings, plan: Plan, pool: WorkPool, store: StageStore, tally: Tally
    ) -> None:
        self.scene, self.settings, self.plan, self.pool, self.tally = scene, settings, plan, pool, tally
        self.tracer = Tracer(scene.flat, settings, plan, projection_for(scene, settings, plan), pool.run)
        self.builder = MapBuilder(scene, settings, plan, pool, store)
        self.places = light_places(scene.flat) if plan.importance else None
        self.latest: PassMaps | None = None
        self.taken_over = Carried()
        """What the first pass that is run takes over from passes that were run elsewhere."""

    @property
    def lacks_first(self) -> bool:
        """Whether radii are missing that the photons of the first pass decide for all: a pass rendered apart needs
        these photons first."""
        if self.latest is not None or self.settings.photons.renew == "once":
            return False
        guides, chooser = self.plan.guided_rays > 0, self.plan.asks_photons
        carried = self.taken_over
        return self.plan.photons and ((guides and carried.guides is None) or (chooser and carried.chooser is None))

    def run(
        self,
        index: int,
        N: int,
        first: FirstRadii,
        importance: ImportanceStage,
        widest: Mapping[str, float] = MappingProxyType({}),
    ) -> PassMaps:
        """Trace the photons of pass `index` and build its maps. `importance` has run for this pass; `widest` are the
        largest radii in use by map, where they may be more than that of the pass. Raises SettingError where the photons
        can't fit into memory."""
        if not self.plan.photons:
            self.latest = self.builder.without_photons(index, N)
            return self.latest
        if self.settings.photons.renew == "once":
            if self.latest is not None:
                return self._told(self.latest)
            index = 0
        carried = self.latest.carried(index) if self.latest is not None else self.taken_over
        light = light_plan(self.settings, self.plan, importance, index, N, first, widest)
        tally, pool = self.tally, self.pool
        traced = tally.timed(pool, "light pass", lambda: traced_pass(self.tracer, light, importance, carried.known))
        maps: PassMaps = tally.timed(pool, "maps", lambda: self.builder.maps(light, traced, carried))
        with tally.once("photons") if self.settings.photons.renew == "once" else nullcontext():
            tally.add_photons(traced.photons, self.scene.flat.total_luminance)
        self.latest = maps
        return self._told(maps)

    def _told(self, maps: PassMaps) -> PassMaps:
        self.tally.set_maps(maps.radii, maps.bytes, maps.n)
        return maps

    @property
    def photons(self) -> PhotonMaps | None:
        """Those of the latest pass."""
        return self.latest.photons if self.latest is not None else None

    def stored(self, name: str) -> NDArray[np.float32]:
        """Photons (n, 6) of the latest pass in the map of that name, "caustic" or "global": those of the path classes
        that are looked up."""
        photons = self.photons
        if photons is None:
            return np.empty((0, 6), np.float32)
        if name == "caustic":
            return of_classes(photons.caustic, self.plan.caustic_classes)
        return of_classes(photons.global_, self.plan.global_classes)
