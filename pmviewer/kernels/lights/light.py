"""Lights (T1): emission of photons, sampling towards a point, and the densities for multiple importance sampling.

Area lights are one-sided: they emit where their normal points; a mesh with vertex normals where these point, as in
Mitsuba 3. Photons leave it with the surface's own cosine in that half of all directions, whose integral is π whatever
the vertex normals are: cosines and densities are always those of the surface.

Lights are picked with probability proportional to their power's luminance. Spots, directional lights, image
environments, projectors and media that emit have files of their own; scenes without them have another type of record
(`pmviewer.kernels.scene`) and compile nothing of them.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.lights.distant import behind_scene, emit_directional, outside, sample_directional
from pmviewer.kernels.lights.environment import emit_image, image_pdf, image_radiance, sample_image
from pmviewer.kernels.lights.projector import emit_projector, sample_projector
from pmviewer.kernels.lights.spot import emit_spot, sample_spot
from pmviewer.kernels.lights.textured_light import area_density, emission_at, picked_triangle, radiance_from, spread
from pmviewer.kernels.media.glow import emit_glow, sample_glow
from pmviewer.kernels.media.medium import has_media
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import (
    CYLINDER,
    DIRECTIONAL,
    DISK,
    ENVIRONMENT,
    GLOW,
    IMAGE,
    L_A,
    L_AREA,
    L_B,
    L_C,
    L_FLIP,
    L_KIND,
    L_LENGTH,
    L_RADIANCE,
    L_RADIUS,
    MESH,
    P_AREA,
    P_RADIUS,
    PARALLELOGRAM,
    PLACE_COLUMNS,
    POINT,
    PROJECTOR,
    SPHERE,
    SPOT,
    light_number,
    light_vector,
    load3,
)
from pmviewer.kernels.surface import gap_of, interpolated_normal, leave
from pmviewer.kernels.table import find_interval
from pmviewer.kernels.textures.uv import barycentrics
from pmviewer.kernels.vector import along, basis, cross, dot, from_basis, luminance, normalize, scale, sub
from pmviewer.kernels.warp import (
    square_to_cone,
    square_to_cosine_hemisphere,
    square_to_disk,
    square_to_sphere,
    square_to_triangle,
)

_f4 = np.float32
_PI = _f4(math.pi)


@device
def pick_light(scene, u):
    """A light, its probability, and u stretched to [0, 1) for another use."""
    if scene.n_lights == 1:
        return np.int64(0), _f4(1.0), u
    light = find_interval(scene.light_cdf, scene.n_lights, np.int64(1), u)
    low = load_f4(scene.light_cdf, light)
    probability = load_f4(scene.light_cdf, light + 1) - low
    return light, probability, min((u - low) / probability, _f4(0.99999994))


@specialised
def is_delta_light(scene, light):
    """Whether no ray can meet the light, which has neither extent nor solid angle."""
    if not has(scene, "projectors"):

        def of_few(scene, light):
            kind = np.int32(light_number(scene, light, L_KIND))
            return kind in (POINT, SPOT, DIRECTIONAL)

        return of_few

    def of_all(scene, light):
        kind = np.int32(light_number(scene, light, L_KIND))
        return kind in (POINT, SPOT, DIRECTIONAL, PROJECTOR)

    return of_all


@device
def light_probability(scene, light):
    """That a photon starts at this light: its share of the power."""
    return load_f4(scene.light_cdf, light + 1) - load_f4(scene.light_cdf, light)


@device
def light_place(scene, light):
    """Centre and radius of a ball around the light, the radius negative where its light comes from all around or from
    far away, and the area that rays may meet."""
    place = light * PLACE_COLUMNS
    center = load3(scene.light_places, place)
    return center, load_f4(scene.light_places, place + P_RADIUS), load_f4(scene.light_places, place + P_AREA)


@device
def _round_gap(n, center, reach):
    return gap_of(n, abs(center[0]) + reach, abs(center[1]) + reach, abs(center[2]) + reach)


@device
def light_point(scene, light, u, v):
    """A point uniform on the area light, its unit normal, the normal on whose side it emits, the gap for `leave`."""
    kind = np.int32(light_number(scene, light, L_KIND))
    a = light_vector(scene, light, L_A)
    b = light_vector(scene, light, L_B)
    if kind == PARALLELOGRAM:
        c = light_vector(scene, light, L_C)
        p = (a[0] + u * b[0] + v * c[0], a[1] + u * b[1] + v * c[1], a[2] + u * b[2] + v * c[2])
        n = normalize(cross(b, c))
        sizes = (
            abs(a[0]) + abs(b[0]) + abs(c[0]),
            abs(a[1]) + abs(b[1]) + abs(c[1]),
            abs(a[2]) + abs(b[2]) + abs(c[2]),
        )
        return p, n, n, gap_of(n, sizes[0], sizes[1], sizes[2])
    flip = light_number(scene, light, L_FLIP)
    radius = light_number(scene, light, L_RADIUS)
    if kind == DISK:
        x, y = square_to_disk(u, v)
        s, t = basis(b)
        return along(along(a, s, x * radius), t, y * radius), b, b, _round_gap(b, a, radius)
    if kind == SPHERE:
        n = square_to_sphere(u, v)
        facing = scale(n, flip)
        return along(a, n, radius), facing, facing, _round_gap(n, a, radius)
    if kind == CYLINDER:
        phi = _f4(2.0) * _PI * u
        s, t = basis(b)
        x, y = _f4(math.cos(phi)), _f4(math.sin(phi))
        n = (s[0] * x + t[0] * y, s[1] * x + t[1] * y, s[2] * x + t[2] * y)
        length = light_number(scene, light, L_LENGTH)
        facing = scale(n, flip)
        return along(along(a, b, v * length), n, radius), facing, facing, _round_gap(n, a, radius + length)
    triangle, u = picked_triangle(scene, light, u)
    base = triangle * 9
    p0 = load3(scene.vertices, base)
    e1 = sub(load3(scene.vertices, base + 3), p0)
    e2 = sub(load3(scene.vertices, base + 6), p0)
    b1, b2 = square_to_triangle(u, v)
    n = normalize(cross(e1, e2))
    gap = gap_of(
        n,
        abs(p0[0]) + abs(e1[0]) + abs(e2[0]),
        abs(p0[1]) + abs(e1[1]) + abs(e2[1]),
        abs(p0[2]) + abs(e1[2]) + abs(e2[2]),
    )
    return along(along(p0, e1, b1), e2, b2), n, interpolated_normal(scene, base, b1, b2, n), gap


@device
def _sphere_cone(scene, light, x):
    """1 − cos of the half angle under which x sees a sphere light from outside; 0 when the cone can't be used."""
    center = light_vector(scene, light, L_A)
    radius = light_number(scene, light, L_RADIUS)
    offset = sub(center, x)
    distance2 = dot(offset, offset)
    sin2 = radius * radius / distance2
    if light_number(scene, light, L_FLIP) < _f4(0.0) or sin2 >= _f4(0.9999):
        return _f4(0.0)
    return sin2 / (_f4(1.0) + _f4(math.sqrt(_f4(1.0) - sin2)))


