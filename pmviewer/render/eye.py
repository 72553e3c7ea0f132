"""The eye pass: one sample per pixel of Jensen's four-way split (R1), from the maps of this pass.

From the camera, mirrors and glass are followed to the first diffuse surface. There, direct light is sampled, caustics
come from the caustic map, and indirect light from the global map: shown directly (`progressive`) or by a final gather,
BSDF-sampled rays that look the map up where they land (`gather`), or radiance photons near there (R3).

Random numbers of a pixel are Owen-scrambled Sobol points over the passes, keyed by (seed, pixel): dimension set 0 is
the place in the pixel and on the light, 1 the choice of light and the BSDF sample, 2 + d the specular choice at depth
d.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf import scatter_specular
from pmviewer.kernels.jit import device, kernel
from pmviewer.kernels.light import emitted
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.random import draw1, draw4, hash3
from pmviewer.kernels.raycast import closest_hit
from pmviewer.kernels.scene import (
    DIFFUSE,
    L_RADIANCE,
    light_of,
    light_vector,
    material_kind,
    material_of,
    material_two_sided,
    reflectance,
)
from pmviewer.kernels.surface import face, leave, surface_at
from pmviewer.kernels.vector import add, dot, from_basis, is_good, largest, mul, normalize, scale
from pmviewer.kernels.warp import square_to_cosine_hemisphere
from pmviewer.render.choice import BY_POWER, LIST_WORDS, choose_by_power, choose_near
from pmviewer.render.direct import BLACK, INV_PI, found_light, light_samples
from pmviewer.render.lookup import gathered_irradiance, irradiance
from pmviewer.render.record import C_DROPPED, C_RAYS, C_SHADOW_RAYS

_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32
_INF = _f4(np.inf)

EMISSION, DIRECT, SPECULAR, CAUSTIC, INDIRECT = 0, 3, 6, 9, 12
ALBEDO, NORMAL, DEPTH = 15, 18, 21
PIXEL_SET, BSDF_SET, CHAIN_SET, GATHER_SET, GATHER_CHAIN_SET = np.array([0, 1, 2, 2000, 3000], np.int64)


@device
def pixel_seed(eye, pixel):
    return hash3(eye.seed, _u4(pixel), _u4(0xE7E))


@device
def camera_ray(eye, pixel, u, v):
    """Unit direction through the pixel at (u, v) in [0, 1)², and the distances at which near and far planes are met."""
    x = _f4(pixel % eye.width) + u
    y = _f4(pixel // eye.width) + v
    d = normalize(
        (
            eye.x_corner + x * eye.x_right + y * eye.x_down,
            eye.y_corner + x * eye.y_right + y * eye.y_down,
            eye.z_corner + x * eye.z_right + y * eye.z_down,
        )
    )
    inv = _f4(1.0) / dot(d, (eye.x_forward, eye.y_forward, eye.z_forward))
    return d, eye.near * inv, eye.far * inv


@device
def deposit(film, counts, pixel, plane, value):
    """Add a sample to a plane of the film, or count it when it is not finite or negative."""
    if is_good(value):
        film[pixel, plane] += _f8(value[0])
        film[pixel, plane + 1] += _f8(value[1])
        film[pixel, plane + 2] += _f8(value[2])
    else:
        counts[C_DROPPED] += 1


@device
def properties(scene, film, eye, pixel, albedo, n, p):
    """Add the first hit's properties: albedo, normal towards the eye, distance along the view."""
    depth = (p[0] - eye.x_eye) * eye.x_forward + (p[1] - eye.y_eye) * eye.y_forward + (p[2] - eye.z_eye) * eye.z_forward
    for k in range(3):
        film[pixel, ALBEDO + k] += _f8(albedo[k])
        film[pixel, NORMAL + k] += _f8(n[k])
    film[pixel, DEPTH] += _f8(depth)


