"""Which photons of a light pass a map stores, and with which power (I4, I5).

A rule sees photons where they arrive, in their order, and decides about storing. It needs one number for each, by place
and normal: the probability of storing it, or the density required there. Whoever knows the importance provides a
function for that (`pmviewer.importance.rules`); constants do as well.

- `KellerWald`: stored with probability p and power Φ/p (Keller and Wald 2000, §2.2). Where p is below ε, it is raised
  to ε, which is free of bias, or the photon is discarded, which is not; the discarded power is counted.
- `Homogeneous`: stored with a probability and power so that no photon has less than Φ₁/I where the importance is I,
  Φ₁ being the power of photons in the most important places (Christensen, course guide §5.7.4).
- `Density`: stored up to the required density, otherwise its power goes to its neighbours
  (`pmviewer.maps.density_control`).

Photons are traced and judged in batches: never are all rejected ones in memory. The maps are the same for any number of
threads.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import REWEIGHT_SALT, STORING_SALT
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.kernels.vector import luminance
from pmviewer.maps.convergence import Converged, Convergence, Criterion
from pmviewer.maps.density_control import NEAREST, Around, Controlled, DensityControl
from pmviewer.maps.power import encode_powers, luminances, write_power
from pmviewer.maps.record import BYTES_PER_PHOTON, decode_power
from pmviewer.maps.search.kdtree import PhotonKdTree
from pmviewer.scene.arrays.flatten import LUMINANCE

Float = NDArray[np.float32]
Codes = NDArray[np.uint32]
Runner = Callable[[list[Callable[[], Any]]], list[Any]]
Evaluate = Callable[[Float, Codes], Float]
"""(positions (n, 3), normal codes (n,)) → (n,) float32; called on several threads at once."""

SMALLEST_EPSILON = 1e-3
"""Powers grow by at most its inverse, for which the photon's code has room."""
STORED, REJECTED, REDISTRIBUTED, DISCARDED = range(4)
FATES = ("stored", "rejected", "redistributed", "discarded")
"""What becomes of a photon that arrives: rejected ones are stood for by stored ones of more power, the power of
redistributed ones is their neighbours', that of discarded ones is lost."""
FIRST_WEIGHT, WEIGHTS = -10, 32
"""Histogram bins: weights around 2^FIRST_WEIGHT and so on, one a doubling; the outermost hold what is beyond."""

_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32


@dataclass(frozen=True)
class KellerWald:
    """`probability` gives f·ΣW, above 1 where the photon is stored for certain."""

    probability: Evaluate
    epsilon: float
    discard: bool = False
    seed: int = 0


@dataclass(frozen=True)
class Density:
    """`required` gives D_r in photons per unit area; `acceptance` is STEP or COSINE; `around` says who shares;
    `beyond` gives the density at positions where nothing is required, 0 without it."""

    required: Evaluate
    acceptance: int
    around: Around = NEAREST
    beyond: Callable[[Float], Float] | None = None
    seed: int = 0

    def wanted(self, photons: Float, normals: Codes) -> tuple[Float, int]:
        """Densities (n,) for photons (n, 6), and at how many of them `required` is above 0."""
        density = self.required(photons[:, :3], normals)
        important = density > 0
        if self.beyond is not None and not important.all():
            density[~important] = self.beyond(photons[~important, :3])
        return density, int(np.count_nonzero(important))


@dataclass(frozen=True)
class Homogeneous:
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


Rule = KellerWald | Density | Homogeneous


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

    @property
    def rejected(self) -> int:
        return self.arrived - self.stored

    @property
    def saved_bytes(self) -> int:
        return self.rejected * BYTES_PER_PHOTON


@device
def judged(p, epsilon, discard, seed, i):
    """What becomes of photon i of a batch, to be stored with probability p: its fate, that probability after the
    cut-off, and random bits to go on with."""
    if not p >= epsilon:  # or no number
        if discard:
            return DISCARDED, p, _u4(0)
        p = epsilon
    noise = hash3(seed, _u4(i), _u4(STORING_SALT))
    if p < _f4(1.0) and not unit_float(noise) < p:
        return REJECTED, p, noise
    return STORED, p, noise


