"""Casting rays: the nearest hit. Whether anything is in between is asked of `pmviewer.kernels.accel.occlusion`.

Where surfaces let rays pass (`pmviewer.kernels.accel.opacity`) a hit counts that the ray does not pass.

`scene` is a record with the fields of `bvh.BVH_FIELDS`, and with those of `instance` if there are instances: their
leaves start a second traversal, of the group's tree by the ray in the group's coordinates.

A ray is the points o + t d with tmin < t < tmax; d need not be of unit length, t is in units of its length. Lengths of
any scale do: there is no absolute epsilon here, callers offset the origin or choose tmin.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.instance import (
    G_N_TRIANGLES,
    G_QUADRICS,
    I_BASE,
    group_number,
    group_of,
    has_instances,
    instance_number,
    local_ray,
)
from pmviewer.kernels.accel.leaves import (
    QUADRIC_BYTES,
    SCRATCH_INTS,
    STACK_INTS,
    closest_quadric,
    closest_veiled_quadric,
    group_tree,
    group_veil,
    is_finite,
    own_quadric,
)
from pmviewer.kernels.accel.opacity import (
    Veil,
    VeiledInstances,
    lets_pass,
    ray_key,
    triangle_counts,
)
from pmviewer.kernels.accel.quadric import intersect_quadric
from pmviewer.kernels.accel.simd import (
    BLOCK_BYTES,
    CHILD_OFFSET,
    ID_OFFSET,
    LANES,
    NODE_BYTES,
    ROW_BYTES,
    hit_boxes,
    hit_triangles,
)
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.compile.specialise import is_a, specialised
from pmviewer.kernels.memory import (
    bits_of_float,
    count_trailing_zeros,
    load_i4,
    stack_get_f4,
    stack_get_i4,
    stack_get_i8,
    stack_i4,
    stack_put_i8,
)

_0 = np.int64(0)


@device
def _key(distances, base, lane):
    """Entry distance in the high half, child in the low half: non-negative floats sort like their bits."""
    distance = np.int64(stack_get_i4(distances, lane))
    return (distance << 32) | (np.int64(load_i4(base, lane)) & 0xFFFFFFFF)


@device
def _closest_in_leaf(scene, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax):
    if leaf < scene.n_own_quadrics:
        t = intersect_quadric(scene.bvh_quadrics + leaf * QUADRIC_BYTES, ox, oy, oz, dx, dy, dz, tmin, tmax)
        return t, np.int32(scene.n_triangles + leaf), np.float32(0), np.float32(0)
    i = leaf - scene.n_own_quadrics
    group = group_of(scene, i)
    px, py, pz, vx, vy, vz, start = local_ray(scene, i, ox, oy, oz, dx, dy, dz)
    leaves = (group_number(scene, group, G_QUADRICS), group_number(scene, group, G_N_TRIANGLES))
    nodes, blocks, n_blocks = group_tree(scene, group)
    t, prim, u, v = _closest_in_tree(
        leaves, nodes, blocks, n_blocks, px, py, pz, vx, vy, vz, tmin - start, tmax - start
    )
    if prim < 0:
        return tmax, prim, u, v
    return start + t, np.int32(instance_number(scene, i, I_BASE)) + prim, u, v


@device
def _closest_in_veiled_leaf(veiled, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax):
    scene, key = veiled.scene, veiled.key
    if leaf < scene.n_own_quadrics:
        quadric = own_quadric(scene, leaf)
        t = closest_quadric(scene, key, quadric, ox, oy, oz, dx, dy, dz, tmin, tmax)
        return t, np.int32(quadric.stored), np.float32(0), np.float32(0)
    i = leaf - scene.n_own_quadrics
    group, base = group_of(scene, i), np.int64(instance_number(scene, i, I_BASE))
    px, py, pz, vx, vy, vz, start = local_ray(scene, i, ox, oy, oz, dx, dy, dz)
    veil = group_veil(scene, key, group, base)
    nodes, blocks, n_blocks = group_tree(scene, group)
    t, prim, u, v = _closest_in_tree(veil, nodes, blocks, n_blocks, px, py, pz, vx, vy, vz, tmin - start, tmax - start)
    if prim < 0:
        return tmax, prim, u, v
    return start + t, np.int32(base) + prim, u, v


@specialised
def meet_leaf(leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax):
    """(t, primitive, u, v) of the nearest hit with what is no block; t = tmax without one."""
    if is_a(leaves, VeiledInstances):
        return lambda leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax: _closest_in_veiled_leaf(
            leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax
        )
    if is_a(leaves, Veil):
        return lambda leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax: (
            closest_veiled_quadric(leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax),
            np.int32(leaves.n_triangles + leaf),
            np.float32(0),
            np.float32(0),
        )
    if has_instances(leaves):
        return lambda leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax: _closest_in_leaf(
            leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax
        )
    return lambda leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax: (
        intersect_quadric(leaves[0] + leaf * QUADRIC_BYTES, ox, oy, oz, dx, dy, dz, tmin, tmax),
        np.int32(leaves[1] + leaf),
        np.float32(0),
        np.float32(0),
    )


@specialised
def closest_hit(scene, ox, oy, oz, dx, dy, dz, tmin, tmax):
    """(t, primitive, u, v) of the nearest hit; (tmax, -1, 0, 0) without one.

    Surfaces that let the ray pass (`pmviewer.kernels.accel.opacity`) are not hit. u and v are the barycentrics of a
    triangle's second and third vertex, 0 for quadrics. Negative tmin counts as 0. A ray with a non-finite number hits
    nothing.
    """
    if lets_pass(scene) and has_instances(scene):
        return lambda scene, ox, oy, oz, dx, dy, dz, tmin, tmax: _closest_in_scene(
            VeiledInstances(scene, ray_key(ox, oy, oz, dx, dy, dz)), scene.bvh_nodes, scene.bvh_blocks,
            scene.bvh_n_blocks, ox, oy, oz, dx, dy, dz, tmin, tmax,
        )  # fmt: skip
    if lets_pass(scene):
        return lambda scene, ox, oy, oz, dx, dy, dz, tmin, tmax: _closest_in_tree(
            Veil(scene.bvh_quadrics, scene.n_triangles, scene, ray_key(ox, oy, oz, dx, dy, dz), _0, _0, _0),
            scene.bvh_nodes, scene.bvh_blocks, scene.bvh_n_blocks, ox, oy, oz, dx, dy, dz, tmin, tmax,
        )  # fmt: skip
    if has_instances(scene):
        return lambda scene, ox, oy, oz, dx, dy, dz, tmin, tmax: _closest_in_scene(
            scene, scene.bvh_nodes, scene.bvh_blocks, scene.bvh_n_blocks, ox, oy, oz, dx, dy, dz, tmin, tmax
        )
    return lambda scene, ox, oy, oz, dx, dy, dz, tmin, tmax: _closest_in_tree(
        (scene.bvh_quadrics, scene.n_triangles), scene.bvh_nodes, scene.bvh_blocks, scene.bvh_n_blocks,
        ox, oy, oz, dx, dy, dz, tmin, tmax,
    )  # fmt: skip


def _closest(leaves, nodes, blocks, n_blocks, ox, oy, oz, dx, dy, dz, tmin, tmax):
    hit, u, v = np.int32(-1), np.float32(0), np.float32(0)
    if not is_finite(ox, oy, oz, dx, dy, dz):
        return tmax, hit, u, v
    if not tmin > np.float32(0):
        tmin = np.float32(0)
    stack = stack_i4(STACK_INTS)
    scratch = stack_i4(SCRATCH_INTS)
    ix, iy, iz = np.float32(1) / dx, np.float32(1) / dy, np.float32(1) / dz
    origin, inverse = (ox, oy, oz), (ix, iy, iz)
    nears = (
        np.int64(0 if ix > 0 else ROW_BYTES),
        np.int64(2 * ROW_BYTES if iy > 0 else 3 * ROW_BYTES),
        np.int64(4 * ROW_BYTES if iz > 0 else 5 * ROW_BYTES),
    )
    stack_put_i8(stack, 0, np.int64(0))
    size = 1
    while True:
        # What is no block is left to this outer loop: a call inside the inner one would cost all rays their vector
        # registers.
        other = np.int64(-1)
        while size > 0:
            size -= 1
            key = stack_get_i8(stack, size)
            if (key >> 32) >= np.int64(bits_of_float(tmax)):
                continue
            child = np.int32(key & 0xFFFFFFFF)
            while child >= 0:
                node = nodes + np.int64(child) * NODE_BYTES
                mask = hit_boxes(node, nears, origin, inverse, tmin, tmax, scratch)
                if mask == 0:
                    break
                children = node + CHILD_OFFSET
                lane = count_trailing_zeros(mask)
                mask &= mask - 1
                if mask == 0:
                    child = load_i4(children, lane)
                    continue
                nearest = _key(scratch, children, lane)
                bottom = size
                while mask != 0:
                    key = _key(scratch, children, count_trailing_zeros(mask))
                    mask &= mask - 1
                    if key < nearest:
                        nearest, key = key, nearest
                    slot = size
                    while slot > bottom:
                        above = stack_get_i8(stack, slot - 1)
                        if above >= key:
                            break
                        stack_put_i8(stack, slot, above)
                        slot -= 1
                    stack_put_i8(stack, slot, key)
                    size += 1
                child = np.int32(nearest & 0xFFFFFFFF)
            if child >= 0:
                continue
            leaf = np.int64(~child)
            if leaf >= n_blocks:
                other = leaf - n_blocks
                break
            block = blocks + leaf * BLOCK_BYTES
            mask = hit_triangles(block, ox, oy, oz, dx, dy, dz, tmin, tmax, scratch)
            while mask != 0:
                lane = count_trailing_zeros(mask)
                mask &= mask - 1
                t = stack_get_f4(scratch, lane)
                if t < tmax:
                    prim = load_i4(block + ID_OFFSET, lane)
                    tu, tv = stack_get_f4(scratch, LANES + lane), stack_get_f4(scratch, 2 * LANES + lane)
                    if triangle_counts(leaves, prim, tu, tv):
                        tmax, hit, u, v = t, prim, tu, tv
        if other < 0:
            return tmax, hit, u, v
        t, prim, tu, tv = meet_leaf(leaves, other, ox, oy, oz, dx, dy, dz, tmin, tmax)
        if t < tmax:
            tmax, hit, u, v = t, prim, tu, tv


# A function can't call itself with other types, so that the scene's tree and the groups' have one each.
_closest_in_tree, _closest_in_scene = device(_closest), device(_closest)


@kernel
def cast_closest(scene, origins, directions, tmin, tmax, t, primitive, uv):
    """`closest_hit` of n rays: origins, directions (n, 3), tmin, tmax (n,) float32 in; t (n,), primitive (n,) int32,
    uv (n, 2) out."""
    for i in range(len(origins)):
        t[i], primitive[i], uv[i, 0], uv[i, 1] = closest_hit(
            scene, origins[i, 0], origins[i, 1], origins[i, 2],
            directions[i, 0], directions[i, 1], directions[i, 2], tmin[i], tmax[i],
        )  # fmt: skip
