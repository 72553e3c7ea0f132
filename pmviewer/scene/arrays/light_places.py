"""Where lights are, as `pmviewer.kernels.lights.light.light_place` reads it: a ball around each, and its area."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pmviewer.scene.arrays.shape_bounds import shape_bounds
from pmviewer.scene.description import DirectionalLight, Light, PointLight, ProjectorLight, Shape, SpotLight


class Place(NamedTuple):
    """Centre and radius of the ball, the radius negative where light comes from all around or from far away; the area
    that rays may meet: 0 where none can, infinite of an environment."""

    x: float
    y: float
    z: float
    radius: float
    area: float


FAR_AWAY = Place(0.0, 0.0, 0.0, -1.0, 0.0)
EVERYWHERE = Place(0.0, 0.0, 0.0, -1.0, math.inf)


def place_of_shape(shape: Shape, area: float) -> Place:
    """Of a shape that emits."""
    low, high = shape_bounds(shape)
    x, y, z = ((low + high) / 2).tolist()
    return Place(x, y, z, float(np.linalg.norm(high - low)) / 2, area)


def place_of_light(light: Light) -> Place:
    """Of a light without a surface."""
    if isinstance(light, PointLight | SpotLight | ProjectorLight):
        return Place(*light.position, 0.0, 0.0)
    return FAR_AWAY if isinstance(light, DirectionalLight) else EVERYWHERE
