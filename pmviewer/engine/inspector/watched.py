"""What a renderer remembers of the pixel that is pinned: its sums after each pass, and the photon life told last."""

from __future__ import annotations

import numpy as np

from pmviewer.engine.inspector.report import Float, History, PhotonLife, luminance


class Watched:
    """Empty until something is pinned, and again when something else is."""

    def __init__(self) -> None:
        self.life: PhotonLife | None = None
        self.areas: dict[int, float] = {}
        """Of shapes that were met, by their number: large meshes are not measured for each pass."""
        self._pixel: tuple[int, int] | None = None
        self._passes: list[int] = []
        self._sums: list[Float] = []

    def record(self, pixel: tuple[int, int], passes: int, mean: Float) -> History:
        """Take the mean (3,) of the pixel after that many passes, and tell its history."""
        if pixel != self._pixel or (self._passes and passes < self._passes[-1]):
            self._pixel, self._passes, self._sums = pixel, [], []
        if passes > 0 and (not self._passes or passes > self._passes[-1]):
            self._passes.append(passes)
            self._sums.append(np.asarray(mean, np.float64) * passes)
        return history_of(np.array(self._passes, np.int64), np.array(self._sums).reshape(-1, 3))


def history_of(passes: np.ndarray, sums: Float) -> History:
    """Of the sums (n, 3) of a pixel after those passes (n,).

    The standard error of the mean of P passes is s/√P, s² being the variance of single passes: what each added since
    the first one known. Passes that were not seen one by one count by their mean, whose variance is that much smaller.
    """
    if not len(passes):
        return History()
    values, first = luminance(sums), passes[0] == 1  # the first pass of all is known by itself
    w = np.diff(passes, prepend=0 if first else passes[0]).astype(np.float64)
    x = np.divide(np.diff(values, prepend=0.0 if first else values[0]), w, out=np.zeros(len(w)), where=w > 0)
    middle = x[-1]  # near all of them, so that the squares below lose no digits
    total, mean, square = (np.cumsum(term) for term in (w, w * (x - middle), w * (x - middle) ** 2))
    n = np.cumsum(w > 0)
    error = np.full(len(passes), np.nan)
    some = n >= 2
    variance = np.maximum(square[some] - mean[some] ** 2 / total[some], 0.0) / (n[some] - 1)
    error[some] = np.sqrt(variance / passes[some])
    return History(passes, sums / passes[:, None], error)