@device
def bsdf_ray(scene, p, ng, gap, wi):
    """What a ray from the surface point p in direction wi meets: primitive (−1: nothing), point, normals, gap."""
    o = leave(p, ng, gap, wi[0], wi[1], wi[2])
    t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], wi[0], wi[1], wi[2], _f4(0.0), _INF)
    if prim < 0:
        return prim, o, wi, wi, gap
    q, nq, sq, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], wi[0], wi[1], wi[2], t)
    return prim, q, nq, sq, gap


@device
def gather_light(scene, eye, photons, sites, prim, q, nq, sq, gap, d, seed, index):
    """Radiance that a gather ray brings back: the global map's at the first diffuse surface, on the side it hit.

    Mirrors and glass end the ray unless the map holds what they reflect (`gather_specular`). Returns L and rays cast.
    """
    beta = (_f4(1.0), _f4(1.0), _f4(1.0))
    rays = 0
    for depth in range(eye.max_depth):
        if prim < 0:
            return BLACK, rays
        material = material_of(scene, prim)
        if material_kind(scene, material) == DIFFUSE:
            if dot(nq, d) > _f4(0.0) and not material_two_sided(scene, material):
                return BLACK, rays
            albedo = reflectance(scene, material)
            if not albedo[0] + albedo[1] + albedo[2] > _f4(0.0):
                return BLACK, rays
            n = face(nq, scale(d, _f4(-1.0)))
            E = gathered_irradiance(photons, sites, eye, q, n)
            return scale(mul(mul(beta, albedo), E), INV_PI), rays
        if eye.gather_specular == 0:
            return BLACK, rays
        u = draw1(eye.sequence, seed, index, GATHER_CHAIN_SET + depth)
        d, weight, compression = scatter_specular(scene, material, sq, d, u)
        beta = scale(mul(beta, weight), compression)
        if not largest(beta) > _f4(0.0):
            return BLACK, rays
        rays += 1
        prim, q, nq, sq, gap = bsdf_ray(scene, q, nq, gap, d)
    return BLACK, rays


