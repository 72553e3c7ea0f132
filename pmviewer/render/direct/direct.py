"""Direct light on a surface: light samples, and the other half of multiple importance sampling (R2).

Which lights are sampled, and how often, is `pmviewer.render.direct.choice`.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import FOLLOWED, bsdf_f, bsdf_pdf, compressed, same_side, shading_normal
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.lights.light import emitted, environment_radiance
from pmviewer.kernels.lights.sky_facing import seen_light_pdf
from pmviewer.kernels.media.medium import has_media
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.scene import light_of
from pmviewer.kernels.vector import add, dot, largest, mul, scale
from pmviewer.render.chain import BLACK, WHITE
from pmviewer.render.counts import C_RAYS, C_SAVED, C_SHADOW_RAYS
from pmviewer.render.direct.choice import expected_samples
from pmviewer.render.direct.places import ABREAST, DRAWN_WORDS, draw_places, drawn_place
from pmviewer.render.direct.shadow import LIT, UNKNOWN, known_visibility
from pmviewer.render.media.through import ANYWHERE, place_of
from pmviewer.render.straight import transmission

_f4 = np.float32
_i8 = np.int64


@device
def power_heuristic(n_this, pdf_this, n_other, pdf_other):
    """Weight of a sample of one technique among two, β = 2 (Veach 1997), for densities up to infinity: lights have them
    that are seen from their edge."""
    a, b = n_this * pdf_this, n_other * pdf_other
    if a == b:
        return _f4(0.5)
    if a > b:
        t = b / a
        return _f4(1.0) / (_f4(1.0) + t * t)
    t = a / b
    return t * t / (_f4(1.0) + t * t)


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
def light_samples(scene, shadows, si, group, choice, n_bsdf, sampler):
    """Radiance towards wo from the light samples of the choice, reflected by a group of the BSDF's lobes.

    Each is weighted against n_bsdf BSDF samples of the group (0: no MIS). `shadows` is for `known_visibility`. Returns
    L, the shadow rays cast and those that shadow photons saved.
    """
    total, rays, saved, drawn = BLACK, 0, 0, stack_i4(DRAWN_WORDS)
    for begin in range(0, choice[4], ABREAST):
        count = min(_i8(ABREAST), choice[4] - begin)
        draw_places(scene, choice, sampler, begin, count, drawn)
        for k in range(count):
            light, m, place = drawn_place(scene, drawn, k, si.p)
            L, cast, spared = _light_sample(scene, shadows, si, group, n_bsdf, light, m, place)
            total = add(total, L)
            rays += cast
            saved += spared
    return total, rays, saved


@device
def _light_sample(scene, shadows, si, group, n_bsdf, light, m, place):
    """The same of one sample, at a place on the light (`drawn_place`)."""
    p, ng, b, wo = si.p, si.ng, si.bsdf, si.wo
    wi, end, L, pdf, findable = place
    if not m * pdf > _f4(0.0) or same_side(b, group, ng, wo, wi) == 0 or left_to_rays(scene, light, group):
        return BLACK, 0, 0
    f = compressed(b, wo, wi, bsdf_f(b, group, wo, wi))
    cos = abs(dot(wi, shading_normal(b)))
    if not (f[0] + f[1] + f[2] > _f4(0.0) and cos > _f4(0.0)):
        return BLACK, 0, 0
    known = known_visibility(shadows, p, ng, light)
    tint = WHITE if known == LIT else BLACK
    if known == UNKNOWN:
        tint = transmission(scene, si, light, wi, end, group != FOLLOWED or not findable)
    reflected = BLACK
    if largest(tint) > _f4(0.0):
        weight = cos / (m * pdf)
        if findable and n_bsdf > 0:
            weight *= power_heuristic(m, pdf, _f4(n_bsdf), bsdf_pdf(b, group, wo, wi))
        reflected = scale(mul(mul(f, L), tint), weight)
    return (reflected, 1, 0) if known == UNKNOWN else (reflected, 0, 1)


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
