"""What the trial's figures promise for a given time: error over N, radius and passes.

The variance of the mean of n passes is that of the camera rays, whose numbers complement one another from pass to pass,
eye/n^1.25, plus the photons' part, which falls as 1/n. Where look-ups shrink, the photons' variance in pass i goes with
r²₁/r²ᵢ, as for Knaus & Zwicker 2011, and bias with a power of rᵢ/r₁.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from pmviewer.engine.auto.trial import ORDER, Measured
from pmviewer.maps.radius import progressive_radius

PHOTONS = (12_500, 25_000, 50_000, 100_000, 150_000, 200_000, 300_000, 600_000, 1_200_000, 2_400_000)
COMPLEMENT = 1.25
"""Power that the camera rays' part falls with: measured over the bundled scenes."""
WIDTHS = (2**-0.5, 1.0, 2**0.5)
"""Radii that are tried, relative to the automatic one."""
FEWEST = 4
"""Passes: a picture of fewer says nothing of its own error."""
MOST = 1 << 20


@dataclass(frozen=True)
class Option:
    """A candidate with its numbers, the passes that the time has room for, and the error that they promise."""

    measured: Measured
    N: int
    width: float
    passes: float
    error: float
    seconds: float

    @property
    def name(self) -> str:
        """What it is, in words."""
        return self.measured.candidate.name


@cache
def _sums() -> tuple[np.ndarray, np.ndarray]:
    """Sums over the passes up to each of the first 4096: of r²₁/r²ᵢ, and of rᵢ/r₁ to the power that bias goes with."""
    ratio = np.array([progressive_radius(1.0, i) ** 2 for i in range(1, 4097)])
    return np.cumsum(1 / ratio), np.cumsum(ratio ** (ORDER / 2))


def _mean(sums: np.ndarray, n: float, power: float) -> float:
    """Mean over n passes, going on by its power law."""
    last = len(sums)
    if n <= last:
        return float(np.interp(n, np.arange(1, last + 1), sums)) / n
    return float(sums[-1]) / last * (n / last) ** power


def error_after(m: Measured, N: int, width: float, passes: float) -> float:
    """relMSE after that many passes of N trajectories, with radii `width` times the trial's."""
    noisier, photons = 1.0, m.photons / N
    if m.candidate.shrinks:
        photons /= width**2
    if m.blurs:
        noisier = _mean(_sums()[0], passes, 1 / 3)
    return m.eye / passes**COMPLEMENT + photons * noisier / passes + bias_after(m, width, passes)


def bias_after(m: Measured, width: float, passes: float) -> float:
    """Squared relative bias after that many passes: of what is interpolated it falls with their cube root."""
    duller = passes ** (-1 / 6) if m.interpolated else _mean(_sums()[1], passes, -ORDER / 6)
    return m.bias2 * width ** (2 * ORDER) * duller**2


def options(m: Measured, widths: tuple[float, ...], seconds: float) -> list[Option]:
    """All numbers for one candidate, with the error after that many CPU seconds."""
    found = []
    for N in PHOTONS if m.photons > 0 else (PHOTONS[4],):
        for width in widths if m.candidate.shrinks and m.photons > 0 else (1.0,):
            cost = m.costs.of(N, width**2)
            passes = min(seconds / max(cost, 1e-6), float(MOST))
            found.append(Option(m, N, width, passes, error_after(m, N, width, max(passes, 1.0)), seconds))
    return found


def seconds_to(m: Measured, N: int, width: float, error: float) -> float:
    """CPU seconds to that error, by bisection over passes."""
    low, high = 0.0, math.log2(MOST)
    if error_after(m, N, width, 2**high) > error:
        return math.inf
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (low, middle) if error_after(m, N, width, 2**middle) <= error else (middle, high)
    return 2**high * m.costs.of(N, width**2)
