"""Rays that leave surfaces by their STORED lobes, and go straight through thin glass where there is any (R9).

Camera rays, and what FOLLOWED lobes make of them, see every pane as it is. What comes after a STORED lobe does not:
light samples and the rays that find the same light by the BSDF, gather rays and those that find corners all go straight
on, weakened and coloured by the panes on their way (`pmviewer.kernels.bsdf.thin_glass`). Light samples of FOLLOWED
lobes do so on the way to lights that no ray can meet, whose light nothing else would find. Scenes whose records have no
such panes compile none of it. Scenes with media have no such panes, and the same rays are weakened by the media.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.accel.occlusion import occluded
from pmviewer.kernels.bsdf.scattering import attenuation
from pmviewer.kernels.bsdf.thin_glass import has_thin_glass, straight_transmittance, thin_rule
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.media.medium import has_media
from pmviewer.kernels.scene import THIN_EXACT, THIN_IGNORED, material_of
from pmviewer.kernels.surface import leave
from pmviewer.kernels.vector import dot, largest, mul, sub
from pmviewer.render.cast import Ray, cast, leaving, medium_towards
from pmviewer.render.chain import BLACK, WHITE
from pmviewer.render.media.through import ANYWHERE, BEFORE_LIGHT, light_through, place_of, way_through

MOST_PANES = 256
"""A ray is stopped by the pane after so many."""

_f4 = np.float32


@device
def visible(scene, p, ng, gap, wi, end):
    """Whether nothing stands between the surface point p and the point `end`, seen from p in direction wi."""
    o = leave(p, ng, gap, wi[0], wi[1], wi[2])
    d = sub(end, o)
    return not occluded(scene, o[0], o[1], o[2], d[0], d[1], d[2], _f4(0.0), BEFORE_LIGHT)


@specialised
def let_through(scene, si, wi, end):
    """The share (red, green, blue) of light from the point `end`, in direction wi, that reaches a SurfaceInteraction:
    all, none, or what media let through."""
    if not has_media(scene):
        return lambda scene, si, wi, end: WHITE if visible(scene, si.p, si.ng, si.gap, wi, end) else BLACK

    def through_media(scene, si, wi, end):
        o = leave(si.p, si.ng, si.gap, wi[0], wi[1], wi[2])
        return light_through(scene, o, end, medium_towards(si, wi), ANYWHERE)

    return through_media


@specialised
def transmission(scene, si, light, wi, end, straight):
    """The share (red, green, blue) of a light sample, from `end` in direction wi, that reaches a SurfaceInteraction:
    all, none, or what media, and where it may go `straight` panes, let through."""
    if has_media(scene):

        def through_media(scene, si, light, wi, end, straight):
            o = leave(si.p, si.ng, si.gap, wi[0], wi[1], wi[2])
            return light_through(scene, o, end, medium_towards(si, wi), place_of(scene, light))

        return through_media
    if not has_thin_glass(scene):
        return lambda scene, si, light, wi, end, straight: (
            WHITE if visible(scene, si.p, si.ng, si.gap, wi, end) else BLACK
        )

    def through(scene, si, light, wi, end, straight):
        p, ng, gap = si.p, si.ng, si.gap
        if not straight:
            return WHITE if visible(scene, p, ng, gap, wi, end) else BLACK
        tint = WHITE
        for _ in range(MOST_PANES):
            o = leave(p, ng, gap, wi[0], wi[1], wi[2])
            d = sub(end, o)
            hit = cast(scene, Ray(o, d, _f4(0.0), BEFORE_LIGHT, None, None))
            if hit.prim < 0:
                return tint
            tint = _behind(scene, hit, wi, hit.t * _f4(math.sqrt(dot(d, d))), tint)
            if not largest(tint) > _f4(0.0):
                return BLACK
            p, ng, gap = hit.p, hit.ng, hit.gap
        return BLACK

    return through


@device
def _behind(scene, hit, d, length, tint):
    """The tint of a ray of unit direction d behind what it met after that length: black where that is no thin glass."""
    material = material_of(scene, hit.prim)
    rule = thin_rule(scene, hit.prim, material)
    if rule == THIN_EXACT:
        return BLACK
    if rule != THIN_IGNORED:
        tint = attenuation(scene, material, hit.ng, d, length, tint)
        cos = min(abs(dot(hit.ns, d)), _f4(1.0))
        tint = mul(tint, straight_transmittance(scene, hit.prim, material, hit.u, hit.v, hit.p, cos))
    return tint


@specialised
def cast_on(scene, ray, straight):
    """What the ray meets (`pmviewer.render.cast.Hit`), behind thin glass if it goes `straight`, and the tint (red,
    green, blue) of media and glass on its way. The hit's t counts from the last pane."""
    if has_media(scene):

        def through_media(scene, ray, straight):
            hit = cast(scene, ray)
            return hit, way_through(scene, ray, hit)

        return through_media
    if not has_thin_glass(scene):
        return lambda scene, ray, straight: (cast(scene, ray), WHITE)

    def through(scene, ray, straight):
        hit, tint = cast(scene, ray), WHITE
        if straight:
            for _ in range(MOST_PANES):
                if hit.prim < 0:
                    break
                after = _behind(scene, hit, ray.d, hit.t, tint)
                if not largest(after) > _f4(0.0):
                    break
                tint = after
                o = leave(hit.p, hit.ng, hit.gap, ray.d[0], ray.d[1], ray.d[2])
                hit = cast(scene, Ray(o, ray.d, _f4(0.0), ray.far, None, ray.wave))
        return hit, tint

    return through


@device
def cast_straight(scene, si, wi):
    """`cast_on` of the ray that leaves a SurfaceInteraction in direction wi."""
    return cast_on(scene, leaving(si, wi), True)


@specialised
def way(scene, o, d, hit):
    """Length of the way from o in direction d to what was met there, panes or not."""
    if not has_thin_glass(scene):
        return lambda scene, o, d, hit: hit.t
    return lambda scene, o, d, hit: hit.t if hit.prim < 0 else dot(sub(hit.p, o), d)
