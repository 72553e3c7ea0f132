"""Participating media as loaders describe them."""

from __future__ import annotations

from dataclasses import dataclass

RGB = tuple[float, float, float]


@dataclass(frozen=True)
class Phase:
    """Henyey and Greenstein's phase function with the mean cosine `g` (0: isotropic, above 0 forward), and in the share
    `beside` a second one with `g_beside`."""

    g: float = 0.0
    g_beside: float = 0.0
    beside: float = 0.0


@dataclass(frozen=True)
class Medium:
    """The same everywhere: extinction `sigma_t` per scene unit and channel, `albedo` the share of it that is
    scattering, and the radiance `emission` sent out per scene unit, in W/(m² sr)."""

    name: str
    sigma_t: RGB = (1.0, 1.0, 1.0)
    albedo: RGB = (0.75, 0.75, 0.75)
    emission: RGB = (0.0, 0.0, 0.0)
    phase: Phase = Phase()

    @property
    def acts(self) -> bool:
        """Does it change light at all?"""
        return max(*self.sigma_t, *self.emission) > 0