@kernel
def _thin(photons, words, normals, p, epsilon, discard, seed, kept, kept_normals, books):
    """Keep photon i with probability p[i] and power Φ/p[i]. kept: (n, 6) uint32 rows, kept_normals: (n,); books:
    float64 (3,), luminance that arrived, that was discarded, and the largest of a photon. Returns the number kept.
    """
    count = np.int64(0)
    for i in range(len(photons)):
        red, green = decode_power(words[i, 4] & _u4(0xFFFF)), decode_power(words[i, 4] >> _u4(16))
        blue = decode_power(words[i, 5] & _u4(0xFFFF))
        start = _f8(luminance((red, green, blue)))
        books[0] += start
        books[2] = max(books[2], start)
        fate, q, noise = judged(p[i], epsilon, discard, seed, i)
        if fate != STORED:
            if fate == DISCARDED:
                books[1] += start
            continue
        for w in range(6):
            kept[count, w] = words[i, w]
        if q < _f4(1.0):
            inverse = _f4(1.0) / q
            noise = hash3(noise, _u4(i), _u4(REWEIGHT_SALT))
            write_power(kept, count, red * inverse, green * inverse, blue * inverse, noise)
        kept_normals[count] = normals[i]
        count += 1
    return count


def probabilities(
    rule: KellerWald | Homogeneous, photons: Float, normals: Codes, index: int
) -> tuple[Float, np.float32, bool, np.uint32]:
    """For kernels: probabilities of storing photons (n, 6) with normal codes (n,), cut-off, whether it discards, and
    the seed of their batch, whose first trajectory is `index`."""
    discard, epsilon = False, np.float32(min(max(rule.epsilon, SMALLEST_EPSILON), 1.0))
    if isinstance(rule, Homogeneous):
        p, epsilon = rule.probability(photons, normals, epsilon), np.float32(SMALLEST_EPSILON)
    else:
        p = rule.probability(photons[:, :3], normals) if len(photons) else np.empty(0, np.float32)
        discard = rule.discard
    seed = np.uint32((rule.seed * 0x9E3779B1 + index * 0x85EBCA77 + (index >> 32)) & 0xFFFFFFFF)
    return p, epsilon, discard, seed


Prepared = tuple[Any, ...]


