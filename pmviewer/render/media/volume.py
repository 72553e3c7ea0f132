"""Light that media send back along a ray: emitted, scattered once, and scattered before (T9, E7).

What lights send straight into the medium is sampled: a distance on the ray, by the transmittance or around the light
(equiangular), and a light there; and a distance with a direction by the phase function. All three are weighted against
each other by multiple importance sampling. Light that was scattered before, over surfaces or media, comes from the
volume map, by the beam estimate (`pmviewer.maps.estimate.beam`) or by ray marching (`pmviewer.render.media.march`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, part, specialised
from pmviewer.kernels.dimensions import FURTHER_LIGHT, GATHER_VOLUME, GATHER_VOLUME_PHASE, VOLUME, VOLUME_PHASE
from pmviewer.kernels.lights.light import sample_one_light
from pmviewer.kernels.media.column import WORDS, column_of, through_all
from pmviewer.kernels.media.medium import free_path, has_media, phase_numbers, scatters, way_seen
from pmviewer.kernels.media.phase import phase, sample_phase
from pmviewer.kernels.media.varying import albedo_at, sigma_at
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.random import draw4
from pmviewer.kernels.scene import DIRECTIONAL, ENVIRONMENT, IMAGE, L_KIND, light_number
from pmviewer.kernels.vector import add, along, largest, mul, scale
from pmviewer.maps.estimate.beam import beam_radiance
from pmviewer.render.cast import Ray, cast
from pmviewer.render.counts import C_RAYS, C_SHADOW_RAYS
from pmviewer.render.direct.choice import LIST_WORDS, choose_by_power, chosen_light
from pmviewer.render.direct.direct import found_light
from pmviewer.render.given import Sampler
from pmviewer.render.media.beams import seen_beam_of
from pmviewer.render.media.distance import distance_in, distance_pdf, equiangular_distance, equiangular_pdf
from pmviewer.render.media.emitted import emitted_in, emitted_nearby
from pmviewer.render.media.march import marched_radiance, marches
from pmviewer.render.media.phase_light import one_light_sample
from pmviewer.render.media.through import next_stretch, way_through
from pmviewer.render.pixel import EMISSION, SPECULAR, VOLUME_INDIRECT, deposit
from pmviewer.render.pixel import VOLUME as SINGLE

_f4 = np.float32
_i8 = np.int64
_INF = _f4(np.inf)
_BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))
_WHITE = (_f4(1.0), _f4(1.0), _f4(1.0))


class FromMedia(NamedTuple):
    """Radiance at a ray's origin that media send along it: `single` scattered light, what was scattered before
    (`indirect`), what they have `emitted`; and the transmittance T of the whole way."""

    single: Any
    indirect: Any
    emitted: Any
    T: Any


class Stretch(NamedTuple):
    """A stretch of a ray in one medium: from o in direction d, its length, the medium, and its column."""

    o: Any
    d: Any
    length: Any
    medium: Any
    column: Any


@device
def _scattered_at(scene, stretch, t, pdf):
    """What light scattered at the distance t weighs, which was chosen with the density pdf: T σs/pdf."""
    if not (pdf > _f4(0.0) and pdf < _INF):
        return _BLACK
    medium = stretch.medium
    p = along(stretch.o, stretch.d, t)
    T = through_all(scene, medium, stretch.column, t)
    weight = mul(mul(sigma_at(scene, medium, p), albedo_at(scene, medium, p)), T)
    return scale(weight, _f4(1.0) / pdf)


@device
def _by_light(scene, stretch, light, m, n_phase, u_t, u, v):
    """Single scattering by one sample of a light, of which m are expected. Returns L and the rays cast."""
    o, d, length, medium, column = stretch
    kind = np.int32(light_number(scene, light, L_KIND))
    if kind in (ENVIRONMENT, DIRECTIONAL, IMAGE):
        t = distance_in(scene, medium, column, length, u_t)
        pdf = distance_pdf(scene, medium, column, o, d, length, t)
    else:
        _, pivot, _, _, _ = sample_one_light(scene, light, o, u, v)
        half, u_t = u_t < _f4(0.5), _f4(2.0) * u_t
        if half:
            t = equiangular_distance(o, d, length, pivot, u_t)
        else:
            t = distance_in(scene, medium, column, length, u_t - _f4(1.0))
        around = equiangular_pdf(o, d, length, pivot, t)
        pdf = _f4(0.5) * (around + distance_pdf(scene, medium, column, o, d, length, t))
    weight = _scattered_at(scene, stretch, t, pdf)
    if not largest(weight) > _f4(0.0):
        return _BLACK, 0
    lobes = phase_numbers(scene, medium)
    L, rays = one_light_sample(scene, along(o, d, t), d, medium, lobes, light, m, n_phase, u, v)
    return mul(weight, L), rays


@device
def _by_phase(scene, stretch, choice, numbers):
    """Single scattering by one direction of the phase function: what light it finds, and what media send along it that
    light samples leave out."""
    o, d, length, medium, column = stretch
    lobes = phase_numbers(scene, medium)
    t = distance_in(scene, medium, column, length, numbers[0])
    weight = _scattered_at(scene, stretch, t, distance_pdf(scene, medium, column, o, d, length, t))
    if not largest(weight) > _f4(0.0):
        return _BLACK
    p = along(o, d, t)
    wi = sample_phase(lobes, d, numbers[1], numbers[2], numbers[3])
    ray = Ray(p, wi, _f4(0.0), _INF, medium, None)
    hit = cast(scene, ray)
    total = emitted_nearby(scene, ray, hit, p)
    L = found_light(scene, p, wi, phase(lobes, d, wi), _f4(1.0), choice, 0, hit)
    if largest(L) > _f4(0.0):
        total = add(total, mul(L, way_through(scene, ray, hit)))
    return mul(weight, total)


@device
def _single(given, stretch, sampler, numbers, of_phase, counts):
    """Single scattering on a stretch. numbers: for the first light sample; of_phase: for the phase function's."""
    scene, eye = given.scene, given.eye
    choice = choose_by_power(stack_i4(LIST_WORDS), eye.light_samples)
    total = _BLACK
    n_phase = eye.phase_rays * eye.mis
    u_pick, u, v, u_t = numbers
    for s in range(choice[4]):
        if s > 0:
            u_pick, u, v, u_t = draw4(sampler.sequence, sampler.seed, sampler.index, sampler.dimension + s)
        light, m = chosen_light(scene, choice, s, u_pick)
        L, rays = _by_light(scene, stretch, light, m, n_phase, u_t, u, v)
        total = add(total, L)
        counts[C_RAYS] += rays
        counts[C_SHADOW_RAYS] += rays
    if n_phase != 0:
        counts[C_RAYS] += 1
        total = add(total, _by_phase(scene, stretch, choice, of_phase))
    return total


