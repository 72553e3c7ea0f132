"""The eye pass: samples of each pixel of Jensen's four-way split (R1), from the maps of this pass.

From the camera, mirrors, glass and smooth glossy lobes are followed, at the first glass both ways
(`pmviewer.render.split`). Wherever a surface has lobes that photons are
stored for, direct light is sampled, caustics come from the caustic map, and indirect light from the global map: shown
directly (`progressive`) or by a final gather (`gather`, see `pmviewer.render.gather.gather`). A surface with lobes of
both kinds does both, so that a chain may light up at every surface it meets.

Random numbers of a pixel are Owen-scrambled Sobol points over the passes, keyed by (seed, pixel); their dimensions are
in `pmviewer.kernels.dimensions`.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import FOLLOWED, NOTHING, STORED, is_delta, is_lambertian
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.dimensions import BSDF, CHAIN_LIGHT, LIGHT, OUTLINE
from pmviewer.kernels.memory import row_of, stack_i4
from pmviewer.kernels.random import draw4
from pmviewer.kernels.vector import add, largest, mul, scale
from pmviewer.maps.record import CAUSTIC as CAUSTIC_CLASS
from pmviewer.render.cast import cast
from pmviewer.render.chain import BLACK, arrive
from pmviewer.render.counts import C_CUT, C_RAYS
from pmviewer.render.direct.choice import LIST_WORDS, choose_by_power
from pmviewer.render.direct.choose import choose, choose_for_group, samples_suffice
from pmviewer.render.direct.direct import direct_light, found_light, met_light, radiance_of
from pmviewer.render.filter_samples import place_of, seen_at, sum_at, value_at
from pmviewer.render.gather.cached import cached, surface_rays
from pmviewer.render.gather.guide import AIM_WORDS, aim
from pmviewer.render.gather.weak import shows_map
from pmviewer.render.given import Aim, GatherRays, Sampler, opened
from pmviewer.render.hidden_lights import hides_lights
from pmviewer.render.media.volume import deposit_media
from pmviewer.render.pixel import (
    CAUSTIC,
    DIRECT,
    EMISSION,
    INDIRECT,
    SPECULAR,
    Pixel,
    deposit,
    lens_ray,
    pixel_seed,
    properties,
    sampled_ray,
)
from pmviewer.render.pixel_radius import OF_CAUSTIC, OF_GLOBAL, count_found, own_radius, radii_of
from pmviewer.render.pixel_samples import OUTLINED, samples_of, share_of, take_sample
from pmviewer.render.reflect import gathered, reflected, unfound
from pmviewer.render.share import OWN_COLUMNS
from pmviewer.render.split import first_way, next_way, split_camera_path, thinned
from pmviewer.render.straight import cast_on
from pmviewer.render.virtual_lights.lit import note_object, virtual_light

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_u4 = np.uint32
_CAUSTICS = np.int32(1 << CAUSTIC_CLASS)


@device
def _outline_ray(scene, eye, pixel, numbers):
    """Radiance that a camera ray for emission meets at a light or the environment; numbers: its place in the pixel and
    on the lens."""
    x, y, a, b = numbers
    ray = lens_ray(eye, pixel.number, x, y, a, b)
    hit, tint = cast_on(scene, ray, False)
    light = met_light(scene, hit)
    if light >= 0:
        return mul(tint, radiance_of(scene, light, hit, ray.d))
    return BLACK


@device
def _taps(scene, eye, pixel, index):
    """The filter's light around a place in the pixel, as `pmviewer.render.filter` has it of all pixels, and how many
    rays that took. index: of random numbers."""
    u, v, _, _ = draw4(eye.sequence, pixel.seed, index, OUTLINE)
    x, y, half, reach = place_of(eye, u), place_of(eye, v), _f4(0.5), eye.filter_reach
    share = _f4(1.0) / max(abs(sum_at(eye, x) * sum_at(eye, y)), _f4(1e-12))
    total, rays = BLACK, _i8(0)
    for j in range(-reach, reach + 1):
        row = value_at(eye, _f4(j) + y - half) * share
        for i in range(-reach, reach + 1):
            weight = row * value_at(eye, _f4(i) + x - half)
            if weight != _f4(0.0):
                number = _u4(_u4(index * _u4(2 * reach + 1) + _u4(reach + j)) * _u4(2 * reach + 1) + _u4(reach + i))
                _, _, a, b = draw4(eye.sequence, pixel.seed, number, OUTLINE)
                place = seen_at(eye, _f4(i) + x), seen_at(eye, _f4(j) + y), a, b
                total = add(total, scale(_outline_ray(scene, eye, pixel, place), weight))
                rays += 1
    return total, rays


@device
def _within(scene, eye, pixel, index):
    """Mean radiance that rays through the pixel meet in pass `index`."""
    total = BLACK
    for j in range(eye.outline_rays):
        numbers = draw4(eye.sequence, pixel.seed, _u4(index * _u4(eye.outline_rays) + _u4(j)), OUTLINE)
        total = add(total, _outline_ray(scene, eye, pixel, numbers))
    return scale(total, _f4(1.0) / _f4(eye.outline_rays))


@specialised
def outline_emission(scene, eye, pixel, columns):
    """Add the mean radiance that camera rays through the pixel meet at lights and the environment to its sums, of which
    there are so many columns. Returns how many rays."""
    if has(eye, "filter_value"):

        def by_taps(scene, eye, pixel, columns):
            side = 2 * eye.filter_reach + 1
            rounds = max(eye.outline_rays // (side * side), 1)
            rays, share, first = _i8(eye.outline_rays), _f8(1.0) / _f8(rounds), columns - OWN_COLUMNS
            for j in range(rounds):
                L, more = _taps(scene, eye, pixel, _u4(eye.filter_pass * _u4(rounds) + _u4(j)))
                rays += more
                for k in range(3):
                    pixel.film[first + k] += _f8(L[k]) * share
            L = _within(scene, eye, pixel, eye.filter_pass)
            for k in range(3):
                pixel.film[first + 3 + k] += _f8(L[k])
            return rays

        return by_taps

    def by_pixel(scene, eye, pixel, columns):
        deposit(pixel, EMISSION, _within(scene, eye, pixel, eye.index))
        return _i8(eye.outline_rays)

    return by_pixel


@specialised
def seen_by_outline(eye, outlined):
    """Whether rays of a pixel's own see its emission, so that its samples don't. By a filter they see it for pixels
    around."""
    if has(eye, "filter_value"):
        return lambda eye, outlined: False
    return lambda eye, outlined: outlined


@device
def _from_maps(given, si, beta, pixel, whole):
    """What the maps show directly by the STORED lobes: caustics, and the terms that the method takes from the global
    map. `whole`: at the camera ray's own surface, so that terms are told apart."""
    eye = given.eye
    if eye.caustic_mask != 0:
        r = own_radius(pixel.radii, OF_CAUSTIC, eye.caustic_radius)
        L = reflected(given.scene, given.caustic_map, eye, r, si, eye.caustic_mask)
        count_found(pixel, OF_CAUSTIC, given.caustic_map, eye, r, si, eye.caustic_mask)
        deposit(pixel, CAUSTIC if whole else SPECULAR, mul(beta, L))
    for k in range(3):  # a loop, so that the look-up is compiled once
        mask, term = eye.global_mask, INDIRECT
        if k == 1:
            mask, term = eye.direct_mask, DIRECT
        elif k == 2:
            mask, term = eye.global_caustics, CAUSTIC
        if mask != 0:
            r = own_radius(pixel.radii, OF_GLOBAL, eye.global_radius)
            L = reflected(given.scene, given.global_map, eye, r, si, mask)
            count_found(pixel, OF_GLOBAL, given.global_map, eye, r, si, mask)
            deposit(pixel, term if whole else SPECULAR, mul(beta, L))


