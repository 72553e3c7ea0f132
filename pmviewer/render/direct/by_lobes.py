"""The choice of few lights by what a surface's lobes reflect of each, on top of the choice by distance.

Gloss shows one lamp of many: a small one that it mirrors counts more than a strong one beside it, of which a choice by
distance alone makes most samples, and takes the small lamp's rarely and at many times their weight (Veach's plates
under a lamp overhead). The lobes' f·cos is looked at where the ball around a light comes nearest to the mirror's
direction, and of one behind the surface to where the ray would go straight on. Its mean over the ball is at most one
over the ball's solid angle, since no surface reflects more than all.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.scattering import bsdf_f, is_plain, shading_normal
from pmviewer.kernels.bsdf.specular import reflect
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import part, specialised
from pmviewer.kernels.lights.light import light_place
from pmviewer.kernels.memory import stack_get_f4, stack_put_f4
from pmviewer.kernels.vector import dot, luminance, normalize, scale, sub
from pmviewer.render.direct.choice import LISTED

MOST = 16
"""Lights that lobes are asked about: each costs what a light sample does without its ray."""
DEFENSIVE = np.float32(0.2)
"""Share of the samples that go by distance as before: what is in between, and how a lobe varies, nobody knows."""
SCRATCH = LISTED - MOST
"""Where in the list of ids, of which few are in use, the weights wait."""

_f4 = np.float32
_i8 = np.int64
_FROM_AFAR = np.float32(1.0 / (2.0 * math.pi))
"""Mean of f·cos of what reflects all, over directions: for light from all around, and from far away."""


@device
def _towards(c, r, cos_reach):
    """The direction within a cone about the unit c, whose half angle has that cosine, nearest to the unit r."""
    cos = dot(c, r)
    if cos >= cos_reach:
        return r
    across = sub(r, scale(c, cos))
    length2 = dot(across, across)
    if not length2 > _f4(1e-12):
        return c
    sin_reach = _f4(math.sqrt(max(_f4(1.0) - cos_reach * cos_reach, _f4(0.0))))
    across = scale(across, sin_reach / _f4(math.sqrt(length2)))
    return normalize((cos_reach * c[0] + across[0], cos_reach * c[1] + across[1], cos_reach * c[2] + across[2]))


@device
def reflected_of(scene, si, group, light):
    """About the mean of f·cos over the directions to a light, by a group of the surface's lobes."""
    center, radius, _ = light_place(scene, light)
    if radius < _f4(0.0):
        return _FROM_AFAR
    to, n = sub(center, si.p), shading_normal(si.bsdf)
    d2 = dot(to, to)
    if not d2 > radius * radius:
        return _FROM_AFAR
    cos_reach = _f4(math.sqrt(_f4(1.0) - radius * radius / d2))
    aimed = scale(si.wo, _f4(-1.0))
    if dot(to, n) * dot(si.wo, n) > _f4(0.0):
        aimed = reflect(aimed, n)
    wi = _towards(scale(to, _f4(1.0) / _f4(math.sqrt(d2))), aimed, cos_reach)
    f = luminance(bsdf_f(si.bsdf, group, si.wo, wi)) * abs(dot(wi, n))
    return min(f, _f4(1.0) / (_f4(2.0 * math.pi) * max(_f4(1.0) - cos_reach, _f4(1e-6))))


@specialised
def choose_by_lobes(scene, si, group, choice):
    """A choice by distance at a surface with m by what a group of its lobes reflects, too; any other choice as it is,
    and that of more than MOST lights. Simple scenes have no gloss, and compile none of it."""
    if is_plain(part(si, "bsdf")):
        return lambda scene, si, group, choice: choice
    return _by_lobes


def _by_lobes(scene, si, group, choice):
    lights, known, _, rest, n, sky = choice
    if known != scene.n_lights or known < 2 or known > MOST or rest > _f4(0.0):
        return choice
    total = _f4(0.0)
    for light in range(known):
        weight = stack_get_f4(lights, LISTED + light) * reflected_of(scene, si, group, light)
        stack_put_f4(lights, SCRATCH + light, weight)
        total += weight
    if not (total > _f4(0.0) and total < _f4(np.inf)):
        return choice
    mass, by_lobes = _f4(0.0), (_f4(1.0) - DEFENSIVE) * _f4(n) / total
    for light in range(known):
        m = by_lobes * stack_get_f4(lights, SCRATCH + light) + DEFENSIVE * stack_get_f4(lights, LISTED + light)
        stack_put_f4(lights, LISTED + light, m)
        mass += m
    return lights, known, mass, rest, n, sky
