"""Direct light on a diffuse surface: light samples, and the other half of multiple importance sampling (R2).

Which lights are sampled, and how often, is `pmviewer.render.choice`.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.jit import device
from pmviewer.kernels.light import emitted, one_light_pdf, sample_one_light
from pmviewer.kernels.random import draw4
from pmviewer.kernels.raycast import occluded
from pmviewer.kernels.scene import L_RADIANCE, light_of, light_vector
from pmviewer.kernels.surface import leave
from pmviewer.kernels.vector import add, dot, scale, sub
from pmviewer.render.choice import chosen_light, expected_samples

_f4 = np.float32
_u4 = np.uint32
INV_PI = _f4(1.0 / math.pi)
EXTRA_SET = np.int64(1000)
"""Dimension set of the second light sample; further ones follow."""
BEFORE_LIGHT = _f4(1.0 - 2.0**-13)
"""Shadow rays end a little before the light's own surface."""
BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))


@device
def power_heuristic(n_this, pdf_this, n_other, pdf_other):
    """Weight of a sample of one technique among two, β = 2 (Veach 1997)."""
    a, b = n_this * pdf_this, n_other * pdf_other
    return a * a / (a * a + b * b)


@device
def visible(scene, p, ng, gap, wi, end):
    """Whether nothing stands between the surface point p and the point `end`, seen from p in direction wi."""
    o = leave(p, ng, gap, wi[0], wi[1], wi[2])
    d = sub(end, o)
    return not occluded(scene, o[0], o[1], o[2], d[0], d[1], d[2], _f4(0.0), BEFORE_LIGHT)


@device
def light_samples(scene, p, ng, ns, gap, choice, n_bsdf, sequence, seed, index, u_pick, u, v):
    """Irradiance at p by the light samples of the choice, each weighted against n_bsdf cosine-distributed BSDF samples.

    (u_pick, u, v) are the first sample's numbers; further ones are drawn. Returns E (W/m²) and the shadow rays cast.
    """
    total = BLACK
    rays = 0
    for s in range(choice[4]):
        if s > 0:
            u_pick, u, v, _ = draw4(sequence, seed, index, EXTRA_SET + s)
        light, m = chosen_light(scene, choice, s, u_pick)
        wi, end, L, pdf, findable = sample_one_light(scene, light, p, u, v)
        cos = dot(wi, ns)
        if m * pdf > _f4(0.0) and cos > _f4(0.0) and dot(wi, ng) > _f4(0.0):
            rays += 1
            if visible(scene, p, ng, gap, wi, end):
                weight = cos / (m * pdf)
                if findable and n_bsdf > 0:
                    weight *= power_heuristic(m, pdf, _f4(n_bsdf), cos * INV_PI)
                total = add(total, scale(L, weight))
    return total, rays


@device
def found_light(scene, p, wi, cos, n_bsdf, choice, biased, prim, q, nq):
    """A BSDF sample from p in direction wi found primitive `prim` at q with geometric normal nq (prim < 0: nothing).

    Its emission (radiance), weighted against the light samples of the choice; a biased choice leaves the lights that it
    does not sample out of both halves.
    """
    light = scene.environment if prim < 0 else light_of(scene, prim)
    if light < 0:
        return BLACK
    L = light_vector(scene, light, L_RADIANCE) if prim < 0 else emitted(scene, light, nq, wi)
    if not L[0] + L[1] + L[2] > _f4(0.0):
        return BLACK
    m = expected_samples(scene, choice, light)
    if biased != 0 and not m > _f4(0.0):
        return BLACK
    pdf = one_light_pdf(scene, light, p, q, nq, wi)
    return scale(L, power_heuristic(_f4(n_bsdf), cos * INV_PI, m, pdf))
