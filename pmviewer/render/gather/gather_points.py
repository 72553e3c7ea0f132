"""The gather rays of one pixel, replayed with the numbers that the eye pass used: where they go and what they bring."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import FOLLOWED, STORED
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import row_of, stack_i4
from pmviewer.kernels.vector import dot, largest, mul, scale
from pmviewer.render.cast import cast
from pmviewer.render.chain import BLACK, arrive
from pmviewer.render.gather.cached import rays_unknown
from pmviewer.render.gather.gather import gather_light, gather_survival
from pmviewer.render.gather.guide import AIM_WORDS, aim, gather_direction
from pmviewer.render.gather.weak import shows_map
from pmviewer.render.given import GatherRays, opened
from pmviewer.render.pixel import sampled_ray
from pmviewer.render.pixel_samples import take_sample
from pmviewer.render.split import first_way, next_way, split_camera_path, thinned
from pmviewer.render.straight import cast_straight

_f4 = np.float32
_i8 = np.int64

POINT_COLUMNS = 10
"""Of a gather ray: its start (3), its end on the first surface that it meets (3), the radiance that it adds to the
pixel (red, green, blue), and 1 if photons guided it, 0 if it followed the BSDF."""


@device
def _replay(given, si, beta, samples, seed, rows, row, counts):
    """The gather rays of a surface, of one of so many samples, into `rows` from `row` on; returns the next free row."""
    n = rays_unknown(given, si)
    rays = GatherRays(n, _i8(0), aim(given, si, n, seed, stack_i4(AIM_WORDS)), None, seed, BLACK)
    for j in range(n):
        wi, weight, pdf, share, u_end, sample = gather_direction(given, rays, si, j)
        if row >= len(rows) or dot(wi, si.ng) <= _f4(0.0) or not largest(weight) > _f4(0.0):
            continue
        survival = gather_survival(given.eye, beta, weight, share)
        if not u_end < survival:
            continue
        hit, tint = cast_straight(given.scene, si, wi)
        if hit.prim < 0:
            continue
        L = mul(tint, gather_light(given, hit, wi, seed, sample, counts))
        L = scale(mul(mul(beta, weight), L), share / (survival * _f4(n * samples)))
        for k in range(3):
            rows[row, k], rows[row, 3 + k], rows[row, 6 + k] = si.p[k], hit.p[k], L[k]
        rows[row, 9] = _f4(0.0) if pdf > _f4(0.0) else _f4(1.0)
        row += 1
    return row


@kernel
def gather_points(given, pixel, samples, counts, rows):
    """Gather rays of the pixel in the pass of the eye record into rows, float32 (n, POINT_COLUMNS); returns how many.

    Rays that meet nothing are left out. given: as for `pmviewer.render.eye.eye_pass`; samples: int64, of the pixel in
    the pass; counts: int64 (N_COUNTS,) of scratch.
    """
    given = opened(given)
    scene, eye = given.scene, given.eye
    index, row, tally = eye.index, _i8(0), row_of(counts, 0)
    for sample in range(samples):
        take_sample(eye, index * samples + sample)
        seed, ray = sampled_ray(scene, eye, pixel)
        way, ways = first_way(ray)
        while True:
            ray, beta, first, splits, u = way
            for depth in range(first, eye.max_depth + 1):
                hit = cast(scene, ray)
                if hit.prim < 0:
                    break
                si, beta = arrive(scene, eye.glossy, ray.d, hit, beta)
                by_map = shows_map(given, si, beta, u, hit.t)
                beta = thinned(beta, u, si.bsdf.groups)
                if not largest(beta) > _f4(0.0):
                    break
                if si.bsdf.groups & STORED != 0 and not by_map:
                    row = _replay(given, si, beta, samples, seed, rows, row, tally)
                if si.bsdf.groups & FOLLOWED == 0:
                    break
                ray, beta, _, u, splits, ways = split_camera_path(scene, eye, si, beta, u, seed, depth, splits, ways)
                if not largest(beta) > _f4(0.0):
                    break
            if ways.n == 0:
                break
            way, ways = next_way(ways)
    take_sample(eye, index)
    return row
