"""Disney's principled material: its four lobes, in local frames, above the surface but for refraction.

Burley, "Physically Based Shading at Disney" (2012) and "Extending the Disney BRDF to a BSDF with Integrated Subsurface
Scattering" (2015), with the weights and Fresnel terms of Mitsuba 3's `principled`:

- diffuse reflection with retro-reflection, flattened towards Hanrahan and Krueger's by `flatness`, and sheen: times
  (1 − metallic)(1 − spec_trans), sheen times 1 − metallic;
- specular reflection, GGX: an exact dielectric Fresnel term, mixed with Schlick's from the base colour by `metallic`
  and from the tint by `spec_tint`;
- clearcoat, GTR1 of roughness 0.1 to 0.001 with the masking of GGX of roughness 0.25 and a reflectance from 0.04;
- refraction, GGX, tinted by the root of the base colour: times (1 − metallic) spec_trans.

From inside there are reflection and refraction of a rough dielectric alone, times the same factor. The lobes do not
keep energy to the letter: a white base under a specular lobe reflects a few percent more than it receives.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.bsdf.microfacet import facet_density, g1_over_cos, reflect_at, sample_visible_normal
from pmviewer.kernels.bsdf.specular import fresnel_dielectric
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import (
    GGX,
    M_CLEARCOAT,
    M_COAT_ALPHA,
    M_FLATNESS,
    M_METALLIC,
    M_METALLIC_MAP,
    M_SHEEN,
    M_SHEEN_TINT,
    M_SPEC_TINT,
    M_SPEC_TRANS,
    MATERIAL_COLUMNS,
)
from pmviewer.kernels.textures.texture import texture_value
from pmviewer.kernels.textures.uv import hit_uv
from pmviewer.kernels.vector import dot, luminance, scale

_f4 = np.float32
_ZERO, _ONE, _HALF = _f4(0.0), _f4(1.0), _f4(0.5)
_INV_PI = _f4(1.0 / math.pi)
LEAST_ALPHA = _f4(1e-3)
"""Mitsuba's least roughness of the specular lobes."""
_COAT_MASKING = _f4(0.25)
_COAT_R0 = _f4(0.04)
_SHEEN_ALBEDO = _f4(0.1)
"""Rough share of light that sheen reflects, for the choice of lobe alone."""


class PrincipledParams(NamedTuple):
    """Numbers of one principled material at one point.

    base, tint (the base colour of luminance 1), sheen (colour and strength): red, green, blue; eta inside over outside;
    ax, ay GGX roughness; roughness the root of their mean; metallic, spec_tint, flatness: shares; opaque: the weight of
    diffuse reflection; clear: that of refraction; transmits bool, whether refraction may have weight anywhere on the
    surface; coat, coat_alpha: weight and roughness of the clearcoat.
    """

    base: Any
    tint: Any
    sheen: Any
    eta: Any
    ax: Any
    ay: Any
    roughness: Any
    metallic: Any
    spec_tint: Any
    flatness: Any
    opaque: Any
    clear: Any
    transmits: Any
    coat: Any
    coat_alpha: Any


@specialised
def metallic_at(scene, material, prim, b1, b2, p):
    """The material's metallic share at the point p of primitive `prim`, at its coordinates (b1, b2)."""
    if not has(scene, "textures"):
        return lambda scene, material, prim, b1, b2, p: load_f4(
            scene.materials, material * MATERIAL_COLUMNS + M_METALLIC
        )

    def textured(scene, material, prim, b1, b2, p):
        row = material * MATERIAL_COLUMNS
        texture = np.int64(load_f4(scene.materials, row + M_METALLIC_MAP))
        if texture < 0:
            return load_f4(scene.materials, row + M_METALLIC)
        u, v = hit_uv(scene, prim, b1, b2, p)
        return min(max(texture_value(scene, texture, u, v), _ZERO), _ONE)

    return textured


