"""What a trial has measured of a picture's bias, which more passes take away slowly or not at all."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.radius import progressive_radius
from pmviewer.settings.access import SETTINGS, Settings, get
from pmviewer.settings.presets import RESET

ORDER = 0.65
"""Power of the radius that the root mean square of bias grows with: ½ where light ends at an outline, as what is wrong
is a band as wide as the radius, and 2 in the open. Between half and twice the automatic radius it was 0.5 to 1.2 in
bundled scenes with a reference, mostly 0.6 to 0.7."""
STEADY = 4
"""What automatic mode has radii delayed by, in passes that it plans for: they shrink by 4 % meanwhile. Of passes with
the same noise those of one radius have the least bias, and where light is gathered narrower look-ups bring noise and
little else. relMSE of files after nine CPU seconds over that without a delay: 0.71 to 0.98, in the mean of eight 0.85.
Not where an error is to be reached: bias that a trial has overlooked might keep a picture from it."""
GATHERED_ORDER = 1.0
"""The same power where gather rays look up: discs reach beyond edges, and what they lack there is as wide as they are;
rays average it. Of a hall the mean is 0.93, 0.47 and 0.27 % low with the automatic radius, half and a quarter of it."""
_SIZE = "camera.width", "camera.height"
_KNOWN = 4096
"""Passes whose radii are summed up one by one."""
F8 = NDArray[np.float64]
Mean = Callable[[float], Any]
"""From a power to the mean of (rᵢ/r₁)^power over passes, a number or an array."""


@dataclass(frozen=True)
class Blur:
    """What look-ups within a radius blur: the squared relative bias of the first pass, and the power of the radius that
    the bias goes with."""

    bias2: float = 0.0
    order: float = ORDER

    def wider(self, factor: float) -> Blur:
        """With radii so many times as wide."""
        return replace(self, bias2=self.bias2 * factor ** (2 * self.order))


@dataclass(frozen=True)
class Bias:
    """By the caustic map, by the global map where it is shown, by interpolation, which shrinks as radii do without a
    delay, and by the global map where gather rays end. `delay`: of radii, in passes."""

    caustic: Blur = Blur()
    shown: Blur = Blur()
    interpolated: float = 0.0
    delay: int = 0
    gathered: Blur = Blur(order=GATHERED_ORDER)

    def __call__(self, passes: Any) -> Any:
        """Squared relative bias after that many passes, a number or an array: the parts sit in different places."""
        return self.over(passes, lambda power: mean_over(passes, power, self.delay))

    def over(self, passes: Any, mean: Mean) -> Any:
        """The same with other radii, whose means over the passes are told."""
        blurs = self.caustic, self.shown, self.gathered
        blurred = sum(blur.bias2 * mean(blur.order) ** 2 for blur in blurs if blur.bias2 > 0)
        return blurred + self.interpolated * np.asarray(passes, float) ** (-1 / 3)

    @staticmethod
    def restored(told: Mapping[str, Any]) -> Bias:
        """What `dataclasses.asdict` made of one."""
        blurs = {name: Blur(**told[name]) for name in ("caustic", "shown", "gathered") if name in told}
        return Bias(interpolated=told["interpolated"], delay=told.get("delay", 0), **blurs)


@cache
def _sums(power: float, delay: int) -> F8:
    """Of (rᵢ/r₁)^power over the passes up to each of the first."""
    ratio = np.array([progressive_radius(1.0, i, delay=delay) for i in range(1, _KNOWN + 1)])
    return np.cumsum(ratio**power)


def mean_over(passes: Any, power: float, delay: int = 0) -> Any:
    """Mean of (rᵢ/r₁)^power over so many passes, a number or an array, beyond the first ones by the power law that the
    radius falls with, rᵢ ∝ (i + delay)^(−1/6)."""
    sums, n, share = _sums(power, delay), np.asarray(passes, float), 1.0 - power / 6
    later = (sums[-1] - sums[-2]) * (_KNOWN + delay) / share * (((n + delay) / (_KNOWN + delay)) ** share - 1.0)
    return np.where(n <= _KNOWN, np.interp(n, np.arange(1, _KNOWN + 1), sums), sums[-1] + later) / n


def steady_mean(power: float) -> float:
    """Mean of (rᵢ/r₁)^power over passes whose radii are delayed by STEADY times as many."""
    share = -power / 6
    return STEADY / (1 + share) * ((1 + 1 / STEADY) ** (1 + share) - 1)


def way_of(settings: Settings) -> Hashable:
    """What bias depends on: all that automatic mode sets, and the picture's size, by which radii are chosen. Another
    view of the scene has about the same."""
    return tuple(str(get(settings, path)) for path in SETTINGS if path.startswith((*RESET, *_SIZE)))
