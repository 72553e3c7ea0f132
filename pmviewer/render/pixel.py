"""A pixel of the eye pass and of the path tracer: its seed, its camera ray, and its place in the film."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.bsdf.dispersion import new_wave
from pmviewer.kernels.bsdf.scattering import shading_normal
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, has, part, specialised
from pmviewer.kernels.dimensions import PIXEL_SALT, WAVE
from pmviewer.kernels.random import hash3
from pmviewer.kernels.surface import face
from pmviewer.kernels.vector import is_good, normalize
from pmviewer.render.cast import of_wave, ray_of_camera
from pmviewer.render.counts import C_DROPPED
from pmviewer.render.filter_samples import place_in_pixel
from pmviewer.render.hidden_lights import past_lights
from pmviewer.render.lens import lens_numbers, through_lens
from pmviewer.render.planes import PLANES

_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32
_EYE = (_f4(0.0), _f4(0.0), _f4(0.0))

EMISSION, DIRECT, SPECULAR, CAUSTIC, INDIRECT, ALBEDO, NORMAL, DEPTH = (
    PLANES[name].start
    for name in ("emission", "direct", "specular", "caustic", "indirect", "albedo", "normal", "depth")
)
"""First column of each plane of the film."""
VOLUME, VOLUME_INDIRECT = PLANES["volume"].start, PLANES["volume indirect"].start
"""Those of scenes with media."""


class Pixel(NamedTuple):
    """A pixel that is sampled: its number and seed, and where its samples go: film, its row of float64
    (pixels, CHANNELS); radii, its row of those of look-ups, or None (`pmviewer.render.pixel_radius`); counts, int64
    (N_COUNTS,), all three by `row_of`; what its sample counts as one of several of the pass, None for 1
    (`pmviewer.render.pixel_samples`)."""

    number: Any
    seed: Any
    film: Any
    radii: Any
    counts: Any
    share: Any


@device
def pixel_seed(eye, pixel):
    """Seed of a pixel's random numbers in all passes."""
    return hash3(eye.seed, _u4(pixel), _u4(PIXEL_SALT))


@device
def _raw_direction(eye, pixel, u, v):
    """Of the ray through the pixel at (u, v), 1 along the view; of an orthographic camera its place from the eye."""
    x = _f4(pixel % eye.width) + (eye.pixel_margin + eye.pixel_side * u)
    y = _f4(pixel // eye.width) + (eye.pixel_margin + eye.pixel_side * v)
    return (
        eye.x_corner + x * eye.x_right + y * eye.x_down,
        eye.y_corner + x * eye.y_right + y * eye.y_down,
        eye.z_corner + x * eye.z_right + y * eye.z_down,
    )


@device
def camera_ray(eye, pixel, u, v):
    """The pinhole's ray through the pixel at (u, v), which is the pixel's own for [0, 1)², from the near to the far
    plane."""
    raw = _raw_direction(eye, pixel, u, v)
    if eye.orthographic != 0:
        return ray_of_camera(eye, raw, (eye.x_forward, eye.y_forward, eye.z_forward))
    return ray_of_camera(eye, _EYE, normalize(raw))


@specialised
def lens_ray(eye, pixel, u, v, a, b):
    """The camera ray through the pixel at (u, v) and the lens at (a, b) in [0, 1)²; without a lens `camera_ray`."""
    if not has(eye, "inverse_focus"):
        return lambda eye, pixel, u, v, a, b: camera_ray(eye, pixel, u, v)

    def of_lens(eye, pixel, u, v, a, b):
        ray, _ = through_lens(eye, _raw_direction(eye, pixel, u, v), a, b)
        return ray

    return of_lens


@device
def sampled_ray(scene, eye, pixel):
    """The pixel's seed, and its camera ray in the pass of the eye record."""
    seed = pixel_seed(eye, pixel)
    x, y = place_in_pixel(eye, seed)
    a, b = lens_numbers(eye, seed)
    ray = past_lights(scene, eye, lens_ray(eye, pixel, x, y, a, b))
    return seed, of_wave(ray, new_wave(scene, eye.sequence, seed, eye.index, WAVE))


@specialised
def shared(pixel, value):
    """What a float64 of a sample adds to a mean over the pixel's samples."""
    if absent(part(pixel, "share")):
        return lambda pixel, value: value
    return lambda pixel, value: value * _f8(pixel.share)


@device
def deposit(pixel, plane, value):
    """Add a sample to a plane of the film, or count it when it is not finite or negative."""
    if is_good(value):
        for k in range(3):
            pixel.film[plane + k] += shared(pixel, _f8(value[k]))
    else:
        pixel.counts[C_DROPPED] += 1


@device
def properties(eye, pixel, si):
    """Add the properties of the first surface that the pixel sees: albedo, normal towards the eye, distance along the
    view. They are means over the pixel's own samples, whatever its filter: others work with them."""
    p, albedo, n = si.p, si.bsdf.albedo, face(shading_normal(si.bsdf), si.wo)
    depth = (p[0] - eye.x_eye) * eye.x_forward + (p[1] - eye.y_eye) * eye.y_forward + (p[2] - eye.z_eye) * eye.z_forward
    for k in range(3):
        pixel.film[ALBEDO + k] += shared(pixel, _f8(albedo[k]))
        pixel.film[NORMAL + k] += shared(pixel, _f8(n[k]))
    pixel.film[DEPTH] += shared(pixel, _f8(depth))
