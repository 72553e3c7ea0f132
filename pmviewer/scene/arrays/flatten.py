"""From a scene's description to the arrays and the record that kernels read (`pmviewer.kernels.scene`).

Primitives are numbered triangles first, then quadrics (spheres, cylinders, disks).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.kernels import scene as K
from pmviewer.kernels.accel.bvh import Bvh, build
from pmviewer.kernels.meshes.mesh import face_normals
from pmviewer.progress import stage
from pmviewer.scene.arrays.covered_emission import with_covered_emission
from pmviewer.scene.arrays.flatten_textures import (
    TextureTable,
    coordinates,
    corner_colours,
    light_arrays,
    needs_tangents,
)
from pmviewer.scene.arrays.instances import build_instanced, instance_bounds, normalised
from pmviewer.scene.arrays.light_table import LightTable, axis_of, side_of
from pmviewer.scene.arrays.material_row import is_rich, material_table, used_materials
from pmviewer.scene.arrays.textured_emission import textured_lights
from pmviewer.scene.description import (
    LUMINANCE,
    Cylinder,
    Disk,
    Mesh,
    Parallelogram,
    Scene,
    Shape,
    Sphere,
)
from pmviewer.scene.meshes.mesh_bounds import mesh_bounds

Float = NDArray[np.float32]

_QUADRIC_KIND = {Sphere: 0, Cylinder: 1, Disk: 2}


@dataclass(frozen=True)
class FlatScene:
    """Arrays of a scene. `record` is the one-element record array for kernels; the other fields keep its memory alive.

    `light_power` is (n_lights, 3) float64 in watts, in the order of the light table; `light_names` and
    the table's rows `lights` (n_lights, LIGHT_COLUMNS) likewise; `prim_light` is each stored primitive's light, −1 for
    none. `light_corners` (n, 3, 3) are the triangles of mesh
    lights.
    """

    record: NDArray[np.void]
    bvh: Bvh
    arrays: tuple[NDArray, ...]
    light_power: NDArray[np.float64]
    light_names: tuple[str, ...]
    lights: Float
    light_corners: Float
    prim_light: NDArray[np.int32]
    center: NDArray[np.float64]
    radius: float
    n_triangles: int
    n_quadrics: int
    owner: Scene = field(repr=False)
    n_instances: int = 0
    n_elements: int = 0
    """Triangles and quadrics that rays can meet, those of instances counted as often as they are shown."""
    trees: tuple[Bvh, ...] = field(default=(), repr=False)
    """Of the instanced groups."""
    shape_of_prim: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32), repr=False)
    """The shape of each stored primitive."""

    @property
    def delta_lights(self) -> bool:
        """Whether there are lights that no ray can meet."""
        return bool(np.isin(self.lights[:, K.L_KIND], (K.POINT, K.SPOT, K.DIRECTIONAL)).any())

    @property
    def total_luminance(self) -> float:
        """Luminance of the power of all lights, in watts: what photon powers are measured in while they travel."""
        return float((self.light_power @ LUMINANCE).sum())


def bounding_sphere(scene: Scene) -> tuple[NDArray[np.float64], float]:
    """Centre and radius of the sphere around the bounding box of all shapes and instances."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for shape in scene.shapes:
        for corner in _bounds(shape):
            low, high = np.minimum(low, corner), np.maximum(high, corner)
    if scene.instances:
        more_low, more_high = instance_bounds(scene.instances)
        low, high = np.minimum(low, more_low), np.maximum(high, more_high)
    center = (low + high) / 2
    return center, max(float(np.linalg.norm(high - low)) / 2, 1e-30)


def _bounds(shape: Shape) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    g = shape.geometry
    if isinstance(g, Mesh):
        return mesh_bounds(g)
    if isinstance(g, Parallelogram):
        corners = np.array(g.corner) + np.array(
            [[0, 0, 0], g.edge_u, g.edge_v, np.add(g.edge_u, g.edge_v)], dtype=float
        )
        return corners.min(axis=0), corners.max(axis=0)
    if isinstance(g, Cylinder):
        return np.minimum(g.p0, g.p1) - g.radius, np.maximum(g.p0, g.p1) + g.radius
    return np.array(g.center) - g.radius, np.array(g.center) + g.radius