@device
def radius_in(scene, eye, medium):
    """Radius of look-ups in a medium: a wider one than its free paths misses much at boundaries, where photons are on
    one side alone."""
    most = eye.free_paths * free_path(scene, medium)
    return eye.volume_radius if eye.volume_radius < most else most


@specialised
def _indirect(given, stretch, u):
    """Light on a stretch that was scattered before, from the volume map; u: a random number."""
    if absent(part(given, "volume_map")):
        return lambda given, stretch, u: _BLACK
    if marches(part(given, "volume_map")):

        def by_marching(given, stretch, u):
            o, d, length, medium, column = stretch
            lobes = phase_numbers(given.scene, medium)
            radius = radius_in(given.scene, given.eye, medium)
            length = min(length, way_seen(given.scene, medium))
            return marched_radiance(
                given.scene, given.volume_map, o, d, length, radius, given.eye.free_paths, column, lobes, u
            )

        return by_marching

    def by_beam(given, stretch, u):
        o, d, length, medium, column = stretch
        lobes = phase_numbers(given.scene, medium)
        radius = radius_in(given.scene, given.eye, medium)
        beam = seen_beam_of(given.scene, medium, o, d, length, radius, u)
        L, _ = beam_radiance(given.scene, given.volume_map, beam, radius, given.eye.free_paths, column, lobes)
        return L

    return by_beam


