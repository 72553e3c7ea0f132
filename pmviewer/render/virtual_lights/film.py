"""A film that divides weighted sums when it is looked at (R10).

A pixel's light is L = (ΣF/ΣG)·Σa·c/passes, with c from ΣC and Σa by the normalisation:

- per pixel: c = ΣC/Σa of the pixel;
- interpolated: of the pixels around it on the same object, with alike normals and depths. The window shrinks with the
  fourth root of the passes, so that its bias goes as well as the walks' noise;
- per object: of all pixels that show the object;
- none, and the printed forms: c = 1.

Where ΣG is 0 nothing has arrived, and L is 0. What lights without a weight sent is in the planes already.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.virtual_lights import (
    CLAMPED,
    ESTIMATORS,
    PRINTED,
    SUMS,
    UNWEIGHTED,
    W_A,
    W_C,
    W_F,
    W_G,
    W_INDIRECT,
    W_LIGHTS,
    W_LOST,
    W_OBJECT,
    W_SPECULAR,
    W_SQUARES,
    W_SUM,
)
from pmviewer.render.film import Film
from pmviewer.render.planes import CHANNELS, PLANES
from pmviewer.settings.access import Virtual

TAPS = 6
"""Pixels asked to each side of the middle; wider windows leave some out."""
ALIKE = 0.9
"""Least cosine between normals of pixels that share a normalisation."""
SAME_DEPTH = 0.05
"""Largest relative difference of their depths."""

F8 = NDArray[np.float64]
_NORMAL, _DEPTH = PLANES["normal"].start, PLANES["depth"].start


@kernel
def shared_sums(sums, width, height, radius, columns, rows, out):
    """ΣA and ΣC over the pixels within `radius` of each pixel that show the same surface, out (n, 2).

    sums: float64 (n, planes + SUMS); columns: the first of the term's sums, and that of the object; rows: the first
    pixel of `out` and the one after the last.
    """
    base, object_ = columns
    step = max(1, math.ceil(radius / TAPS))
    reach = int(radius) // step
    for here in range(rows[0], rows[1]):
        y, x = here // width, here % width
        nx, ny, nz = sums[here, _NORMAL], sums[here, _NORMAL + 1], sums[here, _NORMAL + 2]
        length, depth = math.sqrt(nx * nx + ny * ny + nz * nz), sums[here, _DEPTH]
        total_a, total_c = 0.0, 0.0
        for j in range(-reach, reach + 1):
            for i in range(-reach, reach + 1):
                u, v = x + i * step, y + j * step
                if u < 0 or v < 0 or u >= width or v >= height:
                    continue
                there = v * width + u
                if there != here:
                    if sums[there, object_] != sums[here, object_]:
                        continue
                    mx, my, mz = sums[there, _NORMAL], sums[there, _NORMAL + 1], sums[there, _NORMAL + 2]
                    other = math.sqrt(mx * mx + my * my + mz * mz)
                    if nx * mx + ny * my + nz * mz < ALIKE * length * other:
                        continue
                    if abs(sums[there, _DEPTH] - depth) > SAME_DEPTH * abs(depth):
                        continue
                total_a += sums[there, base + W_A]
                total_c += sums[there, base + W_C]
        out[here - rows[0], 0], out[here - rows[0], 1] = total_a, total_c


def ratio(numerator: NDArray[Any], denominator: NDArray[Any]) -> F8:
    """Quotients, 0 where the denominator is."""
    out = np.zeros(np.broadcast_shapes(numerator.shape, denominator.shape))
    return np.divide(numerator, denominator, out=out, where=denominator > 0)


class WeightedFilm(Film):
    """The film of the method "virtual lights": SUMS columns beyond the planes, see `pmviewer.maps.virtual_lights`."""

    def __init__(self, width: int, height: int, virtual: Virtual, channels: int = CHANNELS) -> None:
        super().__init__(width, height, SUMS, channels)
        self.numbered = channels + W_OBJECT
        self.sums[:] = self.blank
        self.virtual = virtual
        self.estimator = ESTIMATORS.index(virtual.estimator)

    @property
    def weighted(self) -> bool:
        """Whether the estimator divides sums; else the planes hold all light as it is."""
        return self.estimator not in (UNWEIGHTED, CLAMPED)

    def planes(self) -> NDArray[np.float32]:
        """Means (height, width, channels) float32, weighted light included."""
        return self._planes(self._light)

    def undivided(self) -> NDArray[np.float32]:
        """The same with ΣF for weighted light: the plain sum of what the lights send, unbiased and with its spikes."""

        def plain(base: int) -> F8:
            return np.asarray(self.sums[:, base + W_F : base + W_F + 3] / max(self.passes, 1))

        return self._planes(plain)

    def _planes(self, light_of: Callable[[int], F8]) -> NDArray[np.float32]:
        planes = super().planes()
        if self.weighted:
            for term, base in _TERMS.items():
                light = np.zeros_like(planes)
                light[..., PLANES[term]] = light_of(self.channels + base).reshape(self.height, self.width, 3)
                planes += light
        return planes

    def sums_of_weights(self) -> tuple[F8, F8]:
        """ΣG and ΣC over the passes, (h, w, 2) each: of indirect light and of light in mirrors. With many photons their
        expectations are the same, whatever the estimator."""
        columns = [self.channels + base for base in _TERMS.values()]
        both = (self.sums[:, [c + w for c in columns]] / max(self.passes, 1) for w in (W_G, W_C))
        G, C = (part.reshape(self.height, self.width, 2) for part in both)
        return G, C

    def _light(self, base: int) -> F8:
        """Weighted light (n, 3) of the term whose sums begin at that column."""
        sums = self.sums
        if not sums[:, base + W_G].any():
            return np.zeros((len(sums), 3))
        return np.asarray(sums[:, base + W_F : base + W_F + 3] * (self._quotient(base) / max(self.passes, 1))[:, None])

    def _quotient(self, base: int, rows: tuple[int, int] | None = None) -> F8:
        """ΣA·c/ΣG (n,), which weighted light is multiplied by; `rows` as in `normalisation`."""
        these = slice(*rows) if rows is not None else slice(None)
        return ratio(self.sums[these, base + W_A] * self.normalisation(base, rows), self.sums[these, base + W_G])

    def quotient(self, pixel: int, term: str) -> float:
        """ΣA·c/ΣG of one pixel, which weighted light of that term ("indirect", "specular") is multiplied by."""
        base = self.channels + _TERMS[term]
        return float(self._quotient(base, (pixel, pixel + 1))[0])

    def normalisation(self, base: int, rows: tuple[int, int] | None = None) -> F8:
        """c (n,) of the term whose sums begin at that column; of the pixels from the first of `rows` up to the second,
        without them of all."""
        sums, normalisation = self.sums, self.virtual.normalisation
        first, last = rows if rows is not None else (0, len(sums))
        A, C = sums[:, base + W_A], sums[:, base + W_C]
        if self.estimator in PRINTED or normalisation == "none":
            return np.ones(last - first)
        if normalisation == "per object":
            numbers = sums[:, self.channels + W_OBJECT].astype(np.int64) + 1
            return ratio(np.bincount(numbers, C), np.bincount(numbers, A))[numbers[first:last]]
        if normalisation == "interpolated":
            radius = self.virtual.window / max(self.passes, 1) ** 0.25
            shared = np.empty((last - first, 2))
            shared_sums(sums, self.width, self.height, radius, (base, self.channels + W_OBJECT), (first, last), shared)
            return ratio(shared[:, 1], shared[:, 0])
        return ratio(C[first:last], A[first:last])

    @property
    def lost(self) -> float:
        """Share of the light from virtual lights that clamping took."""
        total = float(self.sums[:, self.channels + W_SUM].sum())
        return float(self.sums[:, self.channels + W_LOST].sum()) / total if total > 0 else 0.0

    def views(self) -> dict[str, NDArray[np.float32]]:
        """Planes (h, w, 1) of the diagnostic views; negative where there is nothing."""
        sums = self.sums
        total, n = sums[:, self.channels + W_SUM], sums[:, self.channels + W_LIGHTS]
        variance = np.maximum(sums[:, self.channels + W_SQUARES] - ratio(total * total, n), 0.0)
        made = {"virtual light error": np.where(total > 0, 100 * ratio(np.sqrt(variance), total), -1.0)}
        if self.weighted:
            base = np.where(sums[:, self.channels + W_INDIRECT + W_A] > 0, W_INDIRECT, W_SPECULAR)
            picked = {
                "sum of weights": [
                    ratio(sums[:, self.channels + b + W_G], sums[:, self.channels + b + W_A]) for b in _TERMS.values()
                ],
                "normalisation": [self.normalisation(self.channels + b) for b in _TERMS.values()],
            }
            lit = (sums[:, self.channels + W_INDIRECT + W_A] > 0) | (sums[:, self.channels + W_SPECULAR + W_A] > 0)
            for view, (whole, chained) in picked.items():
                made[view] = np.where(lit, np.where(base == W_INDIRECT, whole, chained), -1.0)
        return {name: view.reshape(self.height, self.width, 1).astype(np.float32) for name, view in made.items()}


_TERMS = {"indirect": W_INDIRECT, "specular": W_SPECULAR}
