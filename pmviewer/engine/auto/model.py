"""What the trial's figures promise for a given time: error over N, radius and passes.

The variance of the mean of n passes is that of the camera rays, whose numbers complement one another from pass to pass,
eye/n^1.25, plus the photons' part, which falls as 1/n. Where look-ups shrink, the photons' variance in pass i goes with
r²₁/r²ᵢ, as for Knaus & Zwicker 2011, and bias with a power of rᵢ/r₁.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pmviewer.engine.auto.bias import Bias, mean_of, radius_sums
from pmviewer.engine.auto.trial import Measured

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


def error_after(m: Measured, N: int, width: float, passes: float) -> float:
    """relMSE after that many passes of N trajectories, with radii `width` times the trial's."""
    noisier, photons = 1.0, m.photons / N
    if m.candidate.shrinks:
        photons /= width**2
    if m.blurs:
        noisier = mean_of(radius_sums()[0], passes, 1 / 3)
    return m.eye / passes**COMPLEMENT + photons * noisier / passes + bias_of(m, width)(passes)


def bias_of(m: Measured, width: float) -> Bias:
    """Of look-ups with radii `width` times the trial's."""
    return Bias(m.bias2, width, m.interpolated)


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
