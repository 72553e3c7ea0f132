"""Photon tracing: emission, scattering with Russian roulette, deposition (T1–T6).

Weights stay nearly equal: lights are picked by power, and roulette decides about scatterings
(`pmviewer.photons.light_pass.roulette`). Photons of guided emission (`pmviewer.photons.emission.strata`) carry a factor
for their power that roulette does not see, so that the same paths survive.

Random numbers of a photon are keyed by (seed, its index over all passes, dimension), see
`pmviewer.kernels.dimensions`: the same photons for any number of threads and any batch size (T2).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.accel.opacity import over_opacity
from pmviewer.kernels.bsdf.dispersion import beyond, colour_of_split, has_dispersion, met_by, new_wave
from pmviewer.kernels.bsdf.scattering import (
    FOLLOWED,
    NOTHING,
    STORED,
    attenuation,
    bsdf_at,
    is_delta,
    keeps,
    pick_group,
)
from pmviewer.kernels.bsdf.thin_glass import is_ignored, keeps_class
from pmviewer.kernels.compile.jit import inlined, kernel
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.dimensions import (
    COPIES,
    EMISSION,
    EMITTER,
    FURTHER_PHOTONS_SALT,
    PHOTON_SCATTER,
    PIECE_SALT,
    STORE,
    WAVE,
)
from pmviewer.kernels.lights.light import is_delta_light
from pmviewer.kernels.media.medium import has_media, light_medium
from pmviewer.kernels.memory import row_of
from pmviewer.kernels.random import draw1, draw4, hash3
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import face, leave, surface_at
from pmviewer.kernels.vector import is_good, largest, luminance, mul, scale
from pmviewer.maps.photon_words import encode_direction
from pmviewer.maps.record import BOUNCES, CAUSTIC, HAD_DIFFUSE, INDIRECT_CAUSTIC, LAST_SPECULAR, UNFOUND
from pmviewer.photons.emission.window import most_pieces, pieces
from pmviewer.photons.light_pass.banded import write_of_wave
from pmviewer.photons.light_pass.flight import Photon, Trajectory, is_full, medium_after, to_surface
from pmviewer.photons.light_pass.ledger import (
    C_CAUSTIC,
    C_DROPPED,
    C_GLOBAL,
    C_PIECES,
    E_ABSORBED,
    E_DROPPED,
    E_EMITTED,
    E_ESCAPED,
    E_STORED,
    E_TERMINATED,
)
from pmviewer.photons.light_pass.paths import begin_path, extend_path
from pmviewer.photons.light_pass.roulette import EQUAL, MOST_COPIES, copies, survival_probability
from pmviewer.photons.light_pass.scatter import scattered
from pmviewer.photons.projection.projected import emission

_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32
_i8 = np.int64

_UNSHOWN = _i8(1 << 32)
"""Added to a trajectory's number for each piece, whose ways are not written down."""

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


class PhotonBuffers(NamedTuple):
    """What photons leave behind. global_out, caustic_out: float32 (capacity, 6), see `pmviewer.maps.record`;
    global_normals, caustic_normals: uint32 (capacity,), receive codes of the surface normals on the side that each
    photon came from, or (0,) when nobody needs them; counts: int64 (N_COUNTS,) and ledgers: float64 (2, N_LEDGER) are
    added to, `counts[C_GLOBAL]`, `counts[C_CAUSTIC]` and `counts[C_VOLUME]` being the rows filled so far; volume_out:
    float32 (capacity, 6), photons in media, or None in scenes without."""

    global_out: Any
    caustic_out: Any
    global_normals: Any
    caustic_normals: Any
    counts: Any
    ledgers: Any
    volume_out: Any


class Arrival(NamedTuple):
    """A photon where it meets a surface that keeps it: point p, unit wi to where it came from, ng on that side, flags
    and light as in `pmviewer.maps.record`, and its wave."""

    p: Any
    wi: Any
    ng: Any
    flags: Any
    light: Any
    wave: Any


