"""The one walk over mirrors, glass and smooth gloss: from the camera, in replays of a pixel, and for gather rays.

Whoever walks asks the same functions with the same numbers, so that a replay meets what the picture met.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import (
    FOLLOWED,
    STORED,
    attenuation,
    bsdf_at,
    bsdf_sample,
    chain_numbers,
    same_side,
)
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.dimensions import CHAIN
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import face, surface_at
from pmviewer.kernels.vector import largest, mul, scale
from pmviewer.render.given import SurfaceInteraction

_f4 = np.float32
FORKS = 3
"""Chains that fork go on at least so deep before they are thinned out."""
BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))


@device
def arrive(scene, eye, o, d, t, prim, u, v, beta):
    """A ray from o in direction d met primitive `prim` at the distance t, there at (u, v).

    Returns the geometric normal as the surface has it, the surface interaction, and beta after the way there.
    """
    p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
    wo = (-d[0], -d[1], -d[2])
    material = material_of(scene, prim)
    beta = attenuation(scene, material, ng, d, t, beta)
    b = bsdf_at(scene, prim, material, u, v, p, ng, ns, wo, eye.glossy)
    return ng, SurfaceInteraction(p, face(ng, wo), gap, b, wo), beta


@device
def follow(scene, si, beta, u_lobe, u, v):
    """A direction by the FOLLOWED lobes: (wi, beta after it, density; 0 of a delta). beta is black where the path ends,
    as where the lobe of a shading normal dips below the surface."""
    wi, weight, pdf, compression = bsdf_sample(scene, si.bsdf, FOLLOWED, si.wo, u_lobe, u, v)
    if same_side(si.bsdf, FOLLOWED, si.ng, si.wo, wi) == 0:
        return wi, BLACK, pdf
    return wi, scale(mul(beta, weight), compression), pdf


@device
def follow_camera_path(given, si, beta, seed, depth):
    """`follow` at the surface number `depth` of a path from the camera, which is thinned out where it forks often."""
    eye = given.eye
    u_lobe, u, v, u_end = chain_numbers(given.scene, eye.sequence, seed, eye.index, CHAIN + depth)
    wi, beta, pdf = follow(given.scene, si, beta, u_lobe, u, v)
    if si.bsdf.groups & STORED != 0 and depth >= FORKS:
        survival = min(largest(beta), _f4(1.0))
        if not u_end < survival:
            return wi, BLACK, pdf
        beta = scale(beta, _f4(1.0) / survival)
    return wi, beta, pdf
