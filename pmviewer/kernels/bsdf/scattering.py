"""What integrators know of materials: one interface, compiled for simple scenes or for rich ones.

A material's lobes fall into two groups, and a path is told apart by the group that it took, the same way by photons,
eye paths and the path tracer:

- STORED lobes: photons are stored for them and looked up with them; diffuse reflection, and glossy reflection from a
  roughness of `glossy` on. They never transmit.
- FOLLOWED lobes are sampled and followed, as mirrors are: smooth ones, smoother glossy ones, everything that transmits.
  Of one material either all of them are deltas or none.

Directions are unit vectors that point away from the surface. `f` never contains the cosine. On refraction f is that of
power; radiance is multiplied by the `compression` (n_i/n_t)² as well.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from pmviewer.kernels.bsdf import lobes
from pmviewer.kernels.bsdf import principled as principled_bsdf
from pmviewer.kernels.bsdf.blend import blend_keeps, chosen_part, inside_attenuation
from pmviewer.kernels.bsdf.kinds import BLEND
from pmviewer.kernels.bsdf.material import at_wave
from pmviewer.kernels.bsdf.material_textures import texture_params
from pmviewer.kernels.bsdf.plain import (
    FOLLOWED,
    NOTHING,
    STORED,
    PlainBsdf,
    plain_bsdf,
    plain_f,
    plain_pdf,
    plain_sample,
)
from pmviewer.kernels.bsdf.principled_lobes import metallic_at
from pmviewer.kernels.bsdf.specular import glass_reflectance
from pmviewer.kernels.compile.specialise import has, is_a, specialised
from pmviewer.kernels.random import draw1, draw4
from pmviewer.kernels.scene import material_kind
from pmviewer.kernels.textures.normal_map import shading_frame
from pmviewer.kernels.vector import dot, scale

__all__ = [
    "FOLLOWED",
    "NOTHING",
    "STORED",
    "attenuation",
    "bsdf_at",
    "bsdf_f",
    "bsdf_pdf",
    "bsdf_sample",
    "chain_numbers",
    "compressed",
    "followed_share",
    "is_delta",
    "is_lambertian",
    "is_plain",
    "keeps",
    "mirrored_share",
    "pick_group",
    "same_side",
    "shading_normal",
    "transmits",
]


_f4 = np.float32


def is_plain(b: object) -> bool:
    """Whether the type of a BSDF in a kernel is that of simple scenes."""
    return is_a(b, PlainBsdf)


def _rich(b: Any) -> ModuleType:
    """The module that knows a BSDF's type in kernels of rich scenes."""
    return principled_bsdf if is_a(b, principled_bsdf.AnyBsdf) else lobes


@specialised
def bsdf_at(scene, prim, material, u, v, p, ng, ns, wo, glossy, wave):
    """The BSDF at the point p of primitive `prim`, at its coordinates (u, v), with normals ng and ns, seen from wo by a
    path of that wave (`pmviewer.kernels.bsdf.dispersion`; None for the middle index).

    Of a blend it is that of the part that counts at this hit (`pmviewer.kernels.bsdf.blend`). Its fields `groups`
    (NOTHING, or bits STORED and FOLLOWED) and `albedo` are for anyone to read. A black surface, or the back of a
    one-sided one, has no groups.
    """
    if has(scene, "blends"):

        def blended(scene, prim, material, u, v, p, ng, ns, wo, glossy, wave):
            part = chosen_part(scene, material, prim, u, v, p, ng, wo)
            return unblended(scene, prim, part, u, v, p, ng, ns, wo, glossy, wave)

        return blended
    return _unblended(scene, prim, material, u, v, p, ng, ns, wo, glossy, wave)


