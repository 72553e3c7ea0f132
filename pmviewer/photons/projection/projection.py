"""Projection maps (T7): from which places and in which directions a light's photons can meet certain surfaces.

Which cells these are is decided by `pmviewer.photons.projection.cells`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels import scene as K
from pmviewer.photons.projection.bounds import enclosing, spheres_of
from pmviewer.photons.projection.cells import SLACK, cells_of_directions, cells_of_places
from pmviewer.photons.projection.gain import gain_of
from pmviewer.photons.projection.projected import (
    COLUMNS,
    CONES,
    DIRECTIONS,
    DISC,
    PLACES,
    PROJECTION_DTYPE,
    ROWS,
    SCALES,
    WHOLE,
    WORLD,
)
from pmviewer.photons.projection.scales import gain, scales
from pmviewer.photons.projection.small import Small, small_of
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.scene.arrays.texture_coordinates import orthonormal
from pmviewer.scene.description import (
    LUMINANCE,
    DirectionalLight,
    Environment,
    PointLight,
    ProjectorLight,
    Shape,
    SpotLight,
)
from pmviewer.scene.emission import spot_solid_angle

Float = NDArray[np.float64]
MODES = {
    WHOLE: "whole",
    DIRECTIONS: "directions",
    PLACES: "places",
    WORLD: "world directions",
    DISC: "disc",
    SCALES: "scales",
    CONES: "cones",
}
WORTHWHILE = 0.7
"""`auto` uses maps that cover less than this share of the power."""
LEAST_GAIN = {SCALES: 8.0, CONES: 16.0}
"""Times that photons start more densely for what is small than by a map, or it isn't worth what is lacking elsewhere.
Skies, gains of 3 to 7 in three scenes: relMSE after 4 CPU s 0.8 to 1.5 times that without, 1.0 in the mean. Lamps
nearby, 5 to 9 in a prism's yard, three glasses and rings: 1.0 to 1.7 times after 5, of a ship under a dome (355) 0.24.
"""
SMALLEST = 1e-6
"""Least radius of the innermost disc or cone, relative to the scene's: float32 tells directions apart to 6e-8."""
MOST_GAIN = 2.0**10
"""Times that photons start more densely for what is small, and have more power where they don't: stored powers end at
2¹⁷."""


@dataclass(frozen=True)
class ProjectionMap:
    """One light's map, for overlays.

    `on` (ROWS, COLUMNS) bool: rows are polar angles (or radii) with edges `edges` (ROWS + 1,) in radians (or scene
    units), columns azimuths from 0 to 2π in the frame `axes` (3, 3), whose rows are the two axes across and the axis
    θ = 0 (or the direction of light). `origin` is the light's middle, or the disc's. `share` is the covered share of
    the light's power. Without cells (modes "whole", "disc", "scales" and "cones") all of `on` is True.
    """

    light: str
    mode: str
    on: NDArray[np.bool_]
    edges: Float
    axes: Float
    origin: Float
    share: float

    @property
    def denser(self) -> bool:
        """Do photons start anywhere, more densely for what is small on a wide floor?"""
        return self.mode in (MODES[SCALES], MODES[CONES])


@dataclass(frozen=True)
class Projection:
    """Maps of all lights for the trajectories that fill the global map (`surfaces`), and for the others (`caustic`).

    `surface_power` and `caustic_power` are what photons share, luminance in watts: what the maps cover, less that of
    lights that are denser for what is small by as much; 0 when nothing can be met. `gain` is the most of these,
    `covered` is what the maps of surfaces cover. `records` is for kernels.
    """

    records: NDArray[np.void]
    arrays: tuple[NDArray, ...]
    surfaces: tuple[ProjectionMap, ...]
    caustic: tuple[ProjectionMap, ...]
    surface_power: float
    caustic_power: float
    covered: float
    gain: float

    @property
    def maps(self) -> dict[str, tuple[ProjectionMap, ...]]:
        """By what they show."""
        return {"surfaces": self.surfaces, "caustic": self.caustic}

    @property
    def spares(self) -> bool:
        """Whether any light's photons are confined."""
        return any(m.mode != MODES[WHOLE] for m in self.surfaces + self.caustic)


