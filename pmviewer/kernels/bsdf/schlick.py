"""Schlick's reflection model with one factor α from diffuse (1) to specular (0), as Jensen used it.

Jensen, "Rendering Caustics on Non-Lambertian Surfaces" (1996), equations 5 and 6, after Schlick 1993:

    f = (1 − G(v)G(v'))/π + G(v)G(v')/(4π v v') · α/(1 + αt² − t²)²,    G(v) = v/(α − αv + v)

with the cosines v and v' of both directions and t of their half vector. The second term's distribution is GGX of
roughness √α. Two things are added. Colours: `reflectance` times the first term, and Schlick's Fresnel term F₀ + (1 −
F₀)(1 − u)⁵ times the second, where u is the cosine between direction and half vector; F₀ = 1 and reflectance 1 give the
equation above. Energy: the equation reflects more than it receives at some angles (1.25 times at α = 1 and grazing
directions, 1/√α-fold as α shrinks), so f is multiplied by min(c(v), c(v')), where c(v) ≤ 1 is the inverse of the albedo
where that exceeds 1. It stays reciprocal, its albedo is at most 1, and it is Jensen's wherever neither angle is
affected.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import BSDF_TABLE_SIZE

_f4 = np.float32
_LAST = BSDF_TABLE_SIZE - 1


@device
def schlick_shadowing(v, alpha):
    """G(v), equation 6."""
    return v / max(alpha - alpha * v + v, _f4(1e-30))


@device
def schlick_shadowing_over_cos(v, alpha):
    """G(v)/v"""
    return _f4(1.0) / max(alpha - alpha * v + v, _f4(1e-30))


@device
def schlick_fresnel(u, f0):
    """F₀ + (1 − F₀)(1 − u)⁵ for each channel."""
    s = max(_f4(1.0) - u, _f4(0.0))
    s2 = s * s
    s = s2 * s2 * s
    return f0[0] + (_f4(1.0) - f0[0]) * s, f0[1] + (_f4(1.0) - f0[1]) * s, f0[2] + (_f4(1.0) - f0[2]) * s


@device
def schlick_bound(table, v):
    """c(v), interpolated in a table whose nodes are at v = (j/63)⁴."""
    x = _f4(math.sqrt(_f4(math.sqrt(min(max(v, _f4(0.0)), _f4(1.0)))))) * _f4(_LAST)
    j = min(np.int64(x), np.int64(_LAST - 1))
    r = x - _f4(j)
    a = load_f4(table, j)
    return a + r * (load_f4(table, j + 1) - a)