@kernel
def eye_pass(scenes, eyes, caustic_maps, global_maps, choice_maps, site_maps, film, counts, first, last):
    """Add one sample to each of the pixels first … last−1.

    scenes: SCENE_DTYPE (1,); eyes: EYE_DTYPE (1,); caustic_maps, global_maps: records (1,) of grids or kd-trees;
    choice_maps: record (1,) of the grid of photons that choose lights;
    site_maps: record (1,) of the radiance photons, or NO_SITES;
    film: float64 (pixels, CHANNELS), see `pmviewer.render.planes`; counts: int64 (N_COUNTS,).
    """
    scene, eye = scenes[0], eyes[0]
    caustic_map, global_map = caustic_maps[0], global_maps[0]
    choice_map, sites = choice_maps[0], site_maps[0]
    lights = stack_i4(LIST_WORDS)
    index = eye.index
    for pixel in range(first, last):
        seed = pixel_seed(eye, pixel)
        ux, uy, lu, lv = draw4(eye.sequence, seed, index, PIXEL_SET)
        d, near, far = camera_ray(eye, pixel, ux, uy)
        o = (eye.x_eye, eye.y_eye, eye.z_eye)
        beta = (_f4(1.0), _f4(1.0), _f4(1.0))
        for depth in range(eye.max_depth + 1):
            t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], near, far)
            counts[C_RAYS] += 1
            seen = EMISSION if depth == 0 else SPECULAR
            if prim < 0:
                if scene.environment >= 0:
                    L = light_vector(scene, scene.environment, L_RADIANCE)
                    deposit(film, counts, pixel, seen, mul(beta, L))
                break
            p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
            wo = (-d[0], -d[1], -d[2])
            material = material_of(scene, prim)
            albedo = reflectance(scene, material)
            if depth == 0:
                properties(scene, film, eye, pixel, albedo, face(ns, wo), p)
            light = light_of(scene, prim)
            if light >= 0:
                deposit(film, counts, pixel, seen, mul(beta, emitted(scene, light, ng, d)))
            if material_kind(scene, material) != DIFFUSE:
                if depth == eye.max_depth:
                    break
                choice = draw1(eye.sequence, seed, index, CHAIN_SET + depth)
                d, weight, compression = scatter_specular(scene, material, ns, d, choice)
                beta = scale(mul(beta, weight), compression)
                if not largest(beta) > _f4(0.0):
                    break
                o = leave(p, ng, gap, d[0], d[1], d[2])
                near, far = _f4(0.0), _INF
                continue
            if dot(ng, d) > _f4(0.0):
                if not material_two_sided(scene, material):
                    break
                ng, ns = scale(ng, _f4(-1.0)), scale(ns, _f4(-1.0))
            beta = mul(beta, albedo)
            if not largest(beta) > _f4(0.0):
                break
            per_E = scale(beta, INV_PI)
            u_pick, bu, bv, _ = draw4(eye.sequence, seed, index, BSDF_SET)
            n_bsdf = 0
            if eye.mis != 0:
                n_bsdf = max(eye.gather_rays, 1)
            choice = choose_by_power(lights, eye.light_samples)
            if eye.direct != 0:
                if eye.choice != BY_POWER:
                    choice = choose_near(scene, eye, choice_map, p, ng, lights)
                E, rays = light_samples(
                    scene, p, ng, ns, gap, choice, n_bsdf, eye.sequence, seed, index, u_pick, lu, lv
                )
                counts[C_RAYS] += rays
                counts[C_SHADOW_RAYS] += rays
                deposit(film, counts, pixel, DIRECT if depth == 0 else SPECULAR, mul(per_E, E))
            if eye.caustic_mask != 0:
                E = irradiance(caustic_map, eye, eye.caustic_radius, p, ng, eye.caustic_mask)
                deposit(film, counts, pixel, CAUSTIC if depth == 0 else SPECULAR, mul(per_E, E))
            if eye.global_mask != 0:
                E = irradiance(global_map, eye, eye.global_radius, p, ng, eye.global_mask)
                deposit(film, counts, pixel, INDIRECT if depth == 0 else SPECULAR, mul(per_E, E))
            bsdf_rays = eye.gather_rays
            if eye.direct != 0:
                bsdf_rays = max(bsdf_rays, n_bsdf)
            direct, indirect = BLACK, BLACK
            for j in range(bsdf_rays):
                sample = index
                if eye.gather_rays > 0:
                    sample = _u4(index * _u4(eye.gather_rays) + _u4(j))
                    bu, bv, _, _ = draw4(eye.sequence, seed, sample, GATHER_SET)
                local = square_to_cosine_hemisphere(bu, bv)
                wi = from_basis(ns, local[0], local[1], local[2])
                if dot(wi, ng) <= _f4(0.0):
                    continue
                counts[C_RAYS] += 1
                hit, q, nq, sq, far_gap = bsdf_ray(scene, p, ng, gap, wi)
                if eye.direct != 0 and eye.mis != 0:
                    L = found_light(scene, p, wi, local[2], bsdf_rays, choice, eye.biased, hit, q, nq)
                    direct = add(direct, L)
                if eye.gather_rays > 0:
                    L, rays = gather_light(scene, eye, global_map, sites, hit, q, nq, sq, far_gap, wi, seed, sample)
                    counts[C_RAYS] += rays
                    indirect = add(indirect, L)
            if bsdf_rays > 0:
                share = scale(beta, _f4(1.0) / _f4(bsdf_rays))
                deposit(film, counts, pixel, DIRECT if depth == 0 else SPECULAR, mul(share, direct))
                if eye.gather_rays > 0:
                    deposit(film, counts, pixel, INDIRECT if depth == 0 else SPECULAR, mul(share, indirect))
            break
