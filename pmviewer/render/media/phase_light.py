"""Light that a point in a medium scatters once: light samples, and the phase function's half of multiple importance
sampling."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.lights.light import sample_one_light
from pmviewer.kernels.media.phase import phase
from pmviewer.kernels.random import draw4
from pmviewer.kernels.vector import add, largest, scale
from pmviewer.render.direct.choice import chosen_light
from pmviewer.render.direct.direct import power_heuristic
from pmviewer.render.media.through import light_through, place_of

_f4 = np.float32


@device
def one_light_sample(scene, p, d, medium, numbers, light, m, n_phase, u, v):
    """What a sample of the light adds to the radiance that p scatters back along a ray of direction d, per albedo, if m
    samples of it are expected; it is weighted against n_phase samples of the phase function (0: no MIS). Returns L and
    the rays cast."""
    wi, end, L, pdf, findable = sample_one_light(scene, light, p, u, v)
    black = (_f4(0.0), _f4(0.0), _f4(0.0))
    if not m * pdf > _f4(0.0):
        return black, 0
    f = phase(numbers, d, wi)
    if not f * largest(L) > _f4(0.0):
        return black, 0
    T = light_through(scene, p, end, medium, place_of(scene, light))
    weight = f / (m * pdf)
    if findable and n_phase > 0:
        weight *= power_heuristic(m, pdf, _f4(n_phase), f)
    return scale((T[0] * L[0], T[1] * L[1], T[2] * L[2]), weight), 1


@device
def phase_light(scene, p, d, medium, numbers, choice, n_phase, sampler, places):
    """Radiance that p scatters back along a ray of direction d from the light samples of the choice, per albedo.
    `places`, three numbers, are for the first sample; the sampler draws further ones. Returns L and the rays cast."""
    total = (_f4(0.0), _f4(0.0), _f4(0.0))
    rays = 0
    u_pick, u, v = places
    for s in range(choice[4]):
        if s > 0:
            u_pick, u, v, _ = draw4(sampler.sequence, sampler.seed, sampler.index, sampler.dimension + s)
        light, m = chosen_light(scene, choice, s, u_pick)
        L, cast = one_light_sample(scene, p, d, medium, numbers, light, m, n_phase, u, v)
        total = add(total, L)
        rays += cast
    return total, rays
