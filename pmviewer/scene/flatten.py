"""From a scene's description to the arrays and the record that kernels read (`pmviewer.kernels.scene`).

Primitives are numbered triangles first, then quadrics (spheres, cylinders, disks).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.kernels import scene as K
from pmviewer.kernels.bvh import Bvh, build
from pmviewer.scene.description import (
    ConstantEnvironment,
    Cylinder,
    Disk,
    Material,
    Mesh,
    Parallelogram,
    PointLight,
    Scene,
    Shape,
    Sphere,
)

Float = NDArray[np.float32]
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

_MATERIAL_KIND = {"diffuse": K.DIFFUSE, "conductor": K.CONDUCTOR, "dielectric": K.DIELECTRIC}
_QUADRIC_KIND = {Sphere: 0, Cylinder: 1, Disk: 2}


@dataclass(frozen=True)
class FlatScene:
    """Arrays of a scene. `record` is the one-element record array for kernels; the other fields keep its memory alive.

    `light_power` is (n_lights, 3) float64 in watts, in the order of the light table; `light_names` likewise.
    """

    record: NDArray[np.void]
    bvh: Bvh
    arrays: tuple[NDArray, ...]
    light_power: NDArray[np.float64]
    light_names: tuple[str, ...]
    center: NDArray[np.float64]
    radius: float
    n_triangles: int
    n_quadrics: int
    owner: Scene = field(repr=False)

    @property
    def total_luminance(self) -> float:
        """Luminance of the power of all lights, in watts: what photon powers are measured in while they travel."""
        return float((self.light_power @ LUMINANCE).sum())


def bounding_sphere(scene: Scene) -> tuple[NDArray[np.float64], float]:
    """Centre and radius of the sphere around the bounding box of all shapes."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for shape in scene.shapes:
        for corner in _bounds(shape):
            low, high = np.minimum(low, corner), np.maximum(high, corner)
    center = (low + high) / 2
    return center, max(float(np.linalg.norm(high - low)) / 2, 1e-30)


def _bounds(shape: Shape) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    g = shape.geometry
    if isinstance(g, Mesh):
        used = g.vertices[np.unique(g.faces)]
        return used.min(axis=0), used.max(axis=0)
    if isinstance(g, Parallelogram):
        corners = np.array(g.corner) + np.array(
            [[0, 0, 0], g.edge_u, g.edge_v, np.add(g.edge_u, g.edge_v)], dtype=float
        )
        return corners.min(axis=0), corners.max(axis=0)
    if isinstance(g, Cylinder):
        return np.minimum(g.p0, g.p1) - g.radius, np.maximum(g.p0, g.p1) + g.radius
    return np.array(g.center) - g.radius, np.array(g.center) + g.radius


