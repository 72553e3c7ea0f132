"""How densely photons leave a light: what weights of whole light paths need of their first segment.

With z0 on the light and z1 the first surface, a photon from z0 arrives at z1 with the density p_ω·cosθ/|z0 − z1|² per
unit of area, p_ω being that of its direction. `spread_over` is |z0 − z1|²/p_ω. Light from outside arrives with
cosθ/(πR²), R being the radius of the disc that it starts on.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.lights.distant import outside
from pmviewer.kernels.lights.light import emit_from, light_point
from pmviewer.kernels.lights.projector import projector_spread
from pmviewer.kernels.lights.spot import spot_falloff
from pmviewer.kernels.lights.textured_light import spread
from pmviewer.kernels.scene import (
    DIRECTIONAL,
    ENVIRONMENT,
    IMAGE,
    L_BEAM,
    L_CUTOFF,
    L_KIND,
    POINT,
    PROJECTOR,
    SPOT,
    light_number,
)
from pmviewer.kernels.vector import dot, scale, sub

_f4 = np.float32
_PI = _f4(math.pi)


@device
def _is_distant(scene, light):
    kind = np.int32(light_number(scene, light, L_KIND))
    return kind in (ENVIRONMENT, DIRECTIONAL, IMAGE)


@device
def spread_over(scene, light, position, d, distance2):
    """Area at the squared distance that a photon in direction d, across it, is spread over: |z0 − z1|²/p_ω, or πR² of
    light from outside; 0 where the light does not shine. `position`: the numbers its place z0 was drawn with."""
    if _is_distant(scene, light):
        return _PI * scene.radius * scene.radius
    return distance2 * _inverse_density(scene, light, position, d)


@specialised
def _inverse_density(scene, light, position, d):
    """1/p_ω; 0 where p_ω is."""
    if has(scene, "projectors"):
        return _inverse_with_projectors
    return _inverse_of_others(scene)


def _inverse_with_projectors(scene, light, position, d):
    if np.int32(light_number(scene, light, L_KIND)) == PROJECTOR:
        return projector_spread(scene, light, d)
    return _inverse_but_projectors(scene, light, position, d)


@specialised
def _inverse_but_projectors(scene, light, position, d):
    return _inverse_of_others(scene)


def _inverse_of_others(scene):
    if not has(scene, "more_lights"):
        return lambda scene, light, position, d: _plain_inverse(scene, light, position, d)

    def more(scene, light, position, d):
        if np.int32(light_number(scene, light, L_KIND)) == SPOT:
            falloff = spot_falloff(scene, light, d)
            return _spot_angle(scene, light) / falloff if falloff > _f4(0.0) else _f4(0.0)
        return _plain_inverse(scene, light, position, d)

    return more


@device
def _spot_angle(scene, light):
    """∫ of a spot's falloff over all directions."""
    beam, cutoff = light_number(scene, light, L_BEAM), light_number(scene, light, L_CUTOFF)
    mean = _f4(math.cos(cutoff))
    if cutoff > beam:
        mean = (_f4(math.sin(cutoff)) - _f4(math.sin(beam))) / (cutoff - beam)
    return _f4(2.0) * _PI * (_f4(1.0) - mean)


@device
def _plain_inverse(scene, light, position, d):
    if np.int32(light_number(scene, light, L_KIND)) == POINT:
        return _f4(4.0) * _PI
    u, v, _ = spread(scene, light, position[0], position[1])
    _, n, front, _ = light_point(scene, light, u, v)
    if not dot(front, d) > _f4(0.0):
        return _f4(0.0)
    return _PI / max(abs(dot(n, d)), _f4(1e-12))


@device
def seen_from(scene, light, position, direction, z):
    """The place that a photon of the light would start from, as seen from the point z: unit direction there, end of
    the shadow ray, and the area that photons from it are spread over at z (`spread_over`)."""
    start, d, _ = emit_from(scene, light, position, direction)
    if _is_distant(scene, light):
        wi = scale(d, _f4(-1.0))
        return wi, outside(scene, z, wi), spread_over(scene, light, position, d, _f4(1.0))
    offset = sub(start, z)
    distance2 = dot(offset, offset)
    if not distance2 > _f4(0.0):
        return (_f4(0.0), _f4(0.0), _f4(1.0)), start, _f4(0.0)
    wi = scale(offset, _f4(1.0) / _f4(math.sqrt(distance2)))
    return wi, start, spread_over(scene, light, position, scale(wi, _f4(-1.0)), distance2)
