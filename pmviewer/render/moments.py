"""What the passes of a film tell of its noise: second moments of the pixels, the standard error of their means, and the
relMSE that noise leaves in the picture.

With x_i what pass i adds to a channel of a pixel, the mean over n independent passes has the variance

    s²/n = (Σx² − n·x̄²) / (n·(n − 1)).

Passes are not independent: their random numbers complement each other, and the mean knows more. How much more is seen
in the two halves of the passes: with A and B their means, (A − B)²/4 has the mean Var(x̄) where the error of a half
falls as 1/n, and s²/n where passes are independent. At each power of two the ratio of both, summed over the picture as
relMSE sums, is the `efficiency`; the last two are averaged, since nets of even and odd powers differ.

What all passes share is not seen: the bias of radii, and photons that are traced once for all passes.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.render.planes import CHANNELS, MEDIA_CHANNELS, TERMS_END
from pmviewer.state import State

EPSILON = 0.01
"""Of relMSE, as in `pmviewer.output.metric`: (W/(m² sr))², so that dark pixels don't outweigh all others."""
FEWEST = 2
"""Passes that tell something."""
BYTES_PER_PIXEL = 3 * 3 * 8


@device
def _image_of(sums, pixel, channels, c):
    """Channel c of the image's sum."""
    total = 0.0
    for column in range(c, TERMS_END, 3):
        total += sums[pixel, column]
    if channels == MEDIA_CHANNELS:
        for column in range(CHANNELS + c, MEDIA_CHANNELS, 3):
            total += sums[pixel, column]
    return total


@kernel
def add_squares(sums, channels, image, squares, first, last):
    """Add to `squares` what the latest pass has added to the image, squared, and make `image` the sums as they are, of
    pixels first … last−1. sums: float64 (n, ≥ channels), of a film; image, squares: float64 (n, 3)."""
    for pixel in range(first, last):
        for c in range(3):
            now = _image_of(sums, pixel, channels, c)
            x = now - image[pixel, c]
            image[pixel, c] = now
            squares[pixel, c] += x * x


@kernel
def relative_variances(image, squares, n, out, first, last):
    """s²/n over x̄² + ε, mean of the channels, of pixels first … last−1 into `out` (n,) float64."""
    for pixel in range(first, last):
        total = 0.0
        for c in range(3):
            mean = image[pixel, c] / n
            variance = max(squares[pixel, c] - n * mean * mean, 0.0) / (n * (n - 1.0))
            total += variance / (mean * mean + EPSILON)
        out[pixel] = total / 3.0


@kernel
def relative_halves(image, half, n, out, first, last):
    """(A − B)²/4 over x̄² + ε, the same way: `half` (n, 3) are the sums after n/2 passes."""
    for pixel in range(first, last):
        total = 0.0
        for c in range(3):
            mean = image[pixel, c] / n
            difference = (2.0 * half[pixel, c] - image[pixel, c]) / n
            total += difference * difference / (mean * mean + EPSILON)
        out[pixel] = total / 3.0


class Moments:
    """Of a film of so many pixels: `image`, the image's sums so far, and `squares` of what passes added, float64
    (pixels, 3); `half`, the image's sums after the latest power of two passes; `efficiency`, the variance of the mean
    over that of independent passes, 1 until it is known. Where
    `refined`, bool (pixels,), is given, the other pixels have a sample of the first pass alone and tell nothing."""

    def __init__(self, pixels: int, refined: NDArray[np.bool_] | None = None) -> None:
        self._refined = refined
        self.image: NDArray[np.float64] = np.zeros((pixels, 3))
        self.squares: NDArray[np.float64] = np.zeros((pixels, 3))
        self.passes = 0
        self.half = np.zeros((pixels, 3))
        self._ratios: list[float] = []

    def add(self, sums: NDArray[np.float64], channels: int, first: int, last: int) -> None:
        """Take what the latest pass has added to pixels first … last−1 of a film's sums (`pmviewer.render.film`)."""
        add_squares(sums, channels, self.image, self.squares, first, last)

    def close_pass(self) -> None:
        """All pixels have been added."""
        self.passes += 1
        n = self.passes
        if n & (n - 1):
            return
        if n > FEWEST:
            out, independent = np.empty(len(self.image)), self._told(self.relative_variances()).sum()
            relative_halves(self.image, self.half, float(n), out, 0, len(out))
            if independent > 0:
                self._ratios.append(float(self._told(out).sum() / independent))
        self.half[:] = self.image

    def state(self) -> State:
        """What has been added so far."""
        arrays = {"image": self.image, "squares": self.squares, "half": self.half}
        return State({"passes": self.passes, "ratios": list(self._ratios)}, arrays)

    def restore(self, state: State) -> None:
        """Go on from there. Raises ValueError where that is of another film."""
        self.image, self.squares, self.half = (
            state.array(name, self.image.shape, np.float64) for name in ("image", "squares", "half")
        )
        self._ratios = [float(ratio) for ratio in state.number("ratios")]
        self.passes = int(state.number("passes"))

    def _told(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        return values if self._refined is None else values[self._refined]

    @property
    def efficiency(self) -> float:
        """Geometric mean of the last two ratios."""
        last = [math.log(ratio) for ratio in self._ratios[-2:] if ratio > 0]
        return math.exp(sum(last) / len(last)) if last else 1.0

    def relative_variances(self) -> NDArray[np.float64]:
        """(pixels,) of means over independent passes, relative to the mean as relMSE is; NaN before FEWEST passes."""
        out = np.full(len(self.image), math.nan)
        if self.passes >= FEWEST:
            relative_variances(self.image, self.squares, float(self.passes), out, 0, len(out))
            if self._refined is not None:
                out[~self._refined] = math.nan
        return out

    def standard_errors(self) -> NDArray[np.float64]:
        """(pixels, 3) of the means, in the film's unit; NaN before FEWEST passes."""
        n = self.passes
        if n < FEWEST:
            return np.full(self.image.shape, math.nan)
        variance = np.maximum(self.squares - self.image**2 / n, 0.0) / (n * (n - 1.0))
        if self._refined is not None:
            variance[~self._refined] = math.nan
        return np.sqrt(self.efficiency * variance)

    def relative_errors(self) -> NDArray[np.float64]:
        """(pixels,) of the means over their size: the root of what noise is expected to add to the pixel's relMSE."""
        return np.sqrt(self.efficiency * self.relative_variances())

    def relmse(self) -> float | None:
        """What noise is expected to leave of the picture's relMSE; None before FEWEST passes."""
        if self.passes < FEWEST:
            return None
        return self.efficiency * float(self._told(self.relative_variances()).mean())


def prepare_moments() -> None:
    """Compile it."""
    moments = Moments(1)
    for _ in range(4):
        moments.add(np.ones((1, CHANNELS)), CHANNELS, 0, 1)
        moments.close_pass()
    moments.relmse()
