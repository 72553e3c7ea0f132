"""The eye pass: one sample per pixel of Jensen's four-way split (R1), from the maps of this pass.

From the camera, mirrors, glass and smooth glossy lobes are followed. Wherever a surface has lobes that photons are
stored for, direct light is sampled, caustics come from the caustic map, and indirect light from the global map: shown
directly (`progressive`) or by a final gather (`gather`, see `pmviewer.render.gather.gather`). A surface with lobes of
both kinds does both, so that a chain may light up at every surface it meets.

Random numbers of a pixel are Owen-scrambled Sobol points over the passes, keyed by (seed, pixel); their dimensions are
in `pmviewer.kernels.dimensions`.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.bsdf.scattering import FOLLOWED, NOTHING, STORED, is_delta, shading_normal
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import BSDF, CHAIN_LIGHT, OUTLINE, PIXEL, PIXEL_SALT
from pmviewer.kernels.lights.light import emitted, environment_radiance
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.random import draw4, hash3
from pmviewer.kernels.scene import light_of
from pmviewer.kernels.surface import face, leave, surface_at
from pmviewer.kernels.vector import add, dot, is_good, largest, mul, normalize, scale
from pmviewer.maps.record import CAUSTIC as CAUSTIC_CLASS
from pmviewer.render.chain import BLACK, arrive, follow_camera_path
from pmviewer.render.direct.choice import BY_POWER, LIST_WORDS, choose_by_power, choose_near
from pmviewer.render.direct.direct import found_light, light_samples
from pmviewer.render.gather.cached import cached, surface_rays
from pmviewer.render.gather.guide import AIM_WORDS, aim
from pmviewer.render.given import Aim, Sampler, opened
from pmviewer.render.pixel_radius import OF_CAUSTIC, OF_GLOBAL, count_found, own_radius
from pmviewer.render.record import C_CUT, C_DROPPED, C_RAYS, C_SAVED, C_SHADOW_RAYS
from pmviewer.render.reflect import reflected, unfound

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_u4 = np.uint32
_INF = _f4(np.inf)
_CAUSTICS = np.int32(1 << CAUSTIC_CLASS)

EMISSION, DIRECT, SPECULAR, CAUSTIC, INDIRECT = 0, 3, 6, 9, 12
ALBEDO, NORMAL, DEPTH = 15, 18, 21


@device
def pixel_seed(eye, pixel):
    return hash3(eye.seed, _u4(pixel), _u4(PIXEL_SALT))


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
        ux, uy, _, _ = draw4(eye.sequence, seed, _u4(eye.index * _u4(eye.outline_rays) + _u4(j)), OUTLINE)
        o, d, near, far = camera_ray(eye, pixel, ux, uy)
        t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], near, far)
        if prim < 0:
            if scene.environment >= 0:
                total = add(total, environment_radiance(scene, d))
        elif light_of(scene, prim) >= 0:
            p, ng, _, _ = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
            total = add(total, emitted(scene, light_of(scene, prim), prim, p, ng, d))
    return scale(total, _f4(1.0) / _f4(eye.outline_rays))


@device
def _direct(given, si, group, choice, n_bsdf, sampler, numbers, counts):
    """Radiance by the light samples of the choice (`light_samples`), their rays counted."""
    L, rays, saved = light_samples(
        given.scene, given.shadows, si, group, choice, n_bsdf, sampler, numbers[0], numbers[1], numbers[2]
    )
    counts[C_RAYS] += rays
    counts[C_SHADOW_RAYS] += rays
    counts[C_SAVED] += saved
    return L


@device
def _from_maps(given, si, beta, pixel, radii, film, counts, whole):
    """What the maps show directly by the STORED lobes: caustics, and the terms that the method takes from the global
    map. `whole`: at the camera ray's own surface, so that terms are told apart."""
    eye = given.eye
    if eye.caustic_mask != 0:
        r = own_radius(radii, OF_CAUSTIC, pixel, eye.caustic_radius)
        L = reflected(given.caustic_map, eye, r, si, eye.caustic_mask)
        count_found(radii, OF_CAUSTIC, pixel, given.caustic_map, eye, r, si, eye.caustic_mask)
        deposit(film, counts, pixel, CAUSTIC if whole else SPECULAR, mul(beta, L))
    for k in range(3):  # a loop, so that the look-up is compiled once
        mask, term = eye.global_mask, INDIRECT
        if k == 1:
            mask, term = eye.direct_mask, DIRECT
        elif k == 2:
            mask, term = eye.global_caustics, CAUSTIC
        if mask != 0:
            r = own_radius(radii, OF_GLOBAL, pixel, eye.global_radius)
            L = reflected(given.global_map, eye, r, si, mask)
            count_found(radii, OF_GLOBAL, pixel, given.global_map, eye, r, si, mask)
            deposit(film, counts, pixel, term if whole else SPECULAR, mul(beta, L))


