"""Tracing virtual lights: photons with what their weights need of their path (R10).

Every hit of a photon on a lobe that stores is a candidate. A candidate's q (see `pmviewer.maps.virtual_lights`) is, of
the path z0, z1 … zm = y,

    first hit           q = (1/N)·spread/cosθ₁
    beyond              q = (1/N)·spread/cosθ₁·(1 − s₁)·(|n₁·ω₁|/P₁)·Π_{i=2}^{m−1} Y(f_i)·κ_i·|n_i·ω_i|/P_i · Y(f_y)·κ_y

(`spread` of `pmviewer.kernels.lights.start`). P_i is the density with which the photon was scattered into ω_i, roulette
and choice of lobes included; Y(f_i)·κ_i that of the same scattering in a gathering walk, κ = |n_s·ω|/|n·ω| of a shading
normal. For grey diffuse walls Y(f)·|n·ω|/P is 1. Written here is all of it but the last Y(f_y), which depends on where
y is seen from, and at first hits but 1 − s₁. Paths over lobes that are followed have q = 0.

Random numbers are keyed by (seed, the trajectory's index over all passes, dimension), as in the light pass.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.occlusion import occluded
from pmviewer.kernels.accel.opacity import over_opacity
from pmviewer.kernels.bsdf.albedo import stored_albedo
from pmviewer.kernels.bsdf.dispersion import beyond, colour_of_split, met_by, new_wave
from pmviewer.kernels.bsdf.plain import INV_PI
from pmviewer.kernels.bsdf.scattering import (
    FOLLOWED,
    NOTHING,
    STORED,
    attenuation,
    bsdf_at,
    bsdf_f,
    bsdf_sample,
    is_lambertian,
    pick_group,
    same_side,
    shading_normal,
)
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import (
    EMISSION,
    EMITTER,
    FURTHER_PHOTONS_SALT,
    PHOTON_SCATTER,
    SEEN_EMITTER,
    SEEN_LIGHT,
    WAVE,
)
from pmviewer.kernels.lights.light import emit_from, pick_light
from pmviewer.kernels.lights.start import seen_from, spread_over
from pmviewer.kernels.media.medium import light_medium
from pmviewer.kernels.memory import float_of_bits
from pmviewer.kernels.random import draw1, draw4, hash3
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import STRAIGHT, adjoint_cosines, face, leave, surface_at
from pmviewer.kernels.vector import dot, is_good, luminance, mul, scale, sub
from pmviewer.maps.record import BOUNCES, HAD_DIFFUSE, LAST_SPECULAR
from pmviewer.maps.virtual_lights import (
    FULL,
    MODIFIED,
    OF_PATHS,
    V_BLOCKED,
    V_F,
    V_FIRST,
    V_GAP,
    V_LAMBERTIAN,
    V_N,
    V_NS,
    V_OPACITY,
    V_P,
    V_PHI,
    V_PRIM,
    V_Q,
    V_U,
    V_V,
    V_WI,
)
from pmviewer.photons.light_pass.flight import medium_after
from pmviewer.photons.virtual.flight import C_DROPPED, C_RAYS, C_STORED, Walker, photon, put, to_surface

_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32
_i8 = np.int64
_BEFORE = _f4(1.0 - 2.0**-13)
LEAST_COSINE = _f4(1e-4)

TRACE_DTYPE = np.dtype(
    [
        ("seed", "u4"),
        ("first_index", "i8"),  # index over all passes of this pass's trajectory 0
        ("sequence", "i4"),
        ("max_bounces", "i4"),
        ("glossy", "f4"),  # roughness from which glossy lobes are lit by virtual lights
        ("estimator", "i4"),
    ],
    align=True,
)


@device
def leaning(b, ng, w):
    """|n_s·w|/|n·w|: by how much more light from w a shading normal catches than the surface does."""
    ns = shading_normal(b)
    if abs(dot(ns, ng)) >= STRAIGHT:
        return _f4(1.0)
    return abs(dot(ns, w)) / max(abs(dot(ng, w)), LEAST_COSINE)


@device
def is_blocked(scene, pass_, seed, index, bounces, p, ng, gap):
    """Whether a sample of the lights, drawn as photons leave them, is hidden from the surface point p."""
    u0, u1, u2, u3 = draw4(pass_.sequence, seed, index, SEEN_LIGHT + bounces)
    light, _, _ = pick_light(scene, draw1(pass_.sequence, seed, index, SEEN_EMITTER + bounces))
    wi, end, area = seen_from(scene, light, (u2, u3), (u0, u1), p)
    if not (area > _f4(0.0) and dot(ng, wi) > _f4(0.0)):
        return True
    o = leave(p, ng, gap, wi[0], wi[1], wi[2])
    to = sub(end, o)
    return occluded(scene, o[0], o[1], o[2], to[0], to[1], to[2], _f4(0.0), _BEFORE)


@device
def _surface(row, b, p, ng, ns, gap, prim, u, v, wi):
    put(row, V_P, p)
    put(row, V_N, ng)
    put(row, V_NS, ns)
    put(row, V_WI, wi)
    row[V_GAP], row[V_U], row[V_V] = gap, u, v
    row[V_PRIM] = float_of_bits(_u4(np.int32(prim)))
    plain = is_lambertian(b) and abs(dot(shading_normal(b), ng)) >= STRAIGHT
    row[V_LAMBERTIAN] = _f4(1.0) if plain else _f4(0.0)
    put(row, V_F, scale(b.albedo, INV_PI))


@kernel
def trace_virtual_lights(scenes, passes, i0, i1, photons_out, lights_out, counts):
    """Trace the trajectories i0 … i1−1 of a pass.

    scenes: SCENE_DTYPE (1,); passes: TRACE_DTYPE (1,); photons_out: float32 (capacity, 6) and lights_out: float32
    (capacity, COLUMNS) receive the candidates, powers in units of the lights' total luminance; counts: int64
    (N_COUNTS,), counts[C_STORED] being the rows filled so far.

    Returns the next trajectory: less than i1 when a buffer may not hold another one's candidates.
    """
    scene, pass_ = scenes[0], passes[0]
    out = (photons_out, lights_out, counts)
    paths = pass_.estimator in OF_PATHS
    stops = pass_.estimator in (FULL, MODIFIED)
    for i in range(i0, i1):
        if counts[C_STORED] + pass_.max_bounces > len(lights_out):
            return i
        place = _i8(pass_.first_index) + _i8(i)
        index, seed = _u4(place), pass_.seed
        if place >> 32 != 0:  # a Sobol set has 2³² points; the next trajectories use other sets
            seed = hash3(seed, _u4(place >> 32), _u4(FURTHER_PHOTONS_SALT))
        u0, u1, u2, u3 = draw4(pass_.sequence, seed, index, EMISSION)
        light, _, _ = pick_light(scene, draw1(pass_.sequence, seed, index, EMITTER))
        z0, d, beta = emit_from(scene, light, (u2, u3), (u0, u1))
        if not is_good(beta):
            counts[C_DROPPED] += 1
            continue
        wave = new_wave(scene, pass_.sequence, seed, index, WAVE)
        q, first = _f4(0.0), True
        walker = Walker(z0, d, light_medium(scene, light), beta, _u4(0), 0)
        while walker.bounces < pass_.max_bounces:
            alive, flown, prim, u, v, t = to_surface(scene, pass_, walker, (seed, index, light), out)
            if not alive or prim < 0:
                break
            if flown.bounces > walker.bounces:  # collisions on the way, which no gathering walk makes
                q, first = _f4(0.0), False
            o, d, medium, beta, flags, bounces = flown
            p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
            material = material_of(scene, prim)
            beta = attenuation(scene, material, ng, d, t, beta)
            wi = (-d[0], -d[1], -d[2])
            b = bsdf_at(scene, prim, material, u, v, p, ng, ns, wi, pass_.glossy, wave)
            wave, beta = met_by(scene, b, wave, beta)
            before = luminance(beta)
            if b.groups == NOTHING or not (is_good(beta) and before > _f4(0.0)):
                break
            if bounces == 0 and paths:
                offset = sub(p, z0)
                q = spread_over(scene, light, (u2, u3), d, dot(offset, offset))
                q /= max(abs(dot(ng, wi)), LEAST_COSINE)
            facing = face(ng, wi)
            blocked = False
            if b.groups & STORED != 0:
                row = lights_out[counts[C_STORED]]
                _surface(row, b, p, ng, ns, gap, prim, u, v, wi)
                lean = leaning(b, ng, wi)
                put(row, V_PHI, scale(beta, lean))
                if pass_.estimator == MODIFIED and not first:
                    counts[C_RAYS] += 1
                    blocked = is_blocked(scene, pass_, seed, index, bounces, p, facing, gap)
                row[V_FIRST] = _f4(1.0) if first else _f4(0.0)
                row[V_BLOCKED] = _f4(1.0) if blocked else _f4(0.0)
                row[V_Q] = q if first else q * lean
                row[V_OPACITY] = _f4(1.0) / over_opacity(scene, prim, u, v, p, (_f4(1.0), _f4(1.0), _f4(1.0)))[0]
                word = _u4(flags | _u4(min(bounces, BOUNCES)))
                photon(photons_out[counts[C_STORED]], p, wi, beta, word, light)
                counts[C_STORED] += 1
            s0, s1, s2, u_lobe = draw4(pass_.sequence, seed, index, PHOTON_SCATTER + bounces)
            group, share, u_lobe = pick_group(b, wi, u_lobe)
            d, weight, pdf, _ = bsdf_sample(scene, b, group, wi, u_lobe, s0, s1)
            if same_side(b, group, facing, wi, d) == 0:
                break
            if abs(dot(shading_normal(b), facing)) < STRAIGHT:
                weight = scale(weight, adjoint_cosines(shading_normal(b), facing, wi, d))
            after = scale(mul(beta, weight), share)
            if not is_good(after):
                counts[C_DROPPED] += 1
                break
            # Where it sees no light, a photon of `modified` goes on as the gathering walk does, with less power.
            survival = _f4(1.0) if blocked else min(luminance(after) / before, _f4(1.0))
            if not s2 < survival:
                break
            beta = colour_of_split(scene, b, wave, d, scale(after, _f4(1.0) / survival))
            wave = beyond(b, wave, d)
            if group == FOLLOWED:
                q, first, flags = _f4(0.0), False, _u4(flags | _u4(LAST_SPECULAR))
            elif paths:
                scattered = abs(dot(facing, d)) * share / (pdf * survival)
                if first:
                    q *= scattered
                    if stops:
                        q *= max(_f4(1.0) - stored_albedo(scene, b, d), _f4(0.0))
                else:
                    q *= scattered * leaning(b, ng, wi) * luminance(bsdf_f(b, STORED, wi, d))
                    if blocked:
                        q /= max(stored_albedo(scene, b, d), LEAST_COSINE)
            if group != FOLLOWED:
                first, flags = False, _u4(HAD_DIFFUSE)
            medium = medium_after(scene, prim, ng, wi, d, medium)
            walker = Walker(leave(p, ng, gap, d[0], d[1], d[2]), d, medium, beta, flags, bounces + 1)
    return i1
