"""What passes with a wider and a narrower radius tell of it: bias, the power of the radius that bias goes with, the
variance that the photons in it make, and what looking them up costs.

All of them have the same photons and camera rays. Bias b ∝ r^p differs by b·(w^p − 1) between radii w·r and r, and by
b·(1 − w^−p) between r and r/w, so that the quotient of both differences is w^p. Where light is narrower than the radius
p is 1 or less, in the open 2; the quotient is noisy, so that p is taken half way between it and the usual one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pmviewer.engine.auto.bias import ORDER, Blur
from pmviewer.engine.auto.relative import F8, squared, variance

ORDERS = 0.7, 1.5
"""The least and the greatest p that a trial believes in."""


@dataclass(frozen=True)
class Tried:
    """Pictures (h, w, 3) of the two seeds, and the CPU seconds of their camera pass."""

    images: list[F8]
    seconds: float


@dataclass(frozen=True)
class Widened:
    """Bias, variance and CPU seconds of the look-ups, by the automatic radius."""

    blur: Blur
    variance: float
    cost: float

    def wider(self, factor: float) -> Widened:
        """Of look-ups with radii so many times as wide."""
        return replace(
            self, blur=self.blur.wider(factor), variance=self.variance / factor**2, cost=self.cost * factor**2
        )


NONE = Widened(Blur(), 0.0, 0.0)


def told_by(wide: Tried, usual: Tried, narrow: Tried, mean: F8, factor: float) -> Widened:
    """From passes with radii of `factor` and 1/`factor` times the usual one, and with that. mean: the picture that
    errors are relative to."""
    span = factor**2 - 1 / factor**2
    noise = max(variance(narrow.images, mean) - variance(wide.images, mean), 0.0) / span
    return Widened(_blur(wide, usual, narrow, mean, factor), noise, max(wide.seconds - narrow.seconds, 0.0) / span)


def _blur(wide: Tried, usual: Tried, narrow: Tried, mean: F8, factor: float) -> Blur:
    above, below = squared(wide.images, usual.images, mean), squared(usual.images, narrow.images, mean)
    order = ORDER
    if above > 0 and below > 0:
        seen = 0.5 * math.log(above / below) / math.log(factor)
        order = min(max((ORDER + seen) / 2, ORDERS[0]), ORDERS[1])
    if above > 0:
        return Blur(above / (factor**order - 1) ** 2, order)
    return Blur(below / (1 - factor**-order) ** 2, order)
