"""Fresnel reflectance of metals. That of dielectrics is in `pmviewer.kernels.bsdf.specular`."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device

_f4 = np.float32


@device
def fresnel_channel(cos, eta, k):
    """Unpolarised reflectance in [0, 1] of a conductor of complex index eta + ik in air, at the cosine `cos` ≥ 0.

    The exact equations, by the square root of η² − sin² (Born and Wolf, Principles of Optics, §14.2). eta = 0 gives 1.
    """
    cos2 = cos * cos
    sin2 = max(_f4(1.0) - cos2, _f4(0.0))
    real = eta * eta - k * k - sin2
    modulus = _f4(math.sqrt(real * real + _f4(4.0) * eta * eta * k * k))
    a = _f4(math.sqrt(max(_f4(0.5) * (modulus + real), _f4(0.0))))
    s_sum, s_cross = modulus + cos2, _f4(2.0) * cos * a
    s = (s_sum - s_cross) / max(s_sum + s_cross, _f4(1e-30))
    p_sum, p_cross = modulus * cos2 + sin2 * sin2, s_cross * sin2
    # With an index of 0 and normal incidence p is 0/0; both polarisations are then the same.
    p = s * (p_sum - p_cross) / (p_sum + p_cross) if p_sum + p_cross > _f4(1e-20) else s
    return min(max(_f4(0.5) * (s + p), _f4(0.0)), _f4(1.0))


@device
def fresnel_conductor(cos, eta, k):
    """Reflectance (red, green, blue) for eta and k per channel; see `fresnel_channel`."""
    return fresnel_channel(cos, eta[0], k[0]), fresnel_channel(cos, eta[1], k[1]), fresnel_channel(cos, eta[2], k[2])
