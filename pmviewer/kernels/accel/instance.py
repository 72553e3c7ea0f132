"""Instances: copies of a group of primitives under affine transformations, as kernels see them.

A group is stored once, moved and scaled by a power of two so that it lies in the unit ball around its origin, with a
tree of its own. An instance keeps both directions of its transformation in float64: a ray's start is rounded to float32
in the group's small coordinates, never in the world's large ones, so a tiny copy far from the origin is as exact as a
large one.

The primitives of instance i have the ids base[i] + 0, 1, … in the order of its group, triangles before quadrics; ids
below `n_stored` are those of stored primitives, which the scene's own surfaces are hit with. Only records with
`INSTANCE_FIELDS` compile any of this.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.memory import load_f8, load_i4, load_i8

INSTANCE_FIELDS: list[tuple[str, str]] = [
    ("instances", "i8"),  # float64 (n, INSTANCE_COLUMNS)
    ("instance_base", "i8"),  # int32 (n): id of each instance's first primitive, ascending
    ("groups", "i8"),  # int64 (n_groups, GROUP_COLUMNS)
    ("n_instances", "i8"),
    ("n_stored", "i8"),  # stored primitives: the ids of instances start here
    ("n_own_quadrics", "i8"),  # leaves from here on are instances
]

_columns = np.arange(32, dtype=np.int64)

INSTANCE_COLUMNS = 26
I_TO_LOCAL, I_TO_WORLD, I_GROUP, I_BASE = _columns[[0, 12, 24, 25]]
"""Two matrices of three rows and four columns, the number of the group and the id of the first primitive."""

GROUP_COLUMNS = 8
G_NODES, G_BLOCKS, G_N_BLOCKS, G_QUADRICS, G_N_TRIANGLES, G_FIRST_TRIANGLE, G_FIRST_QUADRIC = _columns[:7]
"""Addresses and counts of a group's tree; which stored triangle and quadric are its first."""

_one = np.int64(1)


@device
def instance_number(scene, i, column):
    """A float64 of instance i; `column` is one of the I_ names."""
    return load_f8(scene.instances, i * INSTANCE_COLUMNS + column)


@device
def group_of(scene, i):
    """Number of the group that instance i is a copy of."""
    return np.int64(instance_number(scene, i, I_GROUP))


@device
def group_number(scene, group, column):
    """An int64 of a group's row: addresses and counts of its own tree."""
    return load_i8(scene.groups, group * GROUP_COLUMNS + column)


@device
def transform_vector(scene, i, matrix, x, y, z):
    """A direction through the matrix at column `matrix` of instance i, in float64."""
    a = scene.instances + (i * INSTANCE_COLUMNS + matrix) * 8
    return (
        load_f8(a, 0) * x + load_f8(a, 1) * y + load_f8(a, 2) * z,
        load_f8(a, 4) * x + load_f8(a, 5) * y + load_f8(a, 6) * z,
        load_f8(a, 8) * x + load_f8(a, 9) * y + load_f8(a, 10) * z,
    )


@device
def transform_point(scene, i, matrix, x, y, z):
    """A point through the matrix at column `matrix` of instance i, in float64."""
    a = scene.instances + (i * INSTANCE_COLUMNS + matrix) * 8
    vx, vy, vz = transform_vector(scene, i, matrix, x, y, z)
    return vx + load_f8(a, 3), vy + load_f8(a, 7), vz + load_f8(a, 11)


@device
def normal_to_world(scene, i, x, y, z):
    """A group's normal in the world, and its length there: that of 1/distance for planes (float64).

    Normals go with the transpose of the inverse, so what was outside stays outside when the copy is mirrored.
    """
    a = scene.instances + (i * INSTANCE_COLUMNS + I_TO_LOCAL) * 8
    nx = load_f8(a, 0) * x + load_f8(a, 4) * y + load_f8(a, 8) * z
    ny = load_f8(a, 1) * x + load_f8(a, 5) * y + load_f8(a, 9) * z
    nz = load_f8(a, 2) * x + load_f8(a, 6) * y + load_f8(a, 10) * z
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    return np.float32(nx / length), np.float32(ny / length), np.float32(nz / length), length


@device
def find_instance(scene, prim):
    """The instance that a primitive id from `n_stored` on belongs to: the last with base <= prim."""
    low, high = np.int64(0), np.int64(scene.n_instances)
    while high - low > 1:
        middle = (low + high) >> _one
        if load_i4(scene.instance_base, middle) <= prim:
            low = middle
        else:
            high = middle
    return low


@device
def stored_of(scene, i, prim):
    """The stored primitive behind the primitive `prim` of instance i."""
    group = group_of(scene, i)
    local = np.int64(prim) - load_i4(scene.instance_base, i)
    n_triangles = group_number(scene, group, G_N_TRIANGLES)
    if local < n_triangles:
        return group_number(scene, group, G_FIRST_TRIANGLE) + local
    return np.int64(scene.n_triangles) + group_number(scene, group, G_FIRST_QUADRIC) + local - n_triangles


@device
def _through_instances(scene, prim):
    if prim < scene.n_stored:
        return np.int64(prim)
    return stored_of(scene, find_instance(scene, prim), prim)


@specialised
def stored_prim(scene, prim):
    """Where the tables per primitive (vertices, materials, …) keep the primitive of this id."""
    if has_instances(scene):
        return lambda scene, prim: _through_instances(scene, prim)
    return lambda scene, prim: np.int64(prim)


@specialised
def is_own(scene, prim):
    """Whether the primitive is one of the scene's own, not a copy's: only those are lights."""
    if has_instances(scene):
        return lambda scene, prim: prim < scene.n_stored
    return lambda scene, prim: True


def has_instances(record_type) -> bool:
    """Does a numba type of a scene record hold instances?"""
    return "instances" in getattr(record_type, "fields", ())


@device
def local_ray(scene, i, ox, oy, oz, dx, dy, dz):
    """A ray in the coordinates of instance i, its origin moved to just before the unit ball: origin, direction, and by
    how much t is smaller there (float32)."""
    px, py, pz = transform_point(scene, i, I_TO_LOCAL, ox, oy, oz)
    vx, vy, vz = transform_vector(scene, i, I_TO_LOCAL, dx, dy, dz)
    square = vx * vx + vy * vy + vz * vz
    # From afar, rounding of the origin alone could open gaps between neighbours.
    start = np.float32(-(px * vx + py * vy + pz * vz) / square - 1.0 / math.sqrt(square))
    if not start > np.float32(0):
        start = np.float32(0)
    return (
        np.float32(px + start * vx), np.float32(py + start * vy), np.float32(pz + start * vz),
        np.float32(vx), np.float32(vy), np.float32(vz), start,
    )  # fmt: skip
