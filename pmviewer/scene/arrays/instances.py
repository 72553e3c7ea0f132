"""Groups and their instances as arrays: normalised shapes, the kernels' tables, bounds.

Each group is moved and scaled into the unit ball around its origin, by a power of two, so that it is traced in small
numbers whatever its own units are; the instances' transformations make up for it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.kernels.accel import instance as K
from pmviewer.kernels.accel.bvh import Bvh, build
from pmviewer.scene.clean import clean_shapes
from pmviewer.scene.defaults.framing import bounds
from pmviewer.scene.description import (
    Cylinder,
    Disk,
    Geometry,
    Group,
    Instance,
    Mesh,
    Parallelogram,
    Scene,
    Shape,
    Sphere,
    Vec3,
)
from pmviewer.scene.diagnostics import Diagnostics

Float = NDArray[np.float64]
LARGEST_ID = 2**31 - 1
LARGEST_CONDITION = 1e10
"""Of a transformation: beyond it a copy is flat for all that float32 can tell."""

_EXACT = 4096
"""Copies whose exact bounds are worth computing; more are bounded by their boxes."""


@dataclass(frozen=True)
class Normal:
    """A group in the unit ball: `shapes` there, and group coordinates = `scale` · these + `center`."""

    shapes: tuple[Shape, ...]
    center: Float
    scale: float


def normalised(group: Group, scene: Scene) -> Normal:
    """The group in the unit ball around the origin. Raises SceneError for an empty group or one with a light."""
    if not group.shapes:
        raise SceneError(f"The group '{group.name}' has no surface.", scene.path, hint="Add a shape, or remove it.")
    light = next((s for s in group.shapes if s.shines), None)
    if light is not None:
        what = f"'{light.name}' in the group '{group.name}' is a light, which can't be instanced."
        raise SceneError(what, scene.path, hint="Move the light out of the group.")
    low, high = bounds(group.shapes)
    center = (low + high) / 2
    radius = float(np.linalg.norm(high - low)) / 2
    scale = 2.0 ** math.ceil(math.log2(max(radius, 1e-30) * 1.0001))
    moved = tuple(replace(s, geometry=_moved(s.geometry, center, 1 / scale)) for s in group.shapes)
    return Normal(moved, center, scale)


def _moved(g: Geometry, center: Float, scale: float) -> Geometry:
    def point(p: Vec3) -> Vec3:
        x, y, z = ((np.array(p) - center) * scale).tolist()
        return x, y, z

    def vector(v: Vec3) -> Vec3:
        return v[0] * scale, v[1] * scale, v[2] * scale

    if isinstance(g, Mesh):
        return replace(g, vertices=(g.vertices - center) * scale)
    if isinstance(g, Parallelogram):
        return Parallelogram(point(g.corner), vector(g.edge_u), vector(g.edge_v))
    if isinstance(g, Cylinder):
        return replace(g, p0=point(g.p0), p1=point(g.p1), radius=g.radius * scale)
    assert isinstance(g, Sphere | Disk)
    return replace(g, center=point(g.center), radius=g.radius * scale)


@dataclass(frozen=True)
class InstanceTables:
    """What `kernels.instance` reads; the arrays and the groups' trees, to be kept alive. `boxes` are the corners of all
    instances in the world, float32 (n, 3) each."""

    rows: Float
    base: NDArray[np.int32]
    groups: NDArray[np.int64]
    trees: tuple[Bvh, ...]
    boxes: tuple[NDArray[np.float32], NDArray[np.float32]]
    n_elements: int
    """Primitives that rays can meet, the scene's own and those of all instances."""

    def store(self, record: np.record, n_stored: int, n_own_quadrics: int) -> None:
        """Write addresses and counts into a record with INSTANCE_FIELDS."""
        record["instances"], record["instance_base"] = self.rows.ctypes.data, self.base.ctypes.data
        record["groups"], record["n_instances"] = self.groups.ctypes.data, len(self.base)
        record["n_stored"], record["n_own_quadrics"] = n_stored, n_own_quadrics

    @property
    def arrays(self) -> dict[str, NDArray]:
        """What kernels read by address, to be kept alive as long as the record that holds the addresses. The `groups`
        have addresses in their turn."""
        return {"instances": self.rows, "instance_base": self.base, "groups": self.groups}


