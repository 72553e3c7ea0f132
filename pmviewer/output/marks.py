"""Pixels that a picture hides something in: not finite, negative, or brighter than the screen.

The window marks the same pixels on the graphics card (`shaders/picture.frag`); change both together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.tone import Curve

_A, _B, _C, _D, _E = 2.51, 0.03, 2.43, 0.59, 0.14
_FILMIC = ((_D - _B) + math.sqrt((_D - _B) ** 2 + 4 * (_A - _C) * _E)) / (2 * (_A - _C))
"""Where Narkowicz' curve (`pmviewer.output.tone`) reaches 1: (A−C)x² − (D−B)x − E = 0."""
CUT: dict[Curve, float] = {"sRGB": 1.0, "linear": 1.0, "filmic": _FILMIC, "Reinhard": math.inf}
"""Exposed radiance from which a tone curve shows no differences any more."""


@dataclass(frozen=True)
class Marks:
    """Pixels of each kind: any of a pixel's channels counts; one that is not finite counts as that alone."""

    broken: int
    negative: int
    clipped: int
    total: int

    def text(self) -> str:
        """What there is of them, for a caption."""
        parts = ((self.broken, "not finite"), (self.negative, "negative"), (self.clipped, "clipped"))
        return ", ".join(f"{n:,} {name} ({n / max(self.total, 1):.2%})" for n, name in parts)


def radiance_marks(image: NDArray[Any], exposure: float, curve: Curve) -> Marks:
    """Of a radiance (h, w, c) that is shown with that exposure in EV by that curve."""
    finite = np.isfinite(image).all(axis=-1)
    with np.errstate(invalid="ignore"):
        negative = finite & (image < 0).any(axis=-1)
        clipped = finite & (image > CUT[curve] / 2.0**exposure).any(axis=-1)
    broken = finite.size - int(np.count_nonzero(finite))
    return Marks(broken, int(np.count_nonzero(negative)), int(np.count_nonzero(clipped)), finite.size)
