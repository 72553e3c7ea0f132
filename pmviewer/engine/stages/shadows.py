"""The shadow photons of a pass: traced, in a grid, ready for the eye pass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.search.grid import PhotonGrid
from pmviewer.maps.shadow import build_shadows, shadow_record
from pmviewer.photons.shadow import shadow_pass
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.settings.access import Direct
from pmviewer.tasks import Runner

SEED = 0x5AD0
"""Keeps their random numbers apart from those of the light pass."""


@dataclass(frozen=True)
class ShadowMap:
    """`record` for kernels, valid while this object lives; `photons` (n, 6), for the overlay; `rays` cast for them."""

    grid: PhotonGrid
    record: NDArray[np.void]
    photons: NDArray[np.float32]
    rays: int

    @property
    def bytes(self) -> int:
        return self.grid.bytes + self.photons.nbytes


def shadows_of(flat: FlatScene, direct: Direct, glossy: float, seed: int, index: int, run: Runner) -> ShadowMap:
    """Trace and sort the shadow photons that the settings ask for, those of pass `index`."""
    traced = shadow_pass(flat, seed ^ SEED, index * direct.shadow_N, direct.shadow_N, glossy, run)
    radius = None if direct.shadow_radius == "auto" else float(direct.shadow_radius) * flat.radius
    photons = traced.photons
    grid = run([lambda: build_shadows(photons, direct.shadow_fewest, radius, flat.radius)])[0]
    return ShadowMap(grid, shadow_record(grid, direct.shadow_fewest), photons, traced.rays)
