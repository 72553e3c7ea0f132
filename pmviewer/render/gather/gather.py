"""The final gather: rays from the first surface that look the global map up where they land (R3–R5).

Their directions are those of `pmviewer.render.gather.guide`; those that follow the BSDF are the BSDF half of direct
light's multiple importance sampling as well.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import (
    FOLLOWED,
    NOTHING,
    STORED,
    attenuation,
    bsdf_at,
    chain_numbers,
    followed_share,
)
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.dimensions import GATHER_CHAIN, GATHER_FORK
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import face
from pmviewer.kernels.vector import add, dot, largest, mul, scale
from pmviewer.render.cast import cast
from pmviewer.render.chain import BLACK, follow
from pmviewer.render.direct.direct import found_light
from pmviewer.render.gather.corner import gather_again, is_corner
from pmviewer.render.gather.guide import gather_direction
from pmviewer.render.given import SurfaceInteraction
from pmviewer.render.record import C_RAYS
from pmviewer.render.reflect import gathered

_f4 = np.float32
LEAST_SURVIVAL = np.float32(0.05)
"""Roulette lets this share of the weakest rays live, so that none of them counts more than twenty times."""


@device
def gather_light(given, hit, d, seed, index, counts):
    """Radiance that a gather ray of direction d brings back from what it met (`cast`): that of the global map at the
    first surface that stores photons, or of a second gather there (`pmviewer.render.gather.corner`).

    Lobes that are followed (mirrors, glass) add nothing unless the map holds what they reflect (`gather_specular`).
    """
    scene, eye = given.scene, given.eye
    beta = (_f4(1.0), _f4(1.0), _f4(1.0))
    total = BLACK
    length = _f4(0.0)
    again = False
    for depth in range(eye.max_depth):
        prim, u, v, q, nq, sq, gap, t = hit
        if prim < 0:
            break
        length += t
        material = material_of(scene, prim)
        beta = attenuation(scene, material, nq, d, t, beta)
        wo = (-d[0], -d[1], -d[2])
        b = bsdf_at(scene, prim, material, u, v, q, nq, sq, wo, eye.glossy)
        if b.groups == NOTHING:
            break
        si = SurfaceInteraction(q, face(nq, wo), gap, b, wo)
        follows = eye.gather_specular != 0 and b.groups & FOLLOWED != 0
        if b.groups & STORED != 0:
            if not again and is_corner(given, length):
                again = True
                L, weight, onward, hit = gather_again(given, si, seed, index, counts, hit)
                total = add(total, mul(beta, L))
                survival = _f4(1.0)
                if follows:  # one of both chains goes on
                    survival = _f4(1.0) - followed_share(b, wo)
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
        d, beta, _ = follow(scene, si, beta, u_lobe, bu, bv)
        if b.groups & STORED != 0:  # the chain forks: thin it out
            survival = min(followed_share(b, wo), _f4(1.0))
            if not u_end < survival:
                break
            beta = scale(beta, _f4(1.0) / survival)
        if not largest(beta) > _f4(0.0):
            break
        counts[C_RAYS] += 1
        hit = cast(scene, q, nq, gap, d)
    return total


@device
def gather_survival(eye, beta, weight, share):
    """Probability with which roulette lets a gather ray live, by what it may bring (Pharr, exercise 0.3): the path's
    throughput beta, f·cos/pdf and its share by multiple importance sampling."""
    if not eye.roulette > _f4(0.0):
        return _f4(1.0)
    return min(max(largest(mul(beta, weight)) * share / eye.roulette, LEAST_SURVIVAL), _f4(1.0))


@device
def gather_rays(given, si, beta, choice, aimed, n, numbers, seed, counts):
    """n rays by the STORED lobes of the BSDF: direct light that they find, and light that they gather.

    beta is the path's throughput up to the surface. `numbers` serve the ray when it is one of the BSDF alone; gather
    rays draw their own. Returns two radiances towards wo, summed over the rays and not yet divided by n.
    """
    scene, eye = given.scene, given.eye
    direct, indirect = BLACK, BLACK
    for j in range(n):
        wi, weight, pdf, share, u_end, sample = gather_direction(given, aimed, si, j, n, seed, numbers)
        if dot(wi, si.ng) <= _f4(0.0) or not largest(weight) > _f4(0.0):
            continue
        if eye.gather_rays > 0:
            survival = gather_survival(eye, beta, weight, share)
            if not u_end < survival:
                continue
            weight = scale(weight, _f4(1.0) / survival)
        counts[C_RAYS] += 1
        hit = cast(scene, si.p, si.ng, si.gap, wi)
        if eye.direct != 0 and eye.mis != 0 and pdf > _f4(0.0):
            L = found_light(scene, si.p, wi, pdf, n - aimed.rays, choice, eye.biased, hit[0], hit[3], hit[4])
            direct = add(direct, mul(weight, L))
        if eye.gather_rays > 0:
            L = gather_light(given, hit, wi, seed, sample, counts)
            indirect = add(indirect, scale(mul(weight, L), share))
    return direct, indirect
