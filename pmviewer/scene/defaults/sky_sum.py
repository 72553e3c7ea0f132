"""Two environments as one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import ConstantEnvironment, Environment, ImageEnvironment

Float = NDArray[np.float64]


def sum_of_skies(a: Environment, b: Environment) -> Environment:
    """What both bring. The second of two images is looked up at the texels of the finer one."""
    if isinstance(a, ConstantEnvironment) and isinstance(b, ConstantEnvironment):
        red, green, blue = (x + y for x, y in zip(a.radiance, b.radiance))
        return ConstantEnvironment(a.name, (red, green, blue))
    if isinstance(a, ConstantEnvironment):
        a, b = b, a
    assert isinstance(a, ImageEnvironment)
    if isinstance(b, ConstantEnvironment):
        return ImageEnvironment(a.name, a.pixels + np.array(b.radiance, np.float32), a.to_world)
    if b.pixels.size > a.pixels.size:
        a, b = b, a
    height, width = a.pixels.shape[:2]
    pixels = a.pixels.copy()
    phi = (np.arange(width) + 0.5) * 2 * math.pi / width
    for row in range(height):
        theta = math.pi * row / (height - 1)
        flat = math.sin(theta)
        directions = np.stack([flat * np.sin(phi), np.full(width, math.cos(theta)), -flat * np.cos(phi)], axis=1)
        pixels[row] += looked_up(b, directions @ a.to_world.T)
    return ImageEnvironment(a.name, pixels, a.to_world)


def looked_up(sky: ImageEnvironment, directions: Float) -> NDArray[np.float32]:
    """Radiance (n, 3) from directions (n, 3) of the world, as `pmviewer.kernels.lights.environment` has it."""
    height, width = sky.pixels.shape[:2]
    x, y, z = (directions @ sky.to_world).T
    place = (np.arctan2(x, -z) / (2 * math.pi) % 1.0) * width - 0.5
    down = np.arctan2(np.hypot(x, z), y) / math.pi * (height - 1)
    left = np.floor(place).astype(np.int64)
    top = np.clip(down.astype(np.int64), 0, height - 2)
    s, t = (place - left)[:, None], (down - top)[:, None]
    left, right = left % width, (left + 1) % width
    upper = sky.pixels[top, left] * (1 - s) + sky.pixels[top, right] * s
    lower = sky.pixels[top + 1, left] * (1 - s) + sky.pixels[top + 1, right] * s
    return np.asarray(upper * (1 - t) + lower * t, np.float32)