@device
def _light_rays(given, si, choice, gather, aimed):
    """How many rays by the BSDF of a surface look for lights: those that gather unless photons guide them, else one, or
    none where light samples by that choice suffice."""
    eye = given.eye
    if eye.mis == 0:
        return _i8(0)
    if gather > 0:
        return max(gather - aimed.rays, _i8(1))
    if is_lambertian(si.bsdf) and samples_suffice(given.scene, eye, choice, si.p):
        return _i8(0)
    return _i8(1)


@device
def _stored(given, si, beta, pixel, scratch, whole):
    """Light by the STORED lobes of a surface: direct light, what the maps show, gather rays. scratch: lists of lights
    and of photons. Returns the choice of lights."""
    eye = given.eye
    known, gather = cached(given, si, pixel, whole)
    aimed = Aim(scratch[1], _i8(0), _i8(0))
    if gather > 0:
        aimed = aim(given, si, gather, pixel.seed, scratch[1])
    choice = choose_by_power(scratch[0], eye.light_samples)
    if eye.direct != 0:
        choice = choose(given.scene, eye, given.choice_map, si, scratch[0])
    n_bsdf = _light_rays(given, si, choice, gather, aimed)
    if eye.direct != 0:
        sampler = Sampler(eye.sequence, pixel.seed, eye.index, LIGHT)
        L = direct_light(given.scene, given.shadows, si, STORED, choice, n_bsdf, sampler, pixel.counts)
        deposit(pixel, DIRECT if whole else SPECULAR, mul(beta, L))
    _from_maps(given, si, beta, pixel, whole)
    virtual_light(given, si, beta, pixel, whole)
    n = _i8(gather)
    if eye.direct != 0:
        n = max(n, n_bsdf)
    if eye.gather_rays > 0:
        n = max(n, _i8(1))
    if n > 0:
        numbers = BLACK
        if n_bsdf > 0 and gather == 0:
            u, v, u_lobe, _ = draw4(eye.sequence, pixel.seed, eye.index, BSDF)
            numbers = u_lobe, u, v
        rays = GatherRays(n, n_bsdf, aimed, choice, pixel.seed, numbers)
        direct, indirect = surface_rays(given, known, gather, si, beta, rays, pixel.counts)
        share = scale(beta, _f4(1.0) / _f4(n))
        deposit(pixel, DIRECT if whole else SPECULAR, mul(share, direct))
        if eye.gather_rays > 0:
            deposit(pixel, INDIRECT if whole else SPECULAR, mul(share, indirect))
    return choice


