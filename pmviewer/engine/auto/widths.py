"""What passes with a wider and a narrower radius tell of it: bias, the variance that the photons in it make, and what
looking them up costs.

All of them have the same photons and camera rays, so that they differ by their biases and little else. Where light
ends at an outline, which is where most of it is wrong, the mean over a disc of radius r errs in a band of width 2r.
With F(x) = (arccos x − x·√(1 − x²))/π, the part of a disc that lies beyond a straight line at x of its radius, the
squared bias is r·2∫F² per length of line, and from the radius r to 2r it grows by 2.16 times the squared difference of
both. In bundled scenes with a reference (museum, corner_room, cornell_lights, glossy_room, glass_egg, cornell_diffuse,
cornell_caustic, ring_caustic) it grew by 2.0 to 2.9 times that. With bias b ∝ r^p both differences have the quotient
2^p: the less certain that is, the nearer p is taken to the usual one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pmviewer.engine.auto.bias import ORDER, Blur
from pmviewer.engine.auto.relative import F8, certain, difference, variance

WIDER = 2.0
"""Radii that are tried besides are wider and narrower by this."""
OUTLINES, OPEN = (0.5, 2.16), (2.0, 5 / 3)
"""p, and how much the squared bias grows from a radius to one WIDER times as wide, over the squared difference of what
both show: where light ends at an outline, and where it varies smoothly, b ∝ r² everywhere: (4² − 1)/(4 − 1)²."""
ORDERS = OUTLINES[0], OPEN[0]
"""The least and the greatest p that a trial believes in."""
SPREAD = 0.2
"""Standard deviation of p over bundled scenes, around `ORDER`: in seven of eight it is within that."""
HIDDEN = 3e-4
"""Squared relative bias of a shown global map that a noisy trial may well overlook: from the automatic radius to twice
it, discs that count for what is covered of them differ by 8e-5 to 9e-4 in four scenes."""
UNSEEN = 0.8
"""What may be there where nothing is seen, over its standard error: the mean of the positive half of that noise."""


@dataclass(frozen=True)
class Tried:
    """Pictures (h, w, 3) of the seeds, and the CPU seconds of their camera pass."""

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


def told_by(wide: Tried, usual: Tried, narrow: Tried, square: F8, hidden: float = 0.0) -> Widened:
    """From passes with radii of WIDER and 1/WIDER times the usual one, and with that. square: what variance is
    relative to. Biases are relative to the mean of what the narrow radius shows, which is blurred least: where light
    leaks into the dark, the others are brighter than the truth, and the more so the wider they are. (Relative to each
    seed's own narrow picture, `above` was up to twice that of 24 seeds together, with four seeds in museum; relative to
    the mean of four 1.0 to 1.2 times.) `hidden`: how much of the difference of the wide and the usual radius is taken
    to be there, at most, where noise may hide it."""
    span = WIDER**2 - 1 / WIDER**2
    # A disc holds the photons of narrower ones: their difference has the variance by which theirs differ, and nothing
    # else's noise.
    noise = variance([a - b for a, b in zip(narrow.images, wide.images, strict=True)], square) / span
    least = np.mean(narrow.images, axis=0)
    above = difference(wide.images, usual.images, least)
    below = difference(usual.images, narrow.images, least)
    return Widened(_blur(above, below, hidden), noise, max(wide.seconds - narrow.seconds, 0.0) / span)


def _blur(above: tuple[float, float], below: tuple[float, float], hidden: float) -> Blur:
    """From the squared differences of the wide and the usual radius, and of that and the narrow one, with their
    standard errors."""
    order = ORDER
    if above[0] > 0 and below[0] > 0:
        seen = 0.5 * math.log(above[0] / below[0]) / math.log(WIDER)
        error = 0.5 * math.hypot(above[1] / above[0], below[1] / below[0]) / math.log(WIDER)
        order += (seen - ORDER) / (1 + (error / SPREAD) ** 2)
        order = min(max(order, ORDERS[0]), ORDERS[1])
    difference2 = max(certain(*above), min(UNSEEN * above[1], hidden))
    return Blur(_growth(order) * difference2 / (WIDER ** (2 * order) - 1), order)


def _growth(order: float) -> float:
    """Between that of outlines and that of the open."""
    return OUTLINES[1] + (order - OUTLINES[0]) / (OPEN[0] - OUTLINES[0]) * (OPEN[1] - OUTLINES[1])
