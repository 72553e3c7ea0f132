"""The materials of scenes that have principled ones: those, and all kinds of `pmviewer.kernels.bsdf.lobes`.

Functions and groups are those of `pmviewer.kernels.bsdf.lobes`. Diffuse reflection is STORED, refraction FOLLOWED,
specular reflection and clearcoat either by their roughness; seen from inside a material that transmits, everything is
FOLLOWED. No lobe of a principled material is a delta.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.bsdf import lobes
from pmviewer.kernels.bsdf.kinds import PRINCIPLED
from pmviewer.kernels.bsdf.lobes import FOLLOWED, NOTHING, STORED, Bsdf
from pmviewer.kernels.bsdf.material import MaterialParams
from pmviewer.kernels.bsdf.microfacet import half_vector, reflect_at
from pmviewer.kernels.bsdf.principled_lobes import (
    coat_f_pdf,
    coat_fresnel,
    diffuse_f,
    lobe_weights,
    principled_params,
    refraction_f_pdf,
    root,
    sample_coat_normal,
    sample_refraction,
    sample_specular,
    specular_f_pdf,
    specular_fresnel,
)
from pmviewer.kernels.bsdf.rough_dielectric import rough_dielectric_f_pdf, sample_rough_dielectric
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.scene import GGX
from pmviewer.kernels.textures.normal_map import reflecting_normal
from pmviewer.kernels.vector import add, dot, scale
from pmviewer.kernels.warp import square_to_cosine_hemisphere

_f4 = np.float32
_ZERO, _ONE = _f4(0.0), _f4(1.0)
_BLACK = (_ZERO, _ZERO, _ZERO)
_INV_PI = _f4(1.0 / math.pi)
_LEAST, _MOST = _f4(0.05), _f4(0.95)
_FLOOR = _f4(0.05)
"""Each lobe of a group is sampled at least that often, over the others."""


class AnyBsdf(NamedTuple):
    """Lobes at one hit: groups, albedo, delta and n as those of `Bsdf`; `one` the Bsdf of another kind of material, or
    the frame and the rough dielectric that a principled one is from inside; q its `PrincipledParams`; weights (diffuse,
    specular, clearcoat, refraction) and lobes (the groups of specular reflection and clearcoat) as seen from outside.
    """

    groups: Any
    albedo: Any
    delta: Any
    n: Any
    one: Any
    q: Any
    weights: Any
    lobes: Any


@device
def _is_principled(b):
    return b.one.p.kind == PRINCIPLED


@device
def bsdf_at(scene, material, p, metallic, ng, ns, tangent, wo, glossy):
    """The lobes of a material at a hit; arguments as for `lobes.bsdf_at`, and what a principled one is of metal."""
    q = principled_params(scene, material, metallic, p)
    if p.kind != PRINCIPLED:
        one = lobes.bsdf_at(scene, material, p, ng, ns, tangent, wo, glossy)
        none = (_ZERO, _ZERO, _ZERO, _ZERO)
        return AnyBsdf(one.groups, one.albedo, one.delta, one.n, one, q, none, (NOTHING, NOTHING))
    hidden, inside = False, False
    if dot(ng, wo) < _ZERO:
        inside = q.transmits
        if not inside:
            ng, ns = scale(ng, _f4(-1.0)), scale(ns, _f4(-1.0))
            hidden = not p.two_sided
    if not q.transmits and not p.mapped:
        ns = reflecting_normal(ns, ng, wo)
    s, t = lobes.frame(ns, tangent)
    cos = min(abs(dot(ns, wo)), _ONE)
    groups, specular, coat = NOTHING, NOTHING, NOTHING
    weights = lobe_weights(q, cos)
    if inside:
        if weights[3] > _ZERO:
            groups = FOLLOWED
    elif not hidden:
        if weights[0] > _ZERO:
            groups |= STORED
        if weights[1] > _ZERO:
            specular = STORED if min(q.ax, q.ay) >= glossy else FOLLOWED
        if weights[2] > _ZERO:
            coat = STORED if q.coat_alpha >= glossy else FOLLOWED
        if weights[3] > _ZERO:
            groups |= FOLLOWED
        groups |= specular | coat
    albedo = _albedo(q, cos, weights)
    one = Bsdf(groups, albedo, specular, False, s, t, ns, _rough_dielectric(p, q))
    return AnyBsdf(groups, albedo, False, ns, one, q, weights, (specular, coat))


@device
def _rough_dielectric(p, q):
    """What a principled material is from inside, under the kind's own name."""
    r = root(q.base)
    return MaterialParams(
        p.kind,
        p.two_sided,
        (q.clear, q.clear, q.clear),
        p.specular,
        (q.clear * r[0], q.clear * r[1], q.clear * r[2]),
        p.eta,
        p.eta_rgb,
        p.k_rgb,
        q.ax,
        q.ay,
        np.int32(GGX),
        p.nonlinear,
        p.inner,
        p.table,
        p.mapped,
        p.glass,
    )


