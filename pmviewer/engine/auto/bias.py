"""What a trial has measured of a picture's bias, which more passes take away slowly or not at all."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cache

import numpy as np

from pmviewer.maps.radius import progressive_radius
from pmviewer.settings.access import SETTINGS, Settings, get
from pmviewer.settings.presets import RESET

ORDER = 1.5
"""Power of the radius that bias is taken to grow with: 2 in the open, 1 at edges."""
_SIZE = "camera.width", "camera.height"


@dataclass(frozen=True)
class Bias:
    """`bias2` is the squared relative bias of the first pass, with radii `width` times the trial's."""

    bias2: float
    width: float
    interpolated: bool
    """Whether it is that of interpolation, which falls with the cube root of the passes."""

    def __call__(self, passes: float) -> float:
        """Squared relative bias after that many passes."""
        duller = passes ** (-1 / 6) if self.interpolated else mean_of(radius_sums()[1], passes, -ORDER / 6)
        return self.bias2 * self.width ** (2 * ORDER) * duller**2


@cache
def radius_sums() -> tuple[np.ndarray, np.ndarray]:
    """Sums over the passes up to each of the first 4096: of r²₁/r²ᵢ, and of rᵢ/r₁ to the power that bias goes with."""
    ratio = np.array([progressive_radius(1.0, i) ** 2 for i in range(1, 4097)])
    return np.cumsum(1 / ratio), np.cumsum(ratio ** (ORDER / 2))


def mean_of(sums: np.ndarray, n: float, power: float) -> float:
    """Mean over n passes, of sums as `radius_sums` has them, going on by its power law."""
    last = len(sums)
    if n <= last:
        return float(np.interp(n, np.arange(1, last + 1), sums)) / n
    return float(sums[-1]) / last * (n / last) ** power


def way_of(settings: Settings) -> Hashable:
    """What bias depends on: all that automatic mode sets, and the picture's size, by which radii are chosen. Another
    view of the scene has about the same."""
    return tuple(str(get(settings, path)) for path in SETTINGS if path.startswith((*RESET, *_SIZE)))