def flatten(scene: Scene, on_type: Callable[[np.dtype], None] = lambda of_record: None) -> FlatScene:
    """Build arrays, acceleration structure and light table. `on_type` hears of what type the record will be, before the
    tree is built.

    Raises SceneError when the scene has no surface or no light that emits.
    """
    if scene.instances:
        groups = [normalised(group, scene) for group in scene.groups]
        shapes = scene.shapes + tuple(shape for group in groups for shape in group.shapes)
    else:
        groups, shapes = [], scene.shapes
    meshes = [(i, _triangulate(s.geometry)) for i, s in enumerate(shapes) if _is_triangles(s)]
    round_shapes = [i for i, s in enumerate(shapes) if not _is_triangles(s)]
    if not shapes:
        raise SceneError("The scene has no surface.", scene.path, hint="Add at least one shape.")
    counts = [len(m.faces) for _, m in meshes]
    vertices = _corners([m for _, m in meshes], sum(counts))
    quadrics = np.array([_quadric_row(shapes[i]) for i in round_shapes], np.float32).reshape(-1, 12)
    shape_of_prim = np.repeat(
        np.array([i for i, _ in meshes] + round_shapes, np.int32), counts + [1] * len(round_shapes)
    )
    materials, rich = material_table(scene), is_rich(scene)
    prim_material = np.array([s.material for s in shapes], np.int32)[shape_of_prim]

    center, radius = bounding_sphere(scene)
    lit, emissions = textured_lights(with_covered_emission(scene))
    lights = LightTable(lit, vertices, shape_of_prim, radius)
    of_shape = np.concatenate([lights.of_shape, np.full(len(shapes) - len(scene.shapes), -1)])
    prim_light = of_shape.astype(np.int32)[shape_of_prim]
    textured = bool(emissions) or (rich and needs_tangents(scene))
    used = used_materials(scene)
    coloured, passable = any(m.vertex_colours for m in used), any(m.passable for m in used)
    record = np.zeros(
        1,
        K.scene_dtype(
            bsdfs=rich,
            lights=lights.more,
            instances=bool(groups),
            textures=textured,
            colours=coloured,
            opacity=passable,
            principled="principled" in materials.kinds,
            blends="blend" in materials.kinds,
        ),
    )
    r = record[0]
    for name in {"principled", "blends"}.intersection(record.dtype.names):
        r[name] = 1
    on_type(record.dtype)
    stage(f"building the tree over {len(vertices):,} triangles")
    if groups:
        bvh, shown = build_instanced(scene, groups, vertices, quadrics, shape_of_prim, r)
    else:
        bvh, shown = build(vertices, quadrics), None
        bvh.store(r)
    normals = _corner_normals([m for _, m in meshes], len(vertices))
    arrays: dict[str, NDArray] = {
        "vertices": vertices,
        "prim_material": prim_material,
        "prim_light": prim_light,
        "materials": materials.rows,
        "lights": lights.rows,
        "light_cdf": lights.cdf,
        "light_triangles": lights.triangles,
        "light_triangle_cdf": lights.triangle_cdf,
        **lights.sky_arrays(),
    }
    if normals is not None:
        arrays["normals"] = normals
    if passable:
        r["passable"] = 1
    if coloured:
        arrays["colours"] = corner_colours([shapes[i].geometry for i, _ in meshes])
    textures = TextureTable()
    if rich:
        r["bsdfs"] = 1
        arrays["bsdf_tables"] = materials.tables
        textures.write_rows(materials.rows, materials.materials)
    if textured:
        arrays |= coordinates([shapes[i].geometry for i, _ in meshes], [shapes[i].geometry for i in round_shapes])
        arrays |= light_arrays(emissions, lights.of_shape, len(lights.rows), textures)
        arrays |= textures.arrays(scene)
    for name, array in arrays.items():
        arrays[name] = np.ascontiguousarray(array)
        r[name] = arrays[name].ctypes.data
    r["n_lights"], r["environment"] = len(lights.rows), lights.environment
    if lights.more:
        r["more_lights"] = 1
        if lights.sky is not None:
            r["sky_height"], r["sky_width"] = lights.sky.pixels.shape[:2]
    r["center_x"], r["center_y"], r["center_z"], r["radius"] = *center, radius
    return FlatScene(
        record=record,
        bvh=bvh,
        arrays=(*arrays.values(), quadrics, *(shown.arrays if shown else ())),
        light_power=lights.power,
        light_names=lights.names,
        lights=lights.rows,
        light_corners=vertices[lights.triangles],
        prim_light=prim_light,
        center=center,
        radius=radius,
        n_triangles=len(vertices),
        n_quadrics=len(quadrics),
        owner=scene,
        n_instances=len(scene.instances),
        n_elements=shown.n_elements if shown else len(vertices) + len(quadrics),
        trees=shown.trees if shown else (),
        shape_of_prim=shape_of_prim,
    )


def _is_triangles(shape: Shape) -> bool:
    return isinstance(shape.geometry, Mesh | Parallelogram)


def _triangulate(geometry: object) -> Mesh:
    if isinstance(geometry, Mesh):
        return geometry
    assert isinstance(geometry, Parallelogram)
    corner, u, v = np.array(geometry.corner), np.array(geometry.edge_u), np.array(geometry.edge_v)
    return Mesh(np.array([corner, corner + u, corner + u + v, corner + v]), np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def _corners(meshes: list[Mesh], n: int) -> Float:
    """(n, 3, 3) vertices at the corners of all triangles."""
    out, start = np.empty((n, 3, 3), np.float32), 0
    for m in meshes:
        _take(m.vertices, m.faces, out[start : start + len(m.faces)])
        start += len(m.faces)
    return out


def _corner_normals(meshes: list[Mesh], n: int) -> Float | None:
    """(n, 3, 3) normals at the triangles' corners; flat meshes repeat the face's. None if all are flat."""
    if all(m.normals is None for m in meshes):
        return None
    out, start = np.empty((n, 3, 3), np.float32), 0
    for m in meshes:
        rows = out[start : start + len(m.faces)]
        if m.normals is not None:
            _take(m.normals, m.faces, rows)
        else:
            face_normals(np.ascontiguousarray(m.vertices), m.faces, rows)
        start += len(m.faces)
    return out


def _take(values: NDArray[np.float64], faces: NDArray[np.int32], out: Float) -> None:
    """out (F, 3, 3) = values (V, 3) at the corners of the faces."""
    np.take(values.astype(np.float32), faces, axis=0, out=out, mode="clip")  # checked before; "raise" would copy


def _quadric_row(shape: Shape) -> list[float]:
    g = shape.geometry
    if isinstance(g, Sphere):
        return [0, *g.center, 0, 0, 1, g.radius, 0, side_of(g), 0, 0]
    if isinstance(g, Cylinder):
        axis, length = axis_of(g)
        return [1, *g.p0, *axis, g.radius, length, side_of(g), 0, 0]
    assert isinstance(g, Disk)
    return [2, *g.center, *g.normal, g.radius, 0, 1, 0, 0]
