"""Which photons of a light pass a map stores, and with which power (I4, I5).

A rule sees photons where they arrive, in their order, and decides about storing. It needs one number for each, by place
and normal: the probability of storing it, or the density required there. Whoever knows the importance provides a
function for that (`pmviewer.importance.rules`); constants do as well.

- `KellerWald`: stored with probability p and power Φ/p (Keller and Wald 2000, §2.2). Where p is below ε, it is raised
  to ε, which is free of bias, or the photon is discarded, which is not; the discarded power is counted.
- `Homogeneous`: stored with a probability and power so that no photon has less than Φ₁/I where the importance is I,
  Φ₁ being the power of photons in the most important places (Christensen, course guide §5.7.4).
- `Density`: stored up to the required density, otherwise its power goes to its neighbours
  (`pmviewer.maps.density.control`).

Photons are traced and judged in batches: never are all rejected ones in memory. The maps are the same for any number of
threads.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.convergence import Criterion
from pmviewer.maps.density.control import NEAREST, Around
from pmviewer.maps.power import luminances

Float = NDArray[np.float32]
Codes = NDArray[np.uint32]
Evaluate = Callable[[Float, Codes], Float]
"""(positions (n, 3), normal codes (n,)) → (n,) float32; called on several threads at once."""

SMALLEST_EPSILON = 1e-3
"""Powers grow by at most its inverse, for which the photon's code has room."""


class Thinning(ABC):
    """A rule that judges every photon by itself: it is stored with a probability p, and then has the power Φ/p."""

    seed: int

    @abstractmethod
    def odds(self, photons: Float, normals: Codes) -> Odds:
        """Of photons (n, 6) with normal codes (n,), n perhaps 0."""


class Odds(NamedTuple):
    """`p` (n,) float32, above 1 where the photon is stored for certain. Where it is below `cut_off`, it is raised to
    that, or the photon is discarded (`discard`)."""

    p: Float
    cut_off: np.float32
    discard: bool = False


def cut_off(epsilon: float) -> np.float32:
    """The cut-off as kernels take it: powers grow by at most its inverse."""
    return np.float32(min(max(epsilon, SMALLEST_EPSILON), 1.0))


@dataclass(frozen=True)
class KellerWald(Thinning):
    """`probability` gives f·ΣW, above 1 where the photon is stored for certain."""

    probability: Evaluate
    epsilon: float
    discard: bool = False
    seed: int = 0

    def odds(self, photons: Float, normals: Codes) -> Odds:
        p = self.probability(photons[:, :3], normals) if len(photons) else np.empty(0, np.float32)
        return Odds(p, cut_off(self.epsilon), self.discard)


@dataclass(frozen=True)
class Density:
    """`required` gives D_r in photons per unit area; `acceptance` is STEP or COSINE; `around` says who shares;
    `unimportant` gives the density at positions where nothing is required, 0 without it."""

    required: Evaluate
    acceptance: int
    around: Around = NEAREST
    unimportant: Callable[[Float], Float] | None = None
    seed: int = 0

    def wanted(self, photons: Float, normals: Codes) -> tuple[Float, int]:
        """Densities (n,) for photons (n, 6), and at how many of them `required` is above 0."""
        density = self.required(photons[:, :3], normals)
        important = density > 0
        if self.unimportant is not None and not important.all():
            density[~important] = self.unimportant(photons[~important, :3])
        return density, int(np.count_nonzero(important))


@dataclass(frozen=True)
class Homogeneous(Thinning):
    """`importance` gives I, above 1 likewise; a photon of luminance Φ is stored with probability p = I·Φ/Φ₁, if below
    1, and then has Φ/p. I is at least `epsilon`. `power` is Φ₁ in units of the map's."""

    importance: Evaluate
    epsilon: float
    power: float
    seed: int = 0

    def probability(self, photons: Float, normals: Codes, least: np.float32) -> Float:
        """p of photons (n, 6) where importance is at least `least`; strong ones are stored whatever it is."""
        relative = np.empty(len(photons), np.float32)
        luminances(photons.view(np.uint32), relative)
        relative /= np.float32(self.power)
        weak = relative * least < 1
        if weak.any():
            relative[weak] *= np.maximum(self.importance(np.ascontiguousarray(photons[weak, :3]), normals[weak]), least)
        return relative

    def odds(self, photons: Float, normals: Codes) -> Odds:
        return Odds(self.probability(photons, normals, cut_off(self.epsilon)), np.float32(SMALLEST_EPSILON))


Rule = Thinning | Density


@dataclass(frozen=True)
class Deposition:
    """Rules for the photons of the path classes (bit sets) that a map holds; None stores them all. Photons of
    `sample_classes` from the first trajectories are also kept as they arrive. `criterion` tells when the caustic map,
    under density control, needs no more photons."""

    caustic: Rule | None
    global_: Rule | None
    caustic_classes: int
    global_classes: int
    sample_classes: int = 0
    criterion: Criterion | None = None

    @property
    def in_rounds(self) -> bool:
        """Whether a photon's fate depends on those before it."""
        return isinstance(self.caustic, Density) or isinstance(self.global_, Density)


FIRST_ROUND, LARGEST_ROUND = 1, 16
"""Batches of the first round and of the largest one: they double, since the first photons find an empty map."""


def rounds(batches: int) -> Iterator[range]:
    """Batches by rounds, the same for any number of threads."""
    first, size = 0, FIRST_ROUND
    while first < batches:
        yield range(first, min(first + size, batches))
        first, size = first + size, min(2 * size, LARGEST_ROUND)


def constant(value: float) -> Evaluate:
    """The same number everywhere."""
    return lambda positions, normals: np.full(len(positions), value, np.float32)


def density_of_discs(photons: float, radius: float) -> float:
    """Photons per unit area so that a disc of that radius has so many."""
    return photons / (math.pi * radius * radius)
