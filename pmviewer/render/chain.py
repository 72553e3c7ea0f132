"""The one walk over mirrors, glass and smooth gloss: from the camera, in replays of a pixel, for gather rays, importons
and the path tracer.

Whoever walks casts a ray (`pmviewer.render.cast`), arrives, and follows or scatters. Replays of a pixel do so with the
numbers of the eye pass (`follow_camera_path`), so that they meet what the picture met.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.dispersion import colour_of_split, met_by
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
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.dimensions import CHAIN
from pmviewer.kernels.media.medium import has_media, medium_beyond
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import face
from pmviewer.kernels.vector import mul, scale
from pmviewer.render.cast import leaving
from pmviewer.render.given import SurfaceInteraction

_f4 = np.float32
CERTAIN = _f4(-1.0)
"""In place of a number for roulette where there is none."""
BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))
WHITE = (_f4(1.0), _f4(1.0), _f4(1.0))


@device
def arrive(scene, glossy, d, hit, beta):
    """A ray of direction d met a surface (`pmviewer.render.cast`): the SurfaceInteraction there, lobes being stored
    from the roughness `glossy` on, and beta after the way."""
    material = material_of(scene, hit.prim)
    wo = (-d[0], -d[1], -d[2])
    beta = attenuation(scene, material, hit.ng, d, hit.t, beta)
    b = bsdf_at(scene, hit.prim, material, hit.u, hit.v, hit.p, hit.ng, hit.ns, wo, glossy, hit.wave)
    wave, beta = met_by(scene, b, hit.wave, beta)
    return SurfaceInteraction(hit.prim, hit.p, face(hit.ng, wo), hit.gap, b, wo, _media(scene, d, hit), wave), beta


@specialised
def _media(scene, d, hit):
    """`SurfaceInteraction.media` of what a ray of direction d met."""
    if not has_media(scene):
        return lambda scene, d, hit: None
    return lambda scene, d, hit: (hit.medium, medium_beyond(scene, hit.prim, hit.ng, d, hit.medium))


@device
def scatter(scene, si, group, beta, u_lobe, u, v):
    """A direction by a group of the BSDF's lobes: (wi, beta·f·|cos|/pdf, pdf, compression), see `bsdf_sample`. beta is
    black after it where the path ends, as where the lobe of a shading normal dips below the surface."""
    wi, weight, pdf, compression = bsdf_sample(scene, si.bsdf, group, si.wo, u_lobe, u, v)
    if same_side(si.bsdf, group, si.ng, si.wo, wi) == 0:
        return wi, BLACK, pdf, compression
    return wi, colour_of_split(scene, si.bsdf, si.wave, wi, mul(beta, weight)), pdf, compression


@device
def follow(scene, si, beta, u_lobe, u, v):
    """The ray by the FOLLOWED lobes, beta after them (black where the path ends), and the density (0 of a delta)."""
    wi, beta, pdf, compression = scatter(scene, si, FOLLOWED, beta, u_lobe, u, v)
    return leaving(si, wi), scale(beta, compression), pdf


@device
def follow_camera_path(scene, eye, si, beta, u, seed, depth):
    """`follow` at the surface number `depth` of a path from the camera, and the number by which the path is thinned out
    from then on (`pmviewer.render.split.thinned`): a new one where it forks, else u that it had."""
    u_lobe, u, v, u_end = chain_numbers(scene, eye.sequence, seed, eye.index, CHAIN + depth)
    ray, beta, pdf = follow(scene, si, beta, u_lobe, u, v)
    return ray, beta, pdf, u_end if si.bsdf.groups & STORED != 0 else u