def build_instanced(
    scene: Scene,
    normals: Sequence[Normal],
    triangles: NDArray[np.float32],
    quadrics: NDArray[np.float32],
    shape_of_prim: NDArray[np.integer],
    record: np.record,
) -> tuple[Bvh, InstanceTables]:
    """Build the groups' trees and the scene's own over them, and write both into `record`.

    Parameters
    ----------
    normals: the groups of `scene.groups`, normalised.
    triangles, quadrics: all stored primitives, (n, 3, 3) and (m, 12): the scene's own, then the groups' in order.
    shape_of_prim: (n + m,) which of the stored shapes (own, then the groups') each belongs to.

    Raises SceneError for a transformation that has no inverse and for more elements than ids.
    """
    owner = np.concatenate(
        [np.zeros(len(scene.shapes), int), *(np.full(len(n.shapes), k + 1) for k, n in enumerate(normals))]
    )
    n = len(triangles)
    parts = (shape_of_prim[:n], shape_of_prim[n:])
    counts = np.stack([np.bincount(owner[part], minlength=len(normals) + 1) for part in parts], axis=1)
    own_triangles, own_quadrics = (int(c) for c in counts[0])
    shown = _tables(scene, normals, triangles, quadrics, counts)
    bvh = build(triangles[:own_triangles], quadrics[:own_quadrics], shown.boxes)
    bvh.store(record)
    # Hits are numbered and looked up among all that is stored.
    record["bvh_quadrics"], record["n_triangles"] = quadrics.ctypes.data, n
    shown.store(record, n + len(quadrics), own_quadrics)
    return bvh, shown


def _tables(
    scene: Scene,
    normals: Sequence[Normal],
    triangles: NDArray[np.float32],
    quadrics: NDArray[np.float32],
    counts: NDArray[np.int64],
) -> InstanceTables:
    """`counts` (1 + n_groups, 2): triangles and quadrics of the scene's own shapes and of each group."""
    firsts, counts = np.cumsum(counts, axis=0)[:-1], counts[1:]
    own = (len(triangles) - int(counts[:, 0].sum())) + (len(quadrics) - int(counts[:, 1].sum()))
    groups = np.zeros((len(counts), K.GROUP_COLUMNS), np.int64)
    trees: list[Bvh] = []
    for row, (t, q), (nt, nq) in zip(groups, firsts, counts):
        tree = build(triangles[t : t + nt], quadrics[q : q + nq])
        trees.append(tree)
        row[:7] = tree.nodes_address, tree.blocks_address, tree.n_blocks, tree.quadrics_address, nt, t, q

    number = {group: k for k, group in enumerate(scene.groups)}
    group_of = np.array([number[instance.group] for instance in scene.instances])
    sizes = counts.sum(axis=1)[group_of]
    n_stored = len(triangles) + len(quadrics)
    total = n_stored + int(sizes.sum())
    if total > LARGEST_ID:
        what = f"The scene has {total:,} elements through its instances; at most {LARGEST_ID:,} can be told apart."
        raise SceneError(what, scene.path, hint="Use fewer instances, or groups of fewer triangles.")
    base = n_stored + np.concatenate([[0], np.cumsum(sizes)[:-1]])

    normal = np.zeros((len(normals), 4, 4))
    normal[:, 3, 3] = 1.0
    for m, n in zip(normal, normals):
        m[:3, :3], m[:3, 3] = np.eye(3) * n.scale, n.center
    bad = first_singular(scene.instances)
    if bad is not None:
        what = f"The transformation of the instance '{scene.instances[bad].name}' is singular: it squeezes it flat."
        raise SceneError(what, scene.path, hint="Give each axis a scale other than zero.")
    to_world = np.stack([instance.to_world for instance in scene.instances]) @ normal[group_of]
    inverse = np.linalg.inv(to_world[:, :3, :3])
    rows = np.zeros((len(to_world), K.INSTANCE_COLUMNS))
    local = rows[:, K.I_TO_LOCAL : K.I_TO_LOCAL + 12].reshape(-1, 3, 4)
    local[:, :, :3] = inverse
    local[:, :, 3] = -(inverse @ to_world[:, :3, 3:])[:, :, 0]
    rows[:, K.I_TO_LOCAL : K.I_TO_LOCAL + 12] = local.reshape(-1, 12)
    rows[:, K.I_TO_WORLD : K.I_TO_WORLD + 12] = to_world[:, :3].reshape(-1, 12)
    rows[:, K.I_GROUP], rows[:, K.I_BASE] = group_of, base
    return InstanceTables(
        rows, base.astype(np.int32), groups, tuple(trees), _boxes(to_world, group_of, trees), own + int(sizes.sum())
    )


def clean_instances(instances: Sequence[Instance], diagnostics: Diagnostics) -> tuple[Instance, ...]:
    """The instances with the usable shapes of their groups; those of groups without any are counted as left out."""
    groups: dict[Group, Group] = {}
    for group in dict.fromkeys(instance.group for instance in instances):
        groups[group] = Group(group.name, clean_shapes(list(group.shapes), diagnostics))
    kept = [Instance(i.name, groups[i.group], i.to_world) for i in instances if groups[i.group].shapes]
    if len(kept) < len(instances):
        diagnostics.dropped["instance of an empty group"] += len(instances) - len(kept)
    return tuple(kept)


