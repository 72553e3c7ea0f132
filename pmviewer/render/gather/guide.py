"""Where gather rays look: along the BSDF, and along the photons that arrived near the point (R4; Pharr §0.4).

Of n rays n_b are BSDF samples, and n_p are guided by the directions from which photons came: through cones around them
(`pmviewer.render.gather.cones`) or by the cells of a hemisphere (`pmviewer.render.gather.hemicells`). The power
heuristic combines both; directions without photons are left to the BSDF, and every rule is unbiased.

Guides are photons of the same pass that arrived after a diffuse reflection, as the light of gather rays does, in a grid
of their own whose radius does not shrink: it blurs nothing. A pixel looks them up once for all its rays. Where they
come from all around, about as evenly as the BSDF sends rays, they have nothing to tell but their noise, and all rays
follow the BSDF.

Kernels compile for the kind of guides they are given: `guides` is a grid's record with a mark, or NO_GUIDES
(`pmviewer.maps.variant`).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.bsdf.scattering import STORED, bsdf_f, bsdf_pdf, bsdf_sample, shading_normal
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, has, part, specialised
from pmviewer.kernels.dimensions import GATHER, GATHER_BESIDE, GATHER_GUIDED, GUIDE_SALT
from pmviewer.kernels.memory import (
    count_trailing_zeros,
    load_u4,
    stack_get_f4,
    stack_get_i4,
    stack_i4,
    stack_put_f4,
    stack_put_i4,
)
from pmviewer.kernels.random import draw4, hash3
from pmviewer.kernels.vector import basis, dot, luminance, normalize, scale
from pmviewer.maps.photon_words import decode_direction, decode_powers
from pmviewer.maps.search.disc import Disc
from pmviewer.maps.search.grid import PhotonGrid, counted_in_block, grid_ranges, thinning_step
from pmviewer.maps.search.simd import BLOCK_BYTES, ROW_BYTES, WIDTH
from pmviewer.maps.variant import ABSENT, Mark, marked
from pmviewer.render.direct.direct import power_heuristic
from pmviewer.render.gather.cones import cone_direction, cone_pdf
from pmviewer.render.gather.hemicells import CELLS, cell_direction, cell_pdf, fill_cells
from pmviewer.render.given import Aim

Directions = Literal["photon cones", "hemisphere grid"]

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32

NO_GUIDES = ABSENT
"""Stands for guides where rays follow the BSDF."""
_MARKS: dict[Directions, Mark] = {"photon cones": "cones", "hemisphere grid": "cells"}

MOST_CONES, MOST_IN_CELLS = 50, 128
"""Most photons that guide a pixel."""
MOST_CANDIDATES = 512
"""A look-up in a crowded place visits about this many photons, evenly thinned."""
FEWEST = 8
"""Fewer photons say too little about directions."""
AIM_WORDS = 4 * MOST_IN_CELLS + CELLS
"""Words of scratch of `aim`: direction and luminance of each photon, then the cells."""
CONCENTRATED, CONCENTRATED_CELLS = np.float32(1.0), np.float32(1.25)
"""Photons guide from this relative variance of the radiance over directions on, see `concentration`: below, their own
noise costs more than they gain (measured). Cells blur more than cones."""


def guides_of(grid: PhotonGrid, directions: Directions) -> NDArray[np.void]:
    """The record of a grid of photons that guide rays in that way; valid while the grid lives."""
    return marked(grid.record, _MARKS[directions])


@device
def photons_near(grid, class_mask, p, n, seed, most, found):
    """Up to `most` photons near p that arrived on the side of the normal n, a random choice where there are more.

    `found` points to 4·most words that receive direction and luminance (in units of the map's power) of each. Returns
    their number.
    """
    ranges, squared = stack_i4(16), stack_i4(8)
    radius = grid.radius
    disc = Disc(p, n, radius * radius, radius, _i4(class_mask))
    runs = grid_ranges(grid, p[0], p[1], p[2], radius, ranges)
    step = thinning_step(ranges, runs, MOST_CANDIDATES)
    seen = _i8(0)
    state = _u4(seed)
    for k in range(runs):
        first, end = _i8(stack_get_i4(ranges, 2 * k)), _i8(stack_get_i4(ranges, 2 * k + 1))
        for block in range(first // WIDTH, (end - 1) // WIDTH + 1, step):
            mask = counted_in_block(grid, block, first, end, disc, squared)
            words = grid.blocks + block * BLOCK_BYTES + 3 * ROW_BYTES
            while mask != 0:
                lane = count_trailing_zeros(mask)
                mask &= mask - _i4(1)
                at, seen = seen, seen + _i8(1)
                if at >= most:  # algorithm R of Vitter 1985
                    state = _u4(_u4(state * _u4(1664525)) + _u4(1013904223))
                    at = (_i8(state) * seen) >> 32
                if at < most:
                    w = normalize(decode_direction(load_u4(words, lane)))
                    power = luminance(
                        decode_powers(load_u4(words + ROW_BYTES, lane), load_u4(words + 2 * ROW_BYTES, lane))
                    )
                    for axis in range(3):
                        stack_put_f4(found, 4 * at + axis, w[axis])
                    stack_put_f4(found, 4 * at + 3, power)
    return min(seen, _i8(most))


@device
def concentration(found, m, n):
    """Relative variance of the radiance over directions that m > 1 photons tell: E[L²]/E[L]² − 1 in the mean over
    cosine-weighted directions around n.

    Sixteen cells of equal weight: two rings, eight sectors. With cᵢ photons in each, 16·Σcᵢ(cᵢ−1)/(m(m−1)) − 1 is
    free of bias by the photons' own noise.
    """
    counts = stack_i4(16)
    for cell in range(16):
        stack_put_i4(counts, cell, _i4(0))
    s, t = basis(n)
    for j in range(m):
        w = (stack_get_f4(found, 4 * j), stack_get_f4(found, 4 * j + 1), stack_get_f4(found, 4 * j + 2))
        x, y, z = dot(w, s), dot(w, t), dot(w, n)
        cell = 8 if z * z < _f4(0.5) else 0
        if x < _f4(0.0):
            cell += 4
        if y < _f4(0.0):
            cell += 2
        if abs(x) < abs(y):
            cell += 1
        stack_put_i4(counts, cell, stack_get_i4(counts, cell) + _i4(1))
    pairs = _i8(0)
    for cell in range(16):
        c = _i8(stack_get_i4(counts, cell))
        pairs += c * (c - 1)
    return _f4(16.0) * _f4(pairs) / _f4(m * (m - 1)) - _f4(1.0)


@specialised
def aim(given, si, gather, seed, found):
    """What photons tell so many gather rays of a point (`Aim`), their directions in `found` (AIM_WORDS words). They
    guide none of them, or as large a share as the eye record says."""
    guides = part(given, "guides")
    if absent(guides):
        return lambda given, si, gather, seed, found: Aim(found, _i8(0), _i8(0))
    if has(guides, "cones"):
        return _aim_by_cones
    return _aim_by_cells


@device
def _guides(given, si, seed, most, least_concentration, found):
    """Up to `most` photons around the point into `found`: their number, or 0 where they have nothing to tell."""
    grid, mask = given.guides, given.eye.guide_mask
    m = photons_near(grid, mask, si.p, si.ng, hash3(seed, given.eye.index, _u4(GUIDE_SALT)), most, found)
    if m < FEWEST or concentration(found, m, shading_normal(si.bsdf)) < least_concentration:
        return _i8(0)
    return m


@device
def _share_of(eye, gather):
    """How many of so many gather rays photons guide."""
    return _i8(eye.guided_rays) * _i8(gather) // _i8(eye.gather_rays)


def _aim_by_cones(given, si, gather, seed, found):
    m = _guides(given, si, seed, MOST_CONES, CONCENTRATED, found)
    return Aim(found, _share_of(given.eye, gather) if m > 0 else _i8(0), m)


def _aim_by_cells(given, si, gather, seed, found):
    m = _guides(given, si, seed, MOST_IN_CELLS, CONCENTRATED_CELLS, found)
    if m > 0:
        fill_cells(found, 4 * MOST_IN_CELLS, m, si.bsdf, si.wo)
    return Aim(found, _share_of(given.eye, gather) if m > 0 else _i8(0), m)


@specialised
def guided_direction(guides, aimed, b, u, v, u_pick):
    """A direction that photons guide to, and its density per solid angle."""
    if has(guides, "cones"):
        return lambda guides, aimed, b, u, v, u_pick: cone_direction(aimed.found, aimed.photons, u, v, u_pick)
    at = 4 * MOST_IN_CELLS
    return lambda guides, aimed, b, u, v, u_pick: cell_direction(aimed.found, at, b, u, v, u_pick)


@specialised
def guided_pdf(guides, aimed, b, wi):
    """Density with which `guided_direction` comes to wi."""
    if has(guides, "cones"):
        return lambda guides, aimed, b, wi: cone_pdf(aimed.found, aimed.photons, wi)
    at = 4 * MOST_IN_CELLS
    return lambda guides, aimed, b, wi: cell_pdf(aimed.found, at, b, wi)


@specialised
def gather_direction(given, rays, si, j):
    """Direction of ray j of a surface's `GatherRays` by the STORED lobes of the BSDF.

    Returns wi, weight = f·cos/pdf (times n/n_b or n/n_p where there are two kinds), the density of BSDF samples (0 for
    a guided ray: its emission is none of its business), the share by multiple importance sampling in gathered light, a
    number to use and the ray's index in its sequences. Without gather rays the direction is that of `rays.numbers`: one
    for the lobe, two for the direction.
    """
    if absent(part(given, "guides")):
        return _by_bsdf
    return _by_both


def _by_bsdf(given, rays, si, j):
    eye = given.eye
    u_lobe, u, v = rays.numbers
    sample, u_end = eye.index, _f4(0.0)
    if eye.gather_rays > 0:
        sample = _u4(eye.index * _u4(rays.n) + _u4(j))
        u, v, u_lobe, u_end = draw4(eye.sequence, rays.seed, sample, GATHER)
    wi, weight, pdf, _ = bsdf_sample(given.scene, si.bsdf, STORED, si.wo, u_lobe, u, v)
    return wi, weight, pdf, _f4(1.0), u_end, sample


def _by_both(given, rays, si, j):
    # Guides are for gather rays alone, so that all n are such.
    eye, aimed, b, wo, n = given.eye, rays.aimed, si.bsdf, si.wo, rays.n
    guided = aimed.rays
    sample = _u4(eye.index * _u4(n) + _u4(j))
    n_b = n - guided
    if j < n_b:
        place, dimension = sample, GATHER
        if guided > 0:
            place, dimension = _u4(eye.index * _u4(n_b) + _u4(j)), GATHER_BESIDE
        u, v, u_lobe, u_end = draw4(eye.sequence, rays.seed, place, dimension)
        wi, weight, pdf, _ = bsdf_sample(given.scene, b, STORED, wo, u_lobe, u, v)
        share = _f4(1.0)
        if guided > 0:
            share = power_heuristic(_f4(n_b), pdf, _f4(guided), guided_pdf(given.guides, aimed, b, wi))
            weight = scale(weight, _f4(n) / _f4(n_b))
        return wi, weight, pdf, share, u_end, sample
    place = _u4(eye.index * _u4(guided) + _u4(j - n_b))
    u, v, u_pick, u_end = draw4(eye.sequence, rays.seed, place, GATHER_GUIDED)
    wi, q = guided_direction(given.guides, aimed, b, u, v, u_pick)
    cos = dot(wi, shading_normal(b))
    weight, share = (_f4(0.0), _f4(0.0), _f4(0.0)), _f4(0.0)
    if cos > _f4(0.0) and q > _f4(0.0):
        share = power_heuristic(_f4(guided), q, _f4(n_b), bsdf_pdf(b, STORED, wo, wi))
        weight = scale(bsdf_f(b, STORED, wo, wi), cos / q * (_f4(n) / _f4(guided)))
    return wi, weight, _f4(0.0), share, u_end, sample
