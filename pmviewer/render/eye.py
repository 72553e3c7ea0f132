"""The eye pass: one sample per pixel of Jensen's four-way split (R1), from the maps of this pass.

From the camera, mirrors, glass and smooth glossy lobes are followed. Wherever a surface has lobes that photons are
stored for, direct light is sampled, caustics come from the caustic map, and indirect light from the global map: shown
directly (`progressive`) or by a final gather (`gather`, see `pmviewer.render.gather`). A surface with lobes of both
kinds does both, so that a chain may light up at every surface it meets.

Random numbers of a pixel are Owen-scrambled Sobol points over the passes, keyed by (seed, pixel): dimension set 0 is
the place in the pixel and on the light, 1 the choice of light and the BSDF sample, 2 + d the lobe followed at depth d.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.jit import device, kernel
from pmviewer.kernels.light import emitted, environment_radiance
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.random import draw4, hash3
from pmviewer.kernels.raycast import closest_hit
from pmviewer.kernels.scattering import (
    FOLLOWED,
    NOTHING,
    STORED,
    attenuation,
    bsdf_at,
    bsdf_sample,
    chain_numbers,
    is_delta,
    same_side,
    shading_normal,
)
from pmviewer.kernels.scene import light_of, material_of
from pmviewer.kernels.surface import face, leave, surface_at
from pmviewer.kernels.vector import add, dot, is_good, largest, mul, normalize, scale
from pmviewer.maps.record import CAUSTIC as CAUSTIC_CLASS
from pmviewer.render.cached import cached, surface_rays
from pmviewer.render.choice import BY_POWER, LIST_WORDS, choose_by_power, choose_near
from pmviewer.render.direct import BLACK, found_light, light_samples
from pmviewer.render.guide import AIM_WORDS, aim
from pmviewer.render.pixel_radius import OF_CAUSTIC, OF_GLOBAL, count_found, own_radius
from pmviewer.render.record import C_CUT, C_DROPPED, C_RAYS, C_SAVED, C_SHADOW_RAYS
from pmviewer.render.reflect import reflected, unfound

_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32
_INF = _f4(np.inf)
_CAUSTICS = np.int32(1 << CAUSTIC_CLASS)

EMISSION, DIRECT, SPECULAR, CAUSTIC, INDIRECT = 0, 3, 6, 9, 12
ALBEDO, NORMAL, DEPTH = 15, 18, 21
PIXEL_SET, BSDF_SET, CHAIN_SET, CHAIN_LIGHT_SET, OUTLINE_SET = np.array([0, 1, 2, 4000, 5000], np.int64)
FORKS = 3
"""Chains that fork go on at least so deep before they are thinned out."""


@device
def pixel_seed(eye, pixel):
    return hash3(eye.seed, _u4(pixel), _u4(0xE7E))


@device
def camera_ray(eye, pixel, u, v):
    """Origin and unit direction of the ray through the pixel at (u, v) in [0, 1)², and the distances at which near and
    far planes are met."""
    x = _f4(pixel % eye.width) + u
    y = _f4(pixel // eye.width) + v
    o = (eye.x_eye, eye.y_eye, eye.z_eye)
    d = (
        eye.x_corner + x * eye.x_right + y * eye.x_down,
        eye.y_corner + x * eye.y_right + y * eye.y_down,
        eye.z_corner + x * eye.z_right + y * eye.z_down,
    )
    if eye.orthographic != 0:
        return add(o, d), (eye.x_forward, eye.y_forward, eye.z_forward), eye.near, eye.far
    d = normalize(d)
    far = eye.far / dot(d, (eye.x_forward, eye.y_forward, eye.z_forward))
    near = _f4(0.0)
    if eye.near > near:
        towards = dot(d, (eye.x_near, eye.y_near, eye.z_near))
        near = eye.near / towards if towards > near else _INF
    return o, d, near, far


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
def outline_emission(scene, eye, pixel, seed):
    """Mean radiance that camera rays through the pixel meet at lights and the environment."""
    total = BLACK
    for j in range(eye.outline_rays):
        ux, uy, _, _ = draw4(eye.sequence, seed, _u4(eye.index * _u4(eye.outline_rays) + _u4(j)), OUTLINE_SET)
        o, d, near, far = camera_ray(eye, pixel, ux, uy)
        t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], near, far)
        if prim < 0:
            if scene.environment >= 0:
                total = add(total, environment_radiance(scene, d))
        elif light_of(scene, prim) >= 0:
            p, ng, _, _ = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
            total = add(total, emitted(scene, light_of(scene, prim), prim, p, ng, d))
    return scale(total, _f4(1.0) / _f4(eye.outline_rays))


@kernel
def eye_pass(
    scenes,
    eyes,
    caustic_maps,
    global_maps,
    choice_maps,
    site_maps,
    caches,
    shadow_maps,
    guide_maps,
    corners,
    outline,
    radii,
    film,
    counts,
    first,
    last,
):
    """Add one sample to each of the pixels first … last−1.

    scenes: SCENE_DTYPE (1,); eyes: EYE_DTYPE (1,); caustic_maps, global_maps: records (1,) of grids or kd-trees;
    choice_maps: record (1,) of the grid of photons that choose lights;
    site_maps: record (1,) of the radiance photons, or NO_SITES; caches: of the irradiance cache, or NO_CACHE;
    shadow_maps: of the shadow photons, or NO_SHADOWS;
    guide_maps: record (1,) of the photons that guide gather rays, or NO_GUIDES; corners: CORNERS or NO_CORNERS;
    outline: uint8 (pixels,), 1 where emission gets camera rays of its own (`pmviewer.render.outline`), or (0,);
    radii: float32 (pixels, COLUMNS), look-up radii of the pixels (`pmviewer.render.pixel_radius`), or None;
    film: float64 (pixels, CHANNELS), see `pmviewer.render.planes`; counts: int64 (N_COUNTS,).
    """
    scene, eye = scenes[0], eyes[0]
    caustic_map, global_map = caustic_maps[0], global_maps[0]
    choice_map, sites, cache, shadows = choice_maps[0], site_maps[0], caches[0], shadow_maps[0]
    guides, corner = guide_maps[0], corners[0]
    lights, found = stack_i4(LIST_WORDS), stack_i4(AIM_WORDS)
    index = eye.index
    for pixel in range(first, last):
        seed = pixel_seed(eye, pixel)
        ux, uy, lu, lv = draw4(eye.sequence, seed, index, PIXEL_SET)
        o, d, near, far = camera_ray(eye, pixel, ux, uy)
        beta = (_f4(1.0), _f4(1.0), _f4(1.0))
        outlined = len(outline) > 0 and outline[pixel] != 0
        if outlined:
            deposit(film, counts, pixel, EMISSION, outline_emission(scene, eye, pixel, seed))
            counts[C_RAYS] += eye.outline_rays
        left, pdf = o, _f4(0.0)  # where, and with which density, a lobe was left that is not a delta
        choice = choose_by_power(lights, eye.light_samples)
        for depth in range(eye.max_depth + 1):
            t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], near, far)
            counts[C_RAYS] += 1
            whole = depth == 0
            seen = EMISSION if whole else SPECULAR
            if prim < 0:
                if scene.environment >= 0:
                    L = environment_radiance(scene, d)
                    if pdf > _f4(0.0):
                        L = found_light(scene, left, d, pdf, eye.mis, choice, eye.biased, prim, o, d)
                    if not (whole and outlined):
                        deposit(film, counts, pixel, seen, mul(beta, L))
                break
            p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
            wo = (-d[0], -d[1], -d[2])
            material = material_of(scene, prim)
            beta = attenuation(scene, material, ng, d, t, beta)
            b = bsdf_at(scene, prim, material, u, v, p, ng, ns, wo, eye.glossy)
            if whole:
                properties(scene, film, eye, pixel, b.albedo, face(shading_normal(b), wo), p)
            light = light_of(scene, prim)
            if light >= 0 and not (whole and outlined):
                L = emitted(scene, light, prim, p, ng, d)
                if pdf > _f4(0.0):
                    L = found_light(scene, left, d, pdf, eye.mis, choice, eye.biased, prim, p, ng)
                deposit(film, counts, pixel, seen, mul(beta, L))
            if b.groups == NOTHING:
                break
            ng = face(ng, wo)
            if b.groups & STORED != 0:
                u_pick, bu, bv, u_lobe = draw4(eye.sequence, seed, index, BSDF_SET)
                known, gather = cached(cache, eye, p, b, counts)
                guided, m = 0, 0
                if gather > 0:
                    guided, m = aim(guides, eye, p, ng, b, wo, seed, found)
                n_bsdf = 0
                if eye.mis != 0:
                    n_bsdf = max(gather - guided, 1)
                choice = choose_by_power(lights, eye.light_samples)
                if eye.direct != 0:
                    if eye.choice != BY_POWER:
                        choice = choose_near(scene, eye, choice_map, p, ng, lights)
                    L, rays, saved = light_samples(
                        scene,
                        shadows,
                        p,
                        ng,
                        gap,
                        b,
                        STORED,
                        wo,
                        choice,
                        n_bsdf,
                        eye.sequence,
                        seed,
                        index,
                        u_pick,
                        lu,
                        lv,
                    )
                    counts[C_RAYS] += rays
                    counts[C_SHADOW_RAYS] += rays
                    counts[C_SAVED] += saved
                    deposit(film, counts, pixel, DIRECT if whole else SPECULAR, mul(beta, L))
                if eye.caustic_mask != 0:
                    r = own_radius(radii, OF_CAUSTIC, pixel, eye.caustic_radius)
                    L = reflected(caustic_map, eye, r, p, ng, b, wo, eye.caustic_mask)
                    count_found(radii, OF_CAUSTIC, pixel, caustic_map, eye, r, p, ng, eye.caustic_mask)
                    deposit(film, counts, pixel, CAUSTIC if whole else SPECULAR, mul(beta, L))
                for k in range(3):  # a loop, so that the look-up is compiled once
                    mask, term = eye.global_mask, INDIRECT
                    if k == 1:
                        mask, term = eye.direct_mask, DIRECT
                    elif k == 2:
                        mask, term = eye.global_caustics, CAUSTIC
                    if mask != 0:
                        r = own_radius(radii, OF_GLOBAL, pixel, eye.global_radius)
                        L = reflected(global_map, eye, r, p, ng, b, wo, mask)
                        count_found(radii, OF_GLOBAL, pixel, global_map, eye, r, p, ng, mask)
                        deposit(film, counts, pixel, term if whole else SPECULAR, mul(beta, L))
                n = gather
                if eye.direct != 0:
                    n = max(n, n_bsdf)
                if eye.gather_rays > 0:
                    n = max(n, 1)
                if n > 0:
                    direct, indirect = surface_rays(
                        cache,
                        known,
                        gather,
                        scene,
                        eye,
                        global_map,
                        sites,
                        guides,
                        corner,
                        shadows,
                        caustic_map,
                        choice_map,
                        choice,
                        found,
                        guided,
                        m,
                        beta,
                        p,
                        ng,
                        gap,
                        b,
                        wo,
                        n,
                        u_lobe,
                        bu,
                        bv,
                        seed,
                        counts,
                    )
                    share = scale(beta, _f4(1.0) / _f4(n))
                    deposit(film, counts, pixel, DIRECT if whole else SPECULAR, mul(share, direct))
                    if eye.gather_rays > 0:
                        deposit(film, counts, pixel, INDIRECT if whole else SPECULAR, mul(share, indirect))
            if b.groups & FOLLOWED == 0:
                break
            if depth == eye.max_depth:
                counts[C_CUT] += 1
                break
            u_lobe, bu, bv, u_end = chain_numbers(scene, eye.sequence, seed, index, CHAIN_SET + depth)
            if not is_delta(b) and eye.unfound != 0:
                r = own_radius(radii, OF_CAUSTIC, pixel, eye.caustic_radius)
                L = unfound(caustic_map, eye, r, p, ng, b, wo)
                if b.groups & STORED == 0:
                    count_found(radii, OF_CAUSTIC, pixel, caustic_map, eye, r, p, ng, _CAUSTICS)
                deposit(film, counts, pixel, SPECULAR, mul(beta, L))
            if not is_delta(b) and eye.followed_direct != 0:
                choice = choose_by_power(lights, eye.light_samples)
                u_pick, cu, cv, _ = draw4(eye.sequence, seed, index, CHAIN_LIGHT_SET + depth)
                L, rays, saved = light_samples(
                    scene,
                    shadows,
                    p,
                    ng,
                    gap,
                    b,
                    FOLLOWED,
                    wo,
                    choice,
                    eye.mis,
                    eye.sequence,
                    seed,
                    index,
                    u_pick,
                    cu,
                    cv,
                )
                counts[C_RAYS] += rays
                counts[C_SHADOW_RAYS] += rays
                counts[C_SAVED] += saved
                deposit(film, counts, pixel, SPECULAR, mul(beta, L))
            d, weight, pdf, compression = bsdf_sample(scene, b, FOLLOWED, wo, u_lobe, bu, bv)
            if eye.followed_direct == 0:
                pdf = _f4(0.0)
            beta = scale(mul(beta, weight), compression)
            if same_side(b, FOLLOWED, ng, wo, d) == 0:  # the lobe of a shading normal may dip below the surface
                break
            if b.groups & STORED != 0 and depth >= FORKS:
                survival = min(largest(beta), _f4(1.0))
                if not u_end < survival:
                    break
                beta = scale(beta, _f4(1.0) / survival)
            if not largest(beta) > _f4(0.0):
                break
            left = p
            o = leave(p, ng, gap, d[0], d[1], d[2])
            near, far = _f4(0.0), _INF