@kernel
def trace_photons(scenes, passes, projections, i0, i1, out, paths):
    """Trace photons i0 … i1−1 of a pass. Returns the next to trace: less than i1 when a buffer may not hold its path.

    scenes: SCENE_DTYPE (1,); passes: LIGHT_PASS_DTYPE (1,); projections: PROJECTION_DTYPE (2,), STRATA_DTYPE (2,),
    SCATTERED_DTYPE (2,) or NO_PROJECTION, of the trajectories that fill the global map and of the others; out:
    `PhotonBuffers`; paths: None, or where to write whole paths (`pmviewer.photons.light_pass.paths`).
    """
    # Taken apart outside of the loop: counting references to arrays for each photon would take a quarter of the time.
    scene, pass_, counts, ledgers, volume_out = scenes[0], passes[0], row_of(out.counts, 0), out.ledgers, out.volume_out
    into_global, into_caustic = _room(out.global_out, out.global_normals), _room(out.caustic_out, out.caustic_normals)
    most = most_pieces(projections[0]) * pass_.max_bounces * (MOST_COPIES if pass_.roulette == EQUAL else 1)
    for i in range(i0, i1):
        if _are_full(into_global, into_caustic, counts, most) or is_full(volume_out, counts, most):
            return i
        to_global = i < pass_.global_trajectories
        kind = 0 if to_global else 1
        seed, index = _stream(pass_, i)
        p, d, beta, light, starts, factor = _emitted(scene, pass_, projections[kind], i, seed, index)
        if not _sets_out(scene, beta, starts, factor, counts, ledgers, kind):
            continue
        begin_path(paths, i, p, d, scale(beta, factor), light)
        of = Trajectory(i, seed, index, light, factor, to_global)
        photon = Photon(p, d, light_medium(scene, light), beta, _u4(0), 0, _wave(scene, pass_, seed, index))
        deltas = pass_.unfound != 0 and is_delta_light(scene, light)  # and nothing but deltas since the light
        left, piece, whole, split = _i8(0), _i8(0), factor, (photon, factor, deltas)
        while left >= 0:  # the photon, then what it was split into
            while True:
                alive, flown, prim, u, v, t = to_surface(scene, pass_, photon, of, volume_out, counts, ledgers, paths)
                if not alive:
                    break
                deltas = deltas and flown.bounces == photon.bounces  # no collision on the way
                o, d, medium, beta, flags, bounces, wave = flown
                word = _u4(flags | _u4(min(bounces, BOUNCES)))
                if prim < 0:
                    extend_path(paths, i + piece * _UNSHOWN, prim, o, d, scale(beta, factor), word, light, wave)
                    ledgers[kind, E_ESCAPED] += _f8(luminance(beta) * factor)
                    break
                p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
                material = material_of(scene, prim)
                if is_ignored(scene, prim, material):
                    photon = Photon(leave(p, ng, gap, d[0], d[1], d[2]), d, medium, beta, flags, bounces, wave)
                    continue
                beta = _on_the_way(scene, material, ng, d, t, beta, whole, counts, ledgers, kind)
                extend_path(paths, i + piece * _UNSHOWN, prim, p, d, scale(beta, factor), word, light, wave)
                wi = (-d[0], -d[1], -d[2])
                b = bsdf_at(scene, prim, material, u, v, p, ng, ns, wi, pass_.glossy, wave)
                wave, beta = _met(scene, b, wave, beta, whole, ledgers, kind)
                kept, before = keeps(scene, material, b, ng, wi, pass_.glossy), luminance(beta)
                if b.groups | kept == NOTHING or not before > _f4(0.0):
                    ledgers[kind, E_ABSORBED] += _f8(before * factor)
                    break
                outward, ng = ng, face(ng, wi)
                u0, u1, u2, u_lobe = draw4(pass_.sequence, seed, index, PHOTON_SCATTER + bounces)
                unfound = deltas and flags != 0 and kept & FOLLOWED != 0
                if whole > _f4(0.0) and (kept & STORED != 0 or unfound):
                    times, stored = _copies(pass_, beta, seed, index, bounces)
                    # As many photons as the opacity says meet the surface; looked up, it is taken to be there.
                    stored = over_opacity(scene, prim, u, v, p, scale(stored, factor))
                    arrival = Arrival(p, wi, ng, _u4(word | _u4(UNFOUND)) if unfound else word, light, wave)
                    _store_caustic(pass_, into_caustic, counts, arrival, word, stored, times)
                    if to_global and kept & STORED != 0 and _is_chosen(pass_, seed, index, bounces):
                        _store(into_global, counts, C_GLOBAL, arrival, stored, times)
                    ledgers[kind, E_STORED] += _f8(before * factor)
                if left == 0 and whole > _f4(0.0) and kept & STORED != 0:
                    left = pieces(projections[kind], p, ng, factor, piece) - _i8(1)
                    if left > 0:
                        factor, counts[C_PIECES] = factor / _f4(left + _i8(1)), counts[C_PIECES] + left
                        split = photon, factor, deltas
                if b.groups == NOTHING:  # a part of a blend that others keep photons for
                    ledgers[kind, E_ABSORBED] += _f8(before * factor)
                    break
                group, share, u_lobe = pick_group(b, wi, u_lobe)
                deltas = deltas and group == FOLLOWED and is_delta(b)
                if group != FOLLOWED and not to_global and pass_.only_direct != 0:
                    ledgers[kind, E_TERMINATED] += _f8(before * factor)
                    break
                d, weight, part = scattered(scene, projections[kind], b, group, p, wi, ng, u_lobe, (u0, u1), factor)
                flags = _flags_after(scene, group, prim, material, ng, d, flags)
                after = scale(mul(beta, weight), share)
                good, survival = is_good(after), survival_probability(pass_.roulette, before, beta, after)
                if not (good and u2 < survival):
                    counts[C_DROPPED] += 0 if good else 1
                    ledgers[kind, E_ABSORBED if good else E_DROPPED] += _f8(before * factor)
                    break
                beta = scale(after, _f4(1.0) / survival)
                ledgers[kind, E_ABSORBED] += _f8(before * factor) - _f8(luminance(beta) * (factor * part))
                whole = factor = factor * part
                of = Trajectory(i, seed, index, light, factor, to_global)
                wave, beta = _split(scene, b, wave, d, beta, factor, ledgers, kind)
                bounces += 1
                if bounces >= pass_.max_bounces:
                    ledgers[kind, E_TERMINATED] += _f8(luminance(beta) * factor)
                    break
                medium = medium_after(scene, prim, outward, wi, d, medium)
                photon = Photon(leave(p, ng, gap, d[0], d[1], d[2]), d, medium, beta, flags, bounces, wave)
            left, piece = left - 1, piece + 1
            if left >= 0:  # it arrives where all of it has arrived already
                photon, factor, deltas = split
                seed, whole = hash3(seed, _u4(piece), _u4(PIECE_SALT)), _f4(0.0)
    return i1


