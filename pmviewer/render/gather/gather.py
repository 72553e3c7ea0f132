"""The final gather: rays from the first surface that look the global map up where they land (R3–R5).

Their directions are those of `pmviewer.render.gather.guide`; those that follow the BSDF are the BSDF half of direct
light's multiple importance sampling as well.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.dispersion import renewed
from pmviewer.kernels.bsdf.scattering import FOLLOWED, NOTHING, STORED, chain_numbers, followed_share
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, part, specialised
from pmviewer.kernels.dimensions import GATHER_CHAIN, GATHER_FORK, GATHER_WAVE
from pmviewer.kernels.lights.reach import may_meet_light
from pmviewer.kernels.vector import add, dot, largest, mul, scale
from pmviewer.render.cast import Hit, cast, leaving
from pmviewer.render.chain import BLACK, WHITE, arrive, follow
from pmviewer.render.counts import C_RAYS
from pmviewer.render.direct.direct import found_light
from pmviewer.render.gather.corner import gather_again, is_corner
from pmviewer.render.gather.guide import gather_direction
from pmviewer.render.media.emitted import emitted_nearby
from pmviewer.render.media.volume import gathered_from_media
from pmviewer.render.reflect import gathered
from pmviewer.render.straight import cast_straight

_f4 = np.float32
LEAST_SURVIVAL = np.float32(0.05)
"""Roulette lets this share of the weakest rays live, so that none of them counts more than twenty times."""


@specialised
def of_its_own(hit, sequence, seed, index):
    """The Hit of a gather ray that has a wavelength of its own, unless the path before it has one."""
    if absent(part(hit, "wave")):
        return lambda hit, sequence, seed, index: hit

    def another(hit, sequence, seed, index):
        wave = renewed(hit.wave, sequence, seed, index, GATHER_WAVE)
        return Hit(hit.prim, hit.u, hit.v, hit.t, hit.p, hit.ng, hit.ns, hit.gap, hit.medium, hit.crossed, wave)

    return another


@device
def gather_light(given, hit, d, seed, index, counts):
    """Radiance that a gather ray of direction d brings back from what it met, a Hit: that of the global map at the
    first surface that stores photons, or of a second gather there (`pmviewer.render.gather.corner`).

    Lobes that are followed (mirrors, glass) add nothing unless the map holds what they reflect (`gather_specular`).
    """
    scene, eye = given.scene, given.eye
    hit = of_its_own(hit, eye.sequence, seed, index)
    beta = WHITE
    total = BLACK
    length = _f4(0.0)
    again = False
    for depth in range(eye.max_depth):
        if hit.prim < 0:
            break
        length += hit.t
        si, beta = arrive(scene, eye.glossy, d, hit, beta)
        groups = si.bsdf.groups
        if groups == NOTHING:
            break
        follows = eye.gather_specular != 0 and groups & FOLLOWED != 0
        if groups & STORED != 0:
            if not again and is_corner(given, length):
                again = True
                L, weight, onward, hit = gather_again(given, si, seed, index, counts, hit)
                total = add(total, mul(beta, L))
                survival = _f4(1.0)
                if follows:  # one of both chains goes on
                    survival = _f4(1.0) - followed_share(si.bsdf, si.wo)
                    _, _, _, u_end = chain_numbers(scene, eye.sequence, seed, index, GATHER_FORK)
                    follows = not u_end < survival
                if not follows:
                    beta = scale(mul(beta, weight), _f4(1.0) / survival)
                    d = onward
                    if not largest(beta) > _f4(0.0):
                        break
                    continue
                beta = scale(beta, _f4(1.0) / (_f4(1.0) - survival))
            else:
                total = add(total, mul(beta, gathered(given, si)))
        if not follows:
            break
        u_lobe, bu, bv, u_end = chain_numbers(scene, eye.sequence, seed, index, GATHER_CHAIN + depth)
        ray, beta, _ = follow(scene, si, beta, u_lobe, bu, bv)
        d = ray.d
        if groups & STORED != 0:  # the chain forks: thin it out
            survival = min(followed_share(si.bsdf, si.wo), _f4(1.0))
            if not u_end < survival:
                break
            beta = scale(beta, _f4(1.0) / survival)
        if not largest(beta) > _f4(0.0):
            break
        counts[C_RAYS] += 1
        hit = cast(scene, ray)
        L, T = gathered_from_media(given, ray, hit, seed, index, depth + 1, counts)
        total = add(total, mul(beta, L))
        beta = mul(beta, T)
    return total


@device
def gather_survival(eye, beta, weight, share):
    """Probability with which roulette lets a gather ray live, by what it may bring (Pharr, exercise 0.3): the path's
    throughput beta, f·cos/pdf and its share by multiple importance sampling."""
    if not eye.roulette > _f4(0.0):
        return _f4(1.0)
    return min(max(largest(mul(beta, weight)) * share / eye.roulette, LEAST_SURVIVAL), _f4(1.0))


@device
def gather_rays(given, si, beta, rays, counts):
    """Direct light that the rays (`GatherRays`) of a surface find, and light that they gather.

    beta is the path's throughput up to the surface. Returns two radiances towards wo, summed over the rays and not yet
    divided by their number.
    """
    scene, eye = given.scene, given.eye
    direct, indirect = BLACK, BLACK
    for j in range(rays.n):
        wi, weight, pdf, share, u_end, sample = gather_direction(given, rays, si, j)
        if dot(wi, si.ng) <= _f4(0.0) or not largest(weight) > _f4(0.0):
            continue
        if eye.gather_rays == 0 and not may_meet_light(scene, si.p, wi):
            continue
        if eye.gather_rays > 0:
            survival = gather_survival(eye, beta, weight, share)
            if not u_end < survival:
                continue
            weight = scale(weight, _f4(1.0) / survival)
        counts[C_RAYS] += 1
        hit, tint = cast_straight(scene, si, wi)
        if eye.gather_rays > 0:
            from_media, _ = gathered_from_media(given, leaving(si, wi), hit, rays.seed, sample, 0, counts)
            indirect = add(indirect, scale(mul(weight, from_media), share))
        if eye.direct != 0:
            nearby = emitted_nearby(scene, leaving(si, wi), hit, si.p)
            direct = add(direct, scale(mul(weight, nearby), share))
        weight = mul(weight, tint)
        if eye.direct != 0 and rays.n_bsdf > 0 and pdf > _f4(0.0):
            L = found_light(scene, si.p, wi, pdf, rays.n_bsdf, rays.choice, eye.biased, hit)
            direct = add(direct, mul(weight, L))
        if eye.gather_rays > 0:
            L = gather_light(given, hit, wi, rays.seed, sample, counts)
            indirect = add(indirect, scale(mul(weight, L), share))
    return direct, indirect
