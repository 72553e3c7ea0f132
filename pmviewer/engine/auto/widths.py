"""What passes with a wider and a narrower radius tell of it: bias, the variance that the photons in it make, and what
looking them up costs.

All of them have the same photons and camera rays, so that they differ by their biases and little else. Where light
ends at an outline, which is where most of it is wrong, the mean over a disc of radius r errs in a band of width 2r.
With F(x) = (arccos x − x·√(1 − x²))/π, the part of a disc that lies beyond a straight line at x of its radius, the
squared bias is r·2∫F² per length of line, and from the radius r to 2r it grows by 2.16 times the squared difference of
both. In bundled scenes with a reference (museum, corner_room, cornell_lights, glossy_room, glass_egg, cornell_diffuse,
cornell_caustic, ring_caustic) it grew by 2.0 to 2.9 times that. With bias b ∝ r^p both differences have the quotient
2^p, which is noisy, so that p is taken half way between it and the usual one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pmviewer.engine.auto.bias import ORDER, Blur
from pmviewer.engine.auto.relative import F8, squared, variance

WIDER = 2.0
"""Radii that are tried besides are wider and narrower by this."""
GROWTH = 2.16
"""Of the squared bias from a radius to one WIDER times as wide, over the squared difference of what both show."""
ORDERS = 0.5, 1.5
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


def told_by(wide: Tried, usual: Tried, narrow: Tried, mean: F8) -> Widened:
    """From passes with radii of WIDER and 1/WIDER times the usual one, and with that. mean: the picture that errors are
    relative to."""
    span = WIDER**2 - 1 / WIDER**2
    noise = max(variance(narrow.images, mean) - variance(wide.images, mean), 0.0) / span
    return Widened(_blur(wide, usual, narrow, mean), noise, max(wide.seconds - narrow.seconds, 0.0) / span)


def _blur(wide: Tried, usual: Tried, narrow: Tried, mean: F8) -> Blur:
    """The power is told by errors relative to what the narrow radius shows, which is blurred least: where light has
    leaked into the dark, the others are brighter than the truth, and the more so the wider they are."""
    sharp = np.mean(narrow.images, axis=0)
    above, below = squared(wide.images, usual.images, sharp), squared(usual.images, narrow.images, sharp)
    order = ORDER
    if above > 0 and below > 0:
        seen = 0.5 * math.log(above / below) / math.log(WIDER)
        order = min(max((ORDER + seen) / 2, ORDERS[0]), ORDERS[1])
    return Blur(GROWTH * squared(wide.images, usual.images, mean) / (WIDER ** (2 * order) - 1), order)
