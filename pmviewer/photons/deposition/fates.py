"""What becomes of single photons under a deposition rule, for showing them (I4, I5).

The light pass traces its first trajectories again and the rules judge what arrives, just as they did: with the same
random numbers and, where a photon's fate depends on those before it, in the same order. So what is shown happened, and
nothing is kept while nobody looks.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.photons.deposition.deposited import REDISTRIBUTED, STORED
from pmviewer.photons.deposition.depositor import Depositor, Judged, judged, probabilities
from pmviewer.photons.deposition.rules import Codes, Density, Deposition, Float, Rule, Thinning
from pmviewer.tasks import Runner

FATE_BITS = 3
"""The number of a photon's fate is in so many low bits of what is otherwise its light's id; the next bit is the map's:
0 the caustic, 1 the global one."""


@kernel
def _judge(p, epsilon, discard, seed, fates):
    """Fates of the photons of a batch, to be stored with probabilities p (n,), into fates (n,) uint8."""
    for i in range(len(p)):
        fates[i] = judged(p[i], epsilon, discard, seed, i)[0]


class WatchedDepositor(Depositor):
    """A map being filled that keeps all that arrives: `photons` (n, 6) as they arrived, with their `fates` (n,)."""

    def __init__(self, rule: Rule | None) -> None:
        super().__init__(rule)
        self._arrived: list[Float] = []
        self._fates: list[NDArray[np.uint8]] = []

    def judge(self, photons: Float, normals: Codes, index: int) -> Judged:
        fates = np.full(len(photons), STORED, np.uint8)
        if isinstance(self.rule, Thinning):
            _judge(*probabilities(self.rule, np.ascontiguousarray(photons), normals, index), fates)
        return (*super().judge(photons, normals, index), photons, fates)

    def take(self, judged: list[Judged], run: Runner) -> None:
        super().take(judged, run)
        fates = [batch[-1] for batch in judged]
        if isinstance(self.rule, Density) and judged:
            assert self._control is not None
            fates = [np.where(self._control.kept, STORED, REDISTRIBUTED).astype(np.uint8)]
        self._fates += fates
        self._arrived += [batch[-2] for batch in judged]

    @property
    def photons(self) -> Float:
        """(n, 6) float32: all that were judged, in their order."""
        return np.concatenate([np.empty((0, 6), np.float32), *self._arrived])

    @property
    def fates(self) -> NDArray[np.uint8]:
        """(n,) uint8: what became of each."""
        return np.concatenate([np.empty(0, np.uint8), *self._fates])


class Fates:
    """Photons of the first `trajectories` of a pass, rounded up to whole batches, with their fates; `trace_pass` fills
    it."""

    def __init__(self, trajectories: int) -> None:
        self.trajectories = trajectories
        self.caustic = WatchedDepositor(None)
        self.global_ = WatchedDepositor(None)

    def depositors(self, deposition: Deposition) -> tuple[Depositor, Depositor]:
        """Of the caustic and the global map."""
        self.caustic, self.global_ = WatchedDepositor(deposition.caustic), WatchedDepositor(deposition.global_)
        return self.caustic, self.global_

    def cloud(self) -> Float:
        """(n, 6) float32 photon records, with fate and map (FATE_BITS) where the light's id is otherwise."""
        parts = []
        for map_, depositor in enumerate((self.caustic, self.global_)):
            rows = np.array(depositor.photons, np.float32, order="C")
            words: Any = rows.view(np.uint32)
            number = depositor.fates.astype(np.uint32) | np.uint32(map_ << FATE_BITS)
            words[:, 5] = (words[:, 5] & np.uint32(0xFFFF)) | number << np.uint32(16)
            parts.append(rows)
        return np.concatenate(parts)