@device
def principled_params(scene, material, metallic, p):
    """The material's numbers; p: those that all kinds have (`MaterialParams`), textures applied."""
    row = material * MATERIAL_COLUMNS
    m = scene.materials
    base = p.reflectance
    bright = luminance(base)
    tint = (_ONE, _ONE, _ONE)
    if bright > _ZERO:
        tint = scale(base, _ONE / bright)
    dielectric = _ONE - metallic
    through = load_f4(m, row + M_SPEC_TRANS)
    opaque = dielectric * (_ONE - through)
    s, t = load_f4(m, row + M_SHEEN) * dielectric, load_f4(m, row + M_SHEEN_TINT)
    if not opaque > _ZERO:
        s = _ZERO
    sheen = (s * (_ONE + t * (tint[0] - _ONE)), s * (_ONE + t * (tint[1] - _ONE)), s * (_ONE + t * (tint[2] - _ONE)))
    return PrincipledParams(
        base,
        tint,
        sheen,
        p.eta,
        max(p.ax, LEAST_ALPHA),
        max(p.ay, LEAST_ALPHA),
        _f4(math.sqrt(_f4(math.sqrt(p.ax * p.ay)))),
        metallic,
        load_f4(m, row + M_SPEC_TINT),
        load_f4(m, row + M_FLATNESS),
        opaque,
        dielectric * through,
        through > _ZERO,
        load_f4(m, row + M_CLEARCOAT),
        load_f4(m, row + M_COAT_ALPHA),
    )


@device
def _fifth(cos):
    """Schlick's (1 − cos)⁵."""
    s = min(max(_ONE - cos, _ZERO), _ONE)
    s2 = s * s
    return s2 * s2 * s


@device
def specular_fresnel(q, cos):
    """Fresnel factor and colour of the specular reflection at the cosine ≥ 0 of a direction with the half vector."""
    cos = min(cos, _ONE)
    dielectric, cos_t = fresnel_dielectric(cos, q.eta)
    s = _fifth(cos if q.eta > _ONE else cos_t)
    r = (q.eta - _ONE) / (q.eta + _ONE)
    exact = (_ONE - q.metallic) * (_ONE - q.spec_tint) * dielectric
    tinted, r0 = (_ONE - q.metallic) * q.spec_tint, r * r
    # Schlick's term F₀ + (1 − F₀)s of both, with their weights.
    rest = exact + (q.metallic + tinted) * s
    kept = _ONE - s
    red = rest + kept * (q.metallic * q.base[0] + tinted * r0 * q.tint[0])
    green = rest + kept * (q.metallic * q.base[1] + tinted * r0 * q.tint[1])
    blue = rest + kept * (q.metallic * q.base[2] + tinted * r0 * q.tint[2])
    return red, green, blue


@device
def coat_fresnel(q, cos):
    """Reflectance of the clearcoat at that cosine."""
    cos = min(cos, _ONE)
    if not q.eta > _ONE:
        _, cos = fresnel_dielectric(cos, q.eta)
    return _COAT_R0 + (_ONE - _COAT_R0) * _fifth(cos)


@device
def lobe_weights(q, cos):
    """Estimates of what (diffuse, specular, clearcoat, refraction) do to light from outside at that cosine with the
    normal; 0 where a lobe is none."""
    diffuse, specular, coat, refraction = _ZERO, _ZERO, _ZERO, _ZERO
    if q.opaque > _ZERO:
        diffuse = q.opaque * luminance(q.base) + _SHEEN_ALBEDO * luminance(q.sheen)
    if q.eta != _ONE or q.metallic > _ZERO or q.spec_tint > _ZERO:
        specular = max(luminance(specular_fresnel(q, cos)), _f4(1e-3))
    if q.coat > _ZERO:
        coat = max(q.coat * coat_fresnel(q, cos) * cos, _f4(1e-3) * q.coat)
    if q.clear > _ZERO:
        dielectric, _ = fresnel_dielectric(cos, q.eta)
        refraction = max(q.clear * (_ONE - dielectric) * _f4(math.sqrt(luminance(q.base))), _f4(1e-6))
    return diffuse, specular, coat, refraction


@device
def diffuse_f(q, o, i, m):
    """Diffuse, retro- and sheen reflection; m is the half vector."""
    fifth_o, fifth_i = _fifth(o[2]), _fifth(i[2])
    cos = min(dot(m, i), _ONE)
    retro = _f4(2.0) * q.roughness * cos * cos
    f = (_ONE - _HALF * fifth_o) * (_ONE - _HALF * fifth_i)
    f += retro * (fifth_o + fifth_i + fifth_o * fifth_i * (retro - _ONE))
    if q.flatness > _ZERO:
        grazing = _HALF * retro - _ONE
        both = (_ONE + grazing * fifth_o) * (_ONE + grazing * fifth_i)
        flat = _f4(1.25) * (both * (_ONE / max(o[2] + i[2], _f4(1e-12)) - _HALF) + _HALF)
        f += q.flatness * (flat - f)
    f *= q.opaque * _INV_PI
    s = _fifth(cos)
    return f * q.base[0] + s * q.sheen[0], f * q.base[1] + s * q.sheen[1], f * q.base[2] + s * q.sheen[2]


