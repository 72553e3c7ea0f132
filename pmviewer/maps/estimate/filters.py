"""Filter kernels of the density estimate (E2).

A photon at relative distance x = d/r from the point counts with weight w(x); the weighted sum is divided by
`filter_disc_mean · π r²`, where the disc mean is ∫₀¹ 2x·w(x) dx, so that every kernel gives the same mean under uniform
light:

============  ===================================================  ==============
kernel        w(x)                                                 disc mean
============  ===================================================  ==============
constant      1                                                    1
cone, k ≥ 1   1 − x/k (Jensen 2001, §7.2)                          1 − 2/(3k)
gaussian      α·[1 − (1 − e^(−βx²/2)) / (1 − e^(−β))], α = 0.918,  0.53115
              β = 1.953 (Pavicic 1990)
simpson       (1 − x²)² (biweight)                                 1/3
epanechnikov  1 − x²                                               1/2
============  ===================================================  ==============
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device

FILTERS = ("constant", "cone", "gaussian", "simpson", "epanechnikov")
"""Names of the kernels; a kernel's id is its place here."""

CONSTANT, CONE, GAUSSIAN, SIMPSON, EPANECHNIKOV = range(len(FILTERS))

_f4 = np.float32
_ALPHA, _BETA = 0.918, 1.953
_GAUSSIAN_MEAN = _f4(_ALPHA * (1 - (1 - 2 / _BETA * (1 - math.exp(-_BETA / 2))) / (1 - math.exp(-_BETA))))
_GAUSSIAN_SCALE = _f4(_ALPHA / (1 - math.exp(-_BETA)))
_GAUSSIAN_BASE = _f4(_ALPHA - _ALPHA / (1 - math.exp(-_BETA)))
_GAUSSIAN_RATE = _f4(-_BETA / 2)


class Filter(NamedTuple):
    """A kernel: `kind`, int32, its id; `cone_k`, float32 ≥ 1, the k of the cone, which no other reads."""

    kind: Any
    cone_k: Any


@device
def filter_weight(kind, cone_k, x2):
    """Weight of a photon at squared relative distance `x2` = (d/r)² in [0, 1]."""
    if kind == CONSTANT:
        return _f4(1.0)
    if kind == CONE:
        return _f4(1.0) - np.sqrt(x2) / cone_k
    if kind == GAUSSIAN:
        return _GAUSSIAN_BASE + _GAUSSIAN_SCALE * np.exp(_GAUSSIAN_RATE * x2)
    w = _f4(1.0) - x2
    if kind == SIMPSON:
        return w * w
    return w


@device
def filter_disc_mean(kind, cone_k):
    """Mean of the kernel over the unit disc."""
    if kind == CONE:
        return _f4(1.0) - _f4(2.0) / (_f4(3.0) * cone_k)
    if kind == GAUSSIAN:
        return _GAUSSIAN_MEAN
    if kind == SIMPSON:
        return _f4(1.0 / 3.0)
    if kind == EPANECHNIKOV:
        return _f4(0.5)
    return _f4(1.0)
