"""Delta lobes: smooth metal, glass, thin glass and coats. Local frames."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.dispersion import refracted_lazily
from pmviewer.kernels.bsdf.fresnel import fresnel_conductor
from pmviewer.kernels.bsdf.kinds import CONDUCTOR, PLASTIC, THIN_DIELECTRIC
from pmviewer.kernels.bsdf.specular import fresnel_dielectric
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, part, specialised
from pmviewer.kernels.vector import mul, scale

_f4 = np.float32


@device
def thin_reflectance(cos, eta):
    """Reflectance of a thin pane with all reflections between its two faces: 2R/(1 + R)."""
    fresnel, _ = fresnel_dielectric(cos, eta)
    return _f4(2.0) * fresnel / (_f4(1.0) + fresnel)


@specialised
def smooth_lobe(p, o, u):
    """`sample_smooth`, of dispersive glass by the path's wavelength (`pmviewer.kernels.bsdf.dispersion`)."""
    if absent(part(p, "glass")):
        return lambda p, o, u: sample_smooth(p, o, u)
    return lambda p, o, u: refracted_lazily(p, o, u) if p.glass.lazy != 0 else sample_smooth(p, o, u)


@device
def smooth_reflectance(p, o):
    """Probability with which `sample_smooth` reflects at glass; 1 of what never transmits."""
    cos = min(abs(o[2]), _f4(1.0))
    if p.kind == CONDUCTOR or p.kind == PLASTIC:
        return _f4(1.0)
    if p.kind == THIN_DIELECTRIC:
        return thin_reflectance(cos, p.eta)
    eta = p.eta if o[2] > _f4(0.0) else _f4(1.0) / p.eta
    fresnel, _ = fresnel_dielectric(cos, eta)
    return fresnel


@device
def sample_smooth(p, o, u):
    """(direction, weight, compression) of the smooth lobes; `u` chooses between reflection and transmission."""
    cos = min(abs(o[2]), _f4(1.0))
    mirrored = (-o[0], -o[1], o[2])
    one = _f4(1.0)
    if p.kind == CONDUCTOR:
        return mirrored, mul(fresnel_conductor(cos, p.eta_rgb, p.k_rgb), p.reflectance), one
    if p.kind == PLASTIC:
        fresnel, _ = fresnel_dielectric(cos, p.eta)
        return mirrored, scale(p.specular, fresnel), one
    if p.kind == THIN_DIELECTRIC:
        if u < thin_reflectance(cos, p.eta):
            return mirrored, p.reflectance, one
        return (-o[0], -o[1], -o[2]), p.transmittance, one
    side = _f4(math.copysign(one, o[2]))
    eta = p.eta if side > _f4(0.0) else one / p.eta
    fresnel, cos_t = fresnel_dielectric(cos, eta)
    if u < fresnel:
        return mirrored, p.reflectance, one
    inv = one / eta
    x, y, z = -inv * o[0], -inv * o[1], -side * cos_t
    norm = one / _f4(math.sqrt(max(x * x + y * y + z * z, _f4(1e-30))))
    return (x * norm, y * norm, z * norm), p.transmittance, inv * inv