def projection_of(scene: FlatScene, always: bool = True, with_caustics: bool = True) -> Projection:
    """Projection maps of the scene's lights. Unless `always`, those that spare little are replaced by none at all;
    `with_caustics` says whether there are trajectories for the caustic map alone."""
    records = np.zeros(2, PROJECTION_DTYPE)
    arrays: list[NDArray] = []
    charted: list[tuple[tuple[ProjectionMap, ...], float, float]] = []
    total = scene.total_luminance
    most_gain = 1.0
    small = small_of(scene.owner, scene.radius)
    if small is not None:
        small = small._replace(radius=max(small.radius, SMALLEST * scene.radius))
    for record, for_caustics in zip(records, (False, True), strict=True):
        spheres = spheres_of(scene.owner, for_caustics)
        if with_caustics or not for_caustics:
            maps = [_map_or_denser(scene, light, spheres, small) for light in range(len(scene.light_names))]
        else:
            maps = [_whole(scene, light) for light in range(len(scene.light_names))]
        watts = scene.light_power @ LUMINANCE
        if not always and watts @ [_share(*found) for found in maps] > WORTHWHILE * total:
            maps = [old if old[0].denser else _whole(scene, i) for i, old in enumerate(maps)]
        powers, covered = watts * [c for _, c in maps], float(watts @ [_share(*found) for found in maps])
        gains = np.array([1 / c if m.denser else 1.0 for m, c in maps], np.float32)
        most_gain = max(most_gain, float(gains.max(initial=1.0)))
        cells = [np.flatnonzero(m.on) if m.mode in _CELLED else np.zeros(0, np.int64) for m, _ in maps]
        mode_of = {name: mode for mode, name in MODES.items()}
        tables = {
            "cdf": np.concatenate([[0.0], np.cumsum(powers) / max(powers.sum(), 1e-300)]).astype(np.float32),
            "modes": np.array([mode_of[m.mode] for m, _ in maps], np.int32),
            "first": np.concatenate([[0], np.cumsum([len(c) for c in cells])]).astype(np.int32),
            "gains": gains,
            "cells": np.concatenate(cells).astype(np.int32),
        }
        for name, array in tables.items():
            arrays.append(array)
            record[name] = array.ctypes.data
        if len(spheres):
            center, radius = enclosing(spheres)
            record["center_x"], record["center_y"], record["center_z"] = center
            record["radius"] = radius + _slack(scene)
        if small is not None:
            record["small_x"], record["small_y"], record["small_z"] = small.center
            record["small_radius"], record["scales"] = small.radius, scales(small.radius, scene.radius)
        charted.append((tuple(m for m, _ in maps), float(powers.sum()), covered))
    (surfaces, surface_power, covered), (caustic, caustic_power, _) = charted
    return Projection(records, tuple(arrays), surfaces, caustic, surface_power, caustic_power, covered, most_gain)


_CELLED = ("directions", "places", "world directions")


def _slack(scene: FlatScene) -> float:
    """Photons start a little off the surfaces, by a share of their coordinates."""
    return SLACK * (scene.radius + float(np.abs(scene.center).max()))


def _whole(scene: FlatScene, light: int) -> tuple[ProjectionMap, float]:
    on = np.ones((ROWS, COLUMNS), np.bool_)
    edges = np.linspace(0, math.pi, ROWS + 1)
    return ProjectionMap(scene.light_names[light], MODES[WHOLE], on, edges, np.eye(3), scene.center, 1.0), 1.0


def _share(found: ProjectionMap, c: float) -> float:
    """Of a light's power, what its photons bring."""
    return 1.0 if found.denser else c


def _map_or_denser(scene: FlatScene, light: int, spheres: Float, small: Small | None) -> tuple[ProjectionMap, float]:
    """What makes photons denser at what is small: the map, or more of them that start near it or aim at it."""
    found = _map_of(scene, light, spheres)
    if small is None or not found[1] > 0:
        return found
    described = _described(scene, light)
    if isinstance(described, Environment | DirectionalLight):
        mode, times = SCALES, gain(small.radius, scene.radius)
    elif described is None or isinstance(described, PointLight):
        position = None if described is None else np.array(described.position, float)
        mode, times = CONES, gain_of(_shape(scene, light).geometry if described is None else None, position, small)
    else:
        return found
    if times * found[1] <= LEAST_GAIN[mode]:
        return found
    whole, _ = _whole(scene, light)
    return replace(whole, mode=MODES[mode], origin=small.center), 1 / min(times, MOST_GAIN)


