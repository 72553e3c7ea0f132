"""Importons: from the camera through the scene, as the final pass looks at it (I1; course guide §3.4.1).

An importon starts through a place of the image and is scattered like a photon, but goes where eye paths go, and is
stored where these look a map up:

======================  ==================================================  ======================================
method                  caustic importance map                              global importance map
======================  ==================================================  ======================================
gather                  surfaces that store photons, met before any STORED  the first one met after a STORED bounce;
                        bounce; after one, if within the distance below     with `gather_specular` those behind
                        which gather rays gather again                      FOLLOWED lobes there, too
progressive, maps       surfaces that store photons, met through FOLLOWED   the same surfaces: the map is shown there
alone                   lobes alone
======================  ==================================================  ======================================

Weights are those of eye paths, so that ΣΨL over importons is the sum of the pixels: on refraction they are multiplied
by (n_i/n_t)², which a photon's power is not. Roulette goes by luminance without that factor: it cancels where a path
leaves the glass again, and paths inside must not die of it.

Random numbers of an importon are keyed by (seed, index, dimension set): set 0 is the place in the image, 1 + b the b-th
scattering.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.importance.footprint import (
    bounce_specular,
    bounce_stored,
    curvature,
    footprint_importance,
    spread,
    start,
    travel,
)
from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.bsdf.scattering import (
    FOLLOWED,
    NOTHING,
    STORED,
    attenuation,
    bsdf_at,
    bsdf_sample,
    is_delta,
    pick_group,
    same_side,
    shading_normal,
)
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import float_of_bits
from pmviewer.kernels.random import SOBOL, draw4
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import face, leave, surface_at
from pmviewer.kernels.vector import add, along, dot, luminance, mul, scale
from pmviewer.maps.photon_words import encode_direction

_f4 = np.float32
_i8 = np.int64
_u4 = np.uint32
_INF = _f4(np.inf)

IMPORTON_PASS_DTYPE = np.dtype(
    [
        ("seed", "u4"),
        ("max_depth", "i4"),
        ("glossy", "f4"),  # roughness from which glossy lobes are looked up
        ("caustic", "i4"),  # whether the caustic importance map is filled
        ("global_", "i4"),  # whether the global one is
        ("gather", "i4"),  # whether the global map is looked up after a bounce, or at the first surface
        ("gather_specular", "i4"),  # whether gather rays follow mirrors and glass
        ("corner", "f4"),  # gather rays shorter than this gather again where they land
        ("unfound", "i4"),  # whether followed lobes look the caustic map up (`pmviewer.render.reflect.unfound`)
        ("left", "f4"),  # part of the image that importons start through, in pixels
        ("top", "f4"),
        ("across", "f4"),
        ("down", "f4"),
    ],
    align=True,
)

IMPORTON_COLUMNS = 6
"""Position, normal (bits of `encode_direction`), weight, footprint importance."""
N_COUNTS = 4
C_CAUSTIC, C_GLOBAL, C_RAYS, C_DROPPED = range(N_COUNTS)


@device
def image_ray(eye, x, y):
    """Through the place (x, y) of the image, in pixels: origin and unit direction, their changes with the image's
    coordinates (`pmviewer.importance.footprint.start`), and the distances at which near and far planes are met."""
    o = (eye.x_eye, eye.y_eye, eye.z_eye)
    right = (eye.x_right, eye.y_right, eye.z_right)
    down = (eye.x_down, eye.y_down, eye.z_down)
    raw = along(along((eye.x_corner, eye.y_corner, eye.z_corner), right, x), down, y)
    zero = (_f4(0.0), _f4(0.0), _f4(0.0))
    if eye.orthographic != 0:
        P, D = start(right, down, zero, zero)
        return add(o, raw), (eye.x_forward, eye.y_forward, eye.z_forward), P, D, eye.near, eye.far
    inv = _f4(1.0) / _f4(math.sqrt(dot(raw, raw)))
    d = scale(raw, inv)
    dx, dy = scale(along(right, d, -dot(right, d)), inv), scale(along(down, d, -dot(down, d)), inv)
    per_depth = _f4(1.0) / dot(d, (eye.x_forward, eye.y_forward, eye.z_forward))
    P, D = start(zero, zero, dx, dy)
    return o, d, P, D, eye.near * per_depth, eye.far * per_depth


@device
def _store(out, row, p, n, weight, footprint):
    out[row, 0], out[row, 1], out[row, 2] = p
    out[row, 3] = float_of_bits(_u4(encode_direction(n[0], n[1], n[2])))
    out[row, 4], out[row, 5] = weight, footprint


@kernel
def trace_importons(scenes, eyes, passes, i0, i1, caustic_out, global_out, counts):
    """Trace importons i0 … i1−1.

    scenes: SCENE_DTYPE (1,); eyes: EYE_DTYPE (1,); passes: IMPORTON_PASS_DTYPE (1,);
    caustic_out, global_out: float32 (capacity, IMPORTON_COLUMNS), weights in units of an importon's at the start;
    counts: int64 (N_COUNTS,), added to, the first two being rows filled.

    Returns the index of the next importon: less than i1 when a buffer may not hold another path.
    """
    scene, eye, pass_ = scenes[0], eyes[0], passes[0]
    most = 2 * pass_.max_depth + 2
    one = _f4(1.0)
    for i in range(i0, i1):
        if counts[C_CAUSTIC] + most > len(caustic_out) or counts[C_GLOBAL] + most > len(global_out):
            return i
        x, y, _, _ = draw4(SOBOL, pass_.seed, _u4(i), _i8(0))
        o, d, P, D, near, far = image_ray(eye, pass_.left + x * pass_.across, pass_.top + y * pass_.down)
        beta, compressed = (one, one, one), one
        bounced, again, length = False, False, _f4(0.0)
        left = pass_.max_depth + 1
        bounces = 0
        while left > 0:
            left -= 1
            t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], near, far)
            counts[C_RAYS] += 1
            if prim < 0:
                break
            p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
            material = material_of(scene, prim)
            beta = attenuation(scene, material, ng, d, t, beta)
            wo = (-d[0], -d[1], -d[2])
            b = bsdf_at(scene, prim, material, u, v, p, ng, ns, wo, pass_.glossy)
            if b.groups == NOTHING:
                break
            P = travel(P, D, d, t, ng)
            length += t
            ng = face(ng, wo)
            before = luminance(beta)
            weight = before * compressed
            if not (weight > _f4(0.0) and weight < _INF):
                counts[C_DROPPED] += 1
                break
            may_store = pass_.gather != 0 and not bounced
            may_follow = not bounced or pass_.gather_specular != 0
            if b.groups & STORED != 0:
                of_pixel = footprint_importance(P)
                if bounced and not again and length < pass_.corner:
                    again = may_store = True
                    if pass_.caustic != 0:
                        _store(caustic_out, counts[C_CAUSTIC], p, ng, weight, of_pixel)
                        counts[C_CAUSTIC] += 1
                elif bounced:
                    if pass_.global_ != 0:
                        _store(global_out, counts[C_GLOBAL], p, ng, weight, of_pixel)
                        counts[C_GLOBAL] += 1
                else:
                    if pass_.caustic != 0:
                        _store(caustic_out, counts[C_CAUSTIC], p, ng, weight, of_pixel)
                        counts[C_CAUSTIC] += 1
                    if pass_.global_ != 0 and pass_.gather == 0:
                        _store(global_out, counts[C_GLOBAL], p, ng, weight, of_pixel)
                        counts[C_GLOBAL] += 1
            elif pass_.unfound != 0 and not bounced and b.groups & FOLLOWED != 0 and not is_delta(b):
                of_pixel = footprint_importance(P)
                if pass_.caustic != 0:
                    _store(caustic_out, counts[C_CAUSTIC], p, ng, weight, of_pixel)
                    counts[C_CAUSTIC] += 1
                elif pass_.gather == 0:  # one importance serves both maps
                    _store(global_out, counts[C_GLOBAL], p, ng, weight, of_pixel)
                    counts[C_GLOBAL] += 1
            u_lobe, bu, bv, u_end = draw4(SOBOL, pass_.seed, _u4(i), _i8(1 + bounces))
            bounces += 1
            share, group = one, STORED
            if may_store and may_follow:
                group, share, u_lobe = pick_group(b, wo, u_lobe)
            elif may_follow:
                group = FOLLOWED
            if b.groups & group == 0 or not (may_store or may_follow):
                break
            wi, f, pdf, compression = bsdf_sample(scene, b, group, wo, u_lobe, bu, bv)
            if same_side(b, group, ng, wo, wi) == 0:
                break
            after = scale(mul(beta, f), share)
            survival = min(luminance(after) / before, one)
            if not u_end < survival:
                break
            beta = scale(after, one / survival)
            compressed *= compression
            bend = curvature(scene, prim, u, v, p, ng)
            normal = shading_normal(b)
            if group == STORED:
                D = bounce_stored(bend, _like(normal, ns), P, wi)
                if not bounced:
                    left = pass_.max_depth
                    length = _f4(0.0)
                bounced = True
            else:
                through = dot(ng, wi) < _f4(0.0)
                eta = _f4(math.sqrt(compression))
                D = bounce_specular(bend, _like(normal, ns), P, D, wo, wi, through, eta, is_delta(b))
            if pdf > _f4(0.0):
                D = spread(D, wi, pdf)
            o = leave(p, ng, gap, wi[0], wi[1], wi[2])
            d = wi
            near, far = _f4(0.0), _INF
    return i1


@device
def _like(n, ns):
    """n on the side of ns, for which the curvature was taken."""
    return face(n, ns)
