"""Participating media as loaders describe them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pmviewer.kernels.media.kinds import RAYLEIGH
from pmviewer.scene.grid import Grid

RGB = tuple[float, float, float]


@dataclass(frozen=True)
class Phase:
    """Henyey and Greenstein's phase function with the mean cosine `g` (0: isotropic, above 0 forward), or Rayleigh's
    (g = RAYLEIGH), and in the share `beside` a second one with `g_beside`."""

    g: float = 0.0
    g_beside: float = 0.0
    beside: float = 0.0

    @property
    def straightest(self) -> float:
        """The largest |g| of its lobes; Rayleigh's is as wide as can be."""
        return max(abs(g) for g in (self.g, self.g_beside, 0.0) if g != RAYLEIGH)


@dataclass(frozen=True)
class Medium:
    """Extinction `sigma_t` per scene unit and channel, `albedo` the share of it that is scattering, and the radiance
    `emission` sent out per scene unit, in W/(m² sr). The same everywhere, but for what grids multiply: `density` the
    extinction, which is 0 outside of it, `albedo_grid` and `emission_grid` their own; a medium with any has density."""

    name: str
    sigma_t: RGB = (1.0, 1.0, 1.0)
    albedo: RGB = (0.75, 0.75, 0.75)
    emission: RGB = (0.0, 0.0, 0.0)
    phase: Phase = Phase()
    density: Grid | None = None
    albedo_grid: Grid | None = None
    emission_grid: Grid | None = None

    @property
    def varies(self) -> bool:
        """Do its numbers vary in space?"""
        return self.density is not None

    @property
    def free_path(self) -> float:
        """Mean free path in scene units of the channel in which it is shortest; infinite where nothing is met, and on
        lattices, where it varies."""
        stops = 0.0 if self.varies else max(self.sigma_t)
        return 1.0 / stops if stops > 0.0 else math.inf

    @property
    def shortest_path(self) -> float:
        """The mean free path where it is shortest, in scene units; infinite where nothing is met."""
        return 1.0 / self._stops if self._stops > 0.0 else math.inf

    @property
    def _stops(self) -> float:
        return max(self.sigma_t) * (1.0 if self.density is None else self.density.most)

    @property
    def most_scattering(self) -> float:
        """σs where it is largest, per scene unit, of the channel that scatters most; an albedo's grid counts as 1."""
        return max(s * a for s, a in zip(self.sigma_t, self.albedo, strict=True)) * (
            1.0 if self.density is None else self.density.most
        )

    @property
    def acts(self) -> bool:
        """Does it change light at all?"""
        emits = max(self.emission) * (1.0 if self.emission_grid is None else self.emission_grid.most)
        return max(self._stops, emits) > 0
