"""Microfacet distributions, GGX and Beckmann, anisotropic: density, masking, sampling of visible normals.

Local frames: z is the normal, x and y the axes of the roughness `ax` and `ay`. Masking is Smith's, and of both
directions the product of the two (separable), as in Mitsuba 3. Sources: Walter et al. 2007; Heitz 2014, "Understanding
the Masking-Shadowing Function"; Dupuy and Benyoub 2023 for the visible normals of GGX.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.beckmann import beckmann_g1_over_cos, sample_beckmann_slopes
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.scene import BECKMANN

_f4 = np.float32
_PI = _f4(math.pi)
SMOOTHEST = _f4(1e-4)
"""Roughness is at least this, as float32 directions are no finer."""


@device
def facet_density(m, ax, ay, distribution):
    """D(m), normals per unit area of surface and solid angle; 0 for normals below the surface."""
    if m[2] <= _f4(0.0):
        return _f4(0.0)
    x, y, z2 = m[0] / ax, m[1] / ay, m[2] * m[2]
    if distribution == BECKMANN:
        if z2 < _f4(1e-12):
            return _f4(0.0)
        return _f4(math.exp(-(x * x + y * y) / z2)) / (_PI * ax * ay * z2 * z2)
    q = x * x + y * y + z2
    return _f4(1.0) / (_PI * ax * ay * q * q)


@device
def g1_over_cos(w, ax, ay, distribution):
    """Smith's masking G₁(w) over the cosine |w.z| > 0. Without the quotient, grazing angles would divide 0 by 0."""
    z = abs(w[2])
    x, y = ax * w[0], ay * w[1]
    across = _f4(math.sqrt(x * x + y * y))
    if distribution == BECKMANN:
        return beckmann_g1_over_cos(z, across)
    return _f4(2.0) / (z + _f4(math.sqrt(z * z + across * across)))


@device
def sample_visible_normal(w, ax, ay, distribution, u, v):
    """A normal visible from w (w.z > 0), with density G₁(w) D(m) max(0, w·m) / w.z."""
    x, y, z = ax * w[0], ay * w[1], w[2]
    inv = _f4(1.0) / _f4(math.sqrt(max(x * x + y * y + z * z, _f4(1e-30))))
    x, y, z = x * inv, y * inv, z * inv
    if distribution == BECKMANN:
        sin = _f4(math.sqrt(x * x + y * y))
        along, across = sample_beckmann_slopes(z, sin, u, v)
        cos_phi, sin_phi = _f4(1.0), _f4(0.0)
        if sin > _f4(0.0):
            cos_phi, sin_phi = x / sin, y / sin
        mx = -ax * (cos_phi * along - sin_phi * across)
        my = -ay * (sin_phi * along + cos_phi * across)
        mz = _f4(1.0)
    else:
        # Points of the spherical cap around −w, reflected: normals visible on the unit sphere.
        phi = _f4(2.0 * math.pi) * u
        rise = (_f4(1.0) - v) * (_f4(1.0) + z)
        c = rise - z
        s = _f4(math.sqrt(max(_f4(0.0), (_f4(1.0) - c) * (_f4(1.0) + c))))
        mx, my, mz = ax * (s * _f4(math.cos(phi)) + x), ay * (s * _f4(math.sin(phi)) + y), rise
    inv = _f4(1.0) / _f4(math.sqrt(max(mx * mx + my * my + mz * mz, _f4(1e-30))))
    return mx * inv, my * inv, mz * inv


@device
def half_vector(o, i):
    """Unit vector halfway between two directions that are not opposite."""
    x, y, z = o[0] + i[0], o[1] + i[1], o[2] + i[2]
    inv = _f4(1.0) / _f4(math.sqrt(max(x * x + y * y + z * z, _f4(1e-30))))
    return x * inv, y * inv, z * inv


@device
def reflect_at(o, m):
    """The direction o mirrored at the unit vector m; both point away from the surface."""
    s = _f4(2.0) * (o[0] * m[0] + o[1] * m[1] + o[2] * m[2])
    x, y, z = s * m[0] - o[0], s * m[1] - o[1], s * m[2] - o[2]
    inv = _f4(1.0) / _f4(math.sqrt(max(x * x + y * y + z * z, _f4(1e-30))))
    return x * inv, y * inv, z * inv
