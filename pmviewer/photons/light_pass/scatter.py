"""How a photon goes on from a surface: by the lobes of its material, or, far from what is small on a stage, aimed at
that (T4, T7).

Photons that lamps aim at what is small (`pmviewer.photons.projection.cones`) leave few for the floor around it, each of
as much power as many of those; what of them finds the small by chance is a bright spot. So a share AIMED of what a
floor scatters goes there under the same cones, and all of it has the power that the density of both ways says: with
the lobes' density p_b and that of the cones p_c, p_b/((1 − AIMED)·p_b + AIMED·p_c) of the usual. Nothing is biased, and
no photon has more than 1/(1 − AIMED) times that.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import STORED, bsdf_f, bsdf_pdf, bsdf_sample, same_side, shading_normal
from pmviewer.kernels.compile.jit import device, inlined
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.surface import STRAIGHT, adjoint_cosines
from pmviewer.kernels.vector import dot, scale
from pmviewer.photons.projection.cones import cones_from, density_in_cones, direction_in_cones

AIMED = 0.25
"""Share of what is scattered far away that aims at what is small."""

_f4 = np.float32
_AIMED = _f4(AIMED)
_REST = _f4(1.0 - AIMED)
_BELOW_ONE = _f4(0.99999994)
_BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))


@inlined
def scattered(scene, projection, b, group, p, wi, ng, u_lobe, u, factor):
    """A direction in which a group of lobes scatters at p, the weight of the power that goes there, and the factor for
    it that roulette does not see. `projection` as in `pmviewer.photons.projection.projected.emission`; `factor` is
    that of the photon until then."""
    d, weight, part = _direction(scene, projection, b, group, p, wi, u_lobe, u, factor)
    if same_side(b, group, ng, wi, d) == 0:  # the lobe of a shading normal may dip below the surface
        weight = _BLACK
    elif abs(dot(shading_normal(b), ng)) < STRAIGHT:
        weight = scale(weight, adjoint_cosines(shading_normal(b), ng, wi, d))
    return d, weight, part


@specialised
def _direction(scene, projection, b, group, p, wi, u_lobe, u, factor):
    """The same by shading normals alone."""
    if not has(projection, "most_factor"):

        def by_lobes(scene, projection, b, group, p, wi, u_lobe, u, factor):
            d, weight, _, _ = bsdf_sample(scene, b, group, wi, u_lobe, u[0], u[1])
            return d, weight, _f4(1.0)

        return by_lobes
    return _or_aimed


def _or_aimed(scene, projection, b, group, p, wi, u_lobe, u, factor):
    axis, distance2, cones, u0 = p, _f4(0.0), 0, u[0]
    if group == STORED and factor < projection.most_factor:
        axis, distance2, cones = cones_from(projection, p)
    if cones > 1 and u0 < _AIMED:
        d = direction_in_cones(projection, axis, distance2, cones, u0 / _AIMED, u[1])
        weight, pdf = _towards(b, group, wi, d)
    else:
        if cones > 1:
            u0 = min((u0 - _AIMED) / _REST, _BELOW_ONE)
        d, weight, pdf, _ = bsdf_sample(scene, b, group, wi, u_lobe, u0, u[1])
    if cones < 2 or not pdf > _f4(0.0):
        return d, weight, _f4(1.0)
    return d, weight, pdf / (_REST * pdf + _AIMED * density_in_cones(projection, axis, distance2, cones, d))


@device
def _towards(b, group, wi, d):
    """Weight and density of a direction that the lobes did not choose."""
    pdf = bsdf_pdf(b, group, wi, d)
    if not pdf > _f4(0.0):
        return _BLACK, _f4(0.0)
    return scale(bsdf_f(b, group, wi, d), abs(dot(shading_normal(b), d)) / pdf), pdf
