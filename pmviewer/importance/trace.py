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

Media weaken importons on their straight way from surface to surface, as they weaken what is seen through them. What
media scatter towards the camera comes from the volume map, which has no importance: all of its photons are stored.

Random numbers of an importon are keyed by (seed, index, dimension), see `pmviewer.kernels.dimensions`.
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
from pmviewer.kernels.bsdf.scattering import FOLLOWED, NOTHING, STORED, is_delta, pick_group, shading_normal
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.dimensions import IMAGE_PLACE, IMPORTON_SCATTER
from pmviewer.kernels.memory import float_of_bits
from pmviewer.kernels.random import SOBOL, draw4
from pmviewer.kernels.surface import face
from pmviewer.kernels.vector import along, dot, luminance, mul, scale
from pmviewer.maps.photon_words import encode_direction
from pmviewer.render.cast import leaving, ray_of_camera
from pmviewer.render.chain import WHITE, arrive, scatter
from pmviewer.render.hidden_lights import past_lights
from pmviewer.render.lens import through_lens
from pmviewer.render.straight import cast_on, way

_f4 = np.float32
_u4 = np.uint32
_INF = _f4(np.inf)
_ROOT_PI = _f4(math.sqrt(math.pi))

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


@specialised
def image_ray(eye, x, y, a, b):
    """The ray through the place (x, y) of the image, in pixels, and (a, b) in [0, 1)² of the lens, from the near to the
    far plane, and the changes of its place and direction with these (`pmviewer.importance.footprint.start`)."""
    if has(eye, "inverse_focus"):
        return lambda eye, x, y, a, b: _ray_of_lens(eye, x, y, a, b)
    return lambda eye, x, y, a, b: _ray_of_pinhole(eye, x, y)


@device
def _ray_of_lens(eye, x, y, a, b):
    """The lens's part of the changes is that over all of it: two vectors that span its area."""
    right = (eye.x_right, eye.y_right, eye.z_right)
    down = (eye.x_down, eye.y_down, eye.z_down)
    raw = along(along((eye.x_corner, eye.y_corner, eye.z_corner), right, x), down, y)
    ray, towards = through_lens(eye, raw, a, b)
    d, inv = ray.d, _f4(1.0) / _f4(math.sqrt(dot(towards, towards)))
    across = scale((eye.x_lens_right, eye.y_lens_right, eye.z_lens_right), _ROOT_PI)
    up = scale((eye.x_lens_top, eye.y_lens_top, eye.z_lens_top), _ROOT_PI)
    bend = -eye.inverse_focus * inv
    zero = (_f4(0.0), _f4(0.0), _f4(0.0))
    px, py, dx, dy = right, down, zero, zero
    if eye.orthographic == 0:
        px, py, dx, dy = zero, zero, _turned(right, d, inv), _turned(down, d, inv)
    return ray, (px, py, across, up), (dx, dy, _turned(across, d, bend), _turned(up, d, bend))


@device
def _turned(change, d, inv):
    """Change of a unit vector d when what it was made from, 1/inv long, changes."""
    return scale(along(change, d, -dot(change, d)), inv)


@device
def _ray_of_pinhole(eye, x, y):
    right = (eye.x_right, eye.y_right, eye.z_right)
    down = (eye.x_down, eye.y_down, eye.z_down)
    raw = along(along((eye.x_corner, eye.y_corner, eye.z_corner), right, x), down, y)
    zero = (_f4(0.0), _f4(0.0), _f4(0.0))
    if eye.orthographic != 0:
        P, D = start(right, down, zero, zero)
        forward = (eye.x_forward, eye.y_forward, eye.z_forward)
        return ray_of_camera(eye, raw, forward), P, D
    inv = _f4(1.0) / _f4(math.sqrt(dot(raw, raw)))
    d = scale(raw, inv)
    dx, dy = scale(along(right, d, -dot(right, d)), inv), scale(along(down, d, -dot(down, d)), inv)
    P, D = start(zero, zero, dx, dy)
    return ray_of_camera(eye, zero, d), P, D


@device
def _kept(pass_, b, bounced, corner):
    """Whether the caustic and whether the global importance map keep an importon at a surface with BSDF b. `bounced`:
    after a STORED lobe; `corner`: where a gather ray gathers again."""
    caustic, global_ = False, False
    if b.groups & STORED != 0:
        caustic = pass_.caustic != 0 and (corner or not bounced)
        global_ = pass_.global_ != 0 and not corner and (bounced or pass_.gather == 0)
    elif pass_.unfound != 0 and not bounced and b.groups & FOLLOWED != 0 and not is_delta(b):
        caustic = pass_.caustic != 0
        global_ = not caustic and pass_.gather == 0  # one importance serves both maps
    return caustic, global_


