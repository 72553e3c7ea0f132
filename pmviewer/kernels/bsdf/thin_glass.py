"""Panes of glass so thin that rays may go straight through them (R9; course guide §6.2.3).

By the rule of its material a pane is

- THIN_EXACT: glass like any other;
- THIN_IGNORED: not there (solution A);
- THIN_TINTED: passed straight (solution B). Photons refract and reflect there and keep their path class, so that they
  are stored without the caustic map. Rays that leave a surface by its STORED lobes go straight on, times what the pane
  transmits in its direction: (1 − R)·t, R being a thin pane's reflectance with all reflections between its faces,
  or that of the one face met. Light that goes through a `thindielectric` is exact, that through a slab of dielectric
  lacks displacement and focus; what panes reflect onto the surface seen is missing, as in the source;
- THIN_REFLECTING: the same, but what panes reflect is a caustic as that of all glass is, and nothing is missing.

A pane that is a light is always exact.

Scenes' records without the field `thin` compile none of this.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pmviewer.kernels.bsdf.kinds import THIN_DIELECTRIC
from pmviewer.kernels.bsdf.material_textures import texture_params
from pmviewer.kernels.bsdf.smooth import thin_reflectance
from pmviewer.kernels.bsdf.specular import fresnel_dielectric
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import (
    M_THIN,
    MATERIAL_COLUMNS,
    THIN_BY_SETTING,
    THIN_EXACT,
    THIN_IGNORED,
    THIN_REFLECTING,
    THIN_TINTED,
    light_of,
    material_eta,
    material_kind,
    transmittance,
)
from pmviewer.kernels.vector import dot, scale

_f4 = np.float32
_i4 = np.int32


def has_thin_glass(scene: Any) -> bool:
    """Does a scene's record, or its type, hold panes that rays pass straight?"""
    return has(scene, "thin")


@device
def thin_rule(scene, prim, material):
    """What becomes of rays at the primitive: one of the rules above."""
    rule = _i4(load_f4(scene.materials, material * MATERIAL_COLUMNS + M_THIN))
    if rule == THIN_BY_SETTING:
        rule = _i4(scene.thin)
    if rule != THIN_EXACT and light_of(scene, prim) >= 0:
        rule = _i4(THIN_EXACT)
    return rule


@specialised
def is_ignored(scene, prim, material):
    """Whether photons meet nothing at the primitive."""
    if not has_thin_glass(scene):
        return lambda scene, prim, material: False
    return lambda scene, prim, material: thin_rule(scene, prim, material) == THIN_IGNORED


@specialised
def keeps_class(scene, prim, material, ng, d):
    """Whether a photon that goes on in direction d, from the side of the normal ng, has the path class that it had."""
    if not has_thin_glass(scene):
        return lambda scene, prim, material, ng, d: False

    def of_pane(scene, prim, material, ng, d):
        rule = thin_rule(scene, prim, material)
        return rule == THIN_TINTED or (rule == THIN_REFLECTING and dot(ng, d) < _f4(0.0))

    return of_pane


@specialised
def own_transmittance(scene, prim, material, u, v, p):
    """The colour t of light that goes through the pane at its point p."""
    if not (has(scene, "bsdfs") and has(scene, "textures")):
        return lambda scene, prim, material, u, v, p: transmittance(scene, material)
    return lambda scene, prim, material, u, v, p: texture_params(scene, material, prim, u, v, p).transmittance


@device
def straight_transmittance(scene, prim, material, u, v, p, cos):
    """(1 − R)·t of the pane, or of the one face of a slab, under the cosine `cos` to its normal. A ray that goes
    straight through a slab meets both faces at the angle outside, as the refracted one does in effect: parallel faces
    reflect the same from within."""
    eta = material_eta(scene, material)
    if material_kind(scene, material) == THIN_DIELECTRIC:
        reflected = thin_reflectance(cos, eta)
    else:
        reflected, _ = fresnel_dielectric(cos, eta)
    return scale(own_transmittance(scene, prim, material, u, v, p), _f4(1.0) - reflected)
