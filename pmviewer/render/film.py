"""The film: float64 sums of all samples, so that a thousand passes add up without drift."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.render.planes import CHANNELS


@kernel
def resolve(sums, passes, out, first, last):
    """Means of pixels first … last−1: sums (n, ≥ CHANNELS) float64, out (n, CHANNELS) float32."""
    inverse = 1.0 / passes
    for pixel in range(first, last):
        for c in range(out.shape[1]):
            out[pixel, c] = np.float32(sums[pixel, c] * inverse)


class Film:
    """Sums of `passes` samples per pixel: `sums` (height·width, CHANNELS + further) float64, `further` being sums that
    a method keeps beside the planes; `radii` of the pixels' look-ups in the latest pass
    (`pmviewer.render.pixel_radius`), None where all have that of the pass."""

    def __init__(self, width: int, height: int, further: int = 0) -> None:
        self.width, self.height = width, height
        self.sums: NDArray[np.float64] = np.zeros((width * height, CHANNELS + further), np.float64)
        self.radii: NDArray[np.float32] | None = None
        self.passes = 0

    def planes(self) -> NDArray[np.float32]:
        """Means (height, width, CHANNELS) float32."""
        out = np.empty((self.height * self.width, CHANNELS), np.float32)
        resolve(self.sums, float(max(self.passes, 1)), out, 0, len(out))
        return out.reshape(self.height, self.width, CHANNELS)