def flatten(scene: Scene) -> FlatScene:
    """Build arrays, acceleration structure and light table.

    Raises SceneError when the scene has no surface or no light that emits.
    """
    meshes = [(i, _triangulate(s.geometry)) for i, s in enumerate(scene.shapes) if _is_triangles(s)]
    round_shapes = [i for i, s in enumerate(scene.shapes) if not _is_triangles(s)]
    if not scene.shapes:
        raise SceneError("The scene has no surface.", scene.path, hint="Add at least one shape.")
    vertices = np.concatenate([m.vertices[m.faces] for _, m in meshes] or [np.zeros((0, 3, 3))]).astype(np.float32)
    smooth = any(m.normals is not None for _, m in meshes)
    normals = np.concatenate([_corner_normals(m) for _, m in meshes]).astype(np.float32) if smooth else None
    quadrics = np.array([_quadric_row(scene.shapes[i]) for i in round_shapes], np.float32).reshape(-1, 12)
    counts = [len(m.faces) for _, m in meshes]
    shape_of_prim = np.concatenate([np.repeat([i for i, _ in meshes], counts), round_shapes]).astype(np.int64)
    materials = np.array([_material_row(m) for m in scene.materials], np.float32)
    prim_material = np.array([scene.shapes[i].material for i in shape_of_prim], np.int32)

    center, radius = bounding_sphere(scene)
    lights = _LightTable(scene, vertices, shape_of_prim, radius)
    prim_light = lights.of_shape[shape_of_prim].astype(np.int32)
    bvh = build(vertices, quadrics)

    record = np.zeros(1, K.SCENE_DTYPE)
    r = record[0]
    r["bvh_nodes"], r["bvh_blocks"], r["bvh_quadrics"] = bvh.nodes_address, bvh.blocks_address, bvh.quadrics_address
    r["bvh_n_blocks"], r["n_triangles"] = bvh.n_blocks, len(vertices)
    arrays: dict[str, NDArray] = {
        "vertices": vertices,
        "prim_material": prim_material,
        "prim_light": prim_light,
        "materials": materials,
        "lights": lights.rows,
        "light_cdf": lights.cdf,
        "light_triangles": lights.triangles,
        "light_triangle_cdf": lights.triangle_cdf,
    }
    if normals is not None:
        arrays["normals"] = normals
    for name, array in arrays.items():
        arrays[name] = np.ascontiguousarray(array)
        r[name] = arrays[name].ctypes.data
    r["n_lights"], r["environment"] = len(lights.rows), lights.environment
    r["center_x"], r["center_y"], r["center_z"], r["radius"] = *center, radius
    return FlatScene(
        record=record,
        bvh=bvh,
        arrays=tuple(arrays.values()),
        light_power=lights.power,
        light_names=lights.names,
        center=center,
        radius=radius,
        n_triangles=len(vertices),
        n_quadrics=len(quadrics),
        owner=scene,
    )


def _is_triangles(shape: Shape) -> bool:
    return isinstance(shape.geometry, Mesh | Parallelogram)


def _triangulate(geometry: object) -> Mesh:
    if isinstance(geometry, Mesh):
        return geometry
    assert isinstance(geometry, Parallelogram)
    corner, u, v = np.array(geometry.corner), np.array(geometry.edge_u), np.array(geometry.edge_v)
    return Mesh(np.array([corner, corner + u, corner + u + v, corner + v]), np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def _corner_normals(mesh: Mesh) -> NDArray[np.float64]:
    """(F, 3, 3) normals at the triangles' corners; flat meshes repeat the face's."""
    if mesh.normals is not None:
        return mesh.normals[mesh.faces]
    corners = mesh.vertices[mesh.faces]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face /= np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-300)
    return np.repeat(face[:, None], 3, axis=1)


def _quadric_row(shape: Shape) -> list[float]:
    g = shape.geometry
    if isinstance(g, Sphere):
        return [0, *g.center, 0, 0, 1, g.radius, 0, _side(g), 0, 0]
    if isinstance(g, Cylinder):
        axis, length = _axis(g)
        return [1, *g.p0, *axis, g.radius, length, _side(g), 0, 0]
    assert isinstance(g, Disk)
    return [2, *g.center, *g.normal, g.radius, 0, 1, 0, 0]


def _side(g: Sphere | Cylinder) -> float:
    return -1.0 if g.flip_normals else 1.0


def _axis(g: Cylinder) -> tuple[NDArray[np.float64], float]:
    offset = np.subtract(g.p1, g.p0)
    length = float(np.linalg.norm(offset))
    return offset / length, length


def _material_row(m: Material) -> list[float]:
    return [_MATERIAL_KIND[m.kind], m.two_sided, m.eta, 0, *m.reflectance, 0, *m.transmittance, 0]


