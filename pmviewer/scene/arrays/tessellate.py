"""Triangles for the window: every shape as flat arrays of corners, analytic shapes finely cut."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.blends import mean_colour
from pmviewer.scene.arrays.flatten import bounding_sphere
from pmviewer.scene.arrays.primitives import unit
from pmviewer.scene.description import (
    RGB,
    Cylinder,
    Disk,
    Group,
    Material,
    Mesh,
    Parallelogram,
    Scene,
    Shape,
    Sphere,
)
from pmviewer.scene.formats.mitsuba.transform import cofactor, mirrors

Float = NDArray[np.float64]
Drawn = tuple[Float, Float, Float]
SEGMENTS = 96
INSTANCE_BUDGET = 600_000
"""Triangles that all instances together are drawn with."""
FINEST_CELLS = 128


@dataclass(frozen=True)
class DrawGeometry:
    """Corners of all triangles, three a triangle: `vertices`, `normals`, `albedo` (n, 3) float32. Lights carry their
    hue at full brightness as albedo. `center` (3,) and `radius` bound the scene."""

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    albedo: NDArray[np.float32]
    center: Float
    radius: float
    note: str = ""
    """Says how instances were simplified, if they were."""
    objects: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """Numbers of what is drawn, shapes before instances, in the order of its corners."""
    starts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(1, np.int64))
    """The first corner of each, and the end."""

    def vertices_of(self, number: int) -> NDArray[np.float32]:
        """The corners (n, 3) of the shape or instance of that number; none if it is not drawn."""
        found = np.flatnonzero(self.objects == number)
        return self.vertices[self.starts[found[0]] : self.starts[found[0] + 1]] if len(found) else self.vertices[:0]

    def object_at(self, corner: int) -> int:
        """The number of the shape or instance that the corner belongs to, −1 if nobody knows."""
        at = int(np.searchsorted(self.starts, corner, side="right")) - 1
        return int(self.objects[at]) if 0 <= at < len(self.objects) else -1


def recoloured(scene: Scene, like: DrawGeometry) -> DrawGeometry:
    """The geometry of a scene with the same surfaces of other materials or lights (`same_surfaces`)."""
    counts = np.diff(like.starts)
    albedos = [_albedo(scene, shape, int(count)) for shape, count in zip(scene.shapes, counts, strict=True)]
    return replace(like, albedo=np.ascontiguousarray(np.concatenate(albedos), np.float32))


def tessellate(scene: Scene) -> DrawGeometry:
    """All shapes and instances of the scene as triangles."""
    # The boundary of a medium is nothing to be seen, unless there is nothing else.
    solid = [i for i, shape in enumerate(scene.shapes) if scene.materials[shape.material].kind != "null"]
    objects = solid or list(range(len(scene.shapes)))
    parts = [_drawn(scene, scene.shapes[i]) for i in objects]
    note = ""
    if scene.instances:
        copies, numbers, note = _copies(scene)
        parts += copies
        objects += [len(scene.shapes) + number for number in numbers]
    vertices, normals, albedos = zip(*parts)
    center, radius = bounding_sphere(scene)
    return DrawGeometry(
        vertices=np.ascontiguousarray(np.concatenate(vertices), np.float32),
        normals=np.ascontiguousarray(np.concatenate(normals), np.float32),
        albedo=np.ascontiguousarray(np.concatenate(albedos), np.float32),
        center=center,
        radius=radius,
        note=note,
        objects=np.array(objects, np.int64),
        starts=np.concatenate([[0], np.cumsum([len(corners) for corners in vertices])]).astype(np.int64),
    )


def _drawn(scene: Scene, shape: Shape) -> Drawn:
    """Corners, normals and albedo of a shape, (3n, 3) each."""
    corners, corner_normals = triangles_of(shape.geometry)
    return corners.reshape(-1, 3), corner_normals.reshape(-1, 3), _albedo(scene, shape, corners.shape[0] * 3)


def _albedo(scene: Scene, shape: Shape, corners: int) -> Float:
    """Of so many corners of the shape, (corners, 3)."""
    material = scene.materials[shape.material]
    colour = np.array(mean_colour(material, _colour))
    tint: Float = np.ones(3)
    if material.vertex_colours and isinstance(shape.geometry, Mesh) and shape.geometry.colours is not None:
        tint = shape.geometry.colours[shape.geometry.faces].reshape(-1, 3)
    if shape.shines:
        assert shape.radiance is not None
        colour, tint = np.array(shape.radiance) / max(shape.radiance), np.ones(3)
    return np.broadcast_to(colour * tint, (corners, 3))


def _colour(material: Material) -> RGB:
    if not material.transparent:
        return material.reflectance
    r, g, b = 0.5 + 0.5 * np.array(material.transmittance) * np.array([0.8, 0.9, 1.0])
    return (r, g, b)


def _copies(scene: Scene) -> tuple[list[Drawn], list[int], str]:
    """The triangles of the instances that are drawn, their numbers, and what to say when they had to be simplified to
    fit the budget."""
    whole: dict[Group, Drawn] = {}
    for group in scene.groups:
        parts = [_drawn(scene, shape) for shape in group.shapes]
        whole[group] = tuple(np.concatenate(column) for column in zip(*parts))  # type: ignore[assignment]
    asked = sum(len(whole[instance.group][0]) for instance in scene.instances) // 3
    drawn = whole
    cells = FINEST_CELLS
    count = asked
    while count > INSTANCE_BUDGET and cells >= 1:
        drawn = {group: _clustered(part, cells) for group, part in whole.items()}
        count = sum(len(drawn[instance.group][0]) for instance in scene.instances) // 3
        cells //= 2
    step = max(1, -(-count // INSTANCE_BUDGET))
    shown, numbers = scene.instances[::step], list(range(0, len(scene.instances), step))
    found: list[Drawn] = []
    for instance in shown:
        corners, normals, albedo = drawn[instance.group]
        m = instance.to_world
        found.append(
            (corners @ m[:3, :3].T + m[:3, 3], unit(normals @ cofactor(m).T) * (-1.0 if mirrors(m) else 1.0), albedo)
        )
    if count == asked:
        return found, numbers, ""
    total = sum(len(corners) for corners, _, _ in found) // 3
    return found, numbers, f"the geometry view draws {total:,} of {asked:,} instanced triangles"


def _clustered(part: Drawn, cells: int) -> Drawn:
    """Vertices moved to the mean of those in their cell of a cubic grid; triangles that collapse are left out.

    Rossignac and Borrel, "Multi-resolution 3D approximations for rendering complex scenes", 1993.
    """
    corners, normals, albedo = part
    low = corners.min(axis=0)
    size = float((corners.max(axis=0) - low).max()) / cells
    _, cell = np.unique(((corners - low) / max(size, 1e-300)).astype(np.int64), axis=0, return_inverse=True)
    cell = cell.reshape(-1)
    number = np.bincount(cell)[:, None]
    mean = np.stack([np.bincount(cell, corners[:, k]) for k in range(3)], axis=1) / number
    triangles = cell.reshape(-1, 3)
    kept = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    at = np.repeat(kept, 3)
    return mean[cell[at]], normals[at], albedo[at]


def _flat(corners: Float) -> tuple[Float, Float]:
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    return corners, np.repeat(normal[:, None], 3, axis=1)


def triangles_of(g: object, segments: int = SEGMENTS) -> tuple[Float, Float]:
    """Corners and normals (n, 3, 3) of a shape's triangles, with that many segments around what is round."""
    if isinstance(g, Mesh):
        corners = g.vertices[g.faces]
        return _flat(corners) if g.normals is None else (corners, g.normals[g.faces])
    if isinstance(g, Parallelogram):
        a, u, v = np.array(g.corner), np.array(g.edge_u), np.array(g.edge_v)
        return _flat(np.array([[a, a + u, a + u + v], [a, a + u + v, a + v]]))
    if isinstance(g, Sphere):
        theta = np.linspace(0, math.pi, segments // 2 + 1)
        phi = np.linspace(0, 2 * math.pi, segments + 1)
        unit = np.stack(
            [
                np.sin(theta)[:, None] * np.cos(phi),
                np.sin(theta)[:, None] * np.sin(phi),
                np.cos(theta)[:, None] * np.ones_like(phi),
            ],
            axis=-1,
        )
        corners, normals = _sheet(np.array(g.center) + g.radius * unit, unit)
        return corners, -normals if g.flip_normals else normals
    if isinstance(g, Cylinder):
        axis = np.subtract(g.p1, g.p0)
        ring = _ring(axis, segments)
        rows = np.stack([np.array(g.p0) + g.radius * ring, np.array(g.p1) + g.radius * ring])
        corners, normals = _sheet(rows, np.stack([ring, ring]))
        return corners, -normals if g.flip_normals else normals
    assert isinstance(g, Disk)
    ring = np.array(g.center) + g.radius * _ring(np.array(g.normal), segments)
    center = np.broadcast_to(np.array(g.center), ring[:-1].shape)
    return _flat(np.stack([center, ring[:-1], ring[1:]], axis=1))


def _ring(axis: Float, segments: int) -> Float:
    """Unit circle around the axis, (segments + 1, 3), counter-clockwise seen from where the axis points."""
    w = axis / np.linalg.norm(axis)
    u = np.cross(w, np.eye(3)[np.argmin(np.abs(w))])
    u /= np.linalg.norm(u)
    v = np.cross(w, u)
    phi = np.linspace(0, 2 * math.pi, segments + 1)[:, None]
    return np.cos(phi) * u + np.sin(phi) * v


def _sheet(points: Float, normals: Float) -> tuple[Float, Float]:
    """Triangles of a grid of points (rows, columns, 3)."""

    def cut(x: Float) -> Float:
        a, b, c, d = x[:-1, :-1], x[1:, :-1], x[1:, 1:], x[:-1, 1:]
        return np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3, 3), np.stack([a, c, d], 2).reshape(-1, 3, 3)])

    return cut(points), cut(normals)
