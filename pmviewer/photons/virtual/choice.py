"""Which candidates become virtual lights (R10).

Light comes mostly from where photons lie densely, the weights mostly from where they lie sparsely: a light in the dark
stands for a large area. Lights chosen evenly among the candidates leave ΣG to the few of them that lie in the dark, and
a weighted sum is no better than its ΣG. So one half of the choice goes by power, the other by what a candidate will
weigh, and each chosen one counts as often as its probability says. That is unbiased for any probabilities.

Of a single step the weight is guessed: by how many candidates lie in the same cell of space that face the same way.
Candidates in media weigh nothing.
Of whole paths it is known. Estimates that are not weighted, and lights that tell their density themselves, choose by
power alone.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.record import EXPONENT_BASE
from pmviewer.maps.virtual_lights import (
    OF_MEDIUM,
    OF_PATHS,
    V_F,
    V_FIRST,
    V_N,
    V_P,
    V_PHI,
    V_PRIM,
    V_Q,
    V_WI,
)
from pmviewer.scene.description import LUMINANCE

Float = NDArray[np.float32]
PER_CELL = 16
"""Candidates of a cell, roughly."""


def choice_probabilities(rows: Float, estimator: int, scene_radius: float | None) -> NDArray[np.float64]:
    """Probabilities (n,) of the candidates (n, COLUMNS), which sum to 1; `scene_radius` where the density of their map
    weighs them."""
    power = rows[:, V_PHI : V_PHI + 3].astype(np.float64) @ LUMINANCE
    probabilities = normalised(power)
    if estimator in OF_PATHS:
        q = rows[:, V_Q].astype(np.float64)
        beyond = rows[:, V_F : V_F + 3].astype(np.float64) @ LUMINANCE
        weights = np.where(rows[:, V_FIRST] != 0, q, q * beyond)
        return mixed(probabilities, weights)
    if scene_radius is not None and len(rows):
        return mixed(probabilities, np.where(in_media(rows), 0.0, 1.0 / _neighbours(rows, scene_radius)))
    return probabilities


def in_media(rows: Float) -> NDArray[np.bool_]:
    """Which of the candidates (n, COLUMNS) are collisions in media."""
    return np.asarray(np.ascontiguousarray(rows[:, V_PRIM]).view(np.uint32) == OF_MEDIUM)


def mixed(power: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Probabilities (n,), one half by those of `power`, the other by weights, where there are any."""
    return 0.5 * power + 0.5 * normalised(weights) if weights.sum() > 0 else power


def normalised(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (n,) with the sum 1; all alike where they are nothing."""
    total = values.sum()
    return values / total if total > 0 else np.full(len(values), 1.0 / max(len(values), 1))


def _neighbours(rows: Float, scene_radius: float) -> NDArray[np.int64]:
    """Candidates (n,) in the cell of each: a cube of space for each of the six directions that surfaces may face."""
    n, wi = rows[:, V_N : V_N + 3], rows[:, V_WI : V_WI + 3]
    n = n * np.sign((n * wi).sum(axis=1))[:, None]
    axis = np.abs(n).argmax(axis=1)
    faces = 2 * axis + (np.take_along_axis(n, axis[:, None], axis=1)[:, 0] < 0)
    size = scene_radius * math.sqrt(4 * math.pi * PER_CELL / len(rows))
    cells = np.floor((rows[:, V_P : V_P + 3] - rows[:, V_P : V_P + 3].min(axis=0)) / size).astype(np.int64)
    keys = ((cells[:, 0] << 20 | cells[:, 1]) << 20 | cells[:, 2]) * 6 + faces
    _, places, counts = np.unique(keys, return_inverse=True, return_counts=True)
    return np.asarray(counts[places])


def chosen(probabilities: NDArray[np.float64], M: int, start: float) -> tuple[NDArray[np.int64], Float]:
    """M candidates by their probabilities, and how many candidates each stands for, (M,).

    Evenly spaced along the sums of the probabilities, `start` in [0, 1) of a step from the first: of one trajectory, or
    of one place of the light, few are taken together. One whose probability is above 1/M may be taken more than once.
    """
    if M == 0:
        return np.empty(0, np.int64), np.empty(0, np.float32)
    sums = np.cumsum(probabilities)
    at = (np.arange(M) + start) * (sums[-1] / M)
    kept = np.minimum(np.searchsorted(sums, at, side="right"), len(probabilities) - 1)
    return kept, (sums[-1] / (M * probabilities[kept])).astype(np.float32)


def as_photons(photons: Float, share: Float) -> Float:
    """Photon records (n, 6) with power times `share`."""
    words = photons.view(np.uint32).copy()
    codes = np.stack([words[:, 4] & 0xFFFF, words[:, 4] >> 16, words[:, 5] & 0xFFFF], axis=1).astype(np.uint32)
    power = np.where(codes == 0, np.float32(0), ((codes << 13) + np.uint32(EXPONENT_BASE)).view(np.float32))
    bits = (power * share[:, None]).astype(np.float32).view(np.uint32)
    least = np.uint32(EXPONENT_BASE + 0x2000)
    again = np.where(bits < least, 0, np.minimum((bits + 0x1000 - np.uint32(EXPONENT_BASE)) >> 13, 0xFFFF))
    words[:, 4] = again[:, 0] | again[:, 1] << 16
    words[:, 5] = again[:, 2] | (words[:, 5] & np.uint32(0xFFFF0000))
    return np.ascontiguousarray(words.view(np.float32))
