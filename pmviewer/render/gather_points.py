"""The gather rays of one pixel, replayed with the numbers that the eye pass used: where they go and what they bring."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.jit import device, kernel
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.random import draw4
from pmviewer.kernels.raycast import closest_hit
from pmviewer.kernels.scattering import (
    FOLLOWED,
    NOTHING,
    STORED,
    attenuation,
    bsdf_at,
    bsdf_sample,
    chain_numbers,
    same_side,
)
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import face, leave, surface_at
from pmviewer.kernels.vector import dot, largest, mul, scale
from pmviewer.render.cast import cast
from pmviewer.render.eye import CHAIN_SET, FORKS, PIXEL_SET, camera_ray, pixel_seed
from pmviewer.render.gather import gather_light, gather_survival
from pmviewer.render.guide import AIM_WORDS, aim, gather_direction

_f4 = np.float32
_u4 = np.uint32
_i8 = np.int64
_INF = _f4(np.inf)

POINT_COLUMNS = 10
"""Of a gather ray: its start (3), its end on the first surface that it meets (3), the radiance that it adds to the
pixel (red, green, blue), and 1 if photons guided it, 0 if it followed the BSDF."""


@device
def _replay(
    scene,
    eye,
    photons,
    sites,
    guides,
    corner,
    shadows,
    caustic_map,
    choice_map,
    p,
    ng,
    gap,
    b,
    wo,
    beta,
    seed,
    rows,
    row,
    counts,
):
    """The gather rays of the point p into `rows` from `row` on; returns the next free row."""
    found = stack_i4(AIM_WORDS)
    guided, m = aim(guides, eye, p, ng, b, wo, seed, found)
    n = eye.gather_rays
    for j in range(n):
        wi, weight, pdf, share, u_end, sample = gather_direction(
            scene, eye, guides, found, guided, m, b, wo, j, n, seed, _f4(0.0), _f4(0.0), _f4(0.0)
        )
        if row >= len(rows) or dot(wi, ng) <= _f4(0.0) or not largest(weight) > _f4(0.0):
            continue
        survival = gather_survival(eye, beta, weight, share)
        if not u_end < survival:
            continue
        hit = cast(scene, p, ng, gap, wi)
        if hit[0] < 0:
            continue
        L = gather_light(
            scene, eye, photons, sites, corner, shadows, caustic_map, choice_map, hit, wi, seed, sample, counts
        )
        L = scale(mul(mul(beta, weight), L), share / (survival * _f4(n)))
        for k in range(3):
            rows[row, k], rows[row, 3 + k], rows[row, 6 + k] = p[k], hit[3][k], L[k]
        rows[row, 9] = _f4(0.0) if pdf > _f4(0.0) else _f4(1.0)
        row += 1
    return row


@kernel
def gather_points(
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
    pixel,
    counts,
    rows,
):
    """Gather rays of the pixel in the pass of the eye record into rows, float32 (n, POINT_COLUMNS); returns how many.

    Rays that meet nothing are left out. Maps are those of `pmviewer.render.eye.eye_pass`; counts: int64 (N_COUNTS,) of
    scratch.
    """
    scene, eye = scenes[0], eyes[0]
    caustic_map, photons, choice_map = caustic_maps[0], global_maps[0], choice_maps[0]
    sites, shadows, guides, corner = site_maps[0], shadow_maps[0], guide_maps[0], corners[0]
    index, seed = eye.index, pixel_seed(eye, pixel)
    ux, uy, _, _ = draw4(eye.sequence, seed, index, PIXEL_SET)
    o, d, near, far = camera_ray(eye, pixel, ux, uy)
    beta = (_f4(1.0), _f4(1.0), _f4(1.0))
    row = _i8(0)
    for depth in range(eye.max_depth + 1):
        t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], near, far)
        if prim < 0:
            break
        p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
        wo = (-d[0], -d[1], -d[2])
        material = material_of(scene, prim)
        beta = attenuation(scene, material, ng, d, t, beta)
        b = bsdf_at(scene, prim, material, u, v, p, ng, ns, wo, eye.glossy)
        if b.groups == NOTHING:
            break
        ng = face(ng, wo)
        if b.groups & STORED != 0:
            row = _replay(
                scene,
                eye,
                photons,
                sites,
                guides,
                corner,
                shadows,
                caustic_map,
                choice_map,
                p,
                ng,
                gap,
                b,
                wo,
                beta,
                seed,
                rows,
                row,
                counts,
            )
        if b.groups & FOLLOWED == 0:
            break
        u_lobe, bu, bv, u_end = chain_numbers(scene, eye.sequence, seed, index, CHAIN_SET + depth)
        d, weight, _, compression = bsdf_sample(scene, b, FOLLOWED, wo, u_lobe, bu, bv)
        if same_side(b, FOLLOWED, ng, wo, d) == 0:
            break
        beta = scale(mul(beta, weight), compression)
        if b.groups & STORED != 0 and depth >= FORKS:
            survival = min(largest(beta), _f4(1.0))
            if not u_end < survival:
                break
            beta = scale(beta, _f4(1.0) / survival)
        if not largest(beta) > _f4(0.0):
            break
        o = leave(p, ng, gap, d[0], d[1], d[2])
        near, far = _f4(0.0), _INF
    return row
