"""Glossy reflection: rough metal, rough coat, Schlick's and Ward's lobes. In local frames, above the surface."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.fresnel import fresnel_conductor
from pmviewer.kernels.bsdf.kinds import GLOSSY, ROUGH_PLASTIC, SCHLICK, WARD
from pmviewer.kernels.bsdf.microfacet import facet_density, g1_over_cos, half_vector, reflect_at, sample_visible_normal
from pmviewer.kernels.bsdf.schlick import schlick_bound, schlick_fresnel, schlick_shadowing, schlick_shadowing_over_cos
from pmviewer.kernels.bsdf.specular import fresnel_dielectric
from pmviewer.kernels.bsdf.ward import sample_ward_normal, ward_f_pdf
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.vector import scale

_f4 = np.float32
_INV_PI = _f4(1.0 / math.pi)


@device
def lobe_colour(p, cos):
    """Fresnel factor and colour of the specular lobe at the cosine between a direction and the half vector."""
    cos = min(max(cos, _f4(0.0)), _f4(1.0))
    if p.kind == SCHLICK:
        return schlick_fresnel(cos, p.specular)
    if p.kind == WARD:
        return p.specular
    if p.kind == ROUGH_PLASTIC:
        fresnel, _ = fresnel_dielectric(cos, p.eta)
        return scale(p.specular, fresnel)
    fresnel = fresnel_conductor(cos, p.eta_rgb, p.k_rgb)
    return fresnel[0] * p.reflectance[0], fresnel[1] * p.reflectance[1], fresnel[2] * p.reflectance[2]


@device
def glossy_f_pdf(p, o, i):
    """(f, pdf) of the lobe and of `sample_glossy`."""
    if p.kind == WARD:
        f, pdf = ward_f_pdf(o, i, p.ax, p.ay)
        return scale(p.specular, f), pdf
    m = half_vector(o, i)
    density = facet_density(m, p.ax, p.ay, p.distribution)
    seen = g1_over_cos(o, p.ax, p.ay, p.distribution)
    if p.kind == SCHLICK:
        alpha = p.ax * p.ay
        shadowing = schlick_shadowing_over_cos(o[2], alpha) * schlick_shadowing_over_cos(i[2], alpha)
    else:
        shadowing = seen * g1_over_cos(i, p.ax, p.ay, p.distribution)
    f = _f4(0.25) * density * shadowing
    colour = lobe_colour(p, i[0] * m[0] + i[1] * m[1] + i[2] * m[2])
    return scale(colour, f), _f4(0.25) * density * seen


@device
def sample_glossy(p, o, u, v):
    """A direction (possibly below the surface, where it counts for nothing) with the density of `glossy_f_pdf`."""
    if p.kind == WARD:
        return reflect_at(o, sample_ward_normal(p.ax, p.ay, u, v))
    return reflect_at(o, sample_visible_normal(o, p.ax, p.ay, p.distribution, u, v))


@device
def schlick_diffuse(p, cos_o, cos_i):
    """First term of Jensen's equation 5 times the reflectance."""
    alpha = p.ax * p.ay
    both = schlick_shadowing(cos_o, alpha) * schlick_shadowing(cos_i, alpha)
    return scale(p.reflectance, max(_f4(1.0) - both, _f4(0.0)) * _INV_PI)


@device
def schlick_limit(p, cos_o, cos_i):
    """The factor that keeps the model's albedo at most 1."""
    return min(schlick_bound(p.table, cos_o), schlick_bound(p.table, cos_i))


@device
def is_glossy(kind):
    """Does this kind have a glossy reflection?"""
    return kind in GLOSSY