@device
def _followed(given, si, beta, pixel, depth, choice, lights):
    """Light by FOLLOWED lobes that are no deltas, besides what following them finds. Returns the choice of lights."""
    eye = given.eye
    if eye.unfound != 0:
        r = own_radius(pixel.radii, OF_CAUSTIC, eye.caustic_radius)
        L = unfound(given.caustic_map, eye, r, si)
        if si.bsdf.groups & STORED == 0:
            count_found(pixel, OF_CAUSTIC, given.caustic_map, eye, r, si, _CAUSTICS)
        deposit(pixel, SPECULAR, mul(beta, L))
    if eye.followed_direct != 0:
        choice = choose_for_group(given.scene, eye, si, FOLLOWED, lights)
        sampler = Sampler(eye.sequence, pixel.seed, eye.index, CHAIN_LIGHT + depth)
        L = direct_light(given.scene, given.shadows, si, FOLLOWED, choice, _i8(eye.mis), sampler, pixel.counts)
        deposit(pixel, SPECULAR, mul(beta, L))
    return choice


@device
def _emission(scene, eye, left, pdf, choice, hit, d):
    """Radiance that what a camera ray of direction d met sends back: a light, or the sky where it met nothing. Light
    samples at the surface before, `left` with the density pdf, may have found it too; pdf is 0 after a delta."""
    if pdf > _f4(0.0):
        return found_light(scene, left, d, pdf, eye.mis, choice, eye.biased, hit)
    return radiance_of(scene, met_light(scene, hit), hit, d)