@specialised
def sample_one_light(scene, light, x, u, v):
    """A direction from the point x towards the light.

    Returns unit `wi`, the end point of the shadow ray, the radiance L arriving if nothing is in between, its pdf per
    solid angle (0: no contribution; for point lights and spots L/pdf is intensity/distance², for directional ones
    irradiance) and whether a BSDF sample could have found it (False for point, spot and directional lights, projectors,
    and for media that emit, which are sampled where rays don't look for them).
    """
    if has_media(scene):
        return _sample_with_glows
    return _sampler_but_of_glows(scene)


def _sample_with_glows(scene, light, x, u, v):
    if np.int32(light_number(scene, light, L_KIND)) == GLOW:
        return sample_glow(scene, light, x, u, v)
    return _sample_but_glows(scene, light, x, u, v)


@specialised
def _sample_but_glows(scene, light, x, u, v):
    return _sampler_but_of_glows(scene)


def _sampler_but_of_glows(scene):
    if has(scene, "projectors"):
        return _sample_with_projectors
    return _sampler_of_others(scene)


def _sample_with_projectors(scene, light, x, u, v):
    if np.int32(light_number(scene, light, L_KIND)) == PROJECTOR:
        return sample_projector(scene, light, x)
    return _sample_but_projectors(scene, light, x, u, v)


@specialised
def _sample_but_projectors(scene, light, x, u, v):
    return _sampler_of_others(scene)


def _sampler_of_others(scene):
    if not has(scene, "more_lights"):

        def plain(scene, light, x, u, v):
            return _sample_plain(scene, light, x, u, v)

        return plain

    def more(scene, light, x, u, v):
        kind = np.int32(light_number(scene, light, L_KIND))
        if kind == SPOT:
            return sample_spot(scene, light, x)
        if kind == DIRECTIONAL:
            return sample_directional(scene, light, x)
        if kind == IMAGE:
            return sample_image(scene, light, x, u, v)
        return _sample_plain(scene, light, x, u, v)

    return more


