"""What the casts for the nearest hit and for any hit share: rays that are none, groups, quadrics that rays may pass."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.accel.instance import (
    G_BLOCKS,
    G_FIRST_QUADRIC,
    G_FIRST_TRIANGLE,
    G_N_BLOCKS,
    G_N_TRIANGLES,
    G_NODES,
    G_QUADRICS,
    group_number,
)
from pmviewer.kernels.accel.opacity import Veil, hit_counts
from pmviewer.kernels.accel.quadric import QUADRIC_FLOATS, intersect_quadric
from pmviewer.kernels.accel.simd import LANES
from pmviewer.kernels.compile.jit import device, inlined

QUADRIC_BYTES = 4 * QUADRIC_FLOATS
STACK_INTS = 1024  # 512 keys; a level pushes at most 7, and the build keeps trees below 72 levels
SCRATCH_INTS = 3 * LANES


@device
def is_finite(ox, oy, oz, dx, dy, dz):
    """Whether a ray can be cast at all: neither NaN nor infinity in origin and direction."""
    return abs(ox) + abs(oy) + abs(oz) + abs(dx) + abs(dy) + abs(dz) < np.float32(np.inf)


class StoredQuadric(NamedTuple):
    """A quadric that may let rays pass: address of its numbers, id, and where the tables per primitive keep it."""

    address: Any
    ident: Any
    stored: Any


@inlined
def own_quadric(scene, leaf):
    """The `StoredQuadric` of one of the scene's own."""
    stored = scene.n_triangles + leaf
    return StoredQuadric(scene.bvh_quadrics + leaf * QUADRIC_BYTES, stored, stored)


@inlined
def group_tree(scene, group):
    """Nodes, blocks and number of blocks of a group's tree."""
    return (
        group_number(scene, group, G_NODES),
        group_number(scene, group, G_BLOCKS),
        group_number(scene, group, G_N_BLOCKS),
    )


@inlined
def group_veil(scene, key, group, base):
    """The `Veil` of a group's tree for a ray; base: id of the first primitive of its instance."""
    return Veil(
        group_number(scene, group, G_QUADRICS),
        group_number(scene, group, G_N_TRIANGLES),
        scene,
        key,
        group_number(scene, group, G_FIRST_TRIANGLE),
        group_number(scene, group, G_FIRST_QUADRIC),
        base,
    )


@device
def closest_quadric(scene, key, quadric, ox, oy, oz, dx, dy, dz, tmin, tmax):
    """The nearest hit with a `StoredQuadric` that the ray does not pass: it may pass the near side and meet the far
    one. tmax without one."""
    zero = np.float32(0)
    while True:
        t = intersect_quadric(quadric.address, ox, oy, oz, dx, dy, dz, tmin, tmax)
        if not t < tmax:
            return tmax
        if hit_counts(scene, key, quadric.ident, quadric.stored, zero, zero, ox + t * dx, oy + t * dy, oz + t * dz):
            return t
        tmin, key = t, np.uint32(key ^ np.uint32(0x9E3779B9))


@device
def closest_veiled_quadric(veil, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax):
    """The same with a quadric of the tree that a `Veil` is of."""
    quadric = StoredQuadric(
        veil.quadrics + leaf * QUADRIC_BYTES,
        veil.base + veil.n_triangles + leaf,
        veil.scene.n_triangles + veil.first_quadric + leaf,
    )
    return closest_quadric(veil.scene, veil.key, quadric, ox, oy, oz, dx, dy, dz, tmin, tmax)