@inlined
def _are_full(into_global, into_caustic, counts, most):
    """Whether the room of one of both maps may not hold `most` more."""
    return counts[C_GLOBAL] + most > into_global[3] or counts[C_CAUSTIC] + most > into_caustic[3]


@inlined
def _emitted(scene, pass_, projection, i, seed, index):
    """Photon i as it leaves its light, see `emission`."""
    u0, u1, u2, u3 = draw4(pass_.sequence, seed, index, EMISSION)
    u_pick = draw1(pass_.sequence, seed, index, EMITTER)
    return emission(scene, projection, i, pass_.sequence, seed, index, u_pick, (u2, u3), (u0, u1))


@inlined
def _sets_out(scene, beta, starts, factor, counts, ledgers, kind):
    """Whether a photon is to be traced; its emission is booked, and what becomes of one that is not."""
    ledgers[kind, E_EMITTED] += _f8(factor)  # its luminance is 1
    good = is_good(beta)
    if good and starts:
        _book_start(scene, beta, factor, ledgers, kind)
        return True
    counts[C_DROPPED] += 0 if good else 1
    ledgers[kind, _of_no_start(scene, beta) if good else E_DROPPED] += _f8(factor)
    return False


@specialised
def _of_no_start(scene, beta):
    """The entry of a photon that does not start: where it would meet nothing, or in a place that a medium which emits
    does not fill, for which the others have more power."""
    if not has_media(scene):
        return lambda scene, beta: E_ESCAPED
    return lambda scene, beta: E_ESCAPED if largest(beta) > _f4(0.0) else E_ABSORBED


@specialised
def _book_start(scene, beta, factor, ledgers, kind):
    """Book what a photon of a medium has more or less than the mean, which is nothing in the mean."""
    if not has_media(scene):

        def nothing(scene, beta, factor, ledgers, kind):
            pass

        return nothing

    def booked(scene, beta, factor, ledgers, kind):
        ledgers[kind, E_ABSORBED] += _f8(factor) - _f8(luminance(beta) * factor)

    return booked


@inlined
def _stream(pass_, i):
    """Seed and index of the random numbers of photon i."""
    place = _i8(pass_.first_index) + _i8(i)
    seed = pass_.seed
    if place >> 32 != 0:  # a Sobol set has 2³² points; the next photons use other sets
        seed = hash3(seed, _u4(place >> 32), _u4(FURTHER_PHOTONS_SALT))
    return seed, _u4(place)


@inlined
def _wave(scene, pass_, seed, index):
    """The wave of a photon that leaves its light, None in scenes without dispersion."""
    return new_wave(scene, pass_.sequence, seed, index, WAVE)


