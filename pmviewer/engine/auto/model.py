"""What the trial's figures promise for a given time: error over N, radii, q and passes.

The variance of the mean of n passes is that of the camera rays, whose numbers complement one another from pass to pass,
eye/n^1.1, or faster where it is light samples', which follow one another within a pass as over passes (`complement` of
`Measured`), plus the photons' part, which falls as 1/n.
The photons' variance in pass i goes with r²₁/r²ᵢ, as for Knaus & Zwicker 2011, and bias with a power of rᵢ/r₁ that the
trial has measured. For a given time radii are delayed (`estimate.delay`) by STEADY times the passes that it has room
for. Of N trajectories q·N fill both maps and the others the caustic map alone, in the share of the light that
projection maps leave them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from pmviewer.engine.auto.bias import STEADY, Bias, mean_over, steady_mean
from pmviewer.engine.auto.measured import Measured, Numbers, Widths

PHOTONS = (12_500, 25_000, 50_000, 100_000, 150_000, 200_000, 300_000, 600_000, 1_200_000, 2_400_000)
COMPLEMENT = 1.1
"""Power that the camera rays' part falls with, without light samples: from the second to the 32nd pass of 17 scenes
what is followed 0.92 to 1.24, what is gathered 0.74 to 1.28 while radii shrink."""
CAUSTIC_WIDTHS = (0.25, 8**-0.5, 0.5, 2**-0.5, 1.0, 2**0.5, 2.0)
SHOWN_WIDTHS = (0.5, 2**-0.5, 1.0, 2**0.5, 2.0, 8**0.5)
"""Radii that are tried, relative to the automatic one."""
SHARES = (1.0, 0.5, 0.25, 0.125)
"""Values of q that are tried where there are caustics."""
UNSURE = (2 / 3, 1.0), (1 / 6, 0.5), (1 / 6, 2.0)
"""Weights and factors of what the squared bias may be, the likely one first: Gauss and Hermite's three points of
a logarithm with a standard deviation of 0.4. (Eight trials of ring_caustic said 0.45 to 1 of it, sixteen of
cornell_caustic at 64² mostly 1 to 2 times as much.)"""
SAMPLES = (1, 2, 4, 8)
"""Light samples that are tried, relative to the automatic number."""
BETTER = 0.87
"""What another way must promise of the default's error to be taken: less is within the trial's own noise."""
EVEN = 1.1
"""What of the least error makes no difference."""
MISSED = 4.0
"""What an error that is never reached costs, in the time to it."""
FEWEST = 3
"""Passes: a picture of fewer says little of its own error."""
MOST, MOST_DELAY = 1 << 20, 10_000
_PASSES = 2.0 ** np.arange(0, 20.01, 0.125)
"""Passes between which errors are interpolated."""


@dataclass(frozen=True)
class Option:
    """A candidate with its numbers, the passes that the time has room for, and the error that they promise.
    `expected`: of one that is to reach an error, the mean over what the bias may be of the seconds to it. Where more
    bias than is likely keeps the picture from it, they count `MISSED` times: wide look-ups promise the least time up to
    where they never get there. `delay`: of radii, in passes."""

    measured: Measured
    numbers: Numbers
    passes: float
    error: float
    seconds: float
    expected: float = math.nan
    delay: int = 0

    @property
    def name(self) -> str:
        """What it is, in words."""
        return self.measured.candidate.name


def error_after(m: Measured, numbers: Numbers, passes: Any, steady: bool = False) -> Any:
    """relMSE after that many passes, a number or an array; `steady`: with radii delayed by STEADY times as many."""
    n, widths = np.asarray(passes, float), numbers.widths
    mean = steady_mean if steady else partial(mean_over, n)
    looked_up = m.caustic / (widths.caustic**2 * numbers.aimed(m.covered)) + m.shown / (widths.shown**2 * numbers.q)
    photons = (looked_up * mean(-2.0) if looked_up else 0.0) + m.gathered / numbers.q
    eye = (m.eye - m.direct) / n**COMPLEMENT + m.direct / (numbers.samples * n) ** m.complement
    return eye + photons / numbers.N / n + bias_of(m, widths).over(n, mean)


def bias_of(m: Measured, widths: Widths) -> Bias:
    """Of look-ups with such radii."""
    bias = m.bias
    return replace(bias, caustic=bias.caustic.wider(widths.caustic), shown=bias.shown.wider(widths.shown))


def numbers_for(m: Measured, of: Callable[[Numbers], float]) -> list[Numbers]:
    """All that are worth a thought for one candidate, and the defaults. `of` says what is to be least."""
    samples = samples_for(m, of)
    if m.photons <= 0:
        return [Numbers(PHOTONS[4], samples=samples)]
    shown = SHOWN_WIDTHS if m.shown > 0 else (1.0,)
    if m.caustic > 0:
        widths = [Widths(c, s) for c, s in itertools.product(CAUSTIC_WIDTHS, shown)]
    else:  # without caustics their radius goes with the other
        widths = [Widths(s, s) for s in shown]
    numbers = [Numbers(N, w, q, samples) for N, w, q in itertools.product(PHOTONS, widths, _shares(m))]
    return numbers if samples == 1 else [*numbers, *(Numbers(N) for N in PHOTONS)]


def samples_for(m: Measured, of: Callable[[Numbers], float]) -> int:
    """How many times the automatic number of light samples promises the least `of` numbers, with whatever number of
    photons: of what is even the least, and once, unless more are clearly better."""
    if m.direct <= 0:
        return 1
    least = {samples: min(of(Numbers(N, samples=samples)) for N in PHOTONS) for samples in SAMPLES}
    few = next(samples for samples in SAMPLES if least[samples] <= EVEN * min(least.values()))
    return few if least[few] < BETTER * least[1] else 1


def _shares(m: Measured) -> tuple[float, ...]:
    """Caustics that a trial has not met may be there, rare and bright: a gather does with half of the photons."""
    if m.covered <= 0:
        return SHARES[:1]
    if m.candidate.values.get("render.method") == "gather":
        return SHARES[1:] if m.caustic > 0 else SHARES[1:2]
    return SHARES if m.caustic > 0 else SHARES[:1]


def in_time(m: Measured, numbers: Numbers, seconds: float) -> Option:
    """With the error after that many CPU seconds, radii being delayed."""
    passes = min(seconds / max(m.cost(numbers), 1e-6), float(MOST))
    error = float(error_after(m, numbers, max(passes, 1.0), steady=True))
    return Option(m, numbers, passes, error, seconds, delay=min(int(float(f"{STEADY * passes:.2g}")), MOST_DELAY))


def to_error(m: Measured, numbers: Numbers, error: float) -> Option:
    """With the CPU seconds to that error, infinitely many where it is never reached. Radii shrink from the first pass
    on."""
    seconds = _seconds_to(m, numbers, error)
    likely = seconds[0]
    passes = likely / m.cost(numbers) if math.isfinite(likely) else math.inf
    expected = sum(w * min(s, MISSED * likely) for (w, _), s in zip(UNSURE, seconds, strict=True))
    return Option(m, numbers, passes, error, likely, expected)


def _seconds_to(m: Measured, numbers: Numbers, error: float) -> list[float]:
    """CPU seconds to that error, for each of the biases that `UNSURE` tells."""
    bias = bias_of(m, numbers.widths)(_PASSES)
    noise = error_after(m, numbers, _PASSES) - bias
    return [m.cost(numbers) * _passes_to(error, noise + factor * bias) for _, factor in UNSURE]


def _passes_to(error: float, errors: Any) -> float:
    """By log-log interpolation between `_PASSES`."""
    below = np.flatnonzero(errors <= error)
    if not below.size:
        return math.inf
    i = int(below[0])
    if i == 0:
        return float(_PASSES[0])
    share = math.log(errors[i - 1] / error) / math.log(errors[i - 1] / errors[i])
    return float(_PASSES[i - 1]) * 2 ** (0.125 * share)
