"""A material's row as a record of parameters, which textures may change before lobes are made from them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.bsdf.dispersion import Glass, glass_of_material, index_at
from pmviewer.kernels.bsdf.kinds import DIELECTRIC, ROUGH_DIELECTRIC
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, specialised
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import (
    BSDF_TABLE_SIZE,
    M_ALPHA_X,
    M_ALPHA_Y,
    M_DISTRIBUTION,
    M_ETA,
    M_ETA_RGB,
    M_INNER,
    M_K_RGB,
    M_KIND,
    M_MAPPED,
    M_NONLINEAR,
    M_REFLECTANCE,
    M_SPECULAR,
    M_TABLE,
    M_TRANSMITTANCE,
    M_TWO_SIDED,
    MATERIAL_COLUMNS,
    load3,
    material_kind,
)
from pmviewer.kernels.vector import dot

_f4 = np.float32
_i4 = np.int32


class MaterialParams(NamedTuple):
    """Numbers of one material at one point.

    kind int32; two_sided bool; reflectance, specular, transmittance, eta_rgb, k_rgb (red, green, blue); eta inside over
    outside; ax, ay GGX or Beckmann roughness (Schlick's α is its square); distribution int32; nonlinear bool; inner the
    diffuse reflectance of a coat from below; table the address of the material's row in `bsdf_tables`; mapped bool: a
    normal or bump map tilts its normals; glass what dispersive glass is made of (`Glass`), None in scenes without.
    """

    kind: Any
    two_sided: Any
    reflectance: Any
    specular: Any
    transmittance: Any
    eta: Any
    eta_rgb: Any
    k_rgb: Any
    ax: Any
    ay: Any
    distribution: Any
    nonlinear: Any
    inner: Any
    table: Any
    mapped: Any
    glass: Any


@device
def material_params(scene, material):
    """The parameters of a material, before textures."""
    base = material * MATERIAL_COLUMNS
    row = scene.materials
    eta = load_f4(row, base + M_ETA)
    return MaterialParams(
        np.int32(load_f4(row, base + M_KIND)),
        load_f4(row, base + M_TWO_SIDED) != _f4(0.0),
        load3(row, base + M_REFLECTANCE),
        load3(row, base + M_SPECULAR),
        load3(row, base + M_TRANSMITTANCE),
        eta,
        load3(row, base + M_ETA_RGB),
        load3(row, base + M_K_RGB),
        load_f4(row, base + M_ALPHA_X),
        load_f4(row, base + M_ALPHA_Y),
        np.int32(load_f4(row, base + M_DISTRIBUTION)),
        load_f4(row, base + M_NONLINEAR) != _f4(0.0),
        load_f4(row, base + M_INNER),
        scene.bsdf_tables + np.int64(load_f4(row, base + M_TABLE)) * np.int64(4 * BSDF_TABLE_SIZE),
        load_f4(row, base + M_MAPPED) != _f4(0.0),
        glass_of_material(scene, material, eta),
    )


@specialised
def at_wave(scene, p, ns, wo, wave):
    """A material's parameters p for a path's wave (`pmviewer.kernels.bsdf.dispersion`), seen from wo at a shading
    normal ns."""
    if absent(wave):
        return lambda scene, p, ns, wo, wave: p

    def bent(scene, p, ns, wo, wave):
        row, middle = p.glass.row, p.glass.eta
        eta, lazy = p.eta, _i4(0)
        if row > 0:
            eta = index_at(scene, row, wave.u)
            if wave.split == 0 and p.kind == DIELECTRIC and middle > _f4(1.0) and dot(ns, wo) > _f4(0.0):
                lazy = _i4(1)
        return MaterialParams(
            p.kind,
            p.two_sided,
            p.reflectance,
            p.specular,
            p.transmittance,
            eta,
            p.eta_rgb,
            p.k_rgb,
            p.ax,
            p.ay,
            p.distribution,
            p.nonlinear,
            p.inner,
            p.table,
            p.mapped,
            Glass(row, middle, lazy),
        )

    return bent


@device
def beer_lambert(scene, material, distance):
    """Transmittance (red, green, blue) of a path of that length inside a dielectric: exp(−σ·distance), Beer–Lambert."""
    sigma = load3(scene.materials, material * MATERIAL_COLUMNS + M_SPECULAR)
    return (
        _f4(math.exp(-sigma[0] * distance)),
        _f4(math.exp(-sigma[1] * distance)),
        _f4(math.exp(-sigma[2] * distance)),
    )


@device
def interior_attenuation(scene, material, ng, d, t, beta):
    """beta after a ray of unit direction d and length t that ends on this material, whose outward normal is ng.

    A ray that arrives at a dielectric from behind has come through it.
    """
    kind = material_kind(scene, material)
    if kind in (DIELECTRIC, ROUGH_DIELECTRIC) and dot(ng, d) > _f4(0.0):
        a = beer_lambert(scene, material, t)
        return beta[0] * a[0], beta[1] * a[1], beta[2] * a[2]
    return beta
