"""Whole pictures over all scenes: what a method is off by everywhere, too little to show in any one of them.

Each comparison of a picture gives one ratio of means. Their median over the scenes does not ask how noisy each was, so
that rare bright paths of a few scenes don't count, and its standard error comes from how the ratios scatter, not from
what the runs say of themselves. Scenes with what a known deviation takes are left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pmviewer.bench.agree.generate import scene_of
from pmviewer.bench.agree.known import DEVIATIONS
from pmviewer.bench.agree.tree import Node
from pmviewer.bench.agree.verdict import Verdict

WHOLE = ("picture", "plain pixels", "one scattering")
"""What is compared in whole pictures."""
OF_MEDIAN = math.sqrt(math.pi / 2)
"""Standard error of a median to that of a mean, where values are normal."""
OF_MAD = 1.4826
"""Standard deviation of normal values to their median absolute deviation."""


LEAST_SCENES = 20
"""From which the spread of the ratios is known well enough to judge by it."""
SURE = 3.0
"""Standard errors that chance is granted."""


@dataclass(frozen=True)
class Pooled:
    """`method` against `peer` in `what` over so many `scenes`: the median ratio of means and its standard error."""

    method: str
    peer: str
    what: str
    scenes: int
    ratio: float
    error: float

    @property
    def off(self) -> float:
        """By how much it is off for sure."""
        return max(abs(self.ratio - 1) - SURE * self.error, 0.0)

    def __str__(self) -> str:
        return (
            f"over {self.scenes} scenes without known deviations, {self.method} against {self.peer}, {self.what}: "
            f"median ratio of means {self.ratio:.4f} ± {self.error:.4f}"
        )


def farthest_off(all_: Sequence[Pooled]) -> Pooled | None:
    """Of those with scenes enough, the one that is off most; None where there is none of them."""
    return max((p for p in all_ if p.scenes >= LEAST_SCENES), key=lambda p: p.off, default=None)


def pooled(seed: int, verdicts: Mapping[int, Verdict]) -> list[Pooled]:
    """By method, peer and what is compared, where at least two scenes without known deviations tell."""
    found: dict[tuple[str, str, str], list[float]] = {}
    for index, verdict in verdicts.items():
        scene = scene_of(seed, index)
        spoilt: dict[str, bool] = {}
        for c in verdict.comparisons:
            if c.what in WHOLE and c.outcome.whole > 0:
                if c.peer not in spoilt:
                    spoilt[c.peer] = _is_spoilt(scene, c.peer)
                if not spoilt[c.peer]:
                    found.setdefault((c.method, c.peer, c.what), []).append(math.log(c.outcome.whole))
    return [Pooled(*key, len(logs), *_median(logs)) for key, logs in sorted(found.items()) if len(logs) > 1]


def _is_spoilt(scene: Node, peer: str) -> bool:
    return any(d.concerns(peer) and d.without(scene) is not None for d in DEVIATIONS)


def _median(logs: list[float]) -> tuple[float, float]:
    """The median of ratios by their logarithms, and its standard error."""
    middle = float(np.median(logs))
    spread = OF_MAD * float(np.median(np.abs(np.array(logs) - middle)))
    return math.exp(middle), math.exp(middle) * OF_MEDIAN * spread / math.sqrt(len(logs))