def _unblended(scene, prim, material, u, v, p, ng, ns, wo, glossy, wave):
    """`bsdf_at` of a material that is no blend."""
    if has(scene, "principled"):
        return _with_principled(scene)

    if has(scene, "bsdfs") and has(scene, "textures"):

        def textured(scene, prim, material, u, v, p, ng, ns, wo, glossy, wave):
            numbers = texture_params(scene, material, prim, u, v, p)
            ns, tangent = shading_frame(scene, material, prim, u, v, p, ng, ns, wo)
            numbers = at_wave(scene, numbers, ns, wo, wave)
            return lobes.bsdf_at(scene, material, numbers, ng, ns, tangent, wo, glossy)

        return textured

    if has(scene, "bsdfs"):

        def rich(scene, prim, material, u, v, p, ng, ns, wo, glossy, wave):
            tangent = (_f4(0.0), _f4(0.0), _f4(0.0))
            numbers = at_wave(scene, lobes.material_params(scene, material), ns, wo, wave)
            return lobes.bsdf_at(scene, material, numbers, ng, ns, tangent, wo, glossy)

        return rich

    def plain(scene, prim, material, u, v, p, ng, ns, wo, glossy, wave):
        return plain_bsdf(scene, material, ng, ns, wo)

    return plain


unblended = specialised(_unblended)


def _with_principled(scene):
    """`unblended` for scenes with principled materials, by the type of the scene's record."""
    if has(scene, "textures"):

        def textured(scene, prim, material, u, v, p, ng, ns, wo, glossy, wave):
            numbers = texture_params(scene, material, prim, u, v, p)
            metallic = metallic_at(scene, material, prim, u, v, p)
            ns, tangent = shading_frame(scene, material, prim, u, v, p, ng, ns, wo)
            numbers = at_wave(scene, numbers, ns, wo, wave)
            return principled_bsdf.bsdf_at(scene, material, numbers, metallic, ng, ns, tangent, wo, glossy)

        return textured

    def untextured(scene, prim, material, u, v, p, ng, ns, wo, glossy, wave):
        tangent = (_f4(0.0), _f4(0.0), _f4(0.0))
        numbers = at_wave(scene, lobes.material_params(scene, material), ns, wo, wave)
        metallic = metallic_at(scene, material, prim, u, v, p)
        return principled_bsdf.bsdf_at(scene, material, numbers, metallic, ng, ns, tangent, wo, glossy)

    return untextured


@specialised
def keeps(scene, material, b, ng, wo, glossy):
    """The groups that photons are kept for at a hit seen from wo: STORED, and FOLLOWED where such lobes are no deltas.

    b is the BSDF there and ng the surface's normal, outwards. Of a blend, where b is that of one part, those of all.
    """

    def own(scene, material, b, ng, wo, glossy):
        return b.groups & STORED if is_delta(b) else b.groups

    if not has(scene, "blends"):
        return own

    def blended(scene, material, b, ng, wo, glossy):
        if material_kind(scene, material) == BLEND:
            return blend_keeps(scene, material, dot(ng, wo) < _f4(0.0), glossy)
        return b.groups & STORED if is_delta(b) else b.groups

    return blended


@specialised
def bsdf_f(b, group, wo, wi):
    """Value of a group's lobes (red, green, blue); 0 for deltas."""
    if not is_plain(b):
        f = _rich(b).bsdf_f
        return lambda b, group, wo, wi: f(b, group, wo, wi)
    return lambda b, group, wo, wi: plain_f(b, group, wo, wi)


@specialised
def bsdf_pdf(b, group, wo, wi):
    """Density per solid angle of `bsdf_sample` within the group; 0 for deltas."""
    if not is_plain(b):
        f = _rich(b).bsdf_pdf
        return lambda b, group, wo, wi: f(b, group, wo, wi)
    return lambda b, group, wo, wi: plain_pdf(b, group, wo, wi)


@specialised
def bsdf_sample(scene, b, group, wo, u_lobe, u, v):
    """A direction from the group's lobes: (wi, f·|cos|/pdf, pdf, compression); the pdf of a delta is 0."""
    if not is_plain(b):
        f = _rich(b).bsdf_sample
        return lambda scene, b, group, wo, u_lobe, u, v: f(b, group, wo, u_lobe, u, v)
    return lambda scene, b, group, wo, u_lobe, u, v: plain_sample(scene, b, group, wo, u_lobe, u, v)


