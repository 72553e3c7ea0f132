"""Specular BSDFs: mirror and smooth dielectric. Diffuse reflection needs no more than its albedo and a cosine warp."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.kinds import CONDUCTOR
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.scene import material_eta, material_kind, reflectance, transmittance
from pmviewer.kernels.vector import dot

_f4 = np.float32


@device
def reflect(d, n):
    """Mirror image of the travelling direction d at the normal n."""
    s = _f4(-2.0) * dot(d, n)
    return d[0] + s * n[0], d[1] + s * n[1], d[2] + s * n[2]


@device
def fresnel_dielectric(cos_i, eta):
    """Unpolarised Fresnel reflectance and the cosine of refraction (0 under total reflection).

    `cos_i` ≥ 0 on the incident side, `eta` = n_transmitted / n_incident.
    """
    sin2_t = (_f4(1.0) - cos_i * cos_i) / (eta * eta)
    if sin2_t >= _f4(1.0):
        return _f4(1.0), _f4(0.0)
    cos_t = _f4(math.sqrt(_f4(1.0) - sin2_t))
    parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    return _f4(0.5) * (parallel * parallel + perpendicular * perpendicular), cos_t


@device
def glass_reflectance(scene, material, n, wo):
    """Share of the light that smooth glass with outward normal n reflects back to the side of wo; 1 of a mirror."""
    if material_kind(scene, material) == CONDUCTOR:
        return _f4(1.0)
    cos, eta = dot(wo, n), material_eta(scene, material)
    if cos < _f4(0.0):
        cos, eta = -cos, _f4(1.0) / eta
    fresnel, _ = fresnel_dielectric(min(cos, _f4(1.0)), eta)
    return fresnel


@device
def scatter_specular(scene, material, n, d, u):
    """One specular scattering of the travelling direction d at a surface with outward normal n.

    Returns the new direction, its weight per channel (f·cos/probability) and the factor by which *radiance* is
    compressed on refraction, (n_i/n_t)² seen from the light's side: eye paths multiply by it, photons do not. `u` picks
    reflection or refraction with Fresnel probability. A weight of zero means absorbed.
    """
    cos_d = -dot(d, n)
    tint = reflectance(scene, material)
    if material_kind(scene, material) == CONDUCTOR:
        return reflect(d, n), tint, _f4(1.0)
    eta = material_eta(scene, material)
    entering = cos_d > _f4(0.0)
    if not entering:
        n = (-n[0], -n[1], -n[2])
        cos_d = -cos_d
        eta = _f4(1.0) / eta
    cos_d = min(cos_d, _f4(1.0))
    fresnel, cos_t = fresnel_dielectric(cos_d, eta)
    if u < fresnel:
        return reflect(d, n), tint, _f4(1.0)
    inv = _f4(1.0) / eta
    s = inv * cos_d - cos_t
    bent = (inv * d[0] + s * n[0], inv * d[1] + s * n[1], inv * d[2] + s * n[2])
    norm = _f4(1.0) / _f4(math.sqrt(dot(bent, bent)))
    bent = (bent[0] * norm, bent[1] * norm, bent[2] * norm)
    return bent, transmittance(scene, material), inv * inv
