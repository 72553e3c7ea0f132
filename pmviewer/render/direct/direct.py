"""Direct light on a surface: light samples, and the other half of multiple importance sampling (R2).

Which lights are sampled, and how often, is `pmviewer.render.direct.choice`.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import FOLLOWED, bsdf_f, bsdf_pdf, compressed, same_side, shading_normal
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.lights.light import emitted, environment_radiance, sample_one_light
from pmviewer.kernels.lights.sky_facing import place_on_light, seen_light_pdf
from pmviewer.kernels.media.medium import has_media
from pmviewer.kernels.random import SOBOL, draw4
from pmviewer.kernels.scene import light_of
from pmviewer.kernels.vector import add, dot, largest, mul, scale
from pmviewer.render.chain import BLACK, WHITE
from pmviewer.render.counts import C_RAYS, C_SAVED, C_SHADOW_RAYS
from pmviewer.render.direct.choice import chosen_light, expected_samples
from pmviewer.render.direct.shadow import LIT, UNKNOWN, known_visibility
from pmviewer.render.media.through import ANYWHERE, place_of
from pmviewer.render.straight import transmission

_f4 = np.float32
_u4 = np.uint32
_i8 = np.int64


@device
def power_heuristic(n_this, pdf_this, n_other, pdf_other):
    """Weight of a sample of one technique among two, β = 2 (Veach 1997)."""
    a, b = n_this * pdf_this, n_other * pdf_other
    return a * a / (a * a + b * b)


@device
def met_light(scene, hit):
    """The light that a ray met, −1 for none; the environment where it met nothing."""
    return scene.environment if hit.prim < 0 else light_of(scene, hit.prim)


@device
def radiance_of(scene, light, hit, d):
    """Radiance that the light which a ray of direction d met sends back along it."""
    return environment_radiance(scene, d) if hit.prim < 0 else emitted(scene, light, hit.prim, hit.p, hit.ng, d)


@specialised
def left_to_rays(scene, light, group):
    """Whether the rays that leave by the lobes bring a light's light, and samples of it none: what media emit is seen
    along followed rays."""
    if not has_media(scene):
        return lambda scene, light, group: False
    return lambda scene, light, group: group == FOLLOWED and place_of(scene, light) != ANYWHERE


@device
def _drawn_light(scene, choice, s, sampler):
    """Light of sample s, its m (`chosen_light`), two numbers for a place on it, and their density (`place_on_light`).

    Samples of a pass follow one another in the sequence as passes do, so that they complement each other: n samples
    each in the first m passes are its first n·m points. Of these the first two coordinates are spread best, and a
    block of 2ⁱ falls into as many parts of the third.
    """
    n = choice[4]
    index = _u4(_u4(sampler.index) * _u4(n) + _u4(s))
    u, v, u_pick, _ = draw4(sampler.sequence, sampler.seed, index, sampler.dimension)
    if sampler.sequence == SOBOL and n & (n - 1) == 0:
        place = _f4(n) * u_pick
        s = _i8(place)
        u_pick = place - _f4(s)
    light, m = chosen_light(scene, choice, s, u_pick)
    u, v, density = place_on_light(scene, light, choice[5], u, v)
    return light, m, u, v, density


@device
def light_samples(scene, shadows, si, group, choice, n_bsdf, sampler):
    """Radiance towards wo from the light samples of the choice, reflected by a group of the BSDF's lobes.

    Each is weighted against n_bsdf BSDF samples of the group (0: no MIS). `shadows` is for `known_visibility`. Returns
    L, the shadow rays cast and those that shadow photons saved.
    """
    p, ng, b, wo = si.p, si.ng, si.bsdf, si.wo
    total = BLACK
    rays, saved = 0, 0
    for s in range(choice[4]):
        light, m, u, v, density = _drawn_light(scene, choice, s, sampler)
        wi, end, L, pdf, findable = sample_one_light(scene, light, p, u, v)
        pdf *= density
        if not m * pdf > _f4(0.0) or same_side(b, group, ng, wo, wi) == 0 or left_to_rays(scene, light, group):
            continue
        f = compressed(b, wo, wi, bsdf_f(b, group, wo, wi))
        cos = abs(dot(wi, shading_normal(b)))
        if f[0] + f[1] + f[2] > _f4(0.0) and cos > _f4(0.0):
            known = known_visibility(shadows, p, ng, light)
            if known == UNKNOWN:
                rays += 1
            else:
                saved += 1
            tint = WHITE if known == LIT else BLACK
            if known == UNKNOWN:
                tint = transmission(scene, si, light, wi, end, group != FOLLOWED or not findable)
            if largest(tint) > _f4(0.0):
                weight = cos / (m * pdf)
                if findable and n_bsdf > 0:
                    weight *= power_heuristic(m, pdf, _f4(n_bsdf), bsdf_pdf(b, group, wo, wi))
                total = add(total, scale(mul(mul(f, L), tint), weight))
    return total, rays, saved


@device
def direct_light(scene, shadows, si, group, choice, n_bsdf, sampler, counts):
    """L of `light_samples`, its rays counted."""
    L, rays, saved = light_samples(scene, shadows, si, group, choice, n_bsdf, sampler)
    counts[C_RAYS] += rays
    counts[C_SHADOW_RAYS] += rays
    counts[C_SAVED] += saved
    return L


@device
def found_light(scene, p, wi, pdf_bsdf, n_bsdf, choice, biased, hit):
    """Radiance that was emitted by what a BSDF sample from p in direction wi met (`pmviewer.render.cast.Hit`).

    It is weighted against the light samples of the choice, where `pdf_bsdf` is the density of the BSDF sample; a biased
    choice leaves the lights that it does not sample out of both halves.
    """
    light = met_light(scene, hit)
    if light < 0:
        return BLACK
    L = radiance_of(scene, light, hit, wi)
    if not L[0] + L[1] + L[2] > _f4(0.0):
        return BLACK
    m = expected_samples(scene, choice, light)
    if biased != 0 and not m > _f4(0.0):
        return BLACK
    pdf = seen_light_pdf(scene, light, choice[5], p, hit, wi, L)
    return scale(L, power_heuristic(_f4(n_bsdf), pdf_bsdf, m, pdf))
