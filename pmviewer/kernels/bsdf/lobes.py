"""The materials of rich scenes as integrators see them: two groups of lobes, resolved once a hit.

STORED lobes are those that photons are stored for and looked up with: diffuse reflection, and glossy reflection of a
roughness of at least `glossy`. FOLLOWED lobes are sampled and followed, as mirrors are: smooth ones, smoother glossy
ones, everything that transmits. STORED lobes never transmit; the FOLLOWED lobes of a material are all deltas or none
is.

Directions are unit vectors in world space that point away from the surface; f never contains the cosine. On refraction
f is that of power: radiance is multiplied by (n_i/n_t)², the `compression`, as well.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.bsdf.diffuse_transmission import diffuse_transmission, sample_other_side
from pmviewer.kernels.bsdf.fresnel import fresnel_conductor
from pmviewer.kernels.bsdf.glossy import (
    glossy_f_pdf,
    is_glossy,
    sample_glossy,
    schlick_diffuse,
    schlick_limit,
)
from pmviewer.kernels.bsdf.kinds import (
    CONDUCTOR,
    DIELECTRIC,
    DIFFUSE,
    DIFFUSE_TRANSMITTER,
    PLASTIC,
    ROUGH_CONDUCTOR,
    ROUGH_DIELECTRIC,
    ROUGH_PLASTIC,
    SCHLICK,
    THIN_DIELECTRIC,
)
from pmviewer.kernels.bsdf.material import beer_lambert, interior_attenuation, material_params
from pmviewer.kernels.bsdf.plastic import coat_transmittance, coated_diffuse, under_coat
from pmviewer.kernels.bsdf.rough_dielectric import rough_dielectric_f_pdf, sample_rough_dielectric
from pmviewer.kernels.bsdf.schlick import schlick_shadowing
from pmviewer.kernels.bsdf.smooth import smooth_lobe, smooth_reflectance
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.textures.normal_map import reflecting_normal, shows_back
from pmviewer.kernels.vector import add, basis, cross, dot, largest, mul, scale
from pmviewer.kernels.warp import square_to_cosine_hemisphere

__all__ = [
    "FOLLOWED",
    "NOTHING",
    "STORED",
    "Bsdf",
    "beer_lambert",
    "bsdf_albedo",
    "bsdf_at",
    "bsdf_compression",
    "bsdf_f",
    "bsdf_f_pdf",
    "bsdf_groups",
    "bsdf_is_delta",
    "bsdf_is_lambertian",
    "bsdf_pdf",
    "bsdf_sample",
    "bsdf_transmits",
    "followed_share",
    "frame",
    "interior_attenuation",
    "local",
    "material_params",
    "sees_side",
    "world",
]

_f4 = np.float32
_i4 = np.int32
NOTHING, STORED, FOLLOWED = _i4(0), _i4(1), _i4(2)
_BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))
_INV_PI = _f4(1.0 / math.pi)
_LEAST, _MOST = _f4(0.05), _f4(0.95)


class Bsdf(NamedTuple):
    """Lobes at one hit: groups int32, albedo (red, green, blue), glossy int32 group of the glossy lobe, delta bool,
    frame (s, t, n) with n the shading normal (of an opaque surface on the side of wo), and the parameters p."""

    groups: Any
    albedo: Any
    glossy: Any
    delta: Any
    s: Any
    t: Any
    n: Any
    p: Any


@device
def local(b, w):
    """The direction w in the frame of the BSDF b."""
    return dot(w, b.s), dot(w, b.t), dot(w, b.n)


@device
def world(b, w):
    """The direction w of the frame of b in the world."""
    return (
        w[0] * b.s[0] + w[1] * b.t[0] + w[2] * b.n[0],
        w[0] * b.s[1] + w[1] * b.t[1] + w[2] * b.n[1],
        w[0] * b.s[2] + w[1] * b.t[2] + w[2] * b.n[2],
    )


@device
def frame(n, tangent):
    """Axes of anisotropy: the tangent made orthogonal to n; any when it is zero or along n."""
    along = dot(n, tangent)
    x = (tangent[0] - along * n[0], tangent[1] - along * n[1], tangent[2] - along * n[2])
    length2 = dot(x, x)
    if length2 > _f4(1e-8) * dot(tangent, tangent):
        s = scale(x, _f4(1.0) / _f4(math.sqrt(length2)))
        return s, cross(n, s)
    return basis(n)


@device
def _transparent(kind):
    return kind in (DIELECTRIC, ROUGH_DIELECTRIC, THIN_DIELECTRIC, DIFFUSE_TRANSMITTER)


@device
def _diffuse_base(p):
    """Has the material a diffuse lobe that reflects anything?"""
    return not _transparent(p.kind) and p.kind != CONDUCTOR and p.kind != ROUGH_CONDUCTOR and largest(p.reflectance) > 0


@device
def bsdf_at(scene, material, p, ng, ns, tangent, wo, glossy):
    """The lobes of a material at a hit, seen from wo.

    p: its parameters (`material_params`, or what textures made of them); ng, ns: geometric and shading normal, on the
    same side; tangent: direction of the roughness αx, not necessarily unit or orthogonal, zero for any; glossy:
    roughness from which glossy reflection is STORED. The back of a one-sided material and a black one have no groups.
    """
    opaque = not _transparent(p.kind)
    hidden = opaque and not p.two_sided and shows_back(p.kind == DIFFUSE, ng, ns, wo)
    if opaque and dot(ng, wo) < _f4(0.0):
        ng, ns = scale(ng, _f4(-1.0)), scale(ns, _f4(-1.0))
    # A lobe around a normal that looks away, or whose mirror direction is below the surface, would be black.
    # Not so those of maps, which Mitsuba leaves black as well.
    if opaque and p.kind != DIFFUSE and not p.mapped:
        ns = reflecting_normal(ns, ng, wo)
    s, t = frame(ns, tangent)
    cos = min(abs(dot(ns, wo)), _f4(1.0))
    groups, lobe, delta = NOTHING, NOTHING, False
    if not hidden:
        if _diffuse_base(p):
            groups |= STORED
        if is_glossy(p.kind):
            colour = p.reflectance if p.kind == ROUGH_CONDUCTOR else p.specular
            if largest(colour) > _f4(0.0):
                lobe = STORED if min(p.ax, p.ay) >= glossy else FOLLOWED
                groups |= lobe
        elif p.kind == ROUGH_DIELECTRIC or p.kind == DIFFUSE_TRANSMITTER:
            if max(largest(p.reflectance), largest(p.transmittance)) > _f4(0.0):
                groups |= FOLLOWED
        elif p.kind == PLASTIC:
            if largest(p.specular) > _f4(0.0):
                groups |= FOLLOWED
                delta = True
        elif p.kind != DIFFUSE:
            if largest(p.reflectance) > _f4(0.0) or (not opaque and largest(p.transmittance) > _f4(0.0)):
                groups |= FOLLOWED
                delta = True
    return Bsdf(groups, _albedo(p, cos), lobe, delta, s, t, ns, p)


@device
def _albedo(p, cos):
    """Rough share of light from the angle with this cosine that is reflected, per channel; 0 to 1."""
    if p.kind == DIFFUSE or _transparent(p.kind):
        return p.reflectance
    if p.kind == CONDUCTOR or p.kind == ROUGH_CONDUCTOR:
        return mul(fresnel_conductor(cos, p.eta_rgb, p.k_rgb), p.reflectance)
    rho = p.reflectance
    if p.kind == PLASTIC or p.kind == ROUGH_PLASTIC:
        through = coat_transmittance(p, cos)
        base = through * (_f4(1.0) - p.inner)
        base = (base * under_coat(p, rho[0]), base * under_coat(p, rho[1]), base * under_coat(p, rho[2]))
        sum = add(base, scale(p.specular, _f4(1.0) - through))
    elif p.kind == SCHLICK:
        shadowing = schlick_shadowing(cos, p.ax * p.ay)
        sum = add(scale(rho, _f4(1.0) - shadowing), scale(p.specular, shadowing))
    else:
        sum = add(rho, p.specular)
    return min(sum[0], _f4(1.0)), min(sum[1], _f4(1.0)), min(sum[2], _f4(1.0))


@device
def bsdf_groups(b):
    """Bit set of STORED and FOLLOWED."""
    return b.groups


@device
def bsdf_is_delta(b):
    """Whether the FOLLOWED lobes are deltas."""
    return b.delta


@device
def bsdf_transmits(b):
    """Whether light may reach one side of the surface from the other."""
    return _transparent(b.p.kind)


@device
def bsdf_is_lambertian(b):
    """Whether the STORED lobes reflect the same in all directions, so that irradiance says everything."""
    return b.p.kind == DIFFUSE


@device
def bsdf_albedo(b, wo):
    """Rough share of light from wo that is reflected (red, green, blue); of glass the reflected tint."""
    return b.albedo


@device
def sees_side(b, group, ng, wo, wi):
    """Whether light from wi can reach wo by this group, by the geometric normal: on one side, or through.

    Where a map tilts the normal of glass, the surface and its lobes must agree on wi's side, as in Mitsuba.
    """
    if group == FOLLOWED and _transparent(b.p.kind):
        return not b.p.mapped or dot(ng, wi) * dot(b.n, wi) * dot(ng, wo) * dot(b.n, wo) > _f4(0.0)
    return dot(ng, wo) * dot(ng, wi) > _f4(0.0)


@device
def _specular_share(b, cos):
    """Probability of the specular lobe against the diffuse base, both being there, from estimates of their albedo."""
    p = b.p
    base, lobe = p.reflectance, p.specular
    d, s = base[0] + base[1] + base[2], lobe[0] + lobe[1] + lobe[2]
    if p.kind == PLASTIC or p.kind == ROUGH_PLASTIC:
        through = coat_transmittance(p, cos)
        d, s = d * through, s * (_f4(1.0) - through)
    elif p.kind == SCHLICK:
        shadowing = schlick_shadowing(cos, p.ax * p.ay)
        d, s = d * (_f4(1.0) - shadowing), s * shadowing
    return s / max(s + d, _f4(1e-20))


@device
def followed_share(b, wo):
    """Probability with which a path that can take one group only takes FOLLOWED; 0 or 1 when there is but one."""
    if b.groups == STORED | FOLLOWED:
        return min(max(_specular_share(b, abs(dot(b.n, wo))), _LEAST), _MOST)
    return _f4(1.0) if b.groups == FOLLOWED else _f4(0.0)


@device
def _glossy_probability(b, group, cos):
    """Probability with which sampling a group takes its glossy lobe instead of its diffuse one."""
    if b.glossy != group:
        return _f4(0.0)
    if group == FOLLOWED or not _diffuse_base(b.p):
        return _f4(1.0)
    return min(max(_specular_share(b, cos), _LEAST), _MOST)


@device
def _f_pdf(b, group, o, i):
    p = b.p
    if b.groups & group == 0 or (group == FOLLOWED and b.delta):
        return _BLACK, _f4(0.0)
    if p.kind == ROUGH_DIELECTRIC:
        return rough_dielectric_f_pdf(p, o, i)
    if p.kind == DIFFUSE_TRANSMITTER:
        return diffuse_transmission(p.transmittance, o, i)
    if p.kind == DIFFUSE:
        if i[2] <= _f4(0.0):
            return _BLACK, _f4(0.0)
        return scale(p.reflectance, _INV_PI), i[2] * _INV_PI
    if o[2] <= _f4(0.0) or i[2] <= _f4(0.0):
        return _BLACK, _f4(0.0)
    share = _glossy_probability(b, group, o[2])
    f, pdf = _BLACK, _f4(0.0)
    if share > _f4(0.0):
        f, pdf = glossy_f_pdf(p, o, i)
        pdf *= share
    if share < _f4(1.0):
        if p.kind == PLASTIC or p.kind == ROUGH_PLASTIC:
            base = coated_diffuse(p, o[2], i[2])
        elif p.kind == SCHLICK:
            base = schlick_diffuse(p, o[2], i[2])
        else:
            base = scale(p.reflectance, _INV_PI)
        f = add(f, base)
        pdf += (_f4(1.0) - share) * i[2] * _INV_PI
    if p.kind == SCHLICK:
        f = scale(f, schlick_limit(p, o[2], i[2]))
    return f, pdf


@device
def bsdf_f_pdf(b, group, wo, wi):
    """(f, pdf) of a group's lobes: what `bsdf_f` and `bsdf_pdf` give, in one evaluation."""
    return _f_pdf(b, group, local(b, wo), local(b, wi))