@device
def _sample_plain(scene, light, x, u, v):
    kind = np.int32(light_number(scene, light, L_KIND))
    L = light_vector(scene, light, L_RADIANCE)
    if kind == ENVIRONMENT:
        wi = square_to_sphere(u, v)
        return wi, outside(scene, x, wi), L, _f4(1.0 / (4.0 * math.pi)), True
    if kind == POINT:
        p = light_vector(scene, light, L_A)
        offset = sub(p, x)
        distance2 = dot(offset, offset)
        if not distance2 > _f4(0.0):
            return (_f4(0.0), _f4(0.0), _f4(1.0)), p, L, _f4(0.0), False
        inv = _f4(1.0) / _f4(math.sqrt(distance2))
        return scale(offset, inv), p, scale(L, inv * inv), _f4(1.0), False
    if kind == SPHERE:
        cone = _sphere_cone(scene, light, x)
        if cone > _f4(0.0):
            center = light_vector(scene, light, L_A)
            radius = light_number(scene, light, L_RADIUS)
            axis = normalize(sub(center, x))
            local = square_to_cone(u, v, cone)
            wi = from_basis(axis, local[0], local[1], local[2])
            # Nearest intersection with the sphere, from the closest approach to its centre.
            offset = sub(center, x)
            reach = dot(offset, wi)
            miss = sub(offset, scale(wi, reach))
            half = _f4(math.sqrt(max(_f4(0.0), radius * radius - dot(miss, miss))))
            p = along(x, wi, reach - half)
            n = normalize(sub(p, center))
            end = leave(p, n, _round_gap(n, center, radius), -wi[0], -wi[1], -wi[2])
            L = radiance_from(scene, light, p, u, v)
            return wi, end, L, _f4(1.0) / (_f4(2.0) * _PI * cone), True
    u, v, density = spread(scene, light, u, v)
    p, n, front, gap = light_point(scene, light, u, v)
    L = radiance_from(scene, light, p, u, v)
    offset = sub(p, x)
    distance2 = dot(offset, offset)
    if not distance2 > _f4(0.0):
        return n, p, L, _f4(0.0), True
    inv = _f4(1.0) / _f4(math.sqrt(distance2))
    wi = scale(offset, inv)
    cos_light = abs(dot(wi, n))
    if dot(wi, front) >= _f4(0.0) or not cos_light > _f4(0.0):
        return wi, p, L, _f4(0.0), True
    pdf = density * (distance2 / (cos_light * light_number(scene, light, L_AREA)))
    return wi, leave(p, n, gap, -wi[0], -wi[1], -wi[2]), L, pdf, True


@device
def emitted(scene, light, prim, p, ng, d):
    """Radiance that leaves an area light at the point p of its primitive `prim`, with geometric normal ng, against the
    travelling direction d."""
    front = ng
    if np.int32(light_number(scene, light, L_KIND)) == MESH and scene.normals != 0:
        b1, b2 = barycentrics(scene, prim, p)
        front = interpolated_normal(scene, np.int64(prim) * 9, b1, b2, ng)
    if dot(front, d) < _f4(0.0):
        return emission_at(scene, light, prim, p)
    return _f4(0.0), _f4(0.0), _f4(0.0)


@specialised
def environment_radiance(scene, d):
    """Radiance that a ray in direction d brings when it leaves a scene that has an environment."""
    if not has(scene, "more_lights"):

        def constant(scene, d):
            return light_vector(scene, scene.environment, L_RADIANCE)

        return constant

    def image(scene, d):
        if np.int32(light_number(scene, scene.environment, L_KIND)) == IMAGE:
            return image_radiance(scene, scene.environment, d)
        return light_vector(scene, scene.environment, L_RADIANCE)

    return image


@specialised
def one_light_pdf(scene, light, x, p, ng, wi):
    """Density per solid angle with which `sample_one_light` at x would have chosen direction wi to the light's point p,
    whose normal is ng."""
    if not has(scene, "more_lights"):

        def plain(scene, light, x, p, ng, wi):
            return _plain_pdf(scene, light, x, p, ng, wi)

        return plain

    def more(scene, light, x, p, ng, wi):
        if np.int32(light_number(scene, light, L_KIND)) == IMAGE:
            return image_pdf(scene, light, image_radiance(scene, light, wi))
        return _plain_pdf(scene, light, x, p, ng, wi)

    return more