@specialised
def same_side(b, group, ng, wo, wi):
    """1 when wi may leave the surface by the group: on the side of ng, which points to wo, or by transmission."""
    if not is_plain(b):
        f = _rich(b).sees_side
        return lambda b, group, ng, wo, wi: 1 if f(b, group, ng, wo, wi) else 0
    return lambda b, group, ng, wo, wi: 1 if group == FOLLOWED or dot(ng, wi) > _f4(0.0) else 0


@specialised
def shading_normal(b):
    """The normal that cosines are measured with."""
    if not is_plain(b):
        return lambda b: b.n
    return lambda b: b.facing


@specialised
def followed_share(b, wo):
    """Probability with which a path that can take one group only takes FOLLOWED; 0 or 1 when there is but one."""
    if not is_plain(b):
        f = _rich(b).followed_share
        return lambda b, wo: f(b, wo)
    return lambda b, wo: _f4(1.0) if b.groups == FOLLOWED else _f4(0.0)


@specialised
def pick_group(b, wo, u):
    """A group for a path that can take one only: (group, one over its probability, a number to use again)."""
    if not is_plain(b):
        share_of = _rich(b).followed_share

        def rich(b, wo, u):
            share = share_of(b, wo)
            if u < share:
                return FOLLOWED, _f4(1.0) / share, u / share
            rest = _f4(1.0) - share
            return STORED, _f4(1.0) / rest, min((u - share) / rest, _f4(0.99999994))

        return rich
    return lambda b, wo, u: (b.groups, _f4(1.0), u)


@specialised
def transmits(b):
    """Whether the FOLLOWED lobes may transmit light."""
    if not is_plain(b):
        f = _rich(b).bsdf_transmits
        return lambda b: f(b)
    return lambda b: False


@specialised
def compressed(b, wo, wi, f):
    """f for radiance from wi: times the `compression` (n_i/n_t)², given apart by `bsdf_sample`, if refracted."""
    if not is_plain(b):
        factor = _rich(b).bsdf_compression
        return lambda b, wo, wi, f: scale(f, factor(b, wo, wi))
    return lambda b, wo, wi, f: f


@specialised
def is_delta(b):
    """Whether the FOLLOWED lobes are deltas."""
    if not is_plain(b):
        return lambda b: b.delta
    return lambda b: True


@specialised
def is_lambertian(b):
    """Whether the STORED lobes are Lambertian, so that irradiance says everything."""
    if not is_plain(b):
        f = _rich(b).bsdf_is_lambertian
        return lambda b: f(b)
    return lambda b: True


@specialised
def mirrored_share(scene, b, wo):
    """Probability with which FOLLOWED lobes reflect where they are smooth glass; 1 of all else."""
    if is_plain(b):
        return lambda scene, b, wo: glass_reflectance(scene, b.material, b.n, wo)
    f = _rich(b).bsdf_mirrored_share
    return lambda scene, b, wo: f(b, wo)


@specialised
def chain_numbers(scene, sequence, seed, index, dimension):
    """Four numbers for following a lobe: for the choice of lobe, two for the direction, one for roulette.

    Simple materials use the first of the direction's alone.
    """
    if has(scene, "bsdfs"):
        return lambda scene, sequence, seed, index, dimension: draw4(sequence, seed, index, dimension)

    def one(scene, sequence, seed, index, dimension):
        return _f4(0.0), draw1(sequence, seed, index, dimension), _f4(0.0), _f4(0.0)

    return one


@specialised
def attenuation(scene, material, ng, d, t, beta):
    """beta after a ray of direction d and length t that ends on this material: less when it came through a dielectric
    that absorbs (Beer–Lambert)."""
    if has(scene, "blends") or has(scene, "principled"):
        return lambda scene, material, ng, d, t, beta: inside_attenuation(scene, material, ng, d, t, beta)
    if has(scene, "bsdfs"):
        return lambda scene, material, ng, d, t, beta: lobes.interior_attenuation(scene, material, ng, d, t, beta)
    return lambda scene, material, ng, d, t, beta: beta
