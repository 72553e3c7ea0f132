"""Which lights direct light is sampled from: few by their distances, many by the photons that arrived near (R2).

A light that is visible from a point has most likely sent photons to its surroundings, and about as many as it lights
the place (Keller and Wald 2000, §3). Whatever the photons say, direct light is unbiased, because every rule comes down
to one number for each light: m, the expected number of light samples on it at this point. A sample on a light counts
1/(m·pdf), and the power heuristic weighs m·pdf against the BSDF samples. With Pₗ the light's share of the power, cₗ its
photons within the radius and C their sum:

============  ==========================================  =====================================
choice        m of a light with photons near the point    m of any other light
============  ==========================================  =====================================
power         n·Pₗ                                        n·Pₗ
distance      n·((1 − δ)·wₗ/W + δ·Pₗ), wₗ = Pₗ/dₗ² with   –
              the distance dₗ of the light, at least its
              own radius; W: the sum over all lights
photons       n·((1 − δ)·cₗ/C + δ·Pₗ)                     n·δ·Pₗ
Keller-Wald   S_con·cₗ/C, or, when there is a sample for  S_non·Pₗ over the sum of these lights'
              every such light, one each and the others   shares
              by cₗ/C in whole numbers
============  ==========================================  =====================================

"distance" asks no photons and goes through all lights: for few of them. Sun and sky count as from the scene's radius.
The biased variants leave out the last column (and δ). Without a photon near, "photons" falls back to power. A list
holds LISTED lights; photons of further ones are passed over, which puts these into the last column.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.lights.light import light_probability
from pmviewer.kernels.lights.reach import LEAST_RATIO, samples_suffice
from pmviewer.kernels.media.medium import has_media
from pmviewer.kernels.memory import (
    count_trailing_zeros,
    load_f4,
    load_u4,
    stack_get_f4,
    stack_get_i4,
    stack_i4,
    stack_put_f4,
    stack_put_i4,
)
from pmviewer.kernels.scene import P_AREA, P_RADIUS, PLACE_COLUMNS, load3
from pmviewer.kernels.table import find_interval
from pmviewer.kernels.vector import dot, scale, sub
from pmviewer.maps.search.disc import Disc
from pmviewer.maps.search.grid import counted_in_block, grid_ranges
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH
from pmviewer.maps.search.stored import ALL_CLASSES

CHOICES = ("power", "distance", "photons", "Keller-Wald")
"""Names of the rules; a rule's id is its place here."""
BY_POWER, BY_DISTANCE, BY_PHOTONS, KELLER_WALD = range(len(CHOICES))

LISTED = 64
"""Most lights that a point keeps apart."""
LIST_WORDS = 2 * LISTED
"""Words of scratch for `choose_from`: the lights' ids in ascending order, then their m."""
MOST_CANDIDATES = 2048
"""A look-up in a crowded place visits about this many photons, evenly thinned: more would not tell more."""
DEFENSIVE = np.float32(0.1)
"""δ, the share of the samples that the rule "photons" spends on lights by power."""
DEFENSIVE_FAR = np.float32(0.2)
"""The same of "distance", which knows nothing of what is in between."""
NEAREST = np.float32(1e-12)
"""Least square of a distance relative to the scene's radius."""

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32


@device
def _count_photon(lights, known, light):
    """Count a photon of `light`; returns the new number of lights and whether the photon was counted."""
    for j in range(known):
        if stack_get_i4(lights, j) == light:
            stack_put_i4(lights, LISTED + j, stack_get_i4(lights, LISTED + j) + _i4(1))
            return known, True
    if known == LISTED:
        return known, False
    stack_put_i4(lights, known, light)
    stack_put_i4(lights, LISTED + known, _i4(1))
    return known + 1, True


