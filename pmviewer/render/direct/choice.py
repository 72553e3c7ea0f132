"""What a choice of lights is: which of them direct light is sampled from at a point, and how often (R2).

Whatever rule makes it, direct light is unbiased, because all come down to one number for each light: m, the expected
number of light samples on it at this point. A sample on a light counts 1/(m·pdf), and the power heuristic weighs m·pdf
against the BSDF samples. With Pₗ the light's share of the power, cₗ its photons within the radius and C their sum:

============  ==========================================  =====================================
choice        m of a light in the list                    m of any other light
============  ==========================================  =====================================
power         –                                           n·Pₗ
distance      n·((1 − δ)·wₗ/W + δ·Pₗ), wₗ = Pₗ/dₗ² with   –
              the distance dₗ of the light and W the sum
              over all lights
photons       n·((1 − δ)·cₗ/C + δ·Pₗ)                     n·δ·Pₗ
Keller-Wald   S_con·cₗ/C, or, when there is a sample for  S_non·Pₗ over the sum of these lights'
              every such light, one each and the others   shares
              by cₗ/C in whole numbers
============  ==========================================  =====================================

Where lobes are not Lambertian, m of a choice by distance among few lights goes by what they reflect of each, too
(`pmviewer.render.direct.by_lobes`).

A list holds LISTED lights: all of them, by distance (`pmviewer.render.direct.by_distance`), or those with photons near
(`pmviewer.render.direct.by_photons`). `pmviewer.render.direct.choose` asks whichever rule the eye record says.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.lights.light import light_probability
from pmviewer.kernels.memory import load_f4, stack_get_f4, stack_get_i4
from pmviewer.kernels.table import find_interval

CHOICES = ("power", "distance", "photons", "Keller-Wald")
"""Names of the rules; a rule's id is its place here."""
BY_POWER, BY_DISTANCE, BY_PHOTONS, KELLER_WALD = range(len(CHOICES))
ASKING = CHOICES[BY_PHOTONS:]
"""Rules that ask photons."""

LISTED = 64
"""Most lights that a point keeps apart."""
LIST_WORDS = 2 * LISTED
"""Words of scratch for a list: the lights' ids in ascending order, then their m."""

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64


@device
def choose_by_power(lights, n):
    """The rule "power" with n samples. A choice is (list of lights, their number, sum of their m, m/P of any other
    light, samples, how the sky is sampled (`pmviewer.kernels.lights.sky_facing`), 0: by luminance)."""
    return lights, _i8(0), _f4(0.0), _f4(n), _i8(n), _i8(0)


@device
def expected_samples(scene, choice, light):
    """m, the expected number of light samples on `light` under that choice."""
    lights, known, _, rest, _, _ = choice
    for j in range(known):
        if stack_get_i4(lights, j) == light:
            return stack_get_f4(lights, LISTED + j)
    return rest * light_probability(scene, light)


@device
def chosen_light(scene, choice, s, u):
    """Light of sample s (0 … samples − 1) and its m; u in [0, 1). Samples are stratified over the lights.

    m is 0 where rounding ended on a light that is not to be sampled.
    """
    lights, known, mass, rest, samples, _ = choice
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
