"""The choice of many lights, by the photons that arrived near the point (R2).

A light that is visible from a point has most likely sent photons to its surroundings, and about as many as it lights
the place (Keller and Wald 2000, §3). Without a photon near, "photons" falls back to power. Photons of lights beyond
those that a list holds are passed over. The biased variants leave out all lights without photons near (and δ).
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.lights.light import light_probability
from pmviewer.kernels.memory import (
    count_trailing_zeros,
    load_u4,
    stack_get_i4,
    stack_i4,
    stack_put_f4,
    stack_put_i4,
)
from pmviewer.maps.search.disc import Disc
from pmviewer.maps.search.grid import counted_in_block, grid_ranges, thinning_step
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.render.direct.choice import KELLER_WALD, LISTED, choose_by_power

MOST_CANDIDATES = 2048
"""A look-up in a crowded place visits about this many photons, evenly thinned: more would not tell more."""
DEFENSIVE = np.float32(0.1)
"""δ, the share of the samples that the rule "photons" spends on lights by power."""

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
    step = thinning_step(ranges, runs, MOST_CANDIDATES)
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
def choose_by_photons(scene, eye, grid, p, n, lights):
    """The choice at the point p with normal n by whichever of both rules the eye record says; `lights` as for
    `lights_near`."""
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
        return lights, known, _f4(con), _f4(rest), con + non, _i8(0)
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
    return lights, known, mass, _f4(samples) * delta, samples, _i8(0)