@device
def _plain_pdf(scene, light, x, p, ng, wi):
    if light == scene.environment:
        return _f4(1.0 / (4.0 * math.pi))
    if np.int32(light_number(scene, light, L_KIND)) == SPHERE:
        cone = _sphere_cone(scene, light, x)
        if cone > _f4(0.0):
            return _f4(1.0) / (_f4(2.0) * _PI * cone)
    offset = sub(p, x)
    cos_light = abs(dot(ng, wi))
    uniform = dot(offset, offset) / (max(cos_light, _f4(1e-9)) * light_number(scene, light, L_AREA))
    return area_density(scene, light, p) * uniform


@device
def emit_photon(scene, u_pick, position, direction):
    """A photon leaving a light: origin, unit direction, power in units of the total power's luminance, light.

    `position` and `direction` are pairs of numbers in [0, 1). Photons of environments and directional lights start on a
    disc outside the scene's bounding sphere (T1). The pick probability is the light's share of the power, so that every
    photon's power has luminance 1, or nearly for a textured light.
    """
    light, _, _ = pick_light(scene, u_pick)
    p, d, beta = emit_from(scene, light, position, direction)
    return p, d, beta, light


@specialised
def emit_from(scene, light, position, direction):
    """Origin, unit direction and power of a photon that leaves that light; the power's luminance is 1, or 0 of a place
    that a medium which emits turns out not to fill."""
    if has_media(scene):
        return _emit_with_glows
    return _emitter_but_of_glows(scene)


def _emit_with_glows(scene, light, position, direction):
    if np.int32(light_number(scene, light, L_KIND)) == GLOW:
        return emit_glow(scene, light, position, direction)
    return _emit_but_glows(scene, light, position, direction)


@specialised
def _emit_but_glows(scene, light, position, direction):
    return _emitter_but_of_glows(scene)


def _emitter_but_of_glows(scene):
    if has(scene, "projectors"):
        return _emit_with_projectors
    return _emitter_of_others(scene)


def _emit_with_projectors(scene, light, position, direction):
    if np.int32(light_number(scene, light, L_KIND)) == PROJECTOR:
        return emit_projector(scene, light, direction[0], direction[1])
    return _emit_but_projectors(scene, light, position, direction)


@specialised
def _emit_but_projectors(scene, light, position, direction):
    return _emitter_of_others(scene)


def _emitter_of_others(scene):
    if not has(scene, "more_lights"):

        def plain(scene, light, position, direction):
            return _emit_plain(scene, light, position, direction)

        return plain

    def more(scene, light, position, direction):
        kind = np.int32(light_number(scene, light, L_KIND))
        if kind == SPOT:
            return emit_spot(scene, light, direction[0], direction[1])
        if kind == DIRECTIONAL:
            return emit_directional(scene, light, position[0], position[1])
        if kind == IMAGE:
            return emit_image(scene, light, position, direction)
        return _emit_plain(scene, light, position, direction)

    return more


@device
def light_start(scene, light, position):
    """Where a photon leaves an area light, as by `light_point`, and its power of luminance 1, or nearly for a textured
    one. A point light has the gap 0, and normals that mean nothing."""
    L = light_vector(scene, light, L_RADIANCE)
    if np.int32(light_number(scene, light, L_KIND)) == POINT:
        up = (_f4(0.0), _f4(0.0), _f4(1.0))
        return light_vector(scene, light, L_A), up, up, _f4(0.0), scale(L, _f4(1.0) / luminance(L))
    u, v, density = spread(scene, light, position[0], position[1])
    p, n, front, gap = light_point(scene, light, u, v)
    beta = scale(radiance_from(scene, light, p, u, v), _f4(1.0) / (luminance(L) * density))
    return p, n, front, gap, beta


@device
def light_direction(scene, light, n, front, u, v):
    """A direction in which a photon leaves there: of an area light by the cosine to its normal n, on the side of
    `front`, of a point light any."""
    if np.int32(light_number(scene, light, L_KIND)) == POINT:
        return square_to_sphere(u, v)
    local = square_to_cosine_hemisphere(u, v)
    d = from_basis(n, local[0], local[1], local[2])
    return scale(d, _f4(-1.0)) if dot(front, d) < _f4(0.0) else d


@device
def _emit_plain(scene, light, position, direction):
    if np.int32(light_number(scene, light, L_KIND)) == ENVIRONMENT:
        L = light_vector(scene, light, L_RADIANCE)
        d = square_to_sphere(direction[0], direction[1])
        return behind_scene(scene, d, position[0], position[1]), d, scale(L, _f4(1.0) / luminance(L))
    p, n, front, gap, beta = light_start(scene, light, position)
    d = light_direction(scene, light, n, front, direction[0], direction[1])
    return leave(p, n, gap, d[0], d[1], d[2]), d, beta
