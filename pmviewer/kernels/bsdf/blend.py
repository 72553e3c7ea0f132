"""Blends of materials: at each hit one part is chosen, by a hash of the hit, with the probability of its share, or by
the side that is seen.

A reflected or refracted radiance is linear in f, so that the mean over choices is that of the blend, whichever method
follows the path; no random number of a path is spent on it, and the same hit seen again has the same part. Whether
photons are stored must not hang on the choice, for those who look them up choose anew: `keeps` asks all parts.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.kinds import BLEND, DIELECTRIC, PRINCIPLED, ROUGH_DIELECTRIC
from pmviewer.kernels.bsdf.material import beer_lambert
from pmviewer.kernels.bsdf.plain import FOLLOWED, NOTHING, STORED
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.dimensions import BLEND_SALT
from pmviewer.kernels.memory import bits_of_float, load_f4
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.kernels.scene import (
    BY_SIDE,
    M_FOLLOWS_BACK,
    M_FOLLOWS_FRONT,
    M_PART_0,
    M_PART_1,
    M_STORES_BACK,
    M_STORES_FRONT,
    M_WEIGHT,
    M_WEIGHT_MAP,
    MATERIAL_COLUMNS,
    material_kind,
)
from pmviewer.kernels.textures.texture import texture_value
from pmviewer.kernels.textures.uv import hit_uv
from pmviewer.kernels.vector import dot

_f4 = np.float32
_u4 = np.uint32


@device
def hit_number(p, wo, prim, salt):
    """A number in [0, 1) that is a function of the hit: point, direction, primitive; independent for each salt."""
    h = hash3(bits_of_float(p[0]), bits_of_float(p[1]), bits_of_float(p[2]))
    h = hash3(h, bits_of_float(wo[0]), bits_of_float(wo[1]))
    h = hash3(h, bits_of_float(wo[2]), _u4(prim))
    return unit_float(hash3(h, _u4(salt), _u4(BLEND_SALT)))


@specialised
def weight_at(scene, material, prim, b1, b2, p):
    """Share of a blend's second part at the point p of primitive `prim`, at its coordinates (b1, b2)."""
    if not has(scene, "textures"):
        return lambda scene, material, prim, b1, b2, p: load_f4(scene.materials, material * MATERIAL_COLUMNS + M_WEIGHT)

    def textured(scene, material, prim, b1, b2, p):
        row = material * MATERIAL_COLUMNS
        texture = np.int64(load_f4(scene.materials, row + M_WEIGHT_MAP))
        if texture < 0:
            return load_f4(scene.materials, row + M_WEIGHT)
        u, v = hit_uv(scene, prim, b1, b2, p)
        return texture_value(scene, texture, u, v)

    return textured


@device
def chosen_part(scene, material, prim, b1, b2, p, ng, wo):
    """The material itself, or the part of a blend that counts at this hit; blends of blends choose again. ng is the
    surface's normal, outwards."""
    while material_kind(scene, material) == BLEND:
        weight = weight_at(scene, material, prim, b1, b2, p)
        second = dot(ng, wo) < _f4(0.0) if weight >= _f4(BY_SIDE) else hit_number(p, wo, prim, material) < weight
        row = material * MATERIAL_COLUMNS
        material = np.int64(load_f4(scene.materials, row + (M_PART_1 if second else M_PART_0)))
    return material


@device
def blend_keeps(scene, material, back, glossy):
    """The groups of photons that are kept on a blend: STORED and FOLLOWED as for `scattering.keeps`."""
    row = material * MATERIAL_COLUMNS
    groups = NOTHING
    if load_f4(scene.materials, row + (M_STORES_BACK if back else M_STORES_FRONT)) >= glossy:
        groups |= STORED
    if load_f4(scene.materials, row + (M_FOLLOWS_BACK if back else M_FOLLOWS_FRONT)) < glossy:
        groups |= FOLLOWED
    return groups


@device
def inside_attenuation(scene, material, ng, d, t, beta):
    """`material.interior_attenuation` for principled materials and blends as well."""
    kind = material_kind(scene, material)
    if kind in (DIELECTRIC, ROUGH_DIELECTRIC, PRINCIPLED, BLEND) and dot(ng, d) > _f4(0.0):
        a = beer_lambert(scene, material, t)
        return beta[0] * a[0], beta[1] * a[1], beta[2] * a[2]
    return beta
