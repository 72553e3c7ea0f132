"""A material's numbers at a hit: its row in the table, or what its textures say there."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.jit import device
from pmviewer.kernels.material import MaterialParams, material_params
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.microfacet import SMOOTHEST
from pmviewer.kernels.scene import (
    M_ALPHA_MAP,
    M_REFLECTANCE_MAP,
    M_SPECULAR_MAP,
    M_TRANSMITTANCE_MAP,
    MATERIAL_COLUMNS,
)
from pmviewer.kernels.texture import texture_rgb, texture_value
from pmviewer.kernels.uv import hit_uv

_f4 = np.float32


@device
def texture_params(scene, material, prim, b1, b2, p):
    """The material's numbers at the point p of primitive `prim` with a triangle's barycentric coordinates (b1, b2).

    A texture of roughness keeps the ratio of the two directions, and the material's tables are those of its mean.
    """
    plain = material_params(scene, material)
    row = material * MATERIAL_COLUMNS
    m = scene.materials
    reflectance_map = np.int64(load_f4(m, row + M_REFLECTANCE_MAP))
    specular_map = np.int64(load_f4(m, row + M_SPECULAR_MAP))
    alpha_map = np.int64(load_f4(m, row + M_ALPHA_MAP))
    transmittance_map = np.int64(load_f4(m, row + M_TRANSMITTANCE_MAP))
    if max(max(reflectance_map, specular_map), max(alpha_map, transmittance_map)) < 0:
        return plain
    u, v = hit_uv(scene, prim, b1, b2, p)
    reflectance, specular, transmittance = plain.reflectance, plain.specular, plain.transmittance
    ax, ay = plain.ax, plain.ay
    if reflectance_map >= 0:
        reflectance = texture_rgb(scene, reflectance_map, u, v)
    if specular_map >= 0:
        specular = texture_rgb(scene, specular_map, u, v)
    if transmittance_map >= 0:
        transmittance = texture_rgb(scene, transmittance_map, u, v)
    if alpha_map >= 0:
        value = texture_value(scene, alpha_map, u, v)
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
    )
