"""Final gather estimation in the eye pass (R7; course guide §6.3.2): what a pixel's own sample meets, full gathers at
chosen pixels, and the irradiance that the stage has estimated for the others.

Only the first surface of a pixel's own sample is estimated, and only where its stored lobes are Lambertian; the stage
(`pmviewer.engine.stages.estimation`) traces the very camera rays that the eye pass traces, so that a pixel's estimate
belongs to the surface that its sample shows. Which pixels gather, and which are interpolated between them, is decided
in `pmviewer.render.gather.tiles`.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.scattering import STORED, is_lambertian, shading_normal
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import CACHE_SALT
from pmviewer.kernels.memory import load_f4, row_of
from pmviewer.kernels.random import hash3
from pmviewer.kernels.vector import luminance
from pmviewer.maps.hemisphere import irradiance_and_gradients
from pmviewer.render.cast import cast
from pmviewer.render.chain import BLACK, WHITE, arrive
from pmviewer.render.counts import C_DROPPED, C_RAYS
from pmviewer.render.gather.cache_fill import Origin, gather_hemisphere
from pmviewer.render.given import opened
from pmviewer.render.pixel import pixel_seed, sampled_ray

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_u4 = np.uint32

SAMPLE = 12
"""Floats of a pixel's sample."""
POINT, NORMAL, FACE, GAP, FOOTPRINT, KIND = 0, 3, 6, 9, 10, 11
"""Where its parts begin: x, shading normal and geometric normal on the side of the eye, how far rays start off the
surface, the size of a pixel there, and DIFFUSE or OTHER."""
OTHER, DIFFUSE = 0.0, 1.0
"""Whether the first surface of the sample has Lambertian stored lobes."""
ESTIMATE = 4
"""Floats of a pixel's estimate: irradiance (red, green, blue), and 1 where there is one."""
TOLD = 3
"""Floats of what a gather tells besides: the harmonic mean of the distances that its rays went, the standard error of
its irradiance's luminance, taken as if its directions were independent, and the share of its directions that was
reprojected (`pmviewer.render.gather.reprojection`)."""

ESTIMATES = np.dtype(
    [
        ("estimates", "i8"),  # float32 (pixels, ESTIMATE)
        ("pixel_angle", "f4"),  # what a pixel's footprint grows by at distance 1
        ("pixel_size", "f4"),  # its footprint at distance 0
        ("rings", "i4"),  # strata of a gathered hemisphere
        ("sectors", "i4"),
    ],
    align=True,
)
"""What kernels see of the estimates of a pass; it takes the place of the irradiance cache in `PassData`."""


@kernel
def trace_samples(given, samples, counts, first, last):
    """What the samples of pixels first … last−1 meet first.

    given: as for the eye pass; samples: float32 (pixels, SAMPLE); counts: int64 (N_COUNTS,).
    """
    given = opened(given)
    scene, eye, sizes = given.scene, given.eye, given.cache
    for pixel in range(first, last):
        row = samples[pixel]
        row[KIND] = _f4(OTHER)
        _, ray = sampled_ray(scene, eye, pixel)
        hit = cast(scene, ray)
        counts[C_RAYS] += 1
        if hit.prim < 0:
            continue
        si, _ = arrive(scene, eye.glossy, ray.d, hit, WHITE)
        if si.bsdf.groups & STORED == 0 or not is_lambertian(si.bsdf):
            continue
        n = shading_normal(si.bsdf)
        for axis in range(3):
            row[POINT + axis], row[NORMAL + axis], row[FACE + axis] = si.p[axis], n[axis], si.ng[axis]
        row[GAP], row[KIND] = si.gap, _f4(DIFFUSE)
        row[FOOTPRINT] = sizes.pixel_size + hit.t * sizes.pixel_angle


@device
def standard_error(cells):
    """Of the irradiance's luminance, from `cells` (n, ≥ 3) of radiance."""
    n = len(cells)
    total, squares = _f8(0.0), _f8(0.0)
    for i in range(n):
        Y = _f8(luminance((cells[i, 0], cells[i, 1], cells[i, 2])))
        total, squares = total + Y, squares + Y * Y
    variance = max(squares / n - (total / n) ** 2, _f8(0.0))
    return _f8(math.pi) * math.sqrt(variance / n)


@device
def _vector(row, at):
    return row[at], row[at + 1], row[at + 2]


@kernel
def gather_samples(given, pixels, samples, estimates, told, counts, first, last):
    """Full gathers at the samples of pixels[first … last−1], a stratified hemisphere each.

    given: as for the eye pass; pixels: int32 (n,); samples: float32 (pixels, SAMPLE); estimates: float32 (pixels,
    ESTIMATE) and told: float32 (pixels, TOLD), filled in; counts: int64 (N_COUNTS,). A gather that is not finite is
    counted as dropped and left without an estimate.
    """
    given = opened(given)
    eye, strata, tally = given.eye, given.cache, row_of(counts, 0)
    cells = np.empty((strata.rings * strata.sectors, 5), np.float32)
    E, rotation, translation = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    for i in range(first, last):
        pixel = pixels[i]
        row = samples[pixel]
        n = _vector(row, NORMAL)
        seed = hash3(pixel_seed(eye, pixel), eye.index, _u4(CACHE_SALT))
        origin = Origin(_vector(row, POINT), _vector(row, FACE), n, row[GAP], None)  # never in scenes with media
        gather_hemisphere(given, origin, seed, cells, tally)
        mean = irradiance_and_gradients(cells, strata.rings, strata.sectors, n, E, rotation, translation)
        if not E[0] + E[1] + E[2] < _f8(np.inf):
            tally[C_DROPPED] += 1
            continue
        told[pixel, 0], told[pixel, 1], told[pixel, 2] = mean, standard_error(cells), _f4(0.0)
        estimates[pixel, 0], estimates[pixel, 1], estimates[pixel, 2] = E[0], E[1], E[2]
        estimates[pixel, 3] = _f4(1.0)


@device
def estimated(record, pixel):
    """Irradiance (red, green, blue) that was estimated for a pixel's first surface, and whether there is one."""
    at = record.estimates + _i8(pixel) * _i8(4 * ESTIMATE)
    if not load_f4(at, 3) > _f4(0.0):
        return BLACK, False
    return (load_f4(at, 0), load_f4(at, 1), load_f4(at, 2)), True
