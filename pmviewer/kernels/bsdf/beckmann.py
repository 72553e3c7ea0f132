"""The Beckmann distribution's visible slopes, sampled exactly (Heitz and d'Eon 2014, by inverting the CDF)."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device

_f4 = np.float32
_INV_SQRT_PI = _f4(1.0 / math.sqrt(math.pi))
_LARGEST = _f4(4.2)
"""Slopes beyond have a probability below float32's resolution."""
_STEPS = 24


@device
def beckmann_g1_over_cos(z, across):
    """Smith's masking G₁ over the cosine z > 0, where across = √((αx·x)² + (αy·y)²). Exact, not a rational fit."""
    if across <= _f4(1e-12) * z:
        return _f4(1.0) / z
    a = z / across
    if a >= _f4(4.0):
        return _f4(1.0) / z
    bump = _f4(math.exp(-a * a)) * _INV_SQRT_PI
    # (1 + Λ)·a, which stays finite at grazing angles: Λ = (e^(−a²)/(a√π) − erfc a)/2.
    return _f4(1.0) / (across * (a * (_f4(1.0) - _f4(0.5) * _f4(math.erfc(a))) + _f4(0.5) * bump))


@device
def inverse_erf(x):
    """erf⁻¹ of −1 < x < 1 in float32 (Giles 2010, single precision)."""
    x = min(max(x, _f4(-0.9999999)), _f4(0.9999999))
    w = -_f4(math.log((_f4(1.0) - x) * (_f4(1.0) + x)))
    if w < _f4(5.0):
        w -= _f4(2.5)
        p = _f4(2.81022636e-08)
        p = _f4(3.43273939e-07) + p * w
        p = _f4(-3.5233877e-06) + p * w
        p = _f4(-4.39150654e-06) + p * w
        p = _f4(0.00021858087) + p * w
        p = _f4(-0.00125372503) + p * w
        p = _f4(-0.00417768164) + p * w
        p = _f4(0.246640727) + p * w
        p = _f4(1.50140941) + p * w
    else:
        w = _f4(math.sqrt(w)) - _f4(3.0)
        p = _f4(-0.000200214257)
        p = _f4(0.000100950558) + p * w
        p = _f4(0.00134934322) + p * w
        p = _f4(-0.00367342844) + p * w
        p = _f4(0.00573950773) + p * w
        p = _f4(-0.0076224613) + p * w
        p = _f4(0.00943887047) + p * w
        p = _f4(1.00167406) + p * w
        p = _f4(2.83297682) + p * w
    return p * x


@device
def _visible(slope, cos, sin):
    """Integral of the visible slopes up to `slope`, along the plane of incidence, for α = 1."""
    bump = _f4(math.exp(-slope * slope)) * _INV_SQRT_PI
    return _f4(0.5) * (cos * _f4(math.erfc(-slope)) + sin * bump), bump


@device
def sample_beckmann_slopes(cos, sin, u, v):
    """Visible slopes for α = 1 along and across the plane of incidence, seen from the angle with these cos and sin."""
    low, high = -_LARGEST, _LARGEST
    if cos < _LARGEST * sin:
        high = cos / sin
    whole, _ = _visible(high, cos, sin)
    target = u * whole
    slope = min(_f4(0.0), _f4(0.5) * (low + high))
    for _ in range(_STEPS):
        value, bump = _visible(slope, cos, sin)
        value -= target
        if value > _f4(0.0):
            high = slope
        else:
            low = slope
        density = bump * (cos - slope * sin)
        following = slope - value / density if density > _f4(1e-12) else low - _f4(1.0)
        # Newton's step where it stays in the bracket, else halve the bracket.
        if not (following > low and following < high):
            following = _f4(0.5) * (low + high)
        if abs(following - slope) <= _f4(1e-6):
            slope = following
            break
        slope = following
    return slope, inverse_erf(_f4(2.0) * v - _f4(1.0))
