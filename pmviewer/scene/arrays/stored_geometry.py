"""The primitives of a scene as arrays: triangles first, then quadrics (spheres, cylinders, disks)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.kernels.meshes.mesh import face_normals
from pmviewer.scene.arrays.instances import Normal, normalised
from pmviewer.scene.arrays.light_table import axis_of, side_of
from pmviewer.scene.arrays.tree_ahead import TreeAhead, fill_corners, take_corners
from pmviewer.scene.description import Cylinder, Disk, Mesh, Parallelogram, Scene, Shape, Sphere

Float = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class StoredGeometry:
    """The primitives that are stored: `vertices` (n, 3, 3) of triangles, `quadrics` (m, 12), and of which of the
    `shapes` each is (n + m,). Shapes are the scene's, then those of its normalised `groups`; `meshes` those that are
    triangles and `round_shapes` the others, by their places."""

    shapes: tuple[Shape, ...]
    groups: list[Normal]
    meshes: list[tuple[int, Mesh]]
    round_shapes: list[int]
    vertices: Float
    quadrics: Float
    shape_of_prim: NDArray[np.int32]

    def corner_normals(self) -> Float | None:
        """(n, 3, 3) normals at the triangles' corners; flat meshes repeat the face's. None if all are flat."""
        return _corner_normals([m for _, m in self.meshes], len(self.vertices))


def same_surfaces(one: Scene, other: Scene) -> bool:
    """Are the surfaces of both the very same, whatever they are made of? Instances count as others."""
    if one.instances or other.instances or len(one.shapes) != len(other.shapes):
        return False
    return all(a.geometry is b.geometry for a, b in zip(one.shapes, other.shapes))


def stored_geometry(scene: Scene, ahead: TreeAhead | None = None) -> StoredGeometry:
    """Raises SceneError when the scene has no surface. The triangles that `ahead` knows are in its memory."""
    groups = [normalised(group, scene) for group in scene.groups] if scene.instances else []
    shapes = scene.shapes + tuple(shape for group in groups for shape in group.shapes)
    meshes = [(i, _triangulate(s.geometry)) for i, s in enumerate(shapes) if _is_triangles(s)]
    round_shapes = [i for i, s in enumerate(shapes) if not _is_triangles(s)]
    if not shapes:
        raise SceneError("The scene has no surface.", scene.path, hint="Add at least one shape.")
    counts = [len(m.faces) for _, m in meshes]
    return StoredGeometry(
        shapes=shapes,
        groups=groups,
        meshes=meshes,
        round_shapes=round_shapes,
        vertices=_vertices([m for _, m in meshes], sum(counts), ahead),
        quadrics=np.array([_quadric_row(shapes[i]) for i in round_shapes], np.float32).reshape(-1, 12),
        shape_of_prim=np.repeat(
            np.array([i for i, _ in meshes] + round_shapes, np.int32), counts + [1] * len(round_shapes)
        ),
    )


def _is_triangles(shape: Shape) -> bool:
    return isinstance(shape.geometry, Mesh | Parallelogram)


def _triangulate(geometry: object) -> Mesh:
    if isinstance(geometry, Mesh):
        return geometry
    assert isinstance(geometry, Parallelogram)
    corner, u, v = np.array(geometry.corner), np.array(geometry.edge_u), np.array(geometry.edge_v)
    return Mesh(np.array([corner, corner + u, corner + u + v, corner + v]), np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def _vertices(meshes: list[Mesh], n: int, ahead: TreeAhead | None) -> Float:
    """(n, 3, 3) vertices at the corners of all triangles."""
    if ahead is None or n > len(ahead.triangles):
        out = np.empty((n, 3, 3), np.float32)
        fill_corners(meshes, out)
    else:
        out = ahead.triangles[:n]
        fill_corners(meshes[ahead.n_meshes :], out[ahead.n_triangles :])
    return out


def _corner_normals(meshes: list[Mesh], n: int) -> Float | None:
    if all(m.normals is None for m in meshes):
        return None
    out, start = np.empty((n, 3, 3), np.float32), 0
    for m in meshes:
        rows = out[start : start + len(m.faces)]
        if m.normals is not None:
            take_corners(m.normals, m.faces, rows)
        else:
            face_normals(np.ascontiguousarray(m.vertices), m.faces, rows)
        start += len(m.faces)
    return out


def _quadric_row(shape: Shape) -> list[float]:
    g = shape.geometry
    if isinstance(g, Sphere):
        return [0, *g.center, 0, 0, 1, g.radius, 0, side_of(g), 0, 0]
    if isinstance(g, Cylinder):
        axis, length = axis_of(g)
        return [1, *g.p0, *axis, g.radius, length, side_of(g), 0, 0]
    assert isinstance(g, Disk)
    return [2, *g.center, *g.normal, g.radius, 0, 1, 0, 0]
