"""Photon tracing: emission, scattering with Russian roulette, deposition (T1–T6).

Weights stay nearly equal: lights are picked by power, and roulette decides about scatterings
(`pmviewer.photons.light_pass.roulette`). Photons of guided emission (`pmviewer.photons.emission.strata`) carry a factor
for their power that roulette does not see, so that the same paths survive.

Random numbers of a photon are keyed by (seed, its index over all passes, dimension), see
`pmviewer.kernels.dimensions`: the same photons for any number of threads and any batch size (T2).
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.opacity import over_opacity
from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.bsdf.scattering import (
    FOLLOWED,
    NOTHING,
    STORED,
    attenuation,
    bsdf_at,
    bsdf_sample,
    is_delta,
    keeps,
    pick_group,
    same_side,
    shading_normal,
)
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.dimensions import COPIES, EMISSION, EMITTER, FURTHER_PHOTONS_SALT, PHOTON_SCATTER, STORE
from pmviewer.kernels.lights.light import is_delta_light
from pmviewer.kernels.memory import float_of_bits
from pmviewer.kernels.random import draw1, draw4, hash3
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import STRAIGHT, adjoint_cosines, face, leave, surface_at
from pmviewer.kernels.vector import dot, is_good, luminance, mul, scale
from pmviewer.maps.record import (
    BOUNCES,
    CAUSTIC,
    HAD_DIFFUSE,
    INDIRECT_CAUSTIC,
    LAST_SPECULAR,
    UNFOUND,
    encode_direction,
    encode_power,
)
from pmviewer.photons.light_pass.paths import begin_path, extend_path
from pmviewer.photons.light_pass.roulette import BY_LUMINANCE, EQUAL, MOST_COPIES, copies, survival_probability
from pmviewer.photons.projection.projected import emission

_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32
_INF = _f4(np.inf)

LIGHT_PASS_DTYPE = np.dtype(
    [
        ("seed", "u4"),
        ("first_index", "i8"),  # index over all passes of this pass's photon 0
        ("sequence", "i4"),
        ("max_bounces", "i4"),
        ("roulette", "i4"),  # index into `pmviewer.photons.light_pass.roulette.RULES`
        ("glossy", "f4"),  # roughness from which glossy lobes store photons
        ("global_trajectories", "i8"),  # photons 0 … this−1 of the pass fill the global map
        ("store_probability", "f4"),  # of a global photon (q rule "photons"); 1 otherwise
        ("caustics", "i4"),  # whether the caustic map is filled
        ("indirect_caustics", "i4"),  # whether with photons that met a diffuse surface before, too
        ("only_direct", "i4"),  # whether the trajectories that don't fill the global map end where they meet it
        ("indirect_scale", "f4"),  # factor for the power of indirect caustics in the units of the caustic map
        ("direct_scale", "f4"),  # the same for caustics straight from a light
        ("unfound", "i4"),  # whether followed lobes store what no path from the eye finds (`pmviewer.maps.record`)
    ],
    align=True,
)

N_COUNTS = 4
C_GLOBAL, C_CAUSTIC, C_RAYS, C_DROPPED = range(N_COUNTS)
N_LEDGER = 6
E_EMITTED, E_STORED, E_ABSORBED, E_ESCAPED, E_TERMINATED, E_DROPPED = range(N_LEDGER)
"""Energy ledger: luminance of power in units of the map's. What roulette gives a survivor or takes from a victim counts
as absorbed, so that the books always balance and each entry is right in the mean. E_STORED is what arrived where
photons are stored, as often as it arrived; the others after E_EMITTED are how a trajectory ends. A photon whose power
becomes infinite or NaN is dropped with the power that it had before."""


def empty_ledger():
    """Ledgers (2, N_LEDGER) of the trajectories that fill the global map and of the others, float64."""
    return np.zeros((2, N_LEDGER))


@device
def _store(out, row, p, wi, beta, flags, light):
    out[row, 0], out[row, 1], out[row, 2] = p
    r, g, b = encode_power(beta[0]), encode_power(beta[1]), encode_power(beta[2])
    out[row, 3] = float_of_bits(_u4(encode_direction(wi[0], wi[1], wi[2]) | _u4(flags)))
    out[row, 4] = float_of_bits(_u4(r | _u4(g << _u4(16))))
    out[row, 5] = float_of_bits(_u4(b | _u4(_u4(light) << _u4(16))))


@specialised
def _on_the_way(scene, material, ng, d, t, beta, worth, counts, ledgers, book):
    """beta after the way to a surface (`attenuation`), what was lost on it booked; black when it is no number."""
    if not has(scene, "bsdfs"):
        return lambda scene, material, ng, d, t, beta, worth, counts, ledgers, book: beta

    def booked(scene, material, ng, d, t, beta, worth, counts, ledgers, book):
        before = luminance(beta)
        beta = attenuation(scene, material, ng, d, t, beta)
        if not is_good(beta):
            counts[C_DROPPED] += 1
            ledgers[book, E_DROPPED] += _f8(before * worth)
            return _f4(0.0), _f4(0.0), _f4(0.0)
        ledgers[book, E_ABSORBED] += _f8(before * worth) - _f8(luminance(beta) * worth)
        return beta

    return booked


@kernel
def trace_photons(scenes, passes, projections, i0, i1, global_out, normals_out, caustic_out, counts, ledgers, paths):
    """Trace photons i0 … i1−1 of a pass.

    scenes: SCENE_DTYPE (1,); passes: LIGHT_PASS_DTYPE (1,); projections: PROJECTION_DTYPE (2,), STRATA_DTYPE (2,) or
    NO_PROJECTION, of the trajectories that fill the global map and of the others; global_out, caustic_out: float32
    (capacity, 6), see `pmviewer.maps.record`; normals_out: two arrays uint32 (capacity,), receive the surface normals
    of global and of caustic photons, or (0,) when nobody needs them; counts: int64 (N_COUNTS,) and ledgers: float64
    (2, N_LEDGER) are added to, `counts[C_GLOBAL]` and `counts[C_CAUSTIC]` being the rows filled so far; paths: None, or
    where to write whole paths (`pmviewer.photons.light_pass.paths`).

    Returns the index of the next photon to trace: less than i1 when a buffer may not hold another photon's path.
    """
    scene = scenes[0]
    pass_ = passes[0]
    max_bounces = pass_.max_bounces
    most = max_bounces if pass_.roulette != EQUAL else MOST_COPIES * max_bounces
    for i in range(i0, i1):
        if counts[C_GLOBAL] + most > len(global_out) or counts[C_CAUSTIC] + most > len(caustic_out):
            return i
        to_global = i < pass_.global_trajectories
        book = 0 if to_global else 1
        place = np.int64(pass_.first_index) + np.int64(i)
        index, seed = _u4(place), pass_.seed
        if place >> 32 != 0:  # a Sobol set has 2³² points; the next photons use other sets
            seed = hash3(seed, _u4(place >> 32), _u4(FURTHER_PHOTONS_SALT))
        u0, u1, u2, u3 = draw4(pass_.sequence, seed, index, EMISSION)
        u_pick = draw1(pass_.sequence, seed, index, EMITTER)
        projection = projections[0 if to_global else 1]
        p, d, beta, light, kept, worth = emission(
            scene, projection, i, pass_.sequence, seed, index, u_pick, (u2, u3), (u0, u1)
        )
        ledgers[book, E_EMITTED] += _f8(worth)  # its luminance is 1
        if not is_good(beta):
            counts[C_DROPPED] += 1
            ledgers[book, E_DROPPED] += _f8(worth)
            continue
        if not kept:
            ledgers[book, E_ESCAPED] += _f8(worth)
            continue
        begin_path(paths, i, p, d, scale(beta, worth), light)
        o = p
        flags = _u4(0)
        bounces = 0
        deltas = pass_.unfound != 0 and is_delta_light(scene, light)  # and nothing but deltas since the light
        while True:
            t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], _f4(0.0), _INF)
            counts[C_RAYS] += 1
            if prim < 0:
                extend_path(paths, i, prim, o, d, scale(beta, worth), _u4(flags | _u4(min(bounces, BOUNCES))), light)
                ledgers[book, E_ESCAPED] += _f8(luminance(beta) * worth)
                break
            p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
            material = material_of(scene, prim)
            beta = _on_the_way(scene, material, ng, d, t, beta, worth, counts, ledgers, book)
            extend_path(paths, i, prim, p, d, scale(beta, worth), _u4(flags | _u4(min(bounces, BOUNCES))), light)
            wi = (-d[0], -d[1], -d[2])
            b = bsdf_at(scene, prim, material, u, v, p, ng, ns, wi, pass_.glossy)
            kept = keeps(scene, material, b, ng, wi, pass_.glossy)
            if b.groups | kept == NOTHING or not luminance(beta) > _f4(0.0):
                ledgers[book, E_ABSORBED] += _f8(luminance(beta) * worth)
                break
            ng = face(ng, wi)
            u0, u1, u2, u_lobe = draw4(pass_.sequence, seed, index, PHOTON_SCATTER + bounces)
            unfound = deltas and bounces > 0 and kept & FOLLOWED != 0
            if kept & STORED != 0 or unfound:
                path_class = np.int32(flags >> _u4(6))
                word = _u4(flags | _u4(min(bounces, BOUNCES)))
                if unfound:
                    word = _u4(word | _u4(UNFOUND))
                is_caustic = path_class == CAUSTIC or (path_class == INDIRECT_CAUSTIC and pass_.indirect_caustics != 0)
                times, stored = 1, beta
                if pass_.roulette == EQUAL:
                    times, factor = copies(beta, draw1(pass_.sequence, seed, index, COPIES + bounces))
                    stored = scale(beta, factor)
                # As many photons as the opacity says meet the surface; looked up, it is taken to be there.
                stored = over_opacity(scene, prim, u, v, p, scale(stored, worth))
                if is_caustic and pass_.caustics != 0:
                    in_caustic = scale(stored, pass_.direct_scale)
                    if path_class == INDIRECT_CAUSTIC:
                        in_caustic = scale(stored, pass_.indirect_scale)
                    for _ in range(times):
                        _store(caustic_out, counts[C_CAUSTIC], p, wi, in_caustic, word, light)
                        if len(normals_out[1]) > 0:
                            normals_out[1][counts[C_CAUSTIC]] = encode_direction(ng[0], ng[1], ng[2])
                        counts[C_CAUSTIC] += 1
                if (
                    to_global
                    and kept & STORED != 0
                    and (
                        pass_.store_probability >= _f4(1.0)
                        or draw1(pass_.sequence, seed, index, STORE + bounces) < pass_.store_probability
                    )
                ):
                    for _ in range(times):
                        _store(global_out, counts[C_GLOBAL], p, wi, stored, word, light)
                        if len(normals_out[0]) > 0:
                            normals_out[0][counts[C_GLOBAL]] = encode_direction(ng[0], ng[1], ng[2])
                        counts[C_GLOBAL] += 1
                ledgers[book, E_STORED] += _f8(luminance(beta) * worth)
            before = luminance(beta)
            if b.groups == NOTHING:  # a part of a blend that others keep photons for
                ledgers[book, E_ABSORBED] += _f8(before * worth)
                break
            group, share, u_lobe = pick_group(b, wi, u_lobe)
            deltas = deltas and group == FOLLOWED and is_delta(b)
            if group == FOLLOWED:
                flags = _u4(flags | _u4(LAST_SPECULAR))
            elif not to_global and pass_.only_direct != 0:
                ledgers[book, E_TERMINATED] += _f8(before * worth)
                break
            else:
                flags = _u4(HAD_DIFFUSE)
            d, weight, _, _ = bsdf_sample(scene, b, group, wi, u_lobe, u0, u1)
            if same_side(b, group, ng, wi, d) == 0:  # the lobe of a shading normal may dip below the surface
                weight = (_f4(0.0), _f4(0.0), _f4(0.0))
            elif abs(dot(shading_normal(b), ng)) < STRAIGHT:
                weight = scale(weight, adjoint_cosines(shading_normal(b), ng, wi, d))
            after = scale(mul(beta, weight), share)
            if not is_good(after):
                counts[C_DROPPED] += 1
                ledgers[book, E_DROPPED] += _f8(before * worth)
                break
            survival = survival_probability(pass_.roulette, before, beta, after)
            if not u2 < survival:
                ledgers[book, E_ABSORBED] += _f8(before * worth)
                break
            beta = scale(after, _f4(1.0) / survival)
            if pass_.roulette != BY_LUMINANCE or not survival < _f4(1.0):  # else it stays
                ledgers[book, E_ABSORBED] += _f8(before * worth) - _f8(luminance(beta) * worth)
            bounces += 1
            if bounces >= max_bounces:
                ledgers[book, E_TERMINATED] += _f8(luminance(beta) * worth)
                break
            o = leave(p, ng, gap, d[0], d[1], d[2])
    return i1
