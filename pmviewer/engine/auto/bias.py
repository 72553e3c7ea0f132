"""What a trial has measured of a picture's bias, which more passes take away slowly or not at all."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
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
_SIZE = "camera.width", "camera.height"
_KNOWN = 4096
"""Passes whose radii are summed up one by one."""
F8 = NDArray[np.float64]


@dataclass(frozen=True)
class Blur:
    """What look-ups within a radius blur: the squared relative bias of the first pass, and the power of the radius that
    the bias goes with."""

    bias2: float = 0.0
    order: float = ORDER

    def wider(self, factor: float) -> Blur:
        """With radii so many times as wide."""
        return replace(self, bias2=self.bias2 * factor ** (2 * self.order))

    def after(self, passes: Any) -> Any:
        """Squared bias of the mean of so many passes, whose radii shrink; a number or an array."""
        return self.bias2 * mean_over(passes, self.order) ** 2


@dataclass(frozen=True)
class Bias:
    """By the caustic map, by the global map where it is shown, and by interpolation, which shrinks as radii do."""

    caustic: Blur = Blur()
    shown: Blur = Blur()
    interpolated: float = 0.0

    def __call__(self, passes: Any) -> Any:
        """Squared relative bias after that many passes, a number or an array: the parts sit in different places."""
        duller = np.asarray(passes, float) ** (-1 / 3)
        return self.caustic.after(passes) + self.shown.after(passes) + self.interpolated * duller

    @staticmethod
    def restored(told: Mapping[str, Any]) -> Bias:
        """What `dataclasses.asdict` made of one."""
        return Bias(Blur(**told["caustic"]), Blur(**told["shown"]), told["interpolated"])


@cache
def _sums(power: float) -> F8:
    """Of (rᵢ/r₁)^power over the passes up to each of the first."""
    ratio = np.array([progressive_radius(1.0, i) for i in range(1, _KNOWN + 1)])
    return np.cumsum(ratio**power)


def mean_over(passes: Any, power: float) -> Any:
    """Mean of (rᵢ/r₁)^power over so many passes, a number or an array, beyond the first ones by the power law that the
    radius falls with, rᵢ ∝ i^(−1/6)."""
    sums, n = _sums(power), np.asarray(passes, float)
    mean = np.interp(n, np.arange(1, _KNOWN + 1), sums) / n
    return np.where(n <= _KNOWN, mean, sums[-1] / _KNOWN * (n / _KNOWN) ** (-power / 6))


def way_of(settings: Settings) -> Hashable:
    """What bias depends on: all that automatic mode sets, and the picture's size, by which radii are chosen. Another
    view of the scene has about the same."""
    return tuple(str(get(settings, path)) for path in SETTINGS if path.startswith((*RESET, *_SIZE)))
