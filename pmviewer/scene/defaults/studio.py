"""Light for files that have none: a soft square light, a dim sky, and a floor to catch shadows and bounced light; in a
room a light under its ceiling."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.defaults.framing import Up, axes_of, vec3
from pmviewer.scene.defaults.proxy import Proxy
from pmviewer.scene.defaults.viewpoint import Viewpoint
from pmviewer.scene.description import BLACK, ConstantEnvironment, Disk, Material, Parallelogram, Shape

Float = NDArray[np.float64]

# Lengths in radii of the bounding sphere. A white surface that faces the light comes out a little below 1.
LIGHT_DISTANCE, LIGHT_SIDE, LIGHT_RADIANCE = 3.0, 1.2, 15.0
LIGHT_ASIDE = 78.0
"""Degrees that the light stands to the left of the camera."""
SKY_RADIANCE = 0.1
FLOOR_RADIUS, FLOOR_GAP, FLOOR_ALBEDO = 2.5, 1e-3, 0.6
GROUND = 0.6
"""Share of the scene's ground plan from which on surfaces near its lower end are a floor."""
FREE_GROUND = 0.25
"""Share of the plan, and of its rim, over which there must be nothing above such a floor."""
_PLAN, _GAP, _THICKEST = 16, 1e-2, 0.08
"""Places along the plan; how far below the scene they lie, in radii; thickness of a floor over the scene's height."""
WINDOW_SKY, MOST_SKY = 0.2, 2.0
"""Radiance, and the most power of such a sky, relative to that of the light under the ceiling."""
CLOSED = 0.97
"""Share of the directions in which a room must have walls to do without a sky."""


@dataclass(frozen=True)
class Studio:
    """What is added: shapes, their materials (numbered on from the scene's own), and the sky."""

    shapes: tuple[Shape, ...]
    materials: tuple[Material, ...]
    sky: ConstantEnvironment | None


def studio_of(box: tuple[Float, Float], up: Up, first_material: int, eye: Float, *, floor: bool = True) -> Studio:
    """A studio around a scene with these bounds, lit from above and from the left of who looks at it from `eye`."""
    low, high = box
    center = (low + high) / 2
    radius = max(float(np.linalg.norm(high - low)) / 2, 1e-12)
    right, top, front = axes_of(up)
    seen_from = (eye - center) @ np.stack([right, front], axis=1)
    azimuth = math.atan2(seen_from[0], seen_from[1]) - math.radians(LIGHT_ASIDE)
    towards = 0.67 * (math.sin(azimuth) * right + math.cos(azimuth) * front) + top
    towards /= np.linalg.norm(towards)
    light = _square(center + LIGHT_DISTANCE * radius * towards, -towards, top, LIGHT_SIDE * radius)
    shapes = [Shape("light above", light, first_material, (LIGHT_RADIANCE,) * 3)]
    materials = [Material("light", "diffuse", BLACK)]
    if floor:
        below = center + top * (float((low - center) @ top) - FLOOR_GAP * radius)
        shapes.append(Shape("floor", Disk(vec3(below), vec3(top), FLOOR_RADIUS * radius), first_material + 1))
        materials.append(Material("floor", "diffuse", (FLOOR_ALBEDO,) * 3, two_sided=True))
    return Studio(tuple(shapes), tuple(materials), ConstantEnvironment("sky", (SKY_RADIANCE,) * 3))


def has_ground(proxy: Proxy, box: tuple[Float, Float], up: Up) -> bool:
    """Does the scene stand on a floor of its own: level surfaces near its lower end under most of its ground plan, in
    part with nothing above them, at the rim of the plan too? The bottom of a crate is no floor."""
    below, level = _level_bottom(proxy, box, up)
    if level.mean() < GROUND:
        return False
    top = axes_of(up)[1]
    above = below + (2 * _GAP * proxy.radius + _THICKEST * float((box[1] - box[0]) @ np.abs(top))) * top
    free = level & ~proxy.closest(above, np.broadcast_to(top, above.shape)).met
    grid = free.reshape(_PLAN, _PLAN)
    rim = np.concatenate([grid[0], grid[-1], grid[1:-1, 0], grid[1:-1, -1]])
    return bool(min(free.mean(), rim.mean()) >= FREE_GROUND)


def has_level_bottom(proxy: Proxy, box: tuple[Float, Float], up: Up) -> bool:
    """Are there level surfaces near the scene's lower end under most of its ground plan?"""
    return bool(_level_bottom(proxy, box, up)[1].mean() >= GROUND)


def _level_bottom(proxy: Proxy, box: tuple[Float, Float], up: Up) -> tuple[Float, NDArray[np.bool_]]:
    """Points (n, 3) in a grid just below the scene, and above which of them is a level surface near its lower end."""
    low, high = box
    right, top, front = axes_of(up)
    size = high - low
    tall = float(abs(size @ top))
    steps = (np.arange(_PLAN) + 0.5) / _PLAN - 0.5
    x, y = (grid.reshape(-1, 1) for grid in np.meshgrid(steps, steps))
    gap = _GAP * proxy.radius
    below = (low + high) / 2 + x * size * np.abs(right) + y * size * np.abs(front) - (tall / 2 + gap) * top
    hits = proxy.closest(below, np.broadcast_to(top, below.shape))
    level = np.abs(proxy.normals[hits.triangle] @ top) > 0.97
    return below, hits.met & level & (hits.distance <= gap + _THICKEST * tall + 1e-6 * proxy.radius)


def room_light(proxy: Proxy, view: Viewpoint, up: Up, first_material: int) -> Studio:
    """A square light under the ceiling of the room that is looked at, and a sky where it has openings."""
    top = axes_of(up)[1]
    around = np.stack([top, -top, *_level_directions(up, 16)])
    hits = proxy.closest(np.broadcast_to(view.place, around.shape), around)
    distance = np.where(hits.met, hits.distance, np.nan)
    width = float(np.nanpercentile(distance[2:], 30)) if hits.met[2:].any() else proxy.radius
    above = float(distance[0]) if hits.met[0] else width
    below = float(distance[1]) if hits.met[1] else above
    side = min(0.6 * width, above + below)
    center = view.place + top * 0.92 * above
    drop = 0.92 * above + below
    # What it sends to a floor that far below comes to an irradiance of π/2, as if the room were lit to grey.
    radiance = 0.5 * math.pi * (drop**2 + side**2 / 4) / side**2
    shape = Shape(
        "light under the ceiling", _square(center, -top, axes_of(up)[2], side), first_material, (radiance,) * 3
    )
    # A sky sends its photons to the whole scene: around a small room, nearly all of them for nothing.
    lamp_power, sky_power = math.pi * side**2 * radiance, 4 * math.pi**2 * proxy.radius**2 * WINDOW_SKY
    spared = view.enclosed >= CLOSED or sky_power > MOST_SKY * lamp_power
    sky = None if spared else ConstantEnvironment("sky", (WINDOW_SKY,) * 3)
    return Studio((shape,), (Material("light", "diffuse", BLACK),), sky)


def _level_directions(up: Up, count: int) -> list[Float]:
    right, _, front = axes_of(up)
    return [math.cos(a) * right + math.sin(a) * front for a in np.arange(count) * 2 * math.pi / count]


def _square(center: Float, facing: Float, top: Float, side: float) -> Parallelogram:
    """A square with that middle and side that shines in the direction `facing` (unit)."""
    u = np.cross(top, -facing)
    u /= np.linalg.norm(u)
    v = np.cross(facing, u)
    return Parallelogram(vec3(center - side / 2 * (u + v)), vec3(side * u), vec3(side * v))