def first_singular(instances: Sequence[Instance]) -> int | None:
    """Index of the first instance whose transformation can't be undone."""
    bad = np.flatnonzero(singular(instances))
    return int(bad[0]) if len(bad) else None


def singular(instances: Sequence[Instance]) -> NDArray[np.bool_]:
    """Which of the instances have a transformation that can't be undone."""
    if not instances:
        return np.zeros(0, bool)
    linear = np.stack([instance.to_world[:3, :3] for instance in instances])
    a, b, c = linear[:, :, 0], linear[:, :, 1], linear[:, :, 2]
    with np.errstate(all="ignore"):
        adjugate = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        determinant = np.abs((a * adjugate[:, 0]).sum(axis=1))
        # The product of the Frobenius norms of the matrix and its inverse: at least its condition, at most three times.
        condition = np.linalg.norm(linear, axis=(1, 2)) * np.linalg.norm(adjugate, axis=(1, 2)) / determinant
    return np.asarray(~(condition < LARGEST_CONDITION))


def _boxes(
    to_world: Float, group_of: NDArray[np.int64], trees: Sequence[Bvh]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Corners of the instances' boxes, rounded outwards: unions over the boxes of the group's root node."""
    low, high = np.full((len(to_world), 3), np.inf), np.full((len(to_world), 3), -np.inf)
    for k, tree in enumerate(trees):
        mine = np.flatnonzero(group_of == k)
        root = tree.nodes[0].astype(float)
        used = root[0] <= root[1]
        for lane in np.flatnonzero(used):
            center, half = (root[1:6:2, lane] + root[0:6:2, lane]) / 2, (root[1:6:2, lane] - root[0:6:2, lane]) / 2
            middle = to_world[mine, :3, :3] @ center + to_world[mine, :3, 3]
            reach = np.abs(to_world[mine, :3, :3]) @ half
            low[mine], high[mine] = np.minimum(low[mine], middle - reach), np.maximum(high[mine], middle + reach)
    # A hit may lie outside by the tolerance at a triangle's edges and by rounding in the group and the world.
    slack = 2e-5 * (high - low) + 1e-6 * np.maximum(np.abs(low), np.abs(high))
    return (low - slack).astype(np.float32), (high + slack).astype(np.float32)


def instance_bounds(instances: Sequence[Instance]) -> tuple[Float, Float]:
    """Lowest and highest corner of the box around the instances.

    Tight for up to some thousand that could reach furthest; a copy turned askew beyond those counts with its box.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    points: dict[Group, Float] = {}
    for group in dict.fromkeys(i.group for i in instances):
        points[group] = np.concatenate([_extremes(s.geometry) for s in group.shapes])
    to_world = np.stack([i.to_world for i in instances])
    number = {group: k for k, group in enumerate(points)}
    group_of = np.array([number[i.group] for i in instances])
    corners = np.array([[p.min(axis=0), p.max(axis=0)] for p in points.values()])
    middle, half = (corners[:, 0] + corners[:, 1]) / 2, (corners[:, 1] - corners[:, 0]) / 2
    centers = (to_world[:, :3, :3] @ middle[group_of][:, :, None])[:, :, 0] + to_world[:, :3, 3]
    reach = (np.abs(to_world[:, :3, :3]) @ half[group_of][:, :, None])[:, :, 0]
    for axis in range(3):
        for sign, side in ((1.0, high), (-1.0, low)):
            loose = sign * centers[:, axis] + reach[:, axis]
            best = -np.inf
            for tried, i in enumerate(np.argsort(-loose)):
                if loose[i] <= best:
                    break
                if tried >= _EXACT:
                    best = float(loose[i])
                    break
                row = to_world[i, axis]
                best = max(best, float((sign * (points[instances[i].group] @ row[:3] + row[3])).max()))
            side[axis] = sign * best
    return low, high


def _extremes(g: Geometry) -> Float:
    """Points (n, 3) whose hull holds the geometry, and which is the geometry's for triangles."""
    if isinstance(g, Mesh):
        used = g.vertices[np.unique(g.faces)]
        return used if len(used) < 1000 else _hull(used)
    if isinstance(g, Parallelogram):
        c, u, v = np.array(g.corner), np.array(g.edge_u), np.array(g.edge_v)
        return np.stack([c, c + u, c + v, c + u + v])
    low, high = bounds((Shape("", g, 0),))
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def _hull(points: Float) -> Float:
    from scipy.spatial import ConvexHull, QhullError

    try:
        return points[ConvexHull(points).vertices]
    except QhullError:  # flat
        return points


def joint_bounds(shapes: Sequence[Shape], instances: Sequence[Instance]) -> tuple[Float, Float]:
    """Lowest and highest corner of the box around all shapes and instances."""
    low, high = bounds(shapes)
    if instances:
        more_low, more_high = instance_bounds(instances)
        low, high = np.minimum(low, more_low), np.maximum(high, more_high)
    return low, high