class _LightTable:
    """Rows, powers and distributions of all lights: emitting shapes in order, then the scene's other lights."""

    def __init__(self, scene: Scene, vertices: Float, shape_of_prim: NDArray[np.int64], radius: float) -> None:
        self.of_shape = np.full(len(scene.shapes), -1, np.int64)
        self.environment = -1
        rows: list[list[float]] = []
        powers: list[NDArray[np.float64]] = []
        names: list[str] = []
        triangles: list[NDArray[np.int64]] = [np.zeros(0, np.int64)]
        cdfs: list[NDArray[np.float64]] = [np.zeros(0)]
        listed = 0
        for index, shape in enumerate(scene.shapes):
            if shape.radiance is None or not any(c > 0 for c in shape.radiance):
                continue
            row = [0.0] * K.LIGHT_COLUMNS
            row[K.L_RADIANCE : K.L_RADIANCE + 3] = shape.radiance
            if isinstance(shape.geometry, Mesh):
                own = np.flatnonzero(shape_of_prim == index)
                corners = vertices[own].astype(float)
                cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
                areas = np.linalg.norm(cross, axis=1) / 2
                area = float(areas.sum())
                row[K.L_KIND], row[K.L_FIRST], row[K.L_COUNT] = K.MESH, listed, len(own)
                triangles.append(own)
                cdfs.append(np.cumsum(areas) / area)
                listed += len(own)
            else:
                area = _fill_shape(row, shape.geometry)
            row[K.L_AREA] = area
            self.of_shape[index] = len(rows)
            rows.append(row)
            powers.append(math.pi * area * np.array(shape.radiance))
            names.append(shape.name)
        for light in scene.lights:
            row = [0.0] * K.LIGHT_COLUMNS
            if isinstance(light, PointLight):
                row[K.L_KIND] = K.POINT
                row[K.L_RADIANCE : K.L_RADIANCE + 3] = light.intensity
                row[K.L_A : K.L_A + 3] = light.position
                powers.append(4 * math.pi * np.array(light.intensity))
            elif isinstance(light, ConstantEnvironment):
                row[K.L_KIND] = K.ENVIRONMENT
                row[K.L_RADIANCE : K.L_RADIANCE + 3] = light.radiance
                self.environment = len(rows)
                powers.append(4 * math.pi**2 * radius**2 * np.array(light.radiance))
            rows.append(row)
            names.append(light.name)
        if not rows or not any(p.max() > 0 for p in powers):
            raise SceneError("The scene has no light.", scene.path, hint="Add an emitter, or open it with one.")
        self.rows = np.array(rows, np.float32)
        self.power = np.array(powers)
        self.names = tuple(names)
        share = np.cumsum(self.power @ LUMINANCE)
        self.cdf = np.concatenate([[0.0], share / share[-1]]).astype(np.float32)
        self.triangles = np.concatenate(triangles).astype(np.int32)
        self.triangle_cdf = np.concatenate(cdfs).astype(np.float32)


def _fill_shape(row: list[float], g: object) -> float:
    """Write an analytic light's geometry into its row; its area."""
    if isinstance(g, Parallelogram):
        row[K.L_KIND] = K.PARALLELOGRAM
        row[K.L_A : K.L_A + 3], row[K.L_B : K.L_B + 3], row[K.L_C : K.L_C + 3] = g.corner, g.edge_u, g.edge_v
        return float(np.linalg.norm(np.cross(g.edge_u, g.edge_v)))
    if isinstance(g, Disk):
        row[K.L_KIND], row[K.L_RADIUS] = K.DISK, g.radius
        row[K.L_A : K.L_A + 3], row[K.L_B : K.L_B + 3] = g.center, g.normal
        return math.pi * g.radius**2
    if isinstance(g, Sphere):
        row[K.L_KIND], row[K.L_RADIUS], row[K.L_FLIP] = K.SPHERE, g.radius, _side(g)
        row[K.L_A : K.L_A + 3] = g.center
        return 4 * math.pi * g.radius**2
    assert isinstance(g, Cylinder)
    axis, length = _axis(g)
    row[K.L_KIND], row[K.L_RADIUS], row[K.L_FLIP], row[K.L_LENGTH] = K.CYLINDER, g.radius, _side(g), length
    row[K.L_A : K.L_A + 3], row[K.L_B : K.L_B + 3] = g.p0, axis
    return 2 * math.pi * g.radius * length
