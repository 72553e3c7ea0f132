"""What a trial has measured of a candidate, and the numbers that it may be rendered with: what a pass costs, how much
passes differ by chance, and by how much they are wrong."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from pmviewer.engine.auto.bias import Bias
from pmviewer.engine.auto.candidates import Candidate
from pmviewer.engine.radius import NO_RADII, FirstRadii, within
from pmviewer.settings.access import Settings

BY_POWER, BY_PHOTONS = 1.3, 1.1
"""Powers of the number of passes that the variance of direct light falls with, by light samples over all lights and by
those that photons choose: from the second to the 32nd pass 1.02 to 1.82 in 17 scenes, in the mean 1.3 (1.02 to 1.37
where its variance is large: skies, fine geometry); 1.17 in office and 1.10 in rooms_10x10."""


@dataclass(frozen=True)
class Widths:
    """Radii relative to the automatic ones: of look-ups in the caustic map, and in the global one where it is shown."""

    caustic: float = 1.0
    shown: float = 1.0

    @property
    def alike(self) -> bool:
        """Whether they are the automatic ones."""
        return self.caustic == self.shown == 1.0

    def values(self, settings: Settings, first: FirstRadii) -> dict[str, Any]:
        """The settings that they stand for, where the automatic radii are these, relative to the scene."""
        if self.alike:
            return {}
        wide = FirstRadii(self.shown * first.usual, self.shown * first.global_, self.caustic * first.caustic)
        found = wide.values(settings.estimate)
        if self.shown == 1.0:  # the radius stays automatic, and that of caustics goes with the usual one
            found = {"estimate.caustic_radius": within("estimate.caustic_radius", wide.caustic / first.usual)}
        return {name: float(f"{value:.4g}") for name, value in found.items()}


AUTOMATIC = Widths()


@dataclass(frozen=True)
class Numbers:
    """N trajectories, of which the share q fills the global map, too, the radii, and `samples` times the automatic
    number of light samples."""

    N: int
    widths: Widths = AUTOMATIC
    q: float = 1.0
    samples: int = 1

    def aimed(self, covered: float) -> float:
        """Light's caustics by so many times as many photons as with q = 1, where those for the caustic map alone start
        in this share of the light (`pmviewer.photons.light_pass.plan`: a + b)."""
        return self.q + (1.0 - self.q) / covered if covered > 0 else 1.0


@dataclass(frozen=True)
class Costs:
    """CPU seconds of a pass of the whole picture: `base`, `sampled`, of as many light samples more as it has
    automatically, and per trajectory `light`, `stored`, what goes with the global map's photons, and `caustic` and
    `shown`, of look-ups, which go with their areas, too."""

    base: float
    light: float
    caustic: float = 0.0
    shown: float = 0.0
    stored: float = 0.0
    sampled: float = 0.0

    def of(self, numbers: Numbers, covered: float = 0.0) -> float:
        """Of a pass."""
        widths, q = numbers.widths, numbers.q
        look_up = self.caustic * widths.caustic**2 * numbers.aimed(covered) + self.shown * widths.shown**2 * q
        base = self.base + self.sampled * (numbers.samples - 1)
        return base + numbers.N * (self.light + self.stored * q + look_up)


@dataclass(frozen=True)
class Measured:
    """Relative variances of a pass: `eye` what photons don't decide, `direct` as much of it as falls with the power
    `complement` of light samples and passes; of one trajectory, `caustic` what look-ups of caustics decide, `shown`
    those of a global map that is shown, `gathered` the rest. `bias`: of the first pass. `first`: radii of the first
    pass, relative to the scene. `covered`: share of the light that photons for the caustic map alone start in, 0 where
    there are none."""

    candidate: Candidate
    costs: Costs
    eye: float
    caustic: float = 0.0
    shown: float = 0.0
    gathered: float = 0.0
    bias: Bias = field(default_factory=Bias)
    first: FirstRadii = NO_RADII
    covered: float = 0.0
    direct: float = 0.0
    complement: float = BY_POWER

    def shared(self, kept: float) -> Measured:
        """With pixels that share their samples (`pmviewer.render.filter`), which leaves that share of what differs from
        pixel to pixel. Photons that are shown are the same for neighbours."""
        return replace(self, eye=kept * self.eye, direct=kept * self.direct, gathered=kept * self.gathered)

    def cost(self, numbers: Numbers) -> float:
        """CPU seconds of a pass of the whole picture."""
        return self.costs.of(numbers, self.covered)

    @property
    def photons(self) -> float:
        """Variance of one trajectory's."""
        return self.caustic + self.shown + self.gathered


@dataclass
class Trial:
    """What was measured, by candidate, with so many seeds; `cpu_seconds` and `seconds` that it took, without
    compiling."""

    measured: list[Measured] = field(default_factory=list)
    cpu_seconds: float = 0.0
    seconds: float = 0.0
    pixels: int = 0
    seeds: int = 0
