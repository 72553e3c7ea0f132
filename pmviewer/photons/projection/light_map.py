"""From which places and in which directions one light's photons can meet certain surfaces: its projection map (T7).

Which cells these are is decided by `pmviewer.photons.projection.cells`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels import scene as K
from pmviewer.photons.projection.aim import described_lights
from pmviewer.photons.projection.bounds import enclosing
from pmviewer.photons.projection.cells import SLACK, cells_of_directions, cells_of_places
from pmviewer.photons.projection.projected import (
    COLUMNS,
    CONES,
    DIRECTIONS,
    DISC,
    PLACES,
    ROWS,
    SCALES,
    WHOLE,
    WORLD,
)
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.scene.arrays.texture_coordinates import orthonormal
from pmviewer.scene.description import (
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


@dataclass(frozen=True)
class ProjectionMap:
    """One light's map, for overlays.

    `on` (ROWS, COLUMNS) bool: rows are polar angles (or radii) with edges `edges` (ROWS + 1,) in radians (or scene
    units), columns azimuths from 0 to 2π in the frame `axes` (3, 3), whose rows are the two axes across and the axis θ
    = 0 (or the direction of light). `origin` is the light's middle, or the disc's. `share` is the covered share of the
    light's power, `gain` how many times as densely photons start for what is small. Without cells (modes "whole",
    "disc", "scales" and "cones") all of `on` is True.
    """

    light: str
    mode: str
    on: NDArray[np.bool_]
    edges: Float
    axes: Float
    origin: Float
    share: float
    gain: float = 1.0

    @property
    def denser(self) -> bool:
        """Do photons start anywhere, more densely for what is small on a wide floor?"""
        return self.gain > 1.0


def slack(scene: FlatScene) -> float:
    """Photons start a little off the surfaces, by a share of their coordinates."""
    return SLACK * (scene.radius + float(np.abs(scene.center).max()))


def whole(scene: FlatScene, light: int) -> tuple[ProjectionMap, float]:
    """None of its photons is confined."""
    on = np.ones((ROWS, COLUMNS), np.bool_)
    edges = np.linspace(0, math.pi, ROWS + 1)
    return ProjectionMap(scene.light_names[light], MODES[WHOLE], on, edges, np.eye(3), scene.center, 1.0), 1.0


def map_of(scene: FlatScene, light: int, spheres: Float) -> tuple[ProjectionMap, float]:
    """A light's map and c, its power's factor for candidates."""
    name, kind = scene.light_names[light], int(scene.lights[light, K.L_KIND])
    described = described_light(scene, light)
    if not len(spheres):
        nothing = np.zeros((ROWS, COLUMNS), np.bool_)
        empty = ProjectionMap(name, MODES[WORLD], nothing, np.zeros(ROWS + 1), np.eye(3), scene.center, 0.0)
        return empty, 0.0
    if isinstance(described, ProjectorLight):
        return whole(scene, light)  # its cells of numbers are places on a picture, which have no axis to turn around
    u = np.linspace(0, 1, ROWS + 1)
    if isinstance(described, Environment):
        center, radius = enclosing(spheres)
        radius += slack(scene)
        if radius >= scene.radius:
            return whole(scene, light)
        share = (radius / scene.radius) ** 2
        on = np.ones((ROWS, COLUMNS), np.bool_)
        return ProjectionMap(name, MODES[DISC], on, np.sqrt(u) * radius, np.eye(3), center, share), share
    if isinstance(described, DirectionalLight):
        axes = orthonormal(np.array(described.direction))
        edges = np.sqrt(u) * scene.radius
        on = cells_of_places(spheres, scene.center, axes, edges, slack(scene))
        return _celled(scene, light, PLACES, on, edges, axes, scene.center, 1.0)
    origin, reach, axis = _extent(scene, light)
    reach += slack(scene) if reach else 0.0
    if kind in (K.PARALLELOGRAM, K.DISK):
        edges = np.arcsin(np.sqrt(u))
    elif isinstance(described, SpotLight):
        edges = spot_edges(described, u)
    else:
        edges = np.arccos(1 - 2 * u)
    mode = WORLD if kind in (K.SPHERE, K.CYLINDER, K.MESH) else DIRECTIONS
    if mode == WORLD and isinstance(described, Shape) and described.emission is not None:
        return whole(scene, light)  # its places do not all emit alike
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
        return whole(scene, light)
    return ProjectionMap(scene.light_names[light], MODES[mode], on, edges, axes, origin, share), factor * share


def described_light(scene: FlatScene, light: int) -> object:
    """The shape that emits, or the light without a surface, in the order of the table; None of a medium that emits."""
    described = described_lights(scene.owner)
    return described[light] if light < len(described) else None


def _extent(scene: FlatScene, light: int) -> tuple[Float, float, Float]:
    """Middle and radius of a ball around the light, and the axis that its directions are counted from."""
    described = described_light(scene, light)
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
