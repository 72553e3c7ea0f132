"""The materials of simple scenes: diffuse, mirror, smooth glass.

Functions and conventions are those of `pmviewer.kernels.bsdf.scattering`, which chooses between them and the richer
ones.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.bsdf.kinds import CONDUCTOR, DIFFUSE
from pmviewer.kernels.bsdf.specular import scatter_specular
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.scene import material_kind, material_two_sided, reflectance
from pmviewer.kernels.textures.normal_map import reflecting_normal, shows_back
from pmviewer.kernels.vector import dot, from_basis, scale
from pmviewer.kernels.warp import square_to_cosine_hemisphere

_f4 = np.float32
_i4 = np.int32
INV_PI = _f4(1.0 / math.pi)
NOTHING, STORED, FOLLOWED = _i4(0), _i4(1), _i4(2)
_BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))


class PlainBsdf(NamedTuple):
    """A surface point's BSDF: lobe groups, albedo, material, shading normal as the geometry has it and towards wo."""

    groups: Any
    albedo: Any
    material: Any
    n: Any
    facing: Any


@device
def plain_bsdf(scene, material, ng, ns, wo):
    """The BSDF at a point with geometric and shading normals ng and ns, seen from wo."""
    albedo = reflectance(scene, material)
    kind = material_kind(scene, material)
    if kind != DIFFUSE and kind != CONDUCTOR:
        return PlainBsdf(FOLLOWED, albedo, material, ns, ns)
    if not material_two_sided(scene, material) and shows_back(kind == DIFFUSE, ng, ns, wo):
        return PlainBsdf(NOTHING, albedo, material, ns, ns)
    if dot(ng, wo) < _f4(0.0):
        ng, ns = scale(ng, _f4(-1.0)), scale(ns, _f4(-1.0))
    if not albedo[0] + albedo[1] + albedo[2] > _f4(0.0):
        return PlainBsdf(NOTHING, albedo, material, ns, ns)
    if kind == CONDUCTOR:
        n = reflecting_normal(ns, ng, wo)
        return PlainBsdf(FOLLOWED, albedo, material, n, n)
    return PlainBsdf(STORED, albedo, material, ns, ns)


@device
def plain_f(b, group, wo, wi):
    """Albedo over π on the side of wo; 0 for mirrors and glass, whose lobes are deltas."""
    if group != STORED or dot(b.facing, wi) <= _f4(0.0):
        return _BLACK
    return scale(b.albedo, INV_PI)


@device
def plain_pdf(b, group, wo, wi):
    """Cosine over π, per solid angle; 0 for deltas."""
    if group != STORED:
        return _f4(0.0)
    return max(dot(b.facing, wi), _f4(0.0)) * INV_PI


@device
def plain_sample(scene, b, group, wo, u_lobe, u, v):
    """(wi, f·|cos|/pdf, pdf, compression); the pdf of a delta is 0."""
    if group == STORED:
        local = square_to_cosine_hemisphere(u, v)
        wi = from_basis(b.facing, local[0], local[1], local[2])
        return wi, b.albedo, local[2] * INV_PI, _f4(1.0)
    # Not by u_lobe: whoever draws it finds it unused, and its computation goes.
    wi, weight, compression = scatter_specular(scene, b.material, b.n, (-wo[0], -wo[1], -wo[2]), u)
    return wi, weight, _f4(0.0), compression
