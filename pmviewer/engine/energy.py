"""Where the light went: the energy ledgers of all passes, as means with their standard errors."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

ENTRIES = ("emitted", "absorbed", "escaped", "terminated", "dropped")
"""Of a pass, in this order: what the lights emit, and what became of it. Terminated is light that was still on its way
when `photons.max_bounces` ended it, dropped what photons held whose power became infinite or NaN."""


@dataclass(frozen=True)
class Energy:
    """Means over `passes` ledgers in watts of luminance, by `ENTRIES`, and their standard errors, NaN for one pass.
    `uncounted` is how much of the emission is with test photons of guided emission, whose ways no ledger has."""

    passes: int
    watts: tuple[float, ...]
    errors: tuple[float, ...]
    uncounted: float = 0.0

    def share(self, entry: str) -> float:
        """Of what is emitted; 0 when nothing is."""
        return self.watts[ENTRIES.index(entry)] / self.watts[0] if self.watts[0] > 0 else 0.0

    def share_error(self, entry: str) -> float:
        """Standard error of the share, for emission that does not vary."""
        return self.errors[ENTRIES.index(entry)] / self.watts[0] if self.watts[0] > 0 else 0.0

    @property
    def missing(self) -> float:
        """Watts that were emitted and are in no other entry: rounding, or an error of the program."""
        return self.watts[0] - sum(self.watts[1:])


@dataclass
class EnergyLedger:
    """Sums over passes of (5,) ledgers and of their squares."""

    passes: int = 0
    sums: NDArray[np.float64] = field(default_factory=lambda: np.zeros(len(ENTRIES)))
    squares: NDArray[np.float64] = field(default_factory=lambda: np.zeros(len(ENTRIES)))
    lights: float = 0.0

    def add(self, energy: NDArray[np.float64], lights: float) -> None:
        """The ledger of one more pass of lights with that power."""
        self.passes += 1
        self.sums += energy
        self.squares += (energy / lights) ** 2 if lights > 0 else 0.0
        self.lights = lights

    def merge(self, other: EnergyLedger) -> None:
        """Add the passes of another ledger of the same lights."""
        self.passes += other.passes
        self.sums += other.sums
        self.squares += other.squares
        self.lights = other.lights if other.passes else self.lights

    def close(self, with_tests: bool) -> Energy | None:
        """The ledger so far, `with_tests` if test photons carry power, too; None before the first pass."""
        n = self.passes
        if n == 0:
            return None
        mean, errors = self.sums / n, np.full(len(ENTRIES), math.nan)
        if n > 1 and self.lights > 0:
            variance = np.maximum(self.squares - n * (mean / self.lights) ** 2, 0.0) / (n - 1)
            errors = np.sqrt(variance / n) * self.lights
        uncounted = max(self.lights - float(mean[0]), 0.0) if with_tests else 0.0
        return Energy(n, tuple(map(float, mean)), tuple(map(float, errors)), uncounted)