@device
def lights_near(grid, n_lights, radius, p, n, lights):
    """Lights with photons closer than `radius` to p that arrived on the side of the normal n.

    `lights` points to LIST_WORDS words that receive ids (ascending) and photons. Returns the number of lights and of
    photons.
    """
    known, total = _i8(0), _i8(0)
    ranges, squared = stack_i4(16), stack_i4(8)
    radius = min(radius, grid.radius)
    disc = Disc(p, n, radius * radius, radius, _i4(ALL_CLASSES))
    runs = grid_ranges(grid, p[0], p[1], p[2], radius, ranges)
    candidates = _i8(0)
    for k in range(runs):
        candidates += _i8(stack_get_i4(ranges, 2 * k + 1)) - _i8(stack_get_i4(ranges, 2 * k))
    step = _i8(1) + candidates // _i8(MOST_CANDIDATES)
    for k in range(runs):
        first, end = _i8(stack_get_i4(ranges, 2 * k)), _i8(stack_get_i4(ranges, 2 * k + 1))
        for block in range(first // WIDTH, (end - 1) // WIDTH + 1, step):
            mask = counted_in_block(grid, block, first, end, disc, squared)
            b = grid.blocks + block * BLOCK_BYTES + 5 * ROW_BYTES
            while mask != 0:
                lane = count_trailing_zeros(mask)
                mask &= mask - _i4(1)
                light = _i4(load_u4(b, lane) >> _u4(16))
                if light < n_lights:
                    known, counted = _count_photon(lights, known, light)
                    if counted:
                        total += 1
    _sort(lights, known)
    return known, total


@device
def _sort(lights, known):
    """Insertion sort by id: there are few."""
    for i in range(1, known):
        light, photons = stack_get_i4(lights, i), stack_get_i4(lights, LISTED + i)
        j = i
        while j > 0 and stack_get_i4(lights, j - 1) > light:
            stack_put_i4(lights, j, stack_get_i4(lights, j - 1))
            stack_put_i4(lights, LISTED + j, stack_get_i4(lights, LISTED + j - 1))
            j -= 1
        stack_put_i4(lights, j, light)
        stack_put_i4(lights, LISTED + j, photons)


@device
def choose_by_power(lights, n):
    """The rule "power" with n samples. A choice is (list of lights, their number, sum of their m, m/P of any other
    light, samples)."""
    return lights, _i8(0), _f4(0.0), _f4(n), _i8(n)


@device
def _square_of_distance(scene, light, p):
    """Of p from a light, at least that of its radius, relative to the scene's."""
    place = light * PLACE_COLUMNS
    radius, inv = load_f4(scene.light_places, place + P_RADIUS), _f4(1.0) / scene.radius
    if radius < _f4(0.0):
        return _f4(1.0)
    to = scale(sub(load3(scene.light_places, place), p), inv)
    return max(max(dot(to, to), radius * inv * (radius * inv)), NEAREST)


@device
def choose_by_distance(scene, p, n, lights):
    """The rule "distance" with n samples at p, for at most LISTED lights; scratch as for `lights_near`."""
    total = _f4(0.0)
    for light in range(scene.n_lights):
        weight = light_probability(scene, light) / _square_of_distance(scene, light, p)
        stack_put_i4(lights, light, _i4(light))
        stack_put_f4(lights, LISTED + light, weight)
        total += weight
    mass, inv = _f4(0.0), (_f4(1.0) - DEFENSIVE_FAR) / total
    for light in range(scene.n_lights):
        share = stack_get_f4(lights, LISTED + light) * inv + DEFENSIVE_FAR * light_probability(scene, light)
        stack_put_f4(lights, LISTED + light, _f4(n) * share)
        mass += _f4(n) * share
    return lights, _i8(scene.n_lights), mass, _f4(0.0), _i8(n)


@device
def choose_anywhere(scene, eye, p, lights):
    """The choice at p where photons don't tell: by distance where the eye record says so, else by power."""
    choice = choose_by_power(lights, eye.light_samples)
    if eye.choice == BY_DISTANCE:
        choice = choose_by_distance(scene, p, eye.light_samples, lights)
    return choice


@specialised
def samples_do(scene, eye, choice, p):
    """Whether the light samples of the choice find direct light at the point p of a Lambertian surface as well without
    rays by the BSDF (`pmviewer.kernels.lights.reach`). Photons promise nothing; in scenes with media, never."""
    if has_media(scene):
        return lambda scene, eye, choice, p: False
    return _samples_do


def _samples_do(scene, eye, choice, p):
    if eye.choice == BY_POWER:
        return samples_suffice(scene, eye.light_samples, p)
    if eye.choice != BY_DISTANCE:
        return False
    for light in range(scene.n_lights):
        place = light * PLACE_COLUMNS
        radius, area = load_f4(scene.light_places, place + P_RADIUS), load_f4(scene.light_places, place + P_AREA)
        to = sub(load3(scene.light_places, place), p)
        gap = max(_f4(math.sqrt(dot(to, to))) - radius, _f4(0.0))
        if area > _f4(0.0) and not stack_get_f4(choice[0], LISTED + light) * gap * gap >= LEAST_RATIO * area:
            return False
    return True


@device
def choose_near(scene, eye, grid, p, n, lights):
    """The choice at the point p with normal n by the rule of the eye record; scratch as for `lights_near`."""
    known, total = lights_near(grid, scene.n_lights, eye.choice_radius, p, n, lights)
    power = _f8(0.0)
    for j in range(known):
        power += _f8(light_probability(scene, _i8(stack_get_i4(lights, j))))
    rest = _f8(0.0)
    inv = _f4(1.0) / _f4(max(total, 1))
    if eye.choice == KELLER_WALD:
        con, non = _i8(eye.con_samples), _i8(eye.noncon_samples)
        if eye.biased != 0 or known == scene.n_lights or not power < _f8(1.0):
            non = _i8(0)
        if non > 0:
            rest = _f8(non) / (_f8(1.0) - power)
        if known == 0:
            con = _i8(0)
        spare, below = con - known, _i8(0)
        for j in range(known):
            photons = stack_get_i4(lights, LISTED + j)
            m = _f4(con) * _f4(photons) * inv
            if spare >= 0:
                upto = below + _i8(photons)
                m = _f4(1 + spare * upto // total - spare * below // total)
                below = upto
            stack_put_f4(lights, LISTED + j, m)
        return lights, known, _f4(con), _f4(rest), con + non
    samples = _i8(eye.light_samples)
    if total == 0:
        if eye.biased != 0:
            samples = _i8(0)
        return choose_by_power(lights, samples)
    delta = _f4(0.0) if eye.biased != 0 else DEFENSIVE
    mass = _f4(0.0)
    for j in range(known):
        share = light_probability(scene, _i8(stack_get_i4(lights, j)))
        m = (_f4(1.0) - delta) * _f4(stack_get_i4(lights, LISTED + j)) * inv + delta * share
        m *= _f4(samples)
        stack_put_f4(lights, LISTED + j, m)
        mass += m
    return lights, known, mass, _f4(samples) * delta, samples


@device
def choose(scene, eye, grid, p, n, lights):
    """The choice at the point p with normal n by whatever rule; arguments as for `choose_near`."""
    choice = choose_anywhere(scene, eye, p, lights)
    if eye.choice == BY_PHOTONS or eye.choice == KELLER_WALD:
        choice = choose_near(scene, eye, grid, p, n, lights)
    return choice


@device
def expected_samples(scene, choice, light):
    """m, the expected number of light samples on `light` under that choice."""
    lights, known, _, rest, _ = choice
    for j in range(known):
        if stack_get_i4(lights, j) == light:
            return stack_get_f4(lights, LISTED + j)
    return rest * light_probability(scene, light)


@device
def chosen_light(scene, choice, s, u):
    """Light of sample s (0 … samples − 1) and its m; u in [0, 1). Samples are stratified over the lights.

    m is 0 where rounding ended on a light that is not to be sampled.
    """
    lights, known, mass, rest, samples = choice
    place = _f4(s) + u
    if place < mass:
        below = _f4(0.0)
        for j in range(known):
            m = stack_get_f4(lights, LISTED + j)
            below += m
            if place < below or j == known - 1:
                return _i8(stack_get_i4(lights, j)), m
    if not rest > _f4(0.0):
        j = known - 1
        if j >= 0:  # the m of the list add up to the number of samples but for rounding
            return _i8(stack_get_i4(lights, j)), stack_get_f4(lights, LISTED + j)
        return _i8(0), _f4(0.0)
    if known == 0:
        light = find_interval(scene.light_cdf, scene.n_lights, _i8(1), place / _f4(samples))
        return light, rest * light_probability(scene, light)
    # A place in the cumulative power of the other lights: step over those of the list, which are in its order.
    v = (_f8(s) + _f8(u) - _f8(mass)) / _f8(rest)
    for j in range(known):
        light = _i8(stack_get_i4(lights, j))
        low = _f8(load_f4(scene.light_cdf, light))
        if low <= v:
            v += _f8(load_f4(scene.light_cdf, light + 1)) - low
    light = find_interval(scene.light_cdf, scene.n_lights, _i8(1), _f4(min(v, _f8(0.99999994))))
    for j in range(known):
        if stack_get_i4(lights, j) == light:
            return light, _f4(0.0)
    return light, rest * light_probability(scene, light)