@device
def bsdf_f(b, group, wo, wi):
    """Value of a group's lobes (red, green, blue); 0 for deltas and for the wrong side."""
    return _f_pdf(b, group, local(b, wo), local(b, wi))[0]


@device
def bsdf_pdf(b, group, wo, wi):
    """Density per solid angle of `bsdf_sample` within the group; 0 for deltas."""
    return _f_pdf(b, group, local(b, wo), local(b, wi))[1]


@device
def bsdf_compression(b, wo, wi):
    """(n_i/n_t)² when light from wi reaches wo by refraction, else 1: what radiance is multiplied by besides f."""
    p = b.p
    if p.kind != DIELECTRIC and p.kind != ROUGH_DIELECTRIC:
        return _f4(1.0)
    side = dot(b.n, wo)
    if side * dot(b.n, wi) >= _f4(0.0):
        return _f4(1.0)
    return _f4(1.0) / (p.eta * p.eta) if side > _f4(0.0) else p.eta * p.eta


@device
def bsdf_mirrored_share(b, wo):
    """Probability with which FOLLOWED lobes reflect where they are smooth glass; 1 of all else."""
    if b.groups & FOLLOWED == 0 or not b.delta:
        return _f4(1.0)
    return smooth_reflectance(b.p, local(b, wo))


