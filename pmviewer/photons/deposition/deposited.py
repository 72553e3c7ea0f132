"""What became of the photons that arrived for a map."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.record import BYTES_PER_PHOTON

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.maps.convergence import Converged

STORED, REJECTED, REDISTRIBUTED, DISCARDED = range(4)
FATES = ("stored", "rejected", "redistributed", "discarded")
"""What becomes of a photon that arrives: rejected ones are stood for by stored ones of more power, the power of
redistributed ones is their neighbours', that of discarded ones is lost."""
FIRST_WEIGHT, WEIGHTS = -10, 32
"""Histogram bins: weights around 2^FIRST_WEIGHT and so on, one a doubling; the outermost hold all below and above."""


@dataclass(frozen=True)
class Deposited:
    """What became of the photons that arrived for a map. Powers are luminance in watts; weights are the stored
    photons' luminance in units of that with which photons leave the lights."""

    arrived: int = 0
    important: int = 0
    """Of these, photons at places where the rule's probability or required density is above 0."""
    stored: int = 0
    redistributed: int = 0
    arrived_power: float = 0.0
    stored_power: float = 0.0
    discarded_power: float = 0.0
    largest_arrived: float = 0.0
    """Power of the brightest photon that arrived."""
    percentiles: tuple[float, ...] = ()
    """Weights that 1, 50, 99 and 100 % of the stored photons don't exceed."""
    histogram: tuple[int, ...] = ()
    """Photons by weight: bin i from 2^(FIRST_WEIGHT + i − ½) on, twice as wide as the last, so that the weight 1, which
    most have but for rounding, is within a bin."""
    converged: Converged | None = None
    """How much of the map needs no more photons, where that was asked for."""

    @staticmethod
    def from_numbers(numbers: Mapping[str, Any]) -> Deposited:
        """The inverse of `dataclasses.asdict`."""
        from pmviewer.maps.convergence import Converged

        converged = numbers["converged"]
        lists = {name: tuple(numbers[name]) for name in ("percentiles", "histogram")}
        return Deposited(**{**numbers, **lists, "converged": None if converged is None else Converged(**converged)})

    @property
    def rejected(self) -> int:
        """Photons that arrived and are not in the map; their power may be."""
        return self.arrived - self.stored

    @property
    def saved_bytes(self) -> int:
        """What the rejected ones would take in a map, without grid or tree."""
        return self.rejected * BYTES_PER_PHOTON


def weight_histogram(weights: NDArray[np.float32]) -> tuple[int, ...]:
    """Photons by their weight, see `Deposited.histogram`."""
    exponents = np.frexp(weights * np.float32(math.sqrt(2.0)))[1] - 1  # weight · √2 = 2^exponent · [1, 2)
    bins = np.clip(np.where(weights > 0, exponents - FIRST_WEIGHT, 0), 0, WEIGHTS - 1)
    return tuple(int(n) for n in np.bincount(bins, minlength=WEIGHTS))