@specialised
def _on_the_way(scene, material, ng, d, t, beta, factor, counts, ledgers, kind):
    """beta after the way to a surface (`attenuation`), what was lost on it booked; black when it is no number."""
    if not has(scene, "bsdfs"):
        return lambda scene, material, ng, d, t, beta, factor, counts, ledgers, kind: beta

    def booked(scene, material, ng, d, t, beta, factor, counts, ledgers, kind):
        before = luminance(beta)
        beta = attenuation(scene, material, ng, d, t, beta)
        if not is_good(beta):
            counts[C_DROPPED] += 1
            ledgers[kind, E_DROPPED] += _f8(before * factor)
            return _f4(0.0), _f4(0.0), _f4(0.0)
        ledgers[kind, E_ABSORBED] += _f8(before * factor) - _f8(luminance(beta) * factor)
        return beta

    return booked


@specialised
def _met(scene, b, wave, beta, factor, ledgers, kind):
    """A photon's wave and power where it meets a surface of BSDF b; what its colour gives or takes is booked, which is
    nothing in the mean."""
    if not has_dispersion(scene):
        return lambda scene, b, wave, beta, factor, ledgers, kind: (wave, beta)

    def booked(scene, b, wave, beta, factor, ledgers, kind):
        wave, coloured = met_by(scene, b, wave, beta)
        ledgers[kind, E_ABSORBED] += _f8(luminance(beta) * factor) - _f8(luminance(coloured) * factor)
        return wave, coloured

    return booked


@specialised
def _split(scene, b, wave, d, beta, factor, ledgers, kind):
    """The same where it leaves the surface in direction d. After roulette, which would undo the colour."""
    if not has_dispersion(scene):
        return lambda scene, b, wave, d, beta, factor, ledgers, kind: (wave, beta)

    def booked(scene, b, wave, d, beta, factor, ledgers, kind):
        coloured = colour_of_split(scene, b, wave, d, beta)
        ledgers[kind, E_ABSORBED] += _f8(luminance(beta) * factor) - _f8(luminance(coloured) * factor)
        return beyond(b, wave, d), coloured

    return booked


@inlined
def _copies(pass_, beta, seed, index, bounces):
    """As how many photons the power beta is stored, and the power of each."""
    if pass_.roulette != EQUAL:
        return 1, beta
    times, part = copies(beta, draw1(pass_.sequence, seed, index, COPIES + bounces))
    return times, scale(beta, part)


@inlined
def _is_chosen(pass_, seed, index, bounces):
    """Whether a photon is one of those that the global map stores."""
    if pass_.store_probability >= _f4(1.0):
        return True
    return draw1(pass_.sequence, seed, index, STORE + bounces) < pass_.store_probability


@inlined
def _is_caustic(pass_, flags):
    """Whether a photon with these flags is one for the caustic map."""
    path_class = np.int32(flags >> _u4(6))
    is_caustic = path_class == CAUSTIC or (path_class == INDIRECT_CAUSTIC and pass_.indirect_caustics != 0)
    return is_caustic and pass_.caustics != 0


@inlined
def _in_caustic(pass_, flags, power):
    """The power of a photon in the units of the caustic map."""
    if np.int32(flags >> _u4(6)) == INDIRECT_CAUSTIC:
        return scale(power, pass_.indirect_scale)
    return scale(power, pass_.direct_scale)


@inlined
def _store_caustic(pass_, into, counts, arrival, word, power, times):
    """Keep a photon with flags `word` in the caustic map, if it is one for it."""
    if _is_caustic(pass_, word):
        _store(into, counts, C_CAUSTIC, arrival, _in_caustic(pass_, word, power), times)


@inlined
def _room(rows, normals):
    """Pointers to rows (capacity, 6) and to normals (capacity,), whether there are normals, and the capacity."""
    return row_of(rows, 0), row_of(normals, 0), len(normals) > 0, len(rows)


@inlined
def _store(into, counts, which, arrival, power, times):
    """Keep a photon `times` times in that `_room`; counts[which] rows are filled."""
    rows, normals, with_normals, _ = into
    ng = arrival.ng
    for _ in range(times):
        row, flags = counts[which], arrival.flags
        write_of_wave(rows, row, arrival.p, arrival.wi, ng, power, flags, arrival.light, arrival.wave)
        if with_normals:
            normals[counts[which]] = encode_direction(ng[0], ng[1], ng[2])
        counts[which] += 1


@inlined
def _flags_after(scene, group, prim, material, ng, d, flags):
    """A photon's flags after a group of lobes of that material sent it in direction d, from the side of ng."""
    if group != FOLLOWED:
        return _u4(HAD_DIFFUSE)
    if keeps_class(scene, prim, material, ng, d):
        return flags
    return _u4(flags | _u4(LAST_SPECULAR))
