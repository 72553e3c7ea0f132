"""False colours for views of one number per pixel: a colour table, its scale, and the ticks of its legend."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.colour_maps import SEQUENTIAL, TWO_SIDED
from pmviewer.output.tone import MAGENTA

COLOURS: NDArray[np.float32] = SEQUENTIAL["violet-yellow"]
"""(256, 3), display-encoded, dark violet to light yellow."""
DIVERGING: NDArray[np.float32] = TWO_SIDED["blue-orange"]
"""(256, 3), display-encoded: below, at and above a middle that matters."""


@dataclass(frozen=True)
class Tick:
    """`position` in [0, 1] along the legend."""

    position: float
    label: str
    value: float


@dataclass(frozen=True)
class Scale:
    """Maps values from `lower` … `upper` to 0 … 1, evenly or by their logarithm (then 0 < lower)."""

    lower: float
    upper: float
    log: bool = False
    unit: str = ""

    def __post_init__(self) -> None:
        if not (self.lower < self.upper and math.isfinite(self.upper - self.lower)) or (self.log and self.lower <= 0):
            raise ValueError(f"no scale from {self.lower} to {self.upper}" + (" by logarithm" if self.log else ""))

    def normalise(self, values: NDArray[Any]) -> NDArray[np.float64]:
        """Position of each value, cut to [0, 1]; NaN stays NaN. On a logarithmic scale what isn't positive is 0."""
        values = np.asarray(values, np.float64)
        low, high = self.lower, self.upper
        if self.log:
            with np.errstate(divide="ignore"):
                values = np.log(np.maximum(values, 0.0))
            low, high = math.log(low), math.log(high)
        return np.clip((values - low) / (high - low), 0.0, 1.0)

    def ticks(self, count: int = 5) -> list[Tick]:
        """Round values within the scale, about `count`, with the unit."""
        values = _log_values(self.lower, self.upper, count) if self.log else _even_values(self.lower, self.upper, count)
        unit = f" {self.unit}" if self.unit else ""
        return [Tick(float(self.normalise(np.array(v))), f"{v:.6g}{unit}", v) for v in values]


ERROR_SCALE = Scale(1e-5, 1.0, log=True)
"""Of a pixel's relative squared error. The same for every picture, so that two can be compared."""


def scale_of(values: NDArray[Any], log: bool = False, unit: str = "", percentile: float = 1.0) -> Scale:
    """A scale from that percentile to the one as far from the other end of the finite (by logarithm: positive) values,
    widened when they are all alike; 0–1 (0.1–1 by logarithm) when there are none."""
    values = np.asarray(values, np.float64)
    good = values[np.isfinite(values) & (values > 0 if log else True)]
    if not good.size:
        return Scale(0.1 if log else 0.0, 1.0, log, unit)
    low, high = (float(v) for v in np.percentile(good, (percentile, 100 - percentile)))
    if high - low <= 1e-9 * max(abs(low), abs(high)):
        margin = abs(high) / 2 or 0.5
        low, high = low - margin, high + margin
    return Scale(low, high, log, unit)


def scale_around_one(values: NDArray[Any], widest: float = 1000.0, unit: str = "", percentile: float = 1.0) -> Scale:
    """A logarithmic scale with 1 in its middle that holds the positive values but those beyond the percentile at either
    end, 2 to `widest` either way."""
    values = np.asarray(values, np.float64)
    good = values[np.isfinite(values) & (values > 0)]
    reach = (
        max(2.0, *(np.exp(np.abs(np.log(np.percentile(good, (percentile, 100 - percentile))))))) if good.size else 2.0
    )
    reach = min(float(reach), widest)
    return Scale(1.0 / reach, reach, log=True, unit=unit)


def false_colour(values: NDArray[Any], scale: Scale, colours: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """(h, w) or (h, w, 1) to display-encoded (h, w, 3) in [0, 1] by a table (COLOURS unless given); what is not finite
    is magenta."""
    colours = COLOURS if colours is None else colours
    values = np.asarray(values)
    if values.ndim == 3 and values.shape[2] == 1:
        values = values[..., 0]
    good = np.isfinite(values)
    position = scale.normalise(np.where(good, values, scale.lower))
    pixels = colours[np.rint(position * (len(colours) - 1)).astype(np.intp)]
    pixels[~good] = MAGENTA
    return pixels


def _even_values(low: float, high: float, count: int) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / max(count - 1, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [float(f"{i * step:.12g}") for i in range(first, last + 1)]


def _log_values(low: float, high: float, count: int) -> list[float]:
    """Powers of ten, every n-th when there are many; with 2 and 5 between when there are few."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    decades = math.log10(high / low)
    digits = (1,) if decades >= 3 else (1, 2, 5) if decades >= 1 else (1, 2, 3, 5, 7)
    skip = max(1, math.ceil((last - first) / max(count, 1)))
    first -= first % skip  # 1 is among them
    values = [float(f"{d}e{e}") for e in range(first, last + 1, skip) for d in digits]
    inside = [v for v in values if low * (1 - 1e-9) <= v <= high * (1 + 1e-9)]
    return inside if len(inside) > 1 else _even_values(low, high, count)