class Filling:
    """One map of a pass being filled. `judge` runs on any thread, `take` in the order of the batches."""

    def __init__(self, rule: Rule | None) -> None:
        self.rule = rule
        self.arrived, self.important, self.books = 0, 0, np.zeros(3)
        self._parts: list[Float] = []
        self._normals: list[Codes] = []
        self._control = None
        if isinstance(rule, Density):
            self._control = DensityControl(rule.acceptance, rule.around, rule.seed)

    def judge(self, photons: Float, normals: Codes, index: int) -> Prepared:
        """What can be said of a batch of photons (n, 6) alone; `index` is that of its first trajectory over all
        passes."""
        rule, n = self.rule, len(photons)
        photons = np.ascontiguousarray(photons)
        if rule is None:
            return photons, normals, n, np.append(_power_of(photons), n)
        if isinstance(rule, Density):
            required, important = rule.wanted(photons, normals) if n else (np.empty(0, np.float32), 0)
            return photons, normals, n, np.append(_power_of(photons), important), required
        p, epsilon, discard, seed = probabilities(rule, photons, normals, index)
        kept, kept_normals, books = np.empty((n, 6), np.uint32), np.empty(n, np.uint32), np.zeros(3)
        words = photons.view(np.uint32)
        count = _thin(photons, words, normals, p, epsilon, discard, seed, kept, kept_normals, books)
        return (
            kept[:count].view(np.float32).copy(),
            kept_normals[:count].copy(),
            n,
            np.append(books, np.count_nonzero(p > 0)),
        )

    def take(self, judged: list[Prepared], run: Runner) -> None:
        """The next batches, in order; with density control they are one round."""
        if not judged:
            return
        for batch in judged:
            self.arrived += batch[2]
            self.important += int(batch[3][3])
            self.books[:2] += batch[3][:2]
            self.books[2] = max(self.books[2], batch[3][2])
        if self._control is None:
            self._parts += [batch[0] for batch in judged]
            self._normals += [batch[1] for batch in judged]
            return
        photons, normals, required = (np.concatenate([batch[i] for batch in judged]) for i in (0, 1, 4))
        self._control.add(photons, normals, required, run)

    def converged(self, criterion: Criterion, others: PhotonKdTree, unit: float, run: Runner) -> Converged:
        """How much of the map, as it stands, needs no more photons by the criterion; `others` is the light that is not
        in the map, `unit` as for `finish`."""
        assert self._control is not None
        made = self._control.result()
        photons = made.photons.copy()
        unit *= encode_powers(photons, made.powers, 0)
        judge, weights = Convergence(criterion, photons, unit, others), made.powers @ LUMINANCE
        return judge.of_map(photons, made.normals, weights, made.required, run)

    def finish(self, unit: float) -> tuple[Float, Codes, float, Deposited]:
        """The map's photons and normals, its unit of power in watts (`unit` is that of the photons that arrived), and
        the books."""
        redistributed, grown = 0, 1.0
        if self._control is not None:
            assert self.rule is not None
            made: Controlled = self._control.result()
            photons, normals, redistributed = made.photons.copy(), made.normals, made.redistributed
            grown = encode_powers(photons, made.powers, self.rule.seed)
        else:
            photons = np.concatenate([np.empty((0, 6), np.float32), *self._parts])
            normals = np.concatenate([np.empty(0, np.uint32), *self._normals])
        weights = np.empty(len(photons), np.float32)
        luminances(photons.view(np.uint32), weights)
        weights *= np.float32(grown)
        books = Deposited(
            arrived=self.arrived,
            important=self.important,
            stored=len(photons),
            redistributed=redistributed,
            arrived_power=float(self.books[0]) * unit,
            stored_power=float(weights.sum(dtype=np.float64)) * unit,
            discarded_power=float(self.books[1]) * unit,
            largest_arrived=float(self.books[2]) * unit,
            percentiles=tuple(float(w) for w in np.percentile(weights, (1, 50, 99, 100))) if len(weights) else (),
            histogram=weight_histogram(weights),
        )
        return photons, normals, unit * grown, books


def weight_histogram(weights: Float) -> tuple[int, ...]:
    """Photons by their weight, see `Deposited.histogram`."""
    exponents = np.frexp(weights * np.float32(math.sqrt(2.0)))[1] - 1  # weight · √2 = 2^exponent · [1, 2)
    bins = np.clip(np.where(weights > 0, exponents - FIRST_WEIGHT, 0), 0, WEIGHTS - 1)
    return tuple(int(n) for n in np.bincount(bins, minlength=WEIGHTS))


def _power_of(photons: Float) -> NDArray[np.float64]:
    """Luminance that arrived, in units of the map's power, none discarded, and the largest of a photon."""
    weights = np.empty(len(photons), np.float32)
    luminances(photons.view(np.uint32), weights)
    return np.array([weights.sum(dtype=np.float64), 0.0, weights.max(initial=0.0)])


def prepare_rules() -> None:
    """Compile, or load, what the rules run, by judging one photon."""
    photons, normals = np.zeros((1, 6), np.float32), np.zeros(1, np.uint32)
    for rule in (KellerWald(constant(0.5), 0.5), Density(constant(0.0), 0)):
        filling = Filling(rule)
        for _ in range(2):
            filling.take([filling.judge(photons, normals, 0)], lambda tasks: [task() for task in tasks])
        filling.finish(1.0)


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
