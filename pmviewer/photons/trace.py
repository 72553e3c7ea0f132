"""Photon tracing: emission, scattering with Russian roulette, deposition (T1–T6).

Weights stay nearly equal: lights are picked by power, and a photon survives a scattering with the ratio of its power's
luminance after and before (P §0.2.2), so that survivors keep their power.

Random numbers of a photon are keyed by (seed, its index over all passes, dimension): the same photons for any number of
threads and any batch size (T2). Dimension set 0 is emission, set 1 + b the b-th scattering.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf import scatter_specular
from pmviewer.kernels.jit import device, kernel
from pmviewer.kernels.light import emit_photon
from pmviewer.kernels.memory import float_of_bits
from pmviewer.kernels.random import draw1, draw4, hash3
from pmviewer.kernels.raycast import closest_hit
from pmviewer.kernels.scene import DIFFUSE, material_kind, material_of, material_two_sided, reflectance
from pmviewer.kernels.surface import leave, surface_at
from pmviewer.kernels.vector import dot, from_basis, is_good, luminance, mul, scale
from pmviewer.kernels.warp import square_to_cosine_hemisphere
from pmviewer.maps.record import (
    BOUNCES,
    CAUSTIC,
    HAD_DIFFUSE,
    INDIRECT_CAUSTIC,
    LAST_SPECULAR,
    encode_direction,
    encode_power,
)

_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32
_i8 = np.int64
_INF = _f4(np.inf)
LIGHT_CHOICE_SET, STORE_SET = _i8(0xE817), _i8(0x10000)

LIGHT_PASS_DTYPE = np.dtype(
    [
        ("seed", "u4"),
        ("first_index", "i8"),  # index over all passes of this pass's photon 0
        ("sequence", "i4"),
        ("max_bounces", "i4"),
        ("global_trajectories", "i8"),  # photons 0 … this−1 of the pass fill the global map
        ("store_probability", "f4"),  # of a global photon (q rule "photons"); 1 otherwise
        ("caustics", "i4"),  # whether the caustic map is filled
        ("indirect_caustics", "i4"),  # whether with photons that met a diffuse surface before, too
    ],
    align=True,
)

N_COUNTS = 4
C_GLOBAL, C_CAUSTIC, C_RAYS, C_DROPPED = range(N_COUNTS)
N_LEDGER = 5
E_EMITTED, E_STORED, E_ABSORBED, E_ESCAPED, E_TERMINATED = range(N_LEDGER)
"""Energy ledger: luminance of power in units of the map's; roulette balances it in the mean."""


@device
def _store(out, row, p, wi, beta, flags, light):
    out[row, 0], out[row, 1], out[row, 2] = p
    r, g, b = encode_power(beta[0]), encode_power(beta[1]), encode_power(beta[2])
    out[row, 3] = float_of_bits(_u4(encode_direction(wi[0], wi[1], wi[2]) | _u4(flags)))
    out[row, 4] = float_of_bits(_u4(r | _u4(g << _u4(16))))
    out[row, 5] = float_of_bits(_u4(b | _u4(_u4(light) << _u4(16))))


