"""Vectors as tuples of three float32; LLVM keeps them in registers."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device

_f4 = np.float32


@device
def dot(a, b):
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@device
def cross(a, b):
    """Vector product, right-handed."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@device
def add(a, b):
    """a + b"""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@device
def sub(a, b):
    """a − b"""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@device
def mul(a, b):
    """Componentwise product."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@device
def scale(a, s):
    """s·a"""
    return a[0] * s, a[1] * s, a[2] * s


@device
def along(a, b, s):
    """a + s·b"""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@device
def normalize(a):
    """Unit vector along a; NaN for zero."""
    s = _f4(1.0) / _f4(math.sqrt(dot(a, a)))
    return a[0] * s, a[1] * s, a[2] * s


@device
def luminance(c):
    """Relative luminance of linear sRGB primaries (Rec. 709)."""
    return _f4(0.2126) * c[0] + _f4(0.7152) * c[1] + _f4(0.0722) * c[2]


@device
def largest(c):
    """Of three components."""
    return max(c[0], max(c[1], c[2]))


@device
def is_good(c):
    """Finite and not negative in every component."""
    inf = _f4(np.inf)
    return c[0] >= _f4(0) and c[1] >= _f4(0) and c[2] >= _f4(0) and c[0] < inf and c[1] < inf and c[2] < inf


@device
def basis(n):
    """Two unit vectors that make an orthonormal right-handed frame with the unit vector n (Duff et al. 2017)."""
    sign = _f4(math.copysign(_f4(1.0), n[2]))
    a = _f4(-1.0) / (sign + n[2])
    b = n[0] * n[1] * a
    s = (_f4(1.0) + sign * n[0] * n[0] * a, sign * b, -sign * n[0])
    t = (b, sign + n[1] * n[1] * a, -n[1])
    return s, t


@device
def from_basis(n, x, y, z):
    """The vector with coordinates (x, y, z) in the frame whose third axis is n."""
    s, t = basis(n)
    return (
        x * s[0] + y * t[0] + z * n[0],
        x * s[1] + y * t[1] + z * n[1],
        x * s[2] + y * t[2] + z * n[2],
    )
