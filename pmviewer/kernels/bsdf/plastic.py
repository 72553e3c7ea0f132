"""The diffuse base under a smooth or rough dielectric coat, with light that the coat sends back down to it.

f = ρ / (1 − ρ'·R) · T(wo) T(wi) / (π η²), where T is the coat's transmittance, R its diffuse reflectance from below,
and ρ' is ρ with `nonlinear` (colours shift) and 1 without. As Mitsuba 3's `plastic` and `roughplastic`, except that R
is integrated, where Mitsuba's `plastic` uses a fit. A smooth coat transmits 1 − F; a rough one's T is a table over the
cosine.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.kinds import PLASTIC
from pmviewer.kernels.bsdf.specular import fresnel_dielectric
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import BSDF_TABLE_SIZE

_f4 = np.float32
_INV_PI = _f4(1.0 / math.pi)
_LAST = BSDF_TABLE_SIZE - 1


@device
def coat_transmittance(p, cos):
    """Share of light from outside at the angle with this cosine > 0 that reaches the base."""
    if p.kind == PLASTIC:
        fresnel, _ = fresnel_dielectric(min(cos, _f4(1.0)), p.eta)
        return _f4(1.0) - fresnel
    x = min(max(cos, _f4(0.0)), _f4(1.0)) * _f4(_LAST)
    j = min(np.int64(x), np.int64(_LAST - 1))
    a = load_f4(p.table, j)
    return a + (x - _f4(j)) * (load_f4(p.table, j + 1) - a)


@device
def under_coat(p, rho):
    """ρ / (1 − ρ'·R) of one channel."""
    again = rho * p.inner if p.nonlinear else p.inner
    return rho / (_f4(1.0) - again)


@device
def coated_diffuse(p, cos_o, cos_i):
    """f (red, green, blue) of the base seen through the coat."""
    s = coat_transmittance(p, cos_o) * coat_transmittance(p, cos_i) * _INV_PI / (p.eta * p.eta)
    rho = p.reflectance
    return s * under_coat(p, rho[0]), s * under_coat(p, rho[1]), s * under_coat(p, rho[2])
