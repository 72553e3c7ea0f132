"""Spot lights (T1): a point that shines into a cone, as Mitsuba 3's `spot`.

With θ the angle off the axis, the intensity is I·f(θ): f = 1 up to the beam width b, falls linearly to 0 at the cut-off
c. The power is 2πI·(1 − (sin c − sin b)/(c − b)).
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.scene import L_A, L_B, L_BEAM, L_CUTOFF, L_RADIANCE, light_number, light_vector
from pmviewer.kernels.vector import cross, dot, from_basis, luminance, scale, sub

_f4 = np.float32
_f8 = np.float64
_NEWTON_STEPS = 40
"""Most steps of the safeguarded search; it mostly ends after four."""


@device
def spot_falloff(scene, light, d):
    """f of the unit direction d that leaves the spot."""
    axis = light_vector(scene, light, L_B)
    across = cross(axis, d)
    theta = _f4(math.atan2(_f4(math.sqrt(dot(across, across))), dot(axis, d)))  # acos is coarse near the axis
    cutoff = light_number(scene, light, L_CUTOFF)
    beam = light_number(scene, light, L_BEAM)
    if theta <= beam:
        return _f4(1.0)
    if theta >= cutoff:
        return _f4(0.0)
    return (cutoff - theta) / (cutoff - beam)


@device
def sample_spot(scene, light, x):
    """The direction from x to the spot, as `pmviewer.kernels.lights.light.sample_one_light`."""
    p = light_vector(scene, light, L_A)
    L = light_vector(scene, light, L_RADIANCE)
    offset = sub(p, x)
    distance2 = dot(offset, offset)
    if not distance2 > _f4(0.0):
        return (_f4(0.0), _f4(0.0), _f4(1.0)), p, L, _f4(0.0), False
    inv = _f4(1.0) / _f4(math.sqrt(distance2))
    wi = scale(offset, inv)
    f = spot_falloff(scene, light, (-wi[0], -wi[1], -wi[2]))
    pdf = _f4(1.0) if f > _f4(0.0) else _f4(0.0)
    return wi, p, scale(L, f * inv * inv), pdf, False


@device
def spot_angle(u, beam, cutoff):
    """θ with density proportional to f(θ)·sinθ, by the inverse of its cumulative function; float64."""
    core = _f8(2.0) * math.sin(_f8(0.5) * beam) ** 2
    width = cutoff - beam
    rim = _f8(0.0)
    if width > _f8(0.0):
        # ∫ of t·sin(c − t) from 0 to w is w·cos(c − w) + sin(c − w) − sin c, with w = c − θ.
        rim = (width * math.cos(beam) + math.sin(beam) - math.sin(cutoff)) / width
    at = u * (core + rim)
    if at < core or not rim > _f8(0.0):
        return _f8(2.0) * math.asin(math.sqrt(min(_f8(0.5) * at, _f8(1.0))))
    left = (core + rim - at) * width
    low, high = _f8(0.0), width
    w = width * math.sqrt(min(left / (rim * width), _f8(1.0)))
    for _ in range(_NEWTON_STEPS):
        miss = w * math.cos(cutoff - w) + math.sin(cutoff - w) - math.sin(cutoff) - left
        if miss > _f8(0.0):
            high = w
        else:
            low = w
        slope = w * math.sin(cutoff - w)
        following = _f8(0.5) * (low + high)
        if slope > _f8(0.0):
            newton = w - miss / slope
            if newton > low and newton < high:
                following = newton
        if abs(following - w) <= _f8(1e-9) * width:
            w = following
            break
        w = following
    return cutoff - w


@device
def emit_spot(scene, light, u, v):
    """Origin, unit direction and power (luminance 1) of a photon; directions have the density of the intensity."""
    L = light_vector(scene, light, L_RADIANCE)
    beam = _f8(light_number(scene, light, L_BEAM))
    theta = spot_angle(_f8(u), beam, _f8(light_number(scene, light, L_CUTOFF)))
    phi = _f4(2.0 * math.pi) * v
    r, z = _f4(math.sin(theta)), _f4(math.cos(theta))
    d = from_basis(light_vector(scene, light, L_B), r * _f4(math.cos(phi)), r * _f4(math.sin(phi)), z)
    return light_vector(scene, light, L_A), d, scale(L, _f4(1.0) / luminance(L))
