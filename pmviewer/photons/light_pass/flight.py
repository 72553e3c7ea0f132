"""A photon's flight from surface to surface, with what happens to it in media on the way (T9).

A collision stores the photon in the volume map if it was scattered before: light that comes straight from a light
sources is sampled where it is seen. What is stored is the power that the collision scatters, so that a look-up needs
the phase function alone. Collisions count as scatterings, for random numbers and for the bounces allowed; after one, a
photon's path class is that of light scattered diffusely. In scenes without media the ray is cast and that is all.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, specialised
from pmviewer.kernels.dimensions import COPIES, PHOTON_FLIGHT, PHOTON_SCATTER
from pmviewer.kernels.media.flight import fly
from pmviewer.kernels.media.medium import has_media, medium_beyond, phase_numbers
from pmviewer.kernels.media.phase import sample_phase
from pmviewer.kernels.media.varying import albedo_at
from pmviewer.kernels.memory import row_of
from pmviewer.kernels.random import draw1, draw4
from pmviewer.kernels.vector import dot, is_good, luminance, mul, scale
from pmviewer.maps.record import BOUNCES, HAD_DIFFUSE
from pmviewer.photons.light_pass.banded import write_of_wave
from pmviewer.photons.light_pass.ledger import (
    C_DROPPED,
    C_RAYS,
    C_VOLUME,
    E_ABSORBED,
    E_DROPPED,
    E_STORED,
    E_TERMINATED,
)
from pmviewer.photons.light_pass.paths import extend_path
from pmviewer.photons.light_pass.roulette import BY_LUMINANCE, EQUAL, copies, survival_probability

_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32
_i8 = np.int64
_INF = _f4(np.inf)


class Photon(NamedTuple):
    """A photon on its way: from o in direction d, the medium there (None in scenes without), its power, flags and
    number of scatterings, and its wave (`pmviewer.kernels.bsdf.dispersion`, None in scenes without dispersion)."""

    o: Any
    d: Any
    medium: Any
    beta: Any
    flags: Any
    bounces: Any
    wave: Any


class Trajectory(NamedTuple):
    """What stays the same on a photon's way: its number in the pass, seed and index of its random numbers, its light,
    the factor of its power, and whether it fills the global map."""

    i: Any
    seed: Any
    index: Any
    light: Any
    factor: Any
    to_global: Any


class Met(NamedTuple):
    """What a photon meets: is it there still? The photon, from where it flew last; the primitive (−1: nothing) at
    (u, v), and the distance t."""

    alive: Any
    photon: Any
    prim: Any
    u: Any
    v: Any
    t: Any


@specialised
def is_full(volume_out, counts, most):
    """Whether the volume photons of another trajectory may find no room."""
    if absent(volume_out):
        return lambda volume_out, counts, most: False
    return lambda volume_out, counts, most: counts[C_VOLUME] + most > len(volume_out)


@specialised
def to_surface(scene, pass_, photon, of, volume_out, counts, ledgers, paths):
    """What the photon of a Trajectory meets, Met; volume photons are written to volume_out (capacity, 6)."""
    if not has_media(scene):

        def straight(scene, pass_, photon, of, volume_out, counts, ledgers, paths):
            o, d = photon.o, photon.d
            t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], _f4(0.0), _INF)
            counts[C_RAYS] += 1
            return Met(True, photon, prim, u, v, t)

        return straight
    return _through_media


def _through_media(scene, pass_, photon, of, volume_out, counts, ledgers, paths):
    o, d, medium, beta, flags, bounces, wave = photon
    kind = 0 if of.to_global else 1
    while True:
        u_channel, u_depth, _, _ = draw4(pass_.sequence, of.seed, of.index, PHOTON_FLIGHT + bounces)
        flight = fly(scene, o, d, _INF, medium, beta, u_channel, u_depth)
        counts[C_RAYS] += flight.rays
        after, before = mul(beta, flight.weight), luminance(beta)
        o, medium, prim = flight.o, flight.medium, flight.prim
        here = Photon(o, d, medium, after, flags, bounces, wave)
        met = Met(True, here, np.int32(prim), flight.u, flight.v, flight.t)
        gone = Met(False, here, np.int32(prim), flight.u, flight.v, flight.t)
        if not is_good(after):
            counts[C_DROPPED] += 1
            ledgers[kind, E_DROPPED] += _f8(before * of.factor)
            return gone
        # What the choice of a channel gives or takes is right in the mean.
        ledgers[kind, E_ABSORBED] += _f8(before * of.factor) - _f8(luminance(after) * of.factor)
        if not flight.collides:
            return met
        word = _u4(flags | _u4(min(bounces, BOUNCES)))
        extend_path(paths, of.i, 0, flight.p, d, scale(after, of.factor), word, of.light, wave)
        before, scattered = luminance(after), mul(after, albedo_at(scene, medium, flight.p))
        if of.to_global and bounces > 0 and luminance(scattered) > _f4(0.0):
            _store(pass_, of, volume_out, counts, (flight.p, d, scattered, word, wave), bounces)
            ledgers[kind, E_STORED] += _f8(before * of.factor)
        if not before > _f4(0.0):
            return gone
        if not of.to_global and pass_.only_direct != 0:
            ledgers[kind, E_TERMINATED] += _f8(before * of.factor)
            return gone
        u0, u1, u2, u_lobe = draw4(pass_.sequence, of.seed, of.index, PHOTON_SCATTER + bounces)
        survival = survival_probability(pass_.roulette, before, after, scattered)
        if not u2 < survival:
            ledgers[kind, E_ABSORBED] += _f8(before * of.factor)
            return gone
        beta = scale(scattered, _f4(1.0) / survival)
        if pass_.roulette != BY_LUMINANCE or not survival < _f4(1.0):  # else it stays
            ledgers[kind, E_ABSORBED] += _f8(before * of.factor) - _f8(luminance(beta) * of.factor)
        bounces += 1
        if bounces >= pass_.max_bounces:
            ledgers[kind, E_TERMINATED] += _f8(luminance(beta) * of.factor)
            return gone
        o, d = flight.p, sample_phase(phase_numbers(scene, medium), d, u_lobe, u0, u1)
        flags = _u4(HAD_DIFFUSE)


@device
def _store(pass_, of, volume_out, counts, collision, bounces):
    """Keep a photon that collides: its place, direction of travel, scattered power, flags and wave."""
    p, d, scattered, word, wave = collision
    times = 1
    if pass_.roulette == EQUAL:
        times, part = copies(scattered, draw1(pass_.sequence, of.seed, of.index, COPIES + bounces))
        scattered = scale(scattered, part)
    for _ in range(times):
        row = counts[C_VOLUME]
        wi, power = (-d[0], -d[1], -d[2]), scale(scattered, of.factor)
        write_of_wave(row_of(volume_out, 0), row, p, wi, None, power, word, of.light, wave)
        counts[C_VOLUME] += 1


@specialised
def medium_after(scene, prim, ng, wi, d, medium):
    """The medium that a photon is in after a surface with outward normal ng, which it came to from wi and leaves in
    direction d."""
    if not has_media(scene):
        return lambda scene, prim, ng, wi, d, medium: None

    def after(scene, prim, ng, wi, d, medium):
        if dot(ng, wi) * dot(ng, d) < _f4(0.0):
            return medium_beyond(scene, prim, ng, d, medium)
        return medium

    return after
