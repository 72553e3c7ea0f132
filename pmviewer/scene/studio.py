"""Light for files that have none: a soft square light, a dim sky, and a floor to catch shadows and bounced light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pmviewer.scene.description import BLACK, ConstantEnvironment, Disk, Material, Parallelogram, Shape

# Lengths in radii of the bounding sphere. A white surface that faces the light comes out a little below 1.
LIGHT_DISTANCE, LIGHT_SIDE, LIGHT_RADIANCE = 3.0, 1.2, 15.0
SKY_RADIANCE = 0.1
FLOOR_RADIUS, FLOOR_GAP, FLOOR_ALBEDO = 2.5, 1e-3, 0.6


@dataclass(frozen=True)
class Studio:
    """What is added: shapes, their materials (numbered on from the scene's own), and the sky."""

    shapes: tuple[Shape, ...]
    materials: tuple[Material, ...]
    sky: ConstantEnvironment


def studio_of(box: tuple[np.ndarray, np.ndarray], up: Literal["y", "z"], first_material: int) -> Studio:
    """A studio around a scene with these bounds, lit from above, left of and behind the framed camera's shoulder."""
    low, high = box
    center = (low + high) / 2
    radius = max(float(np.linalg.norm(high - low)) / 2, 1e-12)
    top = np.array([0.0, 1.0, 0.0] if up == "y" else [0.0, 0.0, 1.0])
    towards = np.array([-0.45, 1.0, 0.5] if up == "y" else [-0.45, -0.5, 1.0])
    towards /= np.linalg.norm(towards)
    u = np.cross(top, towards)
    u /= np.linalg.norm(u)
    v = np.cross(-towards, u)
    side = LIGHT_SIDE * radius
    corner = center + LIGHT_DISTANCE * radius * towards - side / 2 * (u + v)
    light = Parallelogram(_vector(corner), _vector(side * u), _vector(side * v))
    below = center + top * (float((low - center) @ top) - FLOOR_GAP * radius)
    floor = Disk(_vector(below), _vector(top), FLOOR_RADIUS * radius)
    return Studio(
        shapes=(
            Shape("light above", light, first_material, (LIGHT_RADIANCE,) * 3),
            Shape("floor", floor, first_material + 1),
        ),
        materials=(
            Material("light", "diffuse", BLACK),
            Material("floor", "diffuse", (FLOOR_ALBEDO,) * 3, two_sided=True),
        ),
        sky=ConstantEnvironment("sky", (SKY_RADIANCE,) * 3),
    )


def _vector(x: np.ndarray) -> tuple[float, float, float]:
    return float(x[0]), float(x[1]), float(x[2])
