"""How numbers become colours, by the display settings: which map, from where to where, evenly or by logarithm; and how
many pixels have which value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.colour_maps import CLASSES, FATES, RGB, SEQUENTIAL, TWO_SIDED
from pmviewer.output.falsecolour import Scale, scale_around_one
from pmviewer.output.falsecolour import scale_of as percentile_scale
from pmviewer.settings.access import Display

LEAST_SPAN = 1e-6
"""Of a logarithmic scale whose lower end was set to nothing or less: this share of its upper one."""
BINS = 48
PERCENTILE = 1.0
"""That views leave out at either end by themselves."""


@dataclass(frozen=True)
class Own:
    """What a view is by itself: ends that it always has, by logarithm, around 1 or around 0 (`signed`), from none."""

    unit: str = ""
    log: bool = False
    fixed: tuple[float, float] | None = None
    around_one: bool = False
    signed: bool = False
    from_none: bool = False

    @property
    def two_sided(self) -> bool:
        """Whether its middle matters."""
        return self.around_one or self.signed


@dataclass(frozen=True)
class Look:
    """What the display settings say of false colours; the names of maps are those of `pmviewer.output.colour_maps`."""

    colours: str = "violet-yellow"
    two_sided: str = "blue-orange"
    classes: str = "usual"
    range: str = "auto"
    percentile: float = PERCENTILE
    low: float = 0.0
    high: float = 1.0
    spacing: str = "auto"

    def table(self, own: Own) -> NDArray[np.float32]:
        """(256, 3) of the view's colours."""
        return TWO_SIDED[self.two_sided] if own.two_sided else SEQUENTIAL[self.colours]

    @property
    def class_colours(self) -> tuple[RGB, ...]:
        """Of caustic convergence."""
        return CLASSES[self.classes]

    @property
    def fate_colours(self) -> tuple[RGB, ...]:
        """Of photons by fate."""
        return FATES[self.classes]

    def scale(self, own: Own, values: NDArray[np.floating]) -> Scale:
        """From where to where colours go for these values (n,), of which those that tell nothing are left out."""
        log = own.log if self.spacing == "auto" else self.spacing == "log"
        log = log and not own.signed
        if self.range == "by hand":
            return _by_hand(self.low, self.high, log, own.unit)
        if self.range == "auto" and own.fixed is not None:
            low, high = own.fixed
            return _by_hand(low, high, log, own.unit)
        percentile = self.percentile if self.range == "percentiles" else PERCENTILE
        if own.around_one and log:
            return scale_around_one(values, unit=own.unit, percentile=percentile)
        if own.signed:
            return _around_none(values, own.unit, percentile)
        scale = percentile_scale(values, log, own.unit, percentile)
        if own.from_none and not log:
            return Scale(0.0, max(scale.upper, 1.0), unit=own.unit)
        return scale


def look_of(display: Display) -> Look:
    """The display settings' part that concerns false colours."""
    return Look(
        display.colours,
        display.two_sided,
        display.classes,
        display.range,
        display.percentile,
        display.low,
        display.high,
        display.spacing,
    )


def _by_hand(low: float, high: float, log: bool, unit: str) -> Scale:
    """Ends that may lie the wrong way round, or at the same place."""
    low, high = min(low, high), max(low, high)
    if log and high <= 0:
        log = False  # nothing has a logarithm
    if log and low <= 0:
        low = LEAST_SPAN * high
    if high - low <= 1e-9 * max(abs(low), abs(high)):
        margin = abs(high) / 2 or 0.5
        low, high = low - margin, high + margin
    return Scale(low, high, log, unit)


def _around_none(values: NDArray[np.floating], unit: str, percentile: float) -> Scale:
    """As far below zero as above it, so that all but that percentage of the values at each end is inside."""
    good = np.abs(values[np.isfinite(values)])
    reach = float(np.percentile(good, 100 - percentile)) if good.size else 0.0
    reach = reach or float(good.max(initial=0.0)) or 1.0
    return Scale(-reach, reach, unit=unit)


@dataclass(frozen=True)
class Histogram:
    """Of the pixels that a view tells something of: how many lie in each of `counts` bins from the scale's lower end
    to its upper, `below` and `above` it, or are `broken` (not finite)."""

    counts: NDArray[np.int64]
    below: int
    above: int
    broken: int

    @property
    def total(self) -> int:
        """Of finite values."""
        return int(self.counts.sum()) + self.below + self.above


def histogram(values: NDArray[np.floating], scale: Scale, bins: int = BINS) -> Histogram:
    """Of values (n,) over a scale; on a logarithmic one what isn't positive lies below."""
    values = np.asarray(values).reshape(-1)
    finite = np.isfinite(values)
    broken = int(values.size - np.count_nonzero(finite))
    good = (values[finite] if broken else values).astype(np.float64)
    below, above = int(np.count_nonzero(good < scale.lower)), int(np.count_nonzero(good > scale.upper))
    inside = good[(good >= scale.lower) & (good <= scale.upper)]
    place = np.minimum((scale.normalise(inside) * bins).astype(np.intp), bins - 1)
    return Histogram(np.bincount(place, minlength=bins).astype(np.int64), below, above, broken)