@device
def specular_f_pdf(q, o, i, m):
    """(f, pdf) of the specular reflection, sampled by visible normals."""
    seen = _f4(0.25) * facet_density(m, q.ax, q.ay, GGX) * g1_over_cos(o, q.ax, q.ay, GGX)
    return scale(specular_fresnel(q, dot(i, m)), seen * g1_over_cos(i, q.ax, q.ay, GGX)), seen


@device
def coat_f_pdf(q, o, i, m):
    """(f of all channels, pdf) of the clearcoat, whose normals are sampled with the density GTR1 times the cosine."""
    a2 = q.coat_alpha * q.coat_alpha
    spread = m[0] * m[0] + m[1] * m[1] + a2 * m[2] * m[2]
    density = (a2 - _ONE) / (_f4(math.pi) * _f4(math.log(a2)) * spread)
    masking = g1_over_cos(o, _COAT_MASKING, _COAT_MASKING, GGX) * o[2]
    masking *= g1_over_cos(i, _COAT_MASKING, _COAT_MASKING, GGX) * i[2]
    f = _f4(0.25) * q.coat * coat_fresnel(q, dot(i, m)) * density * masking
    return f, density * m[2] / (_f4(4.0) * max(dot(o, m), _f4(1e-15)))


@device
def sample_coat_normal(q, u, v):
    """A normal with the density of `coat_f_pdf`."""
    a2 = q.coat_alpha * q.coat_alpha
    # a2^(1 − v) from 1 on down, so that 1 − cos² does not cancel.
    sin2 = (_f4(math.exp((_ONE - v) * _f4(math.log(a2)))) - a2) / (_ONE - a2)
    sin2 = min(max(sin2, _ZERO), _ONE)
    sin, phi = _f4(math.sqrt(sin2)), _f4(2.0 * math.pi) * u
    return sin * _f4(math.cos(phi)), sin * _f4(math.sin(phi)), _f4(math.sqrt(_ONE - sin2))


@device
def refraction_f_pdf(q, o, i):
    """(f, pdf) of the refraction from outside (o.z > 0 > i.z), sampled by visible normals."""
    m = (o[0] + q.eta * i[0], o[1] + q.eta * i[1], o[2] + q.eta * i[2])
    size = _f4(math.sqrt(max(dot(m, m), _f4(1e-30))))
    m = scale(m, math.copysign(_ONE, m[2]) / size)
    om, im = dot(o, m), dot(i, m)
    if om <= _ZERO or im >= _ZERO:
        return (_ZERO, _ZERO, _ZERO), _ZERO
    fresnel, _ = fresnel_dielectric(min(om, _ONE), q.eta)
    across = q.eta / max(abs(om + q.eta * im), _f4(1e-15))
    pdf = g1_over_cos(o, q.ax, q.ay, GGX) * facet_density(m, q.ax, q.ay, GGX) * om * -im * across * across
    f = q.clear * (_ONE - fresnel) * pdf * g1_over_cos(i, q.ax, q.ay, GGX)
    return scale(root(q.base), f), pdf


@device
def root(colour):
    """The square root of each channel."""
    return (
        _f4(math.sqrt(max(colour[0], _ZERO))),
        _f4(math.sqrt(max(colour[1], _ZERO))),
        _f4(math.sqrt(max(colour[2], _ZERO))),
    )


@device
def sample_specular(q, o, u, v):
    """A mirrored direction, possibly below the surface."""
    return reflect_at(o, sample_visible_normal(o, q.ax, q.ay, GGX, u, v))


@device
def sample_refraction(q, o, u, v):
    """A refracted direction from outside; o itself where everything is reflected."""
    m = sample_visible_normal(o, q.ax, q.ay, GGX, u, v)
    cos = min(max(dot(o, m), _ZERO), _ONE)
    fresnel, cos_t = fresnel_dielectric(cos, q.eta)
    if not fresnel < _ONE:
        return o
    inv = _ONE / q.eta
    s = inv * cos - cos_t
    i = (s * m[0] - inv * o[0], s * m[1] - inv * o[1], s * m[2] - inv * o[2])
    return scale(i, _ONE / _f4(math.sqrt(max(dot(i, i), _f4(1e-30)))))
