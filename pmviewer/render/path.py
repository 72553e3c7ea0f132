"""A plain path tracer, the yardstick (R12): next-event estimation with MIS, Russian roulette, no photons.

Its samples are sorted into the same terms as the photon methods': a path is a caustic when it leaves the first diffuse
surface over followed lobes (mirrors, glass, see `pmviewer.kernels.bsdf.scattering`) and reaches the light over these
alone, or with `photons.indirect_caustics` whatever it meets after them; indirect when it meets another diffuse surface
else.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import FOLLOWED, NOTHING, STORED, is_delta, pick_group
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import FURTHER_LIGHT, PATH_LIGHT, PATH_SCATTER, PATH_STRIDE
from pmviewer.kernels.lights.sky_facing import seen_light_pdf
from pmviewer.kernels.memory import row_of, stack_i4
from pmviewer.kernels.random import draw4
from pmviewer.kernels.vector import largest, mul, scale
from pmviewer.render.cast import cast, leaving
from pmviewer.render.chain import WHITE, arrive, scatter
from pmviewer.render.counts import C_CUT, C_RAYS, C_SHADOW_RAYS
from pmviewer.render.direct.choice import LIST_WORDS, choose_by_power, expected_samples
from pmviewer.render.direct.choose import choose_for_group, choose_without_photons
from pmviewer.render.direct.direct import light_samples, met_light, power_heuristic, radiance_of
from pmviewer.render.given import Sampler
from pmviewer.render.hidden_lights import hides_lights
from pmviewer.render.media.path_flight import arrive_by_flight, scatter_in_medium
from pmviewer.render.pixel import (
    CAUSTIC,
    DIRECT,
    EMISSION,
    INDIRECT,
    SPECULAR,
    VOLUME,
    VOLUME_INDIRECT,
    Pixel,
    deposit,
    properties,
    sampled_ray,
)

_f4 = np.float32
ROULETTE_DEPTH = 8


@device
def term_of(eye, mirrored, stored, by_chain, in_medium):
    """The term of light that arrives after the lobes that a path took: `stored` of those that photons are stored for,
    collisions in media among them, with followed ones before (`mirrored`) and right after (`by_chain`) the first of
    them, which was a collision or not (`in_medium`)."""
    if mirrored:
        return SPECULAR
    if in_medium:
        return VOLUME if stored == 1 and not by_chain else VOLUME_INDIRECT
    if by_chain and (stored == 1 or eye.indirect_caustics != 0):
        return CAUSTIC
    return DIRECT if stored == 1 else INDIRECT


@device
def path_survival(depth, beta, compressed):
    """Probability with which a path goes on: the share of the light that is left on its way. `compressed`, the
    compression of all its lobes, is no loss: within glass radiance is n² times as high."""
    return min(largest(beta) / compressed, _f4(0.95)) if depth >= ROULETTE_DEPTH else _f4(1.0)


@kernel
def path_pass(scenes, eyes, film, counts, first, last):
    """Add one path to each of the pixels first … last−1; arguments as in `pmviewer.render.eye.eye_pass`."""
    scene, eye = scenes[0], eyes[0]
    lights, tally = stack_i4(LIST_WORDS), row_of(counts, 0)
    for number in range(first, last):
        seed, ray = sampled_ray(scene, eye, number)
        pixel = Pixel(number, seed, row_of(film, number), None, tally, None)
        beta, choice = WHITE, choose_by_power(lights, eye.light_samples)
        compressed = _f4(1.0)  # the compression of all lobes that the path took
        stored = 0  # how often the path took lobes that photons are stored for
        mirrored = False  # whether it took a followed lobe before the first of these
        by_chain = False  # whether it took one right after the first of these
        in_medium = False  # whether the first of these was a collision in a medium
        origin, pdf = ray.o, _f4(0.0)  # where the last direction was sampled, and its density, 0 if the lobe is a delta
        followed = True  # whether that was by the camera or followed lobes, where media's light is not sampled
        for depth in range(eye.max_depth + 1):
            arrival = arrive_by_flight(scene, eye, ray, beta, seed, depth, origin, followed)
            hit = arrival.hit
            tally[C_RAYS] += arrival.rays
            term = EMISSION
            if depth > 0:
                term = term_of(eye, mirrored, stored, by_chain, in_medium)
            if largest(arrival.emitted) > _f4(0.0):
                deposit(pixel, term, mul(beta, arrival.emitted))
            beta = arrival.beta
            if not largest(beta) > _f4(0.0):
                break
            if arrival.collides:
                if depth == 0:
                    seen = cast(scene, ray)
                    if seen.prim >= 0:
                        si, _ = arrive(scene, eye.glossy, ray.d, seen, beta)
                        properties(eye, pixel, si)
                if depth == eye.max_depth:
                    tally[C_CUT] += 1
                    break
                stored += 1
                in_medium = in_medium or stored == 1
                u, v, u_lobe, u_end = draw4(eye.sequence, seed, eye.index, PATH_SCATTER + PATH_STRIDE * depth)
                u_pick, lu, lv, _ = draw4(eye.sequence, seed, eye.index, PATH_LIGHT + PATH_STRIDE * depth)
                sampler = Sampler(eye.sequence, seed, eye.index, FURTHER_LIGHT)
                choice = choose_without_photons(scene, eye, arrival.p, lights)
                after = scatter_in_medium(scene, eye, ray, arrival, choice, sampler, (u_lobe, u, v), (u_pick, lu, lv))
                tally[C_RAYS] += after.rays
                tally[C_SHADOW_RAYS] += after.rays
                deposit(pixel, term_of(eye, mirrored, stored, by_chain, in_medium), after.L)
                survival = path_survival(depth, after.beta, compressed)
                if not u_end < survival:
                    break
                origin, ray, pdf, beta = after.ray.o, after.ray, after.pdf, scale(after.beta, _f4(1.0) / survival)
                followed = False
                continue
            if hit.prim >= 0:
                si, beta = arrive(scene, eye.glossy, ray.d, hit, beta)
            light = met_light(scene, hit)
            if light >= 0 and not (depth == 0 and hides_lights(eye)):
                L = radiance_of(scene, light, hit, ray.d)
                weight = _f4(1.0)
                if pdf > _f4(0.0):
                    weight = _f4(0.0)
                    if eye.mis != 0:
                        other = seen_light_pdf(scene, light, choice[5], origin, hit, ray.d, L)
                        weight = power_heuristic(_f4(1.0), pdf, expected_samples(scene, choice, light), other)
                if largest(L) > _f4(0.0) and weight > _f4(0.0):
                    deposit(pixel, term, scale(mul(beta, L), weight))
            if hit.prim < 0:
                break
            if depth == 0:
                properties(eye, pixel, si)
            if si.bsdf.groups == NOTHING:
                break
            if depth == eye.max_depth:
                tally[C_CUT] += 1
                break
            u, v, u_lobe, u_end = draw4(eye.sequence, seed, eye.index, PATH_SCATTER + PATH_STRIDE * depth)
            group, share, u_lobe = pick_group(si.bsdf, si.wo, u_lobe)
            beta = scale(beta, share)
            if group == FOLLOWED:
                mirrored = mirrored or stored == 0
                by_chain = by_chain or stored == 1
            else:
                stored += 1
            if group == STORED or not is_delta(si.bsdf):
                sampler = Sampler(eye.sequence, seed, eye.index, PATH_LIGHT + PATH_STRIDE * depth)
                choice = choose_for_group(scene, eye, si, group, lights)
                L, rays, _ = light_samples(scene, None, si, group, choice, eye.mis, sampler)
                tally[C_RAYS] += rays
                tally[C_SHADOW_RAYS] += rays
                deposit(pixel, term_of(eye, mirrored, stored, by_chain, in_medium), mul(beta, L))
            wi, beta, pdf, compression = scatter(scene, si, group, beta, u_lobe, u, v)
            beta, compressed = scale(beta, compression), compressed * compression
            if not largest(beta) > _f4(0.0):
                break
            survival = path_survival(depth, beta, compressed)
            if not u_end < survival:
                break
            beta = scale(beta, _f4(1.0) / survival)
            origin, ray, followed = si.p, leaving(si, wi), group == FOLLOWED
