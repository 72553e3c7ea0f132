"""One map of a pass being filled: batches of photons are judged on any thread and taken in their order."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import REWEIGHT_SALT, STORING_SALT
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.kernels.vector import luminance
from pmviewer.maps.convergence import Converged, Convergence, Criterion
from pmviewer.maps.density.control import CHUNK, Controlled, DensityControl
from pmviewer.maps.photon_words import decode_powers
from pmviewer.maps.power import encode_powers, luminances, write_power
from pmviewer.maps.search.kdtree import PhotonKdTree
from pmviewer.photons.deposition.deposited import DISCARDED, REJECTED, STORED, Deposited, weight_histogram
from pmviewer.photons.deposition.rules import Codes, Density, Float, KellerWald, Rule, Thinning, constant
from pmviewer.scene.description import LUMINANCE
from pmviewer.tasks import Runner, in_turn

_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32

Judged = tuple[Any, ...]
"""What `Depositor.judge` says of a batch and `Depositor.take` needs of it."""


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
def _thin(words, normals, p, epsilon, discard, seed, kept, kept_normals, powers):
    """Keep photon i of words (n, 6) uint32 with probability p[i] and power Φ/p[i]. kept: (n, 6) uint32 rows,
    kept_normals: (n,); powers: float64 (3,), receives the luminance that arrived, that was discarded, and the largest
    of a photon. Returns the number kept.
    """
    count = np.int64(0)
    for i in range(len(words)):
        red, green, blue = decode_powers(words[i, 4], words[i, 5])
        start = _f8(luminance((red, green, blue)))
        powers[0] += start
        powers[2] = max(powers[2], start)
        fate, q, noise = judged(p[i], epsilon, discard, seed, i)
        if fate != STORED:
            if fate == DISCARDED:
                powers[1] += start
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
    rule: Thinning, photons: Float, normals: Codes, index: int
) -> tuple[Float, np.float32, bool, np.uint32]:
    """For kernels: probabilities of storing photons (n, 6) with normal codes (n,), cut-off, whether it discards, and
    the seed of their batch, whose first trajectory is `index`."""
    p, epsilon, discard = rule.odds(photons, normals)
    seed = np.uint32((rule.seed * 0x9E3779B1 + index * 0x85EBCA77 + (index >> 32)) & 0xFFFFFFFF)
    return p, epsilon, discard, seed


class Depositor:
    """One map of a pass being filled. `judge` runs on any thread, `take` in the order of the batches."""

    def __init__(self, rule: Rule | None) -> None:
        self.rule = rule
        self.arrived, self.important, self.powers = 0, 0, np.zeros(3)
        self._parts: list[Float] = []
        self._normals: list[Codes] = []
        self._control = None
        if isinstance(rule, Density):
            self._control = DensityControl(rule.acceptance, rule.around, rule.seed)

    def judge(self, photons: Float, normals: Codes, index: int) -> Judged:
        """What can be said of a batch of photons (n, 6) alone; `index` is that of its first trajectory over all
        passes."""
        rule, n = self.rule, len(photons)
        photons = np.ascontiguousarray(photons)
        if rule is None:
            return photons, normals, n, np.append(_power_of(photons), n)
        if isinstance(rule, Density):
            return photons, normals, n, np.append(_power_of(photons), 0)
        p, epsilon, discard, seed = probabilities(rule, photons, normals, index)
        kept, kept_normals, powers = np.empty((n, 6), np.uint32), np.empty(n, np.uint32), np.zeros(3)
        count = _thin(photons.view(np.uint32), normals, p, epsilon, discard, seed, kept, kept_normals, powers)
        return (
            kept[:count].view(np.float32).copy(),
            kept_normals[:count].copy(),
            n,
            np.append(powers, np.count_nonzero(p > 0)),
        )

    def take(self, judged: list[Judged], run: Runner) -> None:
        """The next batches, in order; with density control they are one round."""
        if not judged:
            return
        for batch in judged:
            self.arrived += batch[2]
            self.important += int(batch[3][3])
            self.powers[:2] += batch[3][:2]
            self.powers[2] = max(self.powers[2], batch[3][2])
        if self._control is None:
            self._parts += [batch[0] for batch in judged]
            self._normals += [batch[1] for batch in judged]
            return
        photons, normals = (np.concatenate([batch[i] for batch in judged]) for i in (0, 1))
        self._take_round(photons, normals, run)

    def _take_round(self, photons: Float, normals: Codes, run: Runner) -> None:
        """Photons (n, 6) with normal codes (n,) that density control decides about together. Near ones are asked
        together what is required of them: that is quicker."""
        assert self._control is not None
        assert isinstance(self.rule, Density)
        rule, groups = self.rule, self._control.groups(photons, normals, run)
        n, near, near_normals = len(photons), groups.photons, groups.normals

        def wanted(i0: int) -> tuple[Float, int]:
            return rule.wanted(near[i0 : i0 + CHUNK], near_normals[i0 : i0 + CHUNK])

        parts = run([partial(wanted, i0) for i0 in range(0, n, CHUNK)])
        self.important += sum(important for _, important in parts)
        required = np.empty(n, np.float32)
        required[groups.order] = np.concatenate([np.empty(0, np.float32), *(density for density, _ in parts)])
        self._control.add(photons, normals, required, run, groups)

    def converged(self, criterion: Criterion, others: PhotonKdTree, unit: float, run: Runner) -> Converged:
        """How much of the map, as it stands, needs no more photons by the criterion; `others` is the light that is not
        in the map, `unit` as for `finish`."""
        assert self._control is not None
        held = self._control.result()
        photons = held.photons.copy()
        unit *= encode_powers(photons, held.powers, 0)
        judge, weights = Convergence(criterion, photons, unit, others), held.powers @ LUMINANCE
        return judge.of_map(photons, held.normals, weights, held.required, run)

    def finish(self, unit: float) -> tuple[Float, Codes, float, Deposited]:
        """The map's photons and normals, its unit of power in watts (`unit` is that of the photons that arrived), and
        what became of those that arrived."""
        redistributed, grown = 0, 1.0
        if self._control is not None:
            assert self.rule is not None
            held: Controlled = self._control.result()
            photons, normals, redistributed = held.photons.copy(), held.normals, held.redistributed
            grown = encode_powers(photons, held.powers, self.rule.seed)
        else:
            photons = np.concatenate([np.empty((0, 6), np.float32), *self._parts])
            normals = np.concatenate([np.empty(0, np.uint32), *self._normals])
        weights = np.empty(len(photons), np.float32)
        luminances(photons.view(np.uint32), weights)
        weights *= np.float32(grown)
        deposited = Deposited(
            arrived=self.arrived,
            important=self.important,
            stored=len(photons),
            redistributed=redistributed,
            arrived_power=float(self.powers[0]) * unit,
            stored_power=float(weights.sum(dtype=np.float64)) * unit,
            discarded_power=float(self.powers[1]) * unit,
            largest_arrived=float(self.powers[2]) * unit,
            percentiles=tuple(float(w) for w in np.percentile(weights, (1, 50, 99, 100))) if len(weights) else (),
            histogram=weight_histogram(weights),
        )
        return photons, normals, unit * grown, deposited


def _power_of(photons: Float) -> NDArray[np.float64]:
    """Luminance that arrived, in units of the map's power, none discarded, and the largest of a photon."""
    weights = np.empty(len(photons), np.float32)
    luminances(photons.view(np.uint32), weights)
    return np.array([weights.sum(dtype=np.float64), 0.0, weights.max(initial=0.0)])


def prepare_rules() -> None:
    """Compile, or load, what the rules run, by judging one photon."""
    photons, normals = np.zeros((1, 6), np.float32), np.zeros(1, np.uint32)
    for rule in (KellerWald(constant(0.5), 0.5), Density(constant(0.0), 0)):
        depositor = Depositor(rule)
        for _ in range(2):
            depositor.take([depositor.judge(photons, normals, 0)], in_turn)
        depositor.finish(1.0)