@device
def bsdf_sample(b, group, wo, u_lobe, u, v):
    """A direction from a group's lobes: (wi, f·|cos|/pdf, pdf, compression). The pdf of a delta is 0.

    A weight of zero means absorbed; wi is then wo.
    """
    p = b.p
    o = local(b, wo)
    if b.groups & group == 0:
        return wo, _BLACK, _f4(0.0), _f4(1.0)
    if group == FOLLOWED and b.delta:
        i, weight, compression = smooth_lobe(p, o, u_lobe)
        return world(b, i), weight, _f4(0.0), compression
    if p.kind == ROUGH_DIELECTRIC:
        i, useful = sample_rough_dielectric(p, o, u_lobe, u, v)
        if useful == 0:
            return wo, _BLACK, _f4(0.0), _f4(1.0)
    elif p.kind == DIFFUSE_TRANSMITTER:
        i = sample_other_side(o, u, v)
    elif p.kind != DIFFUSE and o[2] <= _f4(0.0):
        return wo, _BLACK, _f4(0.0), _f4(1.0)
    elif u_lobe < _glossy_probability(b, group, o[2]):
        i = sample_glossy(p, o, u, v)
    else:
        i = square_to_cosine_hemisphere(u, v)
    f, pdf = _f_pdf(b, group, o, i)
    if not pdf > _f4(0.0):
        return wo, _BLACK, _f4(0.0), _f4(1.0)
    wi = world(b, i)
    return wi, scale(f, abs(i[2]) / pdf), pdf, bsdf_compression(b, wo, wi)