def _map_of(scene: FlatScene, light: int, spheres: Float) -> tuple[ProjectionMap, float]:
    """A light's map and c, its power's factor for candidates."""
    name, kind = scene.light_names[light], int(scene.lights[light, K.L_KIND])
    described = _described(scene, light)
    if not len(spheres):
        nothing = np.zeros((ROWS, COLUMNS), np.bool_)
        empty = ProjectionMap(name, MODES[WORLD], nothing, np.zeros(ROWS + 1), np.eye(3), scene.center, 0.0)
        return empty, 0.0
    if isinstance(described, ProjectorLight):
        return _whole(scene, light)  # its cells of numbers are places on a picture, which have no axis to turn around
    u = np.linspace(0, 1, ROWS + 1)
    if isinstance(described, Environment):
        center, radius = enclosing(spheres)
        radius += _slack(scene)
        if radius >= scene.radius:
            return _whole(scene, light)
        share = (radius / scene.radius) ** 2
        on = np.ones((ROWS, COLUMNS), np.bool_)
        return ProjectionMap(name, MODES[DISC], on, np.sqrt(u) * radius, np.eye(3), center, share), share
    if isinstance(described, DirectionalLight):
        axes = orthonormal(np.array(described.direction))
        edges = np.sqrt(u) * scene.radius
        on = cells_of_places(spheres, scene.center, axes, edges, _slack(scene))
        return _celled(scene, light, PLACES, on, edges, axes, scene.center, 1.0)
    origin, reach, axis = _extent(scene, light)
    reach += _slack(scene) if reach else 0.0
    if kind in (K.PARALLELOGRAM, K.DISK):
        edges = np.arcsin(np.sqrt(u))
    elif isinstance(described, SpotLight):
        edges = spot_edges(described, u)
    else:
        edges = np.arccos(1 - 2 * u)
    mode = WORLD if kind in (K.SPHERE, K.CYLINDER, K.MESH) else DIRECTIONS
    if mode == WORLD and _textured(scene, light):
        return _whole(scene, light)
    axes = orthonormal(axis)
    on = cells_of_directions(spheres, origin, reach, axes, edges)
    return _celled(scene, light, mode, on, edges, axes, origin, 4.0 if mode == WORLD else 1.0)


def _celled(
    scene: FlatScene,
    light: int,
    mode: int,
    on: NDArray[np.bool_],
    edges: Float,
    axes: Float,
    origin: Float,
    factor: float,
) -> tuple[ProjectionMap, float]:
    share = float(on.mean())
    if factor * share >= 1:
        return _whole(scene, light)
    return ProjectionMap(scene.light_names[light], MODES[mode], on, edges, axes, origin, share), factor * share


def _described(scene: FlatScene, light: int) -> object:
    """The light's description when it has no surface; lights with one come first in the table."""
    index = light - (len(scene.light_names) - len(scene.owner.lights))
    return scene.owner.lights[index] if index >= 0 else None


def _textured(scene: FlatScene, light: int) -> bool:
    """Is it a shape whose places do not all emit alike?"""
    return light < len(scene.light_names) - len(scene.owner.lights) and _shape(scene, light).emission is not None


def _shape(scene: FlatScene, light: int) -> Shape:
    """That of a light which has a surface."""
    return [shape for shape in scene.owner.shapes if shape.shines][light]


def _extent(scene: FlatScene, light: int) -> tuple[Float, float, Float]:
    """Middle and radius of a ball around the light, and the axis that its directions are counted from."""
    described = _described(scene, light)
    if isinstance(described, PointLight):
        return np.array(described.position, float), 0.0, np.array([0.0, 0.0, 1.0])
    if isinstance(described, SpotLight):
        return np.array(described.position, float), 0.0, np.array(described.axis)
    row = scene.lights[light].astype(float)
    a, b, c = row[K.L_A : K.L_A + 3], row[K.L_B : K.L_B + 3], row[K.L_C : K.L_C + 3]
    if row[K.L_KIND] == K.PARALLELOGRAM:
        normal = np.cross(b, c)
        reach = max(np.linalg.norm(b + c), np.linalg.norm(b - c)) / 2
        return a + (b + c) / 2, float(reach), normal / np.linalg.norm(normal)
    z = np.array([0.0, 0.0, 1.0])
    if row[K.L_KIND] == K.DISK:
        return a, float(row[K.L_RADIUS]), b
    if row[K.L_KIND] == K.SPHERE:
        return a, float(row[K.L_RADIUS]), z
    if row[K.L_KIND] == K.CYLINDER:
        half = row[K.L_LENGTH] / 2
        return a + half * b, float(math.hypot(half, row[K.L_RADIUS])), z
    first, count = int(row[K.L_FIRST]), int(row[K.L_COUNT])
    points = scene.light_corners[first : first + count].reshape(-1, 3).astype(float)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return middle, float(np.linalg.norm(points - middle, axis=1).max()), z


def spot_edges(light: SpotLight, u: Float) -> Float:
    """The angles below which these shares of a spot's power lie (the kernel's `spot_angle`), by bisection."""
    cutoff, beam = math.radians(light.cutoff), math.radians(light.beam)
    low, high = np.zeros_like(u), np.full_like(u, cutoff)
    whole = spot_solid_angle(light) / (2 * math.pi)
    for _ in range(60):
        theta = (low + high) / 2
        w = cutoff - theta
        width = max(cutoff - beam, 1e-300)
        outside = (w * np.cos(theta) + np.sin(theta) - math.sin(cutoff)) / width
        below = np.where(theta <= beam, 2 * np.sin(theta / 2) ** 2, whole - outside)
        low, high = np.where(below < u * whole, theta, low), np.where(below < u * whole, high, theta)
    edges = (low + high) / 2
    edges[0], edges[-1] = 0.0, cutoff
    return edges
