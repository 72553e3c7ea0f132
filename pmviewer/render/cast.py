"""A ray and the surface that it meets."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.bsdf.dispersion import beyond
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, has, part, specialised
from pmviewer.kernels.media.medium import MOST_BOUNDARIES, has_media, is_boundary, medium_beyond
from pmviewer.kernels.surface import leave, surface_at
from pmviewer.kernels.vector import add, along, dot

_f4 = np.float32
_i8 = np.int64
_INF = _f4(np.inf)


class Ray(NamedTuple):
    """From o in the unit direction d; meets what lies between the distances near and far. `medium`: that it starts in
    (`pmviewer.kernels.media.medium`), None in scenes without media; in others near is 0. `wave`: the path's wavelength
    (`pmviewer.kernels.bsdf.dispersion`), None where glass bends all alike."""

    o: Any
    d: Any
    near: Any
    far: Any
    medium: Any
    wave: Any


@specialised
def ray_of_camera(eye, place, d):
    """The camera ray from `place`, counted from the eye, in the unit direction d, in the medium that the eye record
    says the camera is in, if it says so."""
    if not has(eye, "medium"):

        def plain(eye, place, d):
            near, far = span_of(eye, place, d)
            return Ray(_placed(eye, place), d, near, far, None, None)

        return plain

    def within(eye, place, d):
        near, far = span_of(eye, place, d)
        if not near < _INF:  # all of it is before the near plane
            near = far = _f4(0.0)
        return Ray(along(_placed(eye, place), d, near), d, _f4(0.0), far - near, _i8(eye.medium), None)

    return within


@device
def _placed(eye, place):
    return add((eye.x_eye, eye.y_eye, eye.z_eye), place)


@device
def span_of(eye, place, d):
    """From which distance to which a ray from `place`, counted from the eye, in the unit direction d is beyond the near
    plane and before the far one; from infinity if it never is."""
    far = eye.far / dot(d, (eye.x_forward, eye.y_forward, eye.z_forward))
    if not eye.near > _f4(0.0):
        return _f4(0.0), far
    normal = (eye.x_near, eye.y_near, eye.z_near)
    before, towards = eye.near - dot(place, normal), dot(d, normal)
    if before > _f4(0.0):
        return before / towards if towards > _f4(0.0) else _INF, far
    if towards < _f4(0.0):  # of parallel rays some begin beyond the plane, and pass it the other way
        far = min(far, before / towards)
    return _f4(0.0), far


@specialised
def of_wave(ray, wave):
    """The ray with another wave."""
    if absent(wave):
        return lambda ray, wave: ray
    return lambda ray, wave: Ray(ray.o, ray.d, ray.near, ray.far, ray.medium, wave)


class Hit(NamedTuple):
    """What a ray met: primitive (−1: nothing), the coordinates u and v on it, the distance t; there the point p, the
    geometric and the shading normal as the surface has them, and how far rays start off it. Where nothing is met, p is
    the ray's origin and the normals are its direction. `medium`: that the ray arrives in, and `crossed`: the boundaries
    of media that it has crossed, which are no surfaces; both None in scenes without media. `wave`: the ray's."""

    prim: Any
    u: Any
    v: Any
    t: Any
    p: Any
    ng: Any
    ns: Any
    gap: Any
    medium: Any
    crossed: Any
    wave: Any


@specialised
def cast(scene, ray):
    """What the ray meets, a Hit."""
    if has_media(scene):
        return lambda scene, ray: _cast_through(scene, ray)

    def plain(scene, ray):
        o, d = ray.o, ray.d
        t, found, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], ray.near, ray.far)
        prim = _i8(found)  # One type for every kind of scene.
        if prim < 0:
            return Hit(prim, u, v, t, o, d, d, _f4(0.0), None, None, ray.wave)
        p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
        return Hit(prim, u, v, t, p, ng, ns, gap, None, None, ray.wave)

    return plain


@device
def _cast_through(scene, ray):
    """`cast` across the boundaries of media."""
    o, d, far, medium = ray.o, ray.d, ray.far, ray.medium
    travelled = _f4(0.0)
    for crossed in range(MOST_BOUNDARIES):
        t, found, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], _f4(0.0), far)
        prim = _i8(found)
        if prim < 0:
            return Hit(prim, u, v, travelled + t, ray.o, d, d, _f4(0.0), medium, _i8(crossed), ray.wave)
        p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
        if not is_boundary(scene, prim):
            return Hit(prim, u, v, travelled + t, p, ng, ns, gap, medium, _i8(crossed), ray.wave)
        medium = medium_beyond(scene, prim, ng, d, medium)
        o = leave(p, ng, gap, d[0], d[1], d[2])
        travelled += t
        far -= t
    return Hit(_i8(-1), _f4(0.0), _f4(0.0), travelled, ray.o, d, d, _f4(0.0), medium, _i8(0), ray.wave)


@device
def ray_from(p, ng, gap, wi, medium, wave):
    """The ray from a surface point with geometric normal ng, on either side, and that gap in direction wi, which starts
    in the medium and has the wave."""
    return Ray(leave(p, ng, gap, wi[0], wi[1], wi[2]), wi, _f4(0.0), _INF, medium, wave)


@specialised
def medium_towards(si, wi):
    """The medium on the side of a SurfaceInteraction that the direction wi points to; None in scenes without media."""
    if absent(part(si, "media")):
        return lambda si, wi: None
    return lambda si, wi: si.media[0] if dot(wi, si.ng) >= _f4(0.0) else si.media[1]


@device
def leaving(si, wi):
    """The ray from a SurfaceInteraction in direction wi."""
    return ray_from(si.p, si.ng, si.gap, wi, medium_towards(si, wi), beyond(si.bsdf, si.wave, wi))