@kernel
def eye_pass(given, marks, radii, film, counts, first, last):
    """Add a pass's samples to each of the pixels first … last−1.

    given: PassData of arrays (1,), whose eye record is the call's own (`pmviewer.render.pixel_samples.own_eye`); marks:
    uint8 (pixels,), OUTLINED where emission gets camera rays of its own (`pmviewer.render.direct.outline`), and what
    tells how many samples there are (`pmviewer.render.pixel_samples`), or (0,); radii: float32 (pixels, COLUMNS),
    look-up radii of the pixels (`pmviewer.render.pixel_radius`), or None; film: float64 (pixels, CHANNELS), see
    `pmviewer.render.planes`, or with a filter the samples that pixels share (`pmviewer.render.share`); counts:
    int64 (N_COUNTS,).
    """
    given = opened(given)
    scene, eye = given.scene, given.eye
    lights, found = stack_i4(LIST_WORDS), stack_i4(AIM_WORDS)
    index, hidden, tally = eye.index, hides_lights(eye), row_of(counts, 0)
    for number in range(first, last):
        row, own = row_of(film, number), radii_of(radii, number)
        outlined = not hidden and len(marks) > 0 and marks[number] & OUTLINED != 0
        if outlined:
            take_sample(eye, index)
            pixel = Pixel(number, pixel_seed(eye, number), row, own, tally, None)
            tally[C_RAYS] += outline_emission(scene, eye, pixel, film.shape[1])
        unseen = hidden or seen_by_outline(eye, outlined)
        samples = samples_of(eye, marks, number)
        for sample in range(samples):
            take_sample(eye, index * samples + sample)
            seed, ray = sampled_ray(scene, eye, number)
            pixel = Pixel(number, seed, row, own, tally, share_of(eye, samples))
            way, ways = first_way(ray)
            choice = choose_by_power(lights, eye.light_samples)
            while True:
                ray, beta, first_depth, splits, u_way = way
                left, pdf = ray.o, _f4(0.0)  # where, and with which density, a lobe was left that is not a delta
                for depth in range(first_depth, eye.max_depth + 1):
                    hit = cast(scene, ray)
                    tally[C_RAYS] += 1
                    beta = deposit_media(given, ray, hit, beta, pixel, depth)
                    whole = depth == 0
                    seen = EMISSION if whole else SPECULAR
                    if hit.prim < 0:
                        if met_light(scene, hit) >= 0 and not (whole and unseen):
                            deposit(pixel, seen, mul(beta, _emission(scene, eye, left, pdf, choice, hit, ray.d)))
                        break
                    si, beta = arrive(scene, eye.glossy, ray.d, hit, beta)
                    if whole:
                        properties(eye, pixel, si)
                        note_object(given, hit.prim, pixel)
                    if met_light(scene, hit) >= 0 and not (whole and unseen):
                        deposit(pixel, seen, mul(beta, _emission(scene, eye, left, pdf, choice, hit, ray.d)))
                    groups = si.bsdf.groups
                    by_map = shows_map(given, si, beta, u_way, hit.t)
                    if by_map:
                        deposit(pixel, SPECULAR, mul(beta, gathered(given, si)))
                    beta = thinned(beta, u_way, groups)
                    if groups == NOTHING or not largest(beta) > _f4(0.0):
                        break
                    if groups & STORED != 0 and not by_map:
                        choice = _stored(given, si, beta, pixel, (lights, found), whole)
                    if groups & FOLLOWED == 0:
                        break
                    if depth == eye.max_depth:
                        tally[C_CUT] += 1
                        break
                    if not is_delta(si.bsdf):
                        choice = _followed(given, si, beta, pixel, depth, choice, lights)
                    ray, beta, pdf, u_way, splits, ways = split_camera_path(
                        scene, eye, si, beta, u_way, seed, depth, splits, ways
                    )
                    if eye.followed_direct == 0:
                        pdf = _f4(0.0)
                    if not largest(beta) > _f4(0.0):
                        break
                    left = si.p
                if ways.n == 0:
                    break
                way, ways = next_way(ways)
    take_sample(eye, index)
