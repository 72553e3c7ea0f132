"""Making records of the irradiance cache: where pixels find none, a stratified hemisphere of gather rays (R6).

A candidate is a pixel. The eye pass's own sample of it is followed to the surfaces with Lambertian lobes that it meets,
through mirrors and glass as well, and at the first one where the cache says too little a record is made. A record is a
pure function of pixel, pass and the cache as it was given, so that it does not matter which thread makes it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.bsdf.dispersion import new_wave
from pmviewer.kernels.bsdf.scattering import FOLLOWED, STORED, is_lambertian, shading_normal
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.dimensions import CACHE_SALT, GATHER_WAVE, HEMISPHERE
from pmviewer.kernels.media.medium import VACUUM, has_media
from pmviewer.kernels.memory import row_of
from pmviewer.kernels.random import draw4, hash3
from pmviewer.kernels.vector import dot, largest, luminance, mul
from pmviewer.maps.hemisphere import cell_direction, irradiance_and_gradients
from pmviewer.maps.irradiance_cache import (
    FOOTPRINT,
    HARMONIC,
    IRRADIANCE,
    LEVEL,
    REACH,
    ROTATION,
    TRANSLATION,
    interpolate,
    reach_of,
)
from pmviewer.render.cast import cast, medium_towards, ray_from
from pmviewer.render.chain import BLACK, CERTAIN, WHITE, arrive, follow_camera_path
from pmviewer.render.counts import C_DROPPED, C_RAYS
from pmviewer.render.gather.gather import gather_light
from pmviewer.render.gather.weak import shows_map
from pmviewer.render.given import opened
from pmviewer.render.pixel import pixel_seed, sampled_ray
from pmviewer.render.split import thinned
from pmviewer.render.straight import cast_on, way

_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32
_INF = _f4(np.inf)
ENOUGH = _f4(0.25)
"""Sum of weights from which a point needs no record of its own: one of error 0.8, say. Less than that would do for the
eye pass; the overlap hides the rims."""


class Origin(NamedTuple):
    """Where a hemisphere of gather rays starts: the point, its geometric and shading normal on the side of the eye, how
    far rays start off it, and the medium on that side, None in scenes without media."""

    p: Any
    ng: Any
    n: Any
    gap: Any
    medium: Any


@specialised
def no_medium(scene):
    """What stands for the medium of a place that there is none of."""
    if has_media(scene):
        return lambda scene: VACUUM
    return lambda scene: None


@device
def uncovered_hit(given, pixel, counts):
    """The first Lambertian surface on the pixel's chain where the cache says too little.

    Returns whether there is one, the Origin there and the size of a pixel.
    """
    scene, eye, cache = given.scene, given.eye, given.cache
    seed, ray = sampled_ray(scene, eye, pixel)
    beta, u = WHITE, CERTAIN
    travelled = _f4(0.0)
    for depth in range(eye.max_depth + 1):
        hit = cast(scene, ray)
        counts[C_RAYS] += 1
        if hit.prim < 0:
            break
        travelled += hit.t
        si, beta = arrive(scene, eye.glossy, ray.d, hit, beta)
        by_map = shows_map(given, si, beta, u, hit.t)
        beta = thinned(beta, u, si.bsdf.groups)
        if not largest(beta) > _f4(0.0):
            break
        if si.bsdf.groups & STORED != 0 and is_lambertian(si.bsdf) and not by_map:
            n = shading_normal(si.bsdf)
            _, weight, _ = interpolate(cache, si.p, n)
            if weight < ENOUGH:
                footprint = cache.pixel_size + travelled * cache.pixel_angle
                return True, Origin(si.p, si.ng, n, si.gap, medium_towards(si, si.ng)), footprint
        if si.bsdf.groups & FOLLOWED == 0 or depth == eye.max_depth:
            break
        ray, beta, _, u = follow_camera_path(scene, eye, si, beta, u, seed, depth)
        if not largest(beta) > _f4(0.0):
            break
    return False, Origin(BLACK, BLACK, BLACK, _f4(0.0), no_medium(scene)), _f4(0.0)


@device
def gather_cell(given, origin, wi, seed, here, counts):
    """What the gather ray of cell `here` brings back from direction wi: the Hit, how far it is (inf: none), the tint of
    its way and the radiance before it."""
    counts[C_RAYS] += 1
    wave = new_wave(given.scene, given.eye.sequence, seed, _u4(here), GATHER_WAVE)
    ray = ray_from(origin.p, origin.ng, origin.gap, wi, origin.medium, wave)
    hit, tint = cast_on(given.scene, ray, True)
    if hit.prim < 0:
        return hit, _INF, tint, BLACK
    return hit, way(given.scene, ray.o, wi, hit), tint, gather_light(given, hit, wi, seed, _u4(here), counts)


@device
def gather_hemisphere(given, origin, seed, cells, counts):
    """Fill `cells` (see `irradiance_and_gradients`) with what gather rays bring back."""
    eye, cache, n = given.eye, given.cache, origin.n
    for k in range(cache.sectors):
        for j in range(cache.rings):
            here = j + cache.rings * k
            u, v, _, _ = draw4(eye.sequence, seed, _u4(here), HEMISPHERE)
            wi = cell_direction(n, cache.rings, cache.sectors, j, k, u, v)
            cos = dot(wi, n)
            cells[here, 0] = cells[here, 1] = cells[here, 2] = _f4(0.0)
            cells[here, 3], cells[here, 4] = _INF, _f4(1.0) - cos * cos
            if dot(wi, origin.ng) > _f4(0.0):
                _, cells[here, 3], tint, L = gather_cell(given, origin, wi, seed, here, counts)
                cells[here, 0], cells[here, 1], cells[here, 2] = mul(tint, L)


@kernel
def fill_records(given, pixels, rows, filled, counts, first, last):
    """Make the records of candidates first … last−1 that lack them, and tell in `filled` which.

    given: as for the eye pass, with the cache so far; pixels: int32 (n,); rows: float32 (n, ROW); filled: bool (n,);
    counts: int64 (N_COUNTS,).
    """
    given = opened(given)
    eye, cache, tally = given.eye, given.cache, row_of(counts, 0)
    cells = np.empty((cache.rings * cache.sectors, 5), np.float32)
    E, rotation, translation = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    for i in range(first, last):
        pixel = pixels[i]
        found, origin, footprint = uncovered_hit(given, pixel, tally)
        filled[i] = found
        if not found:
            continue
        seed = hash3(pixel_seed(eye, pixel), eye.index, _u4(CACHE_SALT))
        gather_hemisphere(given, origin, seed, cells, tally)
        harmonic = irradiance_and_gradients(cells, cache.rings, cache.sectors, origin.n, E, rotation, translation)
        if not (E[0] + E[1] + E[2] < _f8(np.inf) and harmonic > _f8(0.0)):
            tally[C_DROPPED] += 1
            filled[i] = False
            continue
        harmonic = limit_gradient(cache, harmonic, footprint, E, translation)
        row = rows[i]
        row[:] = _f4(0.0)
        for axis in range(3):
            row[axis], row[3 + axis] = origin.p[axis], origin.n[axis]
            row[IRRADIANCE + axis] = E[axis]
            for c in range(3):
                row[ROTATION + 3 * c + axis] = rotation[c, axis]
                row[TRANSLATION + 3 * c + axis] = translation[c, axis]
        row[HARMONIC], row[FOOTPRINT], row[LEVEL] = harmonic, footprint, _f4(0.0)
        row[REACH] = reach_of(row[HARMONIC], footprint, cache.error, cache.least, cache.most)


@device
def limit_gradient(cache, harmonic, footprint, E, translation):
    """The harmonic distance R, lowered to that over which the translational gradient uses the irradiance up; where that
    is below the least reach, the gradient is lowered instead, in place (Křivánek and others 2005)."""
    squared = _f8(0.0)
    for axis in range(3):
        slope = luminance((translation[0, axis], translation[1, axis], translation[2, axis]))
        squared += slope * slope
    steep = math.sqrt(squared)
    if steep > _f8(0.0):
        harmonic = min(harmonic, luminance((E[0], E[1], E[2])) / steep)
    least = _f8(cache.least) * _f8(footprint) / _f8(cache.error)
    if harmonic < least:
        for c in range(3):
            for axis in range(3):
                translation[c, axis] *= harmonic / least
    return harmonic
