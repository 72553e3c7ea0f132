"""The choice of few lights, by power over the square of the distance: what is near counts, whatever its power.

It goes through all lights at each point and asks no photons. A light's distance is that of the middle of a ball around
it, at least the ball's radius; sun and sky count as if they were the scene's radius away. The rule knows nothing of
what is in between, nor of which side a light shines on, so that a share of the samples goes by power.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.lights.light import light_place, light_probability
from pmviewer.kernels.lights.reach import LEAST_RATIO
from pmviewer.kernels.memory import stack_get_f4, stack_put_f4, stack_put_i4
from pmviewer.kernels.vector import dot, scale, sub
from pmviewer.render.direct.choice import LISTED

DEFENSIVE = np.float32(0.2)
"""δ, the share of the samples by power."""
NEAREST = np.float32(1e-12)
"""Least square of a distance relative to the scene's radius."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64


@device
def _square_of_distance(scene, light, p):
    """Of p from a light, at least that of its radius, relative to the scene's."""
    center, radius, _ = light_place(scene, light)
    if radius < _f4(0.0):
        return _f4(1.0)
    inv = _f4(1.0) / scene.radius
    to = scale(sub(center, p), inv)
    return max(max(dot(to, to), radius * inv * (radius * inv)), NEAREST)


@device
def choose_by_distance(scene, p, n, lights):
    """The rule "distance" with n samples at p, for at most LISTED lights; `lights`: LIST_WORDS words for the list."""
    total = _f4(0.0)
    for light in range(scene.n_lights):
        weight = light_probability(scene, light) / _square_of_distance(scene, light, p)
        stack_put_i4(lights, light, _i4(light))
        stack_put_f4(lights, LISTED + light, weight)
        total += weight
    mass, inv = _f4(0.0), (_f4(1.0) - DEFENSIVE) / total
    for light in range(scene.n_lights):
        share = stack_get_f4(lights, LISTED + light) * inv + DEFENSIVE * light_probability(scene, light)
        stack_put_f4(lights, LISTED + light, _f4(n) * share)
        mass += _f4(n) * share
    return lights, _i8(scene.n_lights), mass, _f4(0.0), _i8(n), _i8(0)


@device
def samples_by_distance_suffice(scene, choice, p):
    """Whether light samples of such a choice find direct light at the point p of a Lambertian surface as well without
    rays by the BSDF (`pmviewer.kernels.lights.reach`). One on a light of area A has a density of at least m·d²/A over
    directions, d being the distance to the ball around it."""
    for light in range(scene.n_lights):
        center, radius, area = light_place(scene, light)
        to = sub(center, p)
        d = max(_f4(math.sqrt(dot(to, to))) - radius, _f4(0.0))
        if area > _f4(0.0) and not stack_get_f4(choice[0], LISTED + light) * d * d >= LEAST_RATIO * area:
            return False
    return True