@device
def _albedo(q, cos, weights):
    """Rough share of light from outside at that cosine that is reflected, per channel; 0 to 1."""
    sum = scale(q.base, q.opaque)
    if weights[1] > _ZERO:
        sum = add(sum, specular_fresnel(q, cos))
    coat = q.coat * coat_fresnel(q, cos) * cos
    return min(sum[0] + coat, _ONE), min(sum[1] + coat, _ONE), min(sum[2] + coat, _ONE)


@device
def bsdf_transmits(b):
    """A principled material does so by its `spec_trans`, whichever lobe is taken."""
    if _is_principled(b):
        return b.q.transmits
    return lobes.bsdf_transmits(b.one)


@device
def bsdf_is_lambertian(b):
    """Never of a principled material, whose diffuse lobe depends on both angles."""
    return not _is_principled(b) and lobes.bsdf_is_lambertian(b.one)


@device
def sees_side(b, group, ng, wo, wi):
    """As `lobes.sees_side`, by whether the material transmits instead of by its kind."""
    if _is_principled(b) and group == FOLLOWED and b.q.transmits:
        return not b.one.p.mapped or dot(ng, wi) * dot(b.n, wi) * dot(ng, wo) * dot(b.n, wo) > _ZERO
    return lobes.sees_side(b.one, group, ng, wo, wi)


@device
def _parts(b, group):
    """Probabilities with which sampling a group from outside takes (diffuse, specular, clearcoat, refraction)."""
    w = b.weights
    d = w[0] if group == STORED else _ZERO
    s = w[1] if b.lobes[0] == group else _ZERO
    c = w[2] if b.lobes[1] == group else _ZERO
    t = w[3] if group == FOLLOWED else _ZERO
    least = _FLOOR * (d + s + c + t)
    d = max(d, least) if d > _ZERO else _ZERO
    s = max(s, least) if s > _ZERO else _ZERO
    c = max(c, least) if c > _ZERO else _ZERO
    t = max(t, least) if t > _ZERO else _ZERO
    inv = _ONE / max(d + s + c + t, _f4(1e-30))
    return d * inv, s * inv, c * inv, t * inv


@device
def followed_share(b, wo):
    """By the lobes' sampling weights, as the FOLLOWED ones may be any of four."""
    if not _is_principled(b):
        return lobes.followed_share(b.one, wo)
    if b.groups != STORED | FOLLOWED:
        return _ONE if b.groups == FOLLOWED else _ZERO
    w = b.weights
    followed = w[3]
    if b.lobes[0] == FOLLOWED:
        followed += w[1]
    if b.lobes[1] == FOLLOWED:
        followed += w[2]
    return min(max(followed / max(w[0] + w[1] + w[2] + w[3], _f4(1e-30)), _LEAST), _MOST)


