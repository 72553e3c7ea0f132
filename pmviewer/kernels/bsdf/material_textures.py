"""A material's numbers at a hit: its row in the table, or what its textures say there."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.accel.instance import stored_prim
from pmviewer.kernels.bsdf.kinds import PRINCIPLED
from pmviewer.kernels.bsdf.material import MaterialParams, material_params
from pmviewer.kernels.bsdf.microfacet import SMOOTHEST
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import (
    M_ACROSS_MAP,
    M_ALPHA_MAP,
    M_COLOURED,
    M_REFLECTANCE_MAP,
    M_SPECULAR_MAP,
    M_TRANSMITTANCE_MAP,
    MATERIAL_COLUMNS,
    load3,
)
from pmviewer.kernels.textures.texture import texture_rgb, texture_value
from pmviewer.kernels.textures.uv import hit_uv
from pmviewer.kernels.vector import mul

_f4 = np.float32


@specialised
def is_tinted(scene, material):
    """Whether colours at a mesh's vertices multiply the material's reflectance."""
    if not has(scene, "colours"):
        return lambda scene, material: False
    return lambda scene, material: load_f4(scene.materials, material * MATERIAL_COLUMNS + M_COLOURED) != _f4(0.0)


@specialised
def tinted(scene, material, prim, b1, b2, reflectance):
    """The reflectance times the colour that the vertices of primitive `prim` give its point (b1, b2)."""
    if not has(scene, "colours"):
        return lambda scene, material, prim, b1, b2, reflectance: reflectance

    def coloured(scene, material, prim, b1, b2, reflectance):
        stored = stored_prim(scene, prim)
        if stored >= scene.n_triangles or not is_tinted(scene, material):
            return reflectance
        at = np.int64(stored) * 9
        a, b, c = load3(scene.colours, at), load3(scene.colours, at + 3), load3(scene.colours, at + 6)
        b0 = _f4(1.0) - b1 - b2
        return mul(
            reflectance,
            (
                max(_f4(0.0), b0 * a[0] + b1 * b[0] + b2 * c[0]),
                max(_f4(0.0), b0 * a[1] + b1 * b[1] + b2 * c[1]),
                max(_f4(0.0), b0 * a[2] + b1 * b[2] + b2 * c[2]),
            ),
        )

    return coloured


@device
def texture_params(scene, material, prim, b1, b2, p):
    """The material's numbers at the point p of primitive `prim` with a triangle's barycentric coordinates (b1, b2).

    A texture of roughness keeps the ratio of the two directions unless each has its own, and the material's tables are
    those of its mean.
    """
    plain = material_params(scene, material)
    row = material * MATERIAL_COLUMNS
    m = scene.materials
    reflectance_map = np.int64(load_f4(m, row + M_REFLECTANCE_MAP))
    specular_map = np.int64(load_f4(m, row + M_SPECULAR_MAP))
    alpha_map = np.int64(load_f4(m, row + M_ALPHA_MAP))
    transmittance_map = np.int64(load_f4(m, row + M_TRANSMITTANCE_MAP))
    mapped = max(max(reflectance_map, specular_map), max(alpha_map, transmittance_map)) >= 0
    if not mapped and not is_tinted(scene, material):
        return plain
    u, v = hit_uv(scene, prim, b1, b2, p)
    reflectance, specular, transmittance = plain.reflectance, plain.specular, plain.transmittance
    ax, ay = plain.ax, plain.ay
    if reflectance_map >= 0:
        reflectance = texture_rgb(scene, reflectance_map, u, v)
    reflectance = tinted(scene, material, prim, b1, b2, reflectance)
    if specular_map >= 0:
        specular = texture_rgb(scene, specular_map, u, v)
    if transmittance_map >= 0:
        transmittance = texture_rgb(scene, transmittance_map, u, v)
    if alpha_map >= 0:
        value = texture_value(scene, alpha_map, u, v)
        across_map = np.int64(-1) if plain.kind == PRINCIPLED else np.int64(load_f4(m, row + M_ACROSS_MAP))
        if across_map >= 0:
            ax, ay = max(SMOOTHEST, value), max(SMOOTHEST, texture_value(scene, across_map, u, v))
        else:
            middle = _f4(math.sqrt(ax * ay))
            ax, ay = max(SMOOTHEST, value * (ax / middle)), max(SMOOTHEST, value * (ay / middle))
    return MaterialParams(
        plain.kind,
        plain.two_sided,
        reflectance,
        specular,
        transmittance,
        plain.eta,
        plain.eta_rgb,
        plain.k_rgb,
        ax,
        ay,
        plain.distribution,
        plain.nonlinear,
        plain.inner,
        plain.table,
        plain.mapped,
        plain.glass,
    )
