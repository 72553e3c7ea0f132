"""Sun and sky as a lat-long image (`pmviewer.scene.description.ImageEnvironment`), up in the middle of its top."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.sky_table import sky_integral
from pmviewer.scene.daylight.models import SkyModel

Float = NDArray[np.float64]
_SKY_ROWS = 257
_SUN_ROWS = 1025
"""Rows of 0.18°: what spreads the sun's edge stays below its own width."""
_SAMPLES = 8
"""Along each side of a pixel that the sun may touch."""


def sky_image(
    model: SkyModel,
    sun: Float,
    sky_scale: float,
    sun_scale: float,
    half_aperture: float,
    stretch: float = 1.0,
    extend: bool = False,
) -> NDArray[np.float32]:
    """Pixels (h, 2 h − 2, 3) in the image's frame, y up, with the sun in the unit direction `sun` (3,).

    Nothing comes from below the horizon, except with Mitsuba 0.6's `stretch`, which draws the sky down, and `extend`,
    which lets it fade out there. The sun is a disc of constant radiance, whose irradiance is that of the model for any
    `half_aperture` (radians).
    """
    pixels = np.zeros((_SKY_ROWS, 2 * (_SKY_ROWS - 1), 3), np.float32)
    if sky_scale > 0:
        _paint(pixels, model, sun, sky_scale, stretch, extend)
    if sun_scale > 0:
        pixels = _finer(pixels, (_SUN_ROWS - 1) // (_SKY_ROWS - 1))
        rows = len(pixels)
        first, disc = _disc(rows, sun, half_aperture)
        means = np.zeros((rows, 1, 1))
        means[first : first + len(disc), 0, 0] = disc.mean(axis=1)
        whole = float(sky_integral(means.astype(np.float32))[0])
        pixels[first : first + len(disc)] += (disc[:, :, None] * (sun_scale / whole) * model.sun()).astype(np.float32)
    return pixels


def _paint(
    pixels: NDArray[np.float32], model: SkyModel, sun: Float, scale: float, stretch: float, extend: bool
) -> None:
    rows = len(pixels)
    step = math.pi / (rows - 1)
    beside = np.cos((np.arange(pixels.shape[1]) + 0.5) * step - math.atan2(sun[0], -sun[2]))
    zenith = math.acos(min(max(float(sun[1]), -1.0), 1.0)) / stretch
    for row in range(rows):
        theta, share = row * step, 1.0
        above = theta / stretch
        if extend:
            t = min(max(2 - 2 * theta / math.pi, 0.0), 1.0)
            share = t * t * (3 - 2 * t)
        elif above > math.pi / 2 + 1e-9:
            continue
        elif above > math.pi / 2 - 1e-9:
            share = 0.5  # rows are joined by straight lines: half as much here ends the sky at the horizon
        above = min(above, math.pi / 2)
        cos_gamma = math.cos(above) * math.cos(zenith) + math.sin(above) * math.sin(zenith) * beside
        gamma = np.arccos(np.clip(cos_gamma, -1.0, 1.0))
        pixels[row] = scale * share * model.radiance(np.full_like(gamma, math.cos(above)), gamma)


def _finer(pixels: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """The same interpolated image with `factor` times the columns and the rows between the poles."""
    height, width = pixels.shape[:2]
    place = (np.arange(width * factor) + 0.5) / factor - 0.5
    left = np.floor(place).astype(np.int64)
    s = (place - left).astype(np.float32)[:, None]
    wide = pixels[:, left % width] * (1 - s) + pixels[:, (left + 1) % width] * s
    down = np.arange((height - 1) * factor + 1) / factor
    top = np.minimum(down.astype(np.int64), height - 2)
    t = (down - top).astype(np.float32)[:, None, None]
    return wide[top] * (1 - t) + wide[top + 1] * t


def _disc(rows: int, sun: Float, half_aperture: float) -> tuple[int, Float]:
    """The first row that the disc reaches, and the share of each pixel from there on that it covers, at least of the
    one that its centre lies in: (rows it reaches, 2 rows − 2)."""
    step = math.pi / (rows - 1)
    columns = 2 * (rows - 1)
    theta = math.acos(min(max(float(sun[1]), -1.0), 1.0))
    phi = math.atan2(sun[0], -sun[2]) % (2 * math.pi)
    reach = half_aperture + 2 * step
    first, last = max(0, int((theta - reach) / step)), min(rows - 1, math.ceil((theta + reach) / step))
    offsets = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5
    across = np.cos((np.arange(columns)[:, None] + 0.5 + offsets) * step - phi)
    disc = np.zeros((last - first + 1, columns))
    for i in range(len(disc)):
        down = np.clip((first + i + offsets) * step, 0.0, math.pi)[:, None, None]
        dots = np.cos(down) * math.cos(theta) + np.sin(down) * math.sin(theta) * across
        disc[i] = (dots >= math.cos(half_aperture)).mean(axis=(0, 2))
    if not disc.any():
        disc[min(max(round(theta / step) - first, 0), len(disc) - 1), int(phi / step) % columns] = 1.0
    return first, disc