@kernel
def trace_photons(scenes, passes, i0, i1, global_out, normals_out, caustic_out, counts, ledger):
    """Trace photons i0 … i1−1 of a pass.

    scenes: SCENE_DTYPE (1,); passes: LIGHT_PASS_DTYPE (1,); global_out, caustic_out: float32 (capacity, 6), see
    `pmviewer.maps.record`; normals_out: uint32 (capacity,), receives each global photon's surface normal, or (0,) when
    nobody needs them; counts: int64 (N_COUNTS,) and ledger: float64 (N_LEDGER,) are added to, `counts[C_GLOBAL]`
    and `counts[C_CAUSTIC]` being the rows filled so far.

    Returns the index of the next photon to trace: less than i1 when a buffer may not hold another photon's path.
    """
    scene = scenes[0]
    pass_ = passes[0]
    max_bounces = pass_.max_bounces
    for i in range(i0, i1):
        if counts[C_GLOBAL] + max_bounces > len(global_out) or counts[C_CAUSTIC] + max_bounces > len(caustic_out):
            return i
        to_global = i < pass_.global_trajectories
        place = np.int64(pass_.first_index) + np.int64(i)
        index, seed = _u4(place), pass_.seed
        if place >> 32 != 0:  # a Sobol set has 2³² points; the next photons use other sets
            seed = hash3(seed, _u4(place >> 32), _u4(LIGHT_CHOICE_SET))
        u0, u1, u2, u3 = draw4(pass_.sequence, seed, index, _i8(0))
        u_pick = draw1(pass_.sequence, seed, index, LIGHT_CHOICE_SET)
        p, d, beta, light = emit_photon(scene, u_pick, (u2, u3), (u0, u1))
        start = luminance(beta)
        ledger[E_EMITTED] += _f8(start)
        o = p
        flags = _u4(0)
        bounces = 0
        while True:
            t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], _f4(0.0), _INF)
            counts[C_RAYS] += 1
            if prim < 0:
                ledger[E_ESCAPED] += _f8(luminance(beta))
                break
            p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
            material = material_of(scene, prim)
            u0, u1, u2, _ = draw4(pass_.sequence, seed, index, _i8(1 + bounces))
            if material_kind(scene, material) != DIFFUSE:
                d, weight, _ = scatter_specular(scene, material, ns, d, u0)
                flags = _u4(flags | _u4(LAST_SPECULAR))
            else:
                albedo = reflectance(scene, material)
                if dot(ng, d) > _f4(0.0):
                    if not material_two_sided(scene, material):
                        ledger[E_ABSORBED] += _f8(luminance(beta))
                        break
                    ng, ns = scale(ng, _f4(-1.0)), scale(ns, _f4(-1.0))
                if not albedo[0] + albedo[1] + albedo[2] > _f4(0.0):
                    ledger[E_ABSORBED] += _f8(luminance(beta))
                    break
                if not is_good(beta):
                    counts[C_DROPPED] += 1
                    break
                wi = (-d[0], -d[1], -d[2])
                path_class = np.int32(flags >> _u4(6))
                word = _u4(flags | _u4(min(bounces, BOUNCES)))
                is_caustic = path_class == CAUSTIC or (path_class == INDIRECT_CAUSTIC and pass_.indirect_caustics != 0)
                if is_caustic and pass_.caustics != 0:
                    _store(caustic_out, counts[C_CAUSTIC], p, wi, beta, word, light)
                    counts[C_CAUSTIC] += 1
                if to_global and (
                    pass_.store_probability >= _f4(1.0)
                    or draw1(pass_.sequence, seed, index, STORE_SET + bounces) < pass_.store_probability
                ):
                    _store(global_out, counts[C_GLOBAL], p, wi, beta, word, light)
                    if len(normals_out) > 0:
                        normals_out[counts[C_GLOBAL]] = encode_direction(ng[0], ng[1], ng[2])
                    counts[C_GLOBAL] += 1
                ledger[E_STORED] += _f8(luminance(beta))
                if not to_global and pass_.indirect_caustics == 0:
                    ledger[E_TERMINATED] += _f8(luminance(beta))
                    break
                local = square_to_cosine_hemisphere(u0, u1)
                d = from_basis(ns, local[0], local[1], local[2])
                weight = albedo
                flags = _u4(HAD_DIFFUSE)
                if dot(d, ng) <= _f4(0.0):  # the cosine lobe of a shading normal may dip below the surface
                    weight = (_f4(0.0), _f4(0.0), _f4(0.0))
            after = mul(beta, weight)
            before = luminance(beta)
            survival = min(luminance(after) / before, _f4(1.0))
            if not u2 < survival:
                ledger[E_ABSORBED] += _f8(before)
                break
            beta = scale(after, _f4(1.0) / survival)
            bounces += 1
            if bounces >= max_bounces:
                ledger[E_TERMINATED] += _f8(luminance(beta))
                break
            o = leave(p, ng, gap, d[0], d[1], d[2])
    return i1