@device
def _store(out, row, si, weight, footprint):
    n = si.ng
    out[row, 0], out[row, 1], out[row, 2] = si.p
    out[row, 3] = float_of_bits(_u4(encode_direction(n[0], n[1], n[2])))
    out[row, 4], out[row, 5] = weight, footprint


@device
def _pick(si, may_store, may_follow, u_lobe):
    """The group by which the path goes on, NOTHING if by none; one over its probability; a number to use again."""
    group, share = STORED, _f4(1.0)
    if may_store and may_follow:
        group, share, u_lobe = pick_group(si.bsdf, si.wo, u_lobe)
    elif may_follow:
        group = FOLLOWED
    elif not may_store:
        group = NOTHING
    return group, share, u_lobe


@device
def _bounce(scene, hit, si, group, wi, pdf, compression, P, D):
    """Changes of direction after a lobe of the group sent the ray to wi (`pmviewer.importance.footprint`)."""
    bend = curvature(scene, hit.prim, hit.u, hit.v, hit.p, si.ng)
    n = face(shading_normal(si.bsdf), hit.ns)  # on the side for which the curvature was taken
    if group == STORED:
        D = bounce_stored(bend, n, P, wi)
    else:
        transmitted = dot(si.ng, wi) < _f4(0.0)
        D = bounce_specular(bend, n, P, D, si.wo, wi, transmitted, _f4(math.sqrt(compression)), is_delta(si.bsdf))
    return spread(D, wi, pdf) if pdf > _f4(0.0) else D


@device
def _trace(scene, pass_, i, ray, P, D, out, counts):
    """Trace importon i along `ray`, whose place and direction change by P and D over a pixel; the rest as for
    `trace_importons`, `out` being both buffers."""
    beta, compressed = WHITE, _f4(1.0)
    bounced, again, length = False, False, _f4(0.0)
    left = pass_.max_depth + 1
    bounces = 0
    while left > 0:
        left -= 1
        hit, tint = cast_on(scene, ray, bounced)
        beta = mul(beta, tint)
        counts[C_RAYS] += 1
        if hit.prim < 0:
            break
        si, beta = arrive(scene, pass_.glossy, ray.d, hit, beta)
        groups = si.bsdf.groups
        if groups == NOTHING:
            break
        P = travel(P, D, ray.d, way(scene, ray.o, ray.d, hit), hit.ng)
        length += hit.t
        before = luminance(beta)
        weight = before * compressed
        if not (weight > _f4(0.0) and weight < _INF):
            counts[C_DROPPED] += 1
            break
        corner = groups & STORED != 0 and bounced and not again and length < pass_.corner
        again = again or corner
        to_caustic, to_global = _kept(pass_, si.bsdf, bounced, corner)
        if to_caustic:
            _store(out[0], counts[C_CAUSTIC], si, weight, footprint_importance(P))
            counts[C_CAUSTIC] += 1
        if to_global:
            _store(out[1], counts[C_GLOBAL], si, weight, footprint_importance(P))
            counts[C_GLOBAL] += 1
        u_lobe, u, v, u_end = draw4(SOBOL, pass_.seed, _u4(i), IMPORTON_SCATTER + bounces)
        bounces += 1
        may_store = corner or (pass_.gather != 0 and not bounced)
        group, share, u_lobe = _pick(si, may_store, not bounced or pass_.gather_specular != 0, u_lobe)
        if groups & group == 0:
            break
        wi, after, pdf, compression = scatter(scene, si, group, beta, u_lobe, u, v)
        after = scale(after, share)
        survival = min(luminance(after) / before, _f4(1.0))
        if not u_end < survival:
            break
        beta = scale(after, _f4(1.0) / survival)
        compressed *= compression
        D = _bounce(scene, hit, si, group, wi, pdf, compression, P, D)
        if group == STORED:
            if not bounced:
                left = pass_.max_depth
                length = _f4(0.0)
            bounced = True
        ray = leaving(si, wi)


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
    for i in range(i0, i1):
        if counts[C_CAUSTIC] + most > len(caustic_out) or counts[C_GLOBAL] + most > len(global_out):
            return i
        x, y, a, b = draw4(SOBOL, pass_.seed, _u4(i), IMAGE_PLACE)
        ray, P, D = image_ray(eye, pass_.left + x * pass_.across, pass_.top + y * pass_.down, a, b)
        _trace(scene, pass_, i, past_lights(scene, eye, ray), P, D, (caustic_out, global_out), counts)
    return i1
