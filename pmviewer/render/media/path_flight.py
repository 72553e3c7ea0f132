"""Paths of the path tracer in media: their flight to the next surface or collision, and what becomes of a collision."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.dimensions import PATH_FLIGHT
from pmviewer.kernels.media.flight import fly
from pmviewer.kernels.media.glow import near_a_glow
from pmviewer.kernels.media.medium import has_media, phase_numbers
from pmviewer.kernels.media.phase import phase, sample_phase
from pmviewer.kernels.media.varying import albedo_at
from pmviewer.kernels.random import draw4
from pmviewer.kernels.surface import surface_at
from pmviewer.kernels.vector import mul
from pmviewer.render.cast import Hit, Ray, cast
from pmviewer.render.media.emitted import emitted_on_the_way
from pmviewer.render.media.phase_light import phase_light

_f4 = np.float32
_i8 = np.int64
_INF = _f4(np.inf)
BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))


class Arrival(NamedTuple):
    """Where a path arrives: `hit`, and whether it `collides` before, at p; what media send back along the whole way,
    for the throughput before (`emitted`); the throughput after; the rays cast."""

    hit: Any
    collides: Any
    p: Any
    emitted: Any
    beta: Any
    rays: Any


class Scattered(NamedTuple):
    """A path after a collision: the light that is scattered back from light samples, for the throughput before; the ray
    that goes on, its density, and the throughput."""

    L: Any
    ray: Any
    pdf: Any
    beta: Any
    rays: Any


@specialised
def arrive_by_flight(scene, eye, ray, beta, seed, depth, left, everything):
    """The Arrival of a path at surface or collision number `depth`, with `everything` that media emit or what light
    samples where it `left` leave out. In scenes without media the ray is cast and that is all."""
    if not has_media(scene):
        return lambda scene, eye, ray, beta, seed, depth, left, everything: Arrival(
            cast(scene, ray), False, ray.o, BLACK, beta, 1
        )

    def through_media(scene, eye, ray, beta, seed, depth, left, everything):
        o, d = ray.o, ray.d
        u_channel, u_depth, _, _ = draw4(eye.sequence, seed, eye.index, PATH_FLIGHT + depth)
        flight = fly(scene, o, d, ray.far, ray.medium, beta, u_channel, u_depth)
        rays = flight.rays
        emitted = BLACK
        if scene.emits != 0 and (everything or near_a_glow(scene, left)):
            # Of the whole way, whether or not the path goes all of it: exact for each ray.
            emitted = emitted_on_the_way(scene, ray, cast(scene, ray), left, everything)
            rays += 1
        beta = mul(beta, flight.weight)
        no, prim = _f4(0.0), flight.prim
        hit = Hit(prim, flight.u, flight.v, flight.length, o, d, d, no, flight.medium, _i8(0), ray.wave)
        if prim >= 0:
            b = flight.o
            p, ng, ns, gap = surface_at(scene, prim, flight.u, flight.v, b[0], b[1], b[2], d[0], d[1], d[2], flight.t)
            hit = Hit(prim, flight.u, flight.v, flight.length, p, ng, ns, gap, flight.medium, _i8(0), ray.wave)
        return Arrival(hit, flight.collides, flight.p, emitted, beta, rays)

    return through_media


@specialised
def scatter_in_medium(scene, eye, ray, arrival, choice, sampler, numbers, places):
    """What becomes of a path that collides in a medium, Scattered. numbers: for the lobe and the direction; places: for
    the light samples."""
    if not has_media(scene):
        return lambda scene, eye, ray, arrival, choice, sampler, numbers, places: Scattered(
            BLACK, ray, _f4(0.0), BLACK, 0
        )

    def scattered(scene, eye, ray, arrival, choice, sampler, numbers, places):
        p, medium = arrival.p, arrival.hit.medium
        lobes = phase_numbers(scene, medium)
        beta = mul(arrival.beta, albedo_at(scene, medium, p))
        L, rays = phase_light(scene, p, ray.d, medium, lobes, choice, eye.mis, sampler, places)
        wi = sample_phase(lobes, ray.d, numbers[0], numbers[1], numbers[2])
        return Scattered(
            mul(beta, L), Ray(p, wi, _f4(0.0), _INF, medium, ray.wave), phase(lobes, ray.d, wi), beta, rays
        )

    return scattered
