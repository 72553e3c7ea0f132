"""Phase functions: Henyey and Greenstein's, isotropic for g = 0, Rayleigh's, and mixtures of two of them.

Directions are those of travel, before and after; the density over the sphere is the value of the phase function, which
is also the pdf of `sample_phase`. Near |g| = 1 everything is written in 1 − cos, which float32 keeps.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.media.kinds import RAYLEIGH
from pmviewer.kernels.vector import dot, from_basis, normalize, sub

_f4 = np.float32
_TWO_PI = _f4(2.0 * math.pi)
_INV_FOUR_PI = _f4(0.25 / math.pi)
_THIRD = _f4(1.0 / 3.0)
_RAYLEIGH = _f4(RAYLEIGH)
_STRAIGHTEST = _f4(1e-3)
"""|g| below which the lobe is sampled as a sphere's: the inversion divides by g."""


@device
def _lobe(g, d, wi):
    """Henyey and Greenstein 1941: (1 − g²)/(4π (1 + g² − 2 g cos)^1.5); Rayleigh 1871: 3/(16π) (1 + cos²)."""
    if g == _RAYLEIGH:
        cos = dot(d, wi)
        return _f4(0.75) * _INV_FOUR_PI * (_f4(1.0) + cos * cos)
    if g < _f4(0.0):
        g, wi = -g, (-wi[0], -wi[1], -wi[2])
    apart = sub(d, wi)
    lift = _f4(0.5) * dot(apart, apart)  # 1 − cos
    rest = _f4(1.0) - g
    denominator = rest * rest + _f4(2.0) * g * lift
    return _INV_FOUR_PI * rest * (_f4(1.0) + g) / (denominator * _f4(math.sqrt(denominator)))


@device
def phase(numbers, d, wi):
    """Value of the phase function from the direction of travel d to wi, per solid angle. numbers: (g, g of the second
    lobe, its share), RAYLEIGH in place of a g."""
    value = _lobe(numbers[0], d, wi)
    if numbers[2] > _f4(0.0):
        value = (_f4(1.0) - numbers[2]) * value + numbers[2] * _lobe(numbers[1], d, wi)
    return value


@device
def _lift(g, u):
    """1 − cos of a direction by the lobe with g ≥ 0."""
    if g == _RAYLEIGH:
        # The real root of cos³ + 3 cos + 4 = 8u (Cardano).
        q = _f4(4.0) * u - _f4(2.0)
        z = (q + _f4(math.sqrt(q * q + _f4(1.0)))) ** _THIRD
        return _f4(1.0) - (z - _f4(1.0) / z)
    if g < _STRAIGHTEST:
        # First order in g of the inversion below.
        return _f4(2.0) * u * (_f4(1.0) - _f4(3.0) * g * (_f4(1.0) - u))
    s = (_f4(1.0) - g * g) / (_f4(1.0) + g - _f4(2.0) * g * u)
    rest = _f4(1.0) - g
    return (s - rest) * (s + rest) / (_f4(2.0) * g)


@device
def sample_phase(numbers, d, u_lobe, u, v):
    """A direction of travel after scattering from d, with the density `phase`."""
    g = numbers[1] if u_lobe < numbers[2] else numbers[0]
    axis = d
    if g < _f4(0.0):
        g, axis = -g, (-d[0], -d[1], -d[2])
    lift = min(max(_lift(g, u), _f4(0.0)), _f4(2.0))
    r = _f4(math.sqrt(lift * (_f4(2.0) - lift)))
    phi = _TWO_PI * v
    return normalize(from_basis(axis, r * _f4(math.cos(phi)), r * _f4(math.sin(phi)), _f4(1.0) - lift))
