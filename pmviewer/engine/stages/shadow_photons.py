"""The shadow photons of a pass: traced, in a grid, ready for the eye pass."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.store import StageStore
from pmviewer.engine.tally import Tally
from pmviewer.kernels.dimensions import SHADOW_SALT
from pmviewer.maps.search.grid import PhotonGrid
from pmviewer.maps.shadow import build_shadows, shadow_record
from pmviewer.photons.shadow import shadow_pass
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.settings.access import Direct, Settings
from pmviewer.tasks import Runner


@dataclass(frozen=True)
class ShadowMap:
    """`record` for kernels, valid while this object lives; `photons` (n, 6), for the overlay; `rays` cast for them."""

    grid: PhotonGrid
    record: NDArray[np.void]
    photons: NDArray[np.float32]
    rays: int

    @property
    def bytes(self) -> int:
        """Of photons and grid, for the stage store."""
        return self.grid.bytes + self.photons.nbytes


class ShadowStage:
    """The shadow photons of one scene with one set of settings; `latest` are those of the latest pass, None while they
    are off."""

    def __init__(self, scene: OpenScene, settings: Settings, pool: WorkPool, store: StageStore, tally: Tally) -> None:
        self.scene, self.settings, self.pool, self.store, self.tally = scene, settings, pool, store, tally
        self.latest: ShadowMap | None = None

    def run(self, index: int) -> ShadowMap:
        """Those of pass `index`; those of the first where one photon map serves all passes."""
        s = self.settings
        if s.photons.renew == "once":
            if self.latest is not None:
                return self.latest
            index = 0
        direct, glossy, seed = s.direct, s.photons.glossy, s.render.seed

        def make() -> ShadowMap:
            return shadows_of(self.scene.flat, direct, glossy, seed, index, self.pool.run)

        shape = direct.shadow_N, direct.shadow_fewest, direct.shadow_radius
        key = ("shadows", self.scene.uid, seed, index, *shape, glossy)
        made: ShadowMap = (
            make() if index >= self.store.passes else self.store.get(key, make, lambda shadows: shadows.bytes)
        )
        with self.tally.once("shadow photons") if s.photons.renew == "once" else nullcontext():
            self.tally.rays += made.rays
        self.latest = made
        return made


def shadows_of(flat: FlatScene, direct: Direct, glossy: float, seed: int, index: int, run: Runner) -> ShadowMap:
    """Trace and sort the shadow photons that the settings ask for, those of pass `index`."""
    traced = shadow_pass(flat, seed ^ SHADOW_SALT, index * direct.shadow_N, direct.shadow_N, glossy, run)
    radius = None if direct.shadow_radius == "auto" else float(direct.shadow_radius) * flat.radius
    photons = traced.photons
    grid = run([lambda: build_shadows(photons, direct.shadow_fewest, radius, flat.radius)])[0]
    return ShadowMap(grid, shadow_record(grid, direct.shadow_fewest), photons, traced.rays)