@device
def _stored(given, si, beta, pixel, place, scratch, radii, film, counts, whole):
    """Light by the STORED lobes of a surface: direct light, what the maps show, gather rays. `place`: the pixel's two
    numbers for the first light sample; scratch: lists of lights and of photons. Returns the choice of lights."""
    eye = given.eye
    seed = pixel_seed(eye, pixel)
    u_pick, bu, bv, u_lobe = draw4(eye.sequence, seed, eye.index, BSDF)
    known, gather = cached(given, si, counts)
    aimed = Aim(scratch[1], _i8(0), _i8(0))
    if gather > 0:
        aimed = aim(given, si, seed, scratch[1])
    n_bsdf = _i8(0)
    if eye.mis != 0:
        n_bsdf = max(gather - aimed.rays, _i8(1))
    choice = choose_by_power(scratch[0], eye.light_samples)
    if eye.direct != 0:
        if eye.choice != BY_POWER:
            choice = choose_near(given.scene, eye, given.choice_map, si.p, si.ng, scratch[0])
        sampler = Sampler(eye.sequence, seed, eye.index)
        L = _direct(given, si, STORED, choice, n_bsdf, sampler, (u_pick, place[0], place[1]), counts)
        deposit(film, counts, pixel, DIRECT if whole else SPECULAR, mul(beta, L))
    _from_maps(given, si, beta, pixel, radii, film, counts, whole)
    n = _i8(gather)
    if eye.direct != 0:
        n = max(n, n_bsdf)
    if eye.gather_rays > 0:
        n = max(n, _i8(1))
    if n > 0:
        numbers = (u_lobe, bu, bv)
        direct, indirect = surface_rays(given, known, gather, si, beta, choice, aimed, n, numbers, seed, counts)
        share = scale(beta, _f4(1.0) / _f4(n))
        deposit(film, counts, pixel, DIRECT if whole else SPECULAR, mul(share, direct))
        if eye.gather_rays > 0:
            deposit(film, counts, pixel, INDIRECT if whole else SPECULAR, mul(share, indirect))
    return choice


@device
def _followed(given, si, beta, pixel, depth, choice, lights, radii, film, counts):
    """Light by FOLLOWED lobes that are no deltas, besides what following them finds. Returns the choice of lights."""
    eye = given.eye
    if eye.unfound != 0:
        r = own_radius(radii, OF_CAUSTIC, pixel, eye.caustic_radius)
        L = unfound(given.caustic_map, eye, r, si)
        if si.bsdf.groups & STORED == 0:
            count_found(radii, OF_CAUSTIC, pixel, given.caustic_map, eye, r, si, _CAUSTICS)
        deposit(film, counts, pixel, SPECULAR, mul(beta, L))
    if eye.followed_direct != 0:
        choice = choose_by_power(lights, eye.light_samples)
        sampler = Sampler(eye.sequence, pixel_seed(eye, pixel), eye.index)
        u_pick, u, v, _ = draw4(sampler.sequence, sampler.seed, sampler.index, CHAIN_LIGHT + depth)
        L = _direct(given, si, FOLLOWED, choice, eye.mis, sampler, (u_pick, u, v), counts)
        deposit(film, counts, pixel, SPECULAR, mul(beta, L))
    return choice


@device
def _found(given, left, pdf, choice, prim, p, ng, d):
    """Radiance of what a camera path meets: primitive `prim` at p with normal ng, or the sky (prim < 0). Light samples
    at the last surface, `left` with the density pdf, may have found it too; pdf is 0 after a delta."""
    scene, eye = given.scene, given.eye
    if pdf > _f4(0.0):
        return found_light(scene, left, d, pdf, eye.mis, choice, eye.biased, prim, p, ng)
    if prim < 0:
        return environment_radiance(scene, d)
    return emitted(scene, light_of(scene, prim), prim, p, ng, d)


@kernel
def eye_pass(given, outline, radii, film, counts, first, last):
    """Add one sample to each of the pixels first … last−1.

    given: PassData of arrays (1,); outline: uint8 (pixels,), 1 where emission gets camera rays of its own
    (`pmviewer.render.direct.outline`), or (0,); radii: float32 (pixels, COLUMNS), look-up radii of the pixels
    (`pmviewer.render.pixel_radius`), or None; film: float64 (pixels, CHANNELS), see `pmviewer.render.planes`; counts:
    int64 (N_COUNTS,).
    """
    given = opened(given)
    scene, eye = given.scene, given.eye
    lights, found = stack_i4(LIST_WORDS), stack_i4(AIM_WORDS)
    for pixel in range(first, last):
        seed = pixel_seed(eye, pixel)
        ux, uy, lu, lv = draw4(eye.sequence, seed, eye.index, PIXEL)
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
                if scene.environment >= 0 and not (whole and outlined):
                    deposit(film, counts, pixel, seen, mul(beta, _found(given, left, pdf, choice, prim, o, d, d)))
                break
            ng, si, beta = arrive(scene, eye, o, d, t, prim, u, v, beta)
            b = si.bsdf
            if whole:
                properties(scene, film, eye, pixel, b.albedo, face(shading_normal(b), si.wo), si.p)
            if light_of(scene, prim) >= 0 and not (whole and outlined):
                deposit(film, counts, pixel, seen, mul(beta, _found(given, left, pdf, choice, prim, si.p, ng, d)))
            if b.groups == NOTHING:
                break
            if b.groups & STORED != 0:
                choice = _stored(given, si, beta, pixel, (lu, lv), (lights, found), radii, film, counts, whole)
            if b.groups & FOLLOWED == 0:
                break
            if depth == eye.max_depth:
                counts[C_CUT] += 1
                break
            if not is_delta(b):
                choice = _followed(given, si, beta, pixel, depth, choice, lights, radii, film, counts)
            d, beta, pdf = follow_camera_path(given, si, beta, seed, depth)
            if eye.followed_direct == 0:
                pdf = _f4(0.0)
            if not largest(beta) > _f4(0.0):
                break
            left = si.p
            o = leave(si.p, si.ng, si.gap, d[0], d[1], d[2])
            near, far = _f4(0.0), _INF