@device
def _f_pdf(b, group, o, i):
    """(f, pdf) of a principled material, in its frame."""
    if b.groups & group == 0 or o[2] == _ZERO or i[2] == _ZERO:
        return _BLACK, _ZERO
    if o[2] < _ZERO:
        if not b.q.transmits:
            return _BLACK, _ZERO
        return rough_dielectric_f_pdf(b.one.p, o, i)
    diffuse, specular, coat, refraction = _parts(b, group)
    if i[2] < _ZERO:
        if not refraction > _ZERO:
            return _BLACK, _ZERO
        f, pdf = refraction_f_pdf(b.q, o, i)
        return f, refraction * pdf
    m = half_vector(o, i)
    f, pdf = _BLACK, _ZERO
    if diffuse > _ZERO:
        f, pdf = diffuse_f(b.q, o, i, m), diffuse * i[2] * _INV_PI
    if specular > _ZERO:
        value, density = specular_f_pdf(b.q, o, i, m)
        f, pdf = add(f, value), pdf + specular * density
    if coat > _ZERO:
        grey, density = coat_f_pdf(b.q, o, i, m)
        f, pdf = add(f, (grey, grey, grey)), pdf + coat * density
    return f, pdf


@device
def bsdf_f_pdf(b, group, wo, wi):
    """(f, pdf) of a group's lobes, per solid angle; all lobes of the group together."""
    if _is_principled(b):
        return _f_pdf(b, group, lobes.local(b.one, wo), lobes.local(b.one, wi))
    return lobes.bsdf_f_pdf(b.one, group, wo, wi)


@device
def bsdf_f(b, group, wo, wi):
    """Value of a group's lobes (red, green, blue)."""
    return bsdf_f_pdf(b, group, wo, wi)[0]


@device
def bsdf_pdf(b, group, wo, wi):
    """Density per solid angle of `bsdf_sample` within the group."""
    return bsdf_f_pdf(b, group, wo, wi)[1]


@device
def bsdf_compression(b, wo, wi):
    """(n_i/n_t)² on refraction, else 1: what radiance is multiplied by besides f."""
    if not _is_principled(b):
        return lobes.bsdf_compression(b.one, wo, wi)
    side = dot(b.n, wo)
    if side * dot(b.n, wi) >= _ZERO:
        return _ONE
    eta = b.q.eta
    return _ONE / (eta * eta) if side > _ZERO else eta * eta


@device
def _sampled(b, group, o, u_lobe, u, v):
    """(direction, 1 if it is of use) from a group of a principled material, in its frame."""
    if o[2] < _ZERO:
        return sample_rough_dielectric(b.one.p, o, u_lobe, u, v)
    diffuse, specular, coat, _ = _parts(b, group)
    if u_lobe < diffuse:
        return square_to_cosine_hemisphere(u, v), 1
    i = o
    if u_lobe < diffuse + specular:
        i = sample_specular(b.q, o, u, v)
    elif u_lobe < diffuse + specular + coat:
        i = reflect_at(o, sample_coat_normal(b.q, u, v))
    elif group == FOLLOWED and b.weights[3] > _ZERO:
        i = sample_refraction(b.q, o, u, v)
        return i, 1 if i[2] < _ZERO else 0
    else:  # rounding of the probabilities
        i = sample_specular(b.q, o, u, v)
    return i, 1 if i[2] > _ZERO else 0


@device
def bsdf_mirrored_share(b, wo):
    """See `lobes.bsdf_mirrored_share`; 1 of a principled one."""
    if _is_principled(b):
        return _ONE
    return lobes.bsdf_mirrored_share(b.one, wo)


@device
def bsdf_sample(b, group, wo, u_lobe, u, v):
    """(wi, f·|cos|/pdf, pdf, compression), the pdf being that of all lobes of the group; weight 0 means absorbed."""
    if not _is_principled(b):
        return lobes.bsdf_sample(b.one, group, wo, u_lobe, u, v)
    o = lobes.local(b.one, wo)
    if b.groups & group == 0 or o[2] == _ZERO or (o[2] < _ZERO and not b.q.transmits):
        return wo, _BLACK, _ZERO, _ONE
    i, useful = _sampled(b, group, o, u_lobe, u, v)
    if useful == 0:
        return wo, _BLACK, _ZERO, _ONE
    f, pdf = _f_pdf(b, group, o, i)
    if not pdf > _ZERO:
        return wo, _BLACK, _ZERO, _ONE
    wi = lobes.world(b.one, i)
    return wi, scale(f, abs(i[2]) / pdf), pdf, bsdf_compression(b, wo, wi)