@device
def from_media(given, ray, hit, sampler, numbers, of_phase, counts, looks):
    """What media send back along the ray up to what it met, FromMedia; what they have emitted if it `looks` for that.
    numbers, of_phase: four random numbers each, which all stretches share, as nothing multiplies what two of them
    find."""
    scene, eye = given.scene, given.eye
    single, indirect, emitted, T = _BLACK, _BLACK, _BLACK, _WHITE
    o, medium, left = ray.o, ray.medium, hit.t
    marks = stack_i4(WORDS)
    for k in range(hit.crossed + 1):
        length, beyond, next_medium = next_stretch(scene, hit.crossed - k, o, ray.d, medium, left)
        if medium >= 0:
            column = column_of(scene, medium, o, ray.d, length, marks)
            if looks and scene.emits != 0:
                emitted = add(emitted, mul(T, emitted_in(scene, medium, column, o, ray.d, length)))
            if scatters(scene, medium) and eye.volume_light != 0:
                stretch = Stretch(o, ray.d, length, medium, column)
                single = add(single, mul(T, _single(given, stretch, sampler, numbers, of_phase, counts)))
                indirect = add(indirect, mul(T, _indirect(given, stretch, numbers[3])))
            T = mul(T, through_all(scene, medium, column, length))
        o, medium = beyond, next_medium
        left -= length
    return FromMedia(single, indirect, emitted, T)


@specialised
def deposit_media(given, ray, hit, beta, pixel, depth):
    """Deposit what media send along camera ray number `depth` of a pixel, and return beta behind them."""
    if not has_media(part(given, "scene")):
        return lambda given, ray, hit, beta, pixel, depth: beta

    def deposited(given, ray, hit, beta, pixel, depth):
        eye = given.eye
        sampler = Sampler(eye.sequence, pixel.seed, eye.index, FURTHER_LIGHT)
        numbers = draw4(eye.sequence, pixel.seed, eye.index, VOLUME + depth)
        of_phase = draw4(eye.sequence, pixel.seed, eye.index, VOLUME_PHASE + depth)
        L = from_media(given, ray, hit, sampler, numbers, of_phase, pixel.counts, True)
        whole = depth == 0
        deposit(pixel, SINGLE if whole else SPECULAR, mul(beta, L.single))
        deposit(pixel, VOLUME_INDIRECT if whole else SPECULAR, mul(beta, L.indirect))
        deposit(pixel, EMISSION if whole else SPECULAR, mul(beta, L.emitted))
        return mul(beta, L.T)

    return deposited


@specialised
def gathered_from_media(given, ray, hit, seed, index, depth, counts):
    """Radiance that media scatter along stretch number `depth` of a gather ray, and the transmittance of the way. What
    they emit is direct light of the surface that gathers."""
    if not has_media(part(given, "scene")):
        return lambda given, ray, hit, seed, index, depth, counts: (_BLACK, _WHITE)

    def gathered(given, ray, hit, seed, index, depth, counts):
        eye = given.eye
        numbers = draw4(eye.sequence, seed, index, GATHER_VOLUME + depth)
        of_phase = draw4(eye.sequence, seed, index, GATHER_VOLUME_PHASE + depth)
        sampler = Sampler(eye.sequence, seed, index, FURTHER_LIGHT)
        L = from_media(given, ray, hit, sampler, numbers, of_phase, counts, False)
        return add(L.single, L.indirect), L.T

    return gathered
