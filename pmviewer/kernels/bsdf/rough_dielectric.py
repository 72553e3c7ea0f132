"""Rough glass: reflection and refraction at microfacets (Walter et al. 2007).

Local frame with z outwards; directions may be on either side. f on refraction is that of power; radiance is multiplied
by (n_i/n_t)² as well.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.microfacet import facet_density, g1_over_cos, half_vector, reflect_at, sample_visible_normal
from pmviewer.kernels.bsdf.specular import fresnel_dielectric
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.vector import dot, scale

_f4 = np.float32
_ZERO = (_f4(0.0), _f4(0.0), _f4(0.0))


@device
def rough_dielectric_f_pdf(p, o, i):
    """(f, pdf) for light arriving from i and leaving to o, and of `sample_rough_dielectric` from o."""
    if o[2] == _f4(0.0) or i[2] == _f4(0.0):
        return _ZERO, _f4(0.0)
    eta = p.eta if o[2] > _f4(0.0) else _f4(1.0) / p.eta
    reflects = o[2] * i[2] > _f4(0.0)
    m = half_vector(o, i if reflects else scale(i, eta))
    if m[2] < _f4(0.0):
        m = (-m[0], -m[1], -m[2])
    om, im = dot(o, m), dot(i, m)
    # Facets seen from behind neither reflect nor refract.
    if om * o[2] <= _f4(0.0) or im * i[2] <= _f4(0.0):
        return _ZERO, _f4(0.0)
    om, im = abs(om), abs(im)
    fresnel, _ = fresnel_dielectric(min(om, _f4(1.0)), eta)
    seen = g1_over_cos(o, p.ax, p.ay, p.distribution) * facet_density(m, p.ax, p.ay, p.distribution)
    lit = g1_over_cos(i, p.ax, p.ay, p.distribution)
    if reflects:
        f = _f4(0.25) * fresnel * seen
        return scale(p.reflectance, f * lit), f
    # On refraction o·m and i·m have opposite signs.
    spread = eta / max(abs(om - eta * im), _f4(1e-15))
    f = (_f4(1.0) - fresnel) * seen * om * im * spread * spread
    return scale(p.transmittance, f * lit), f


@device
def sample_rough_dielectric(p, o, u_lobe, u, v):
    """(direction, 1 if it is of use): reflection with Fresnel probability, else refraction."""
    side = _f4(math.copysign(_f4(1.0), o[2]))
    up = scale(o, side)
    eta = p.eta if side > _f4(0.0) else _f4(1.0) / p.eta
    m = sample_visible_normal(up, p.ax, p.ay, p.distribution, u, v)
    cos = min(max(dot(up, m), _f4(0.0)), _f4(1.0))
    fresnel, cos_t = fresnel_dielectric(cos, eta)
    if u_lobe < fresnel:
        i = reflect_at(up, m)
        return scale(i, side), 1 if i[2] > _f4(0.0) else 0
    inv = _f4(1.0) / eta
    s = inv * cos - cos_t
    i = (s * m[0] - inv * up[0], s * m[1] - inv * up[1], s * m[2] - inv * up[2])
    i = scale(i, _f4(1.0) / _f4(math.sqrt(max(dot(i, i), _f4(1e-30)))))
    return scale(i, side), 1 if i[2] < _f4(0.0) else 0
