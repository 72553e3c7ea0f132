"""The way of a photon that makes virtual lights to the next surface, and the lights that it leaves in media (R10, T9).

Every collision in a medium is a candidate: a virtual light without a surface, which sends its power by the phase
function (Raab, Seidel and Keller 2006). No gathering walk finds it, so that its q is 0 and it is summed unweighted.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.dimensions import PHOTON_FLIGHT, PHOTON_SCATTER
from pmviewer.kernels.media.flight import fly
from pmviewer.kernels.media.medium import has_media, phase_numbers
from pmviewer.kernels.media.phase import sample_phase
from pmviewer.kernels.media.varying import albedo_at
from pmviewer.kernels.memory import float_of_bits
from pmviewer.kernels.random import draw4
from pmviewer.kernels.vector import is_good, luminance, mul, scale
from pmviewer.maps.photon_words import encode_direction, encode_power
from pmviewer.maps.record import BOUNCES, HAD_DIFFUSE
from pmviewer.maps.virtual_lights import OF_MEDIUM, V_N, V_NS, V_OPACITY, V_P, V_PHI, V_PRIM, V_U, V_WI

_f4 = np.float32
_u4 = np.uint32
_INF = _f4(np.inf)
N_COUNTS = 3
C_STORED, C_RAYS, C_DROPPED = range(N_COUNTS)


class Walker(NamedTuple):
    """A photon on its way: from o in direction d, the medium there (None in scenes without), its power, flags and
    number of scatterings."""

    o: Any
    d: Any
    medium: Any
    beta: Any
    flags: Any
    bounces: Any


class Met(NamedTuple):
    """What a photon meets: is it there still? The Walker, from where it flew last; the primitive (−1: nothing) at
    (u, v), and the distance t."""

    alive: Any
    walker: Any
    prim: Any
    u: Any
    v: Any
    t: Any


@device
def put(row, column, value):
    """Three numbers of a candidate's row."""
    row[column], row[column + 1], row[column + 2] = value


@device
def photon(out, p, wi, beta, flags, light):
    """A candidate as a photon record (`pmviewer.maps.record`)."""
    out[0], out[1], out[2] = p
    r, g, b = encode_power(beta[0]), encode_power(beta[1]), encode_power(beta[2])
    out[3] = float_of_bits(_u4(encode_direction(wi[0], wi[1], wi[2]) | _u4(flags)))
    out[4] = float_of_bits(_u4(r | _u4(g << _u4(16))))
    out[5] = float_of_bits(_u4(b | _u4(_u4(light) << _u4(16))))


@specialised
def to_surface(scene, pass_, walker, of, out):
    """What a Walker meets, Met. of: seed and index of its random numbers, and its light; out: the candidates' photons
    and rows and the counts, as for `pmviewer.photons.virtual.trace.trace_virtual_lights`."""
    if not has_media(scene):

        def straight(scene, pass_, walker, of, out):
            o, d = walker.o, walker.d
            t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], _f4(0.0), _INF)
            out[2][C_RAYS] += 1
            return Met(True, walker, prim, u, v, t)

        return straight
    return _through_media


def _through_media(scene, pass_, walker, of, out):
    o, d, medium, beta, flags, bounces = walker
    seed, index, light = of
    photons_out, lights_out, counts = out
    while True:
        u_channel, u_depth, _, _ = draw4(pass_.sequence, seed, index, PHOTON_FLIGHT + bounces)
        flight = fly(scene, o, d, _INF, medium, beta, u_channel, u_depth)
        counts[C_RAYS] += flight.rays
        beta = mul(beta, flight.weight)
        o, medium, prim = flight.o, flight.medium, np.int32(flight.prim)
        here = Walker(o, d, medium, beta, flags, bounces)
        met = Met(True, here, prim, flight.u, flight.v, flight.t)
        gone = Met(False, here, prim, flight.u, flight.v, flight.t)
        before = luminance(beta)
        if not (is_good(beta) and before > _f4(0.0)):
            return gone
        if not flight.collides:
            return met
        scattered = mul(beta, albedo_at(scene, medium, flight.p))
        wi = (-d[0], -d[1], -d[2])
        if luminance(scattered) > _f4(0.0):
            row = lights_out[counts[C_STORED]]
            put(row, V_P, flight.p)
            put(row, V_N, wi)
            put(row, V_NS, wi)
            put(row, V_WI, wi)
            put(row, V_PHI, scattered)
            row[V_U], row[V_OPACITY] = _f4(medium), _f4(1.0)
            row[V_PRIM] = float_of_bits(_u4(OF_MEDIUM))
            photon(photons_out[counts[C_STORED]], flight.p, wi, scattered, flags | _u4(min(bounces, BOUNCES)), light)
            counts[C_STORED] += 1
        u0, u1, u2, u_lobe = draw4(pass_.sequence, seed, index, PHOTON_SCATTER + bounces)
        survival = min(luminance(scattered) / before, _f4(1.0))
        if not u2 < survival:
            return gone
        beta = scale(scattered, _f4(1.0) / survival)
        bounces += 1
        if bounces >= pass_.max_bounces:
            return gone
        o, d = flight.p, sample_phase(phase_numbers(scene, medium), d, u_lobe, u0, u1)
        flags = _u4(HAD_DIFFUSE)
