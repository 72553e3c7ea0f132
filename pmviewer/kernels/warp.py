"""Warps from the unit square to directions and shapes. Local frames have the normal along +z."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device

_f4 = np.float32
PI = _f4(math.pi)
INV_PI = _f4(1.0 / math.pi)


@device
def _sin_cos_eighth(x):
    """Sine and cosine of |x| ≤ π/4 to float32 rounding (Taylor), several times faster than the library's."""
    y = x * x
    sin = x * (_f4(1.0) + y * (_f4(-1.0 / 6) + y * (_f4(1.0 / 120) + y * (_f4(-1.0 / 5040) + y * _f4(1.0 / 362880)))))
    cos = _f4(1.0) + y * (
        _f4(-0.5) + y * (_f4(1.0 / 24) + y * (_f4(-1.0 / 720) + y * (_f4(1.0 / 40320) - y * _f4(1.0 / 3628800))))
    )
    return sin, cos


@device
def square_to_disk(u, v):
    """Uniform point on the unit disc, concentric map (Shirley and Chiu 1997)."""
    a, b = _f4(2.0) * u - _f4(1.0), _f4(2.0) * v - _f4(1.0)
    # Selections, no branches: which half of the square it is, nobody can guess.
    wide = abs(a) > abs(b)
    r, other = (a, b) if wide else (b, a)
    r_or_one = r if r != _f4(0.0) else _f4(1.0)
    sin, cos = _sin_cos_eighth(_f4(math.pi / 4) * (other / r_or_one))
    return (r * cos, r * sin) if wide else (r * sin, r * cos)


@device
def square_to_cosine_hemisphere(u, v):
    """Direction with pdf cosθ/π around +z."""
    x, y = square_to_disk(u, v)
    return x, y, _f4(math.sqrt(max(_f4(0.0), _f4(1.0) - x * x - y * y)))


@device
def square_to_sphere(u, v):
    """Uniform direction on the sphere, pdf 1/(4π)."""
    z = _f4(1.0) - _f4(2.0) * u
    r = _f4(math.sqrt(max(_f4(0.0), _f4(1.0) - z * z)))
    phi = _f4(2.0 * math.pi) * v
    return r * _f4(math.cos(phi)), r * _f4(math.sin(phi)), z


@device
def square_to_cone(u, v, one_minus_cos):
    """Uniform direction in the cone around +z with that 1 − cosine of its half angle; pdf 1/(2π(1 − cos))."""
    lift = u * one_minus_cos
    z = _f4(1.0) - lift
    r = _f4(math.sqrt(max(_f4(0.0), lift * (_f4(2.0) - lift))))
    phi = _f4(2.0 * math.pi) * v
    return r * _f4(math.cos(phi)), r * _f4(math.sin(phi)), z


@device
def square_to_triangle(u, v):
    """Barycentric coordinates (of vertices 1 and 2), uniform on a triangle."""
    s = _f4(math.sqrt(u))
    return v * s, _f4(1.0) - s
