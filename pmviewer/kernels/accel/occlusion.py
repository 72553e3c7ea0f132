"""Casting rays: whether anything is in between. As `pmviewer.kernels.accel.raycast`, without asking what."""

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
    count_trailing_zeros,
    load_i4,
    stack_get_f4,
    stack_get_i4,
    stack_i4,
    stack_put_i4,
)

_0 = np.int64(0)


@device
def _occluded_in_leaf(scene, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax):
    if leaf < scene.n_own_quadrics:
        address = scene.bvh_quadrics + leaf * QUADRIC_BYTES
        return intersect_quadric(address, ox, oy, oz, dx, dy, dz, tmin, tmax) < tmax
    i = leaf - scene.n_own_quadrics
    group = group_of(scene, i)
    px, py, pz, vx, vy, vz, start = local_ray(scene, i, ox, oy, oz, dx, dy, dz)
    leaves = (group_number(scene, group, G_QUADRICS), group_number(scene, group, G_N_TRIANGLES))
    nodes, blocks, n_blocks = group_tree(scene, group)
    return _occluded_in_tree(leaves, nodes, blocks, n_blocks, px, py, pz, vx, vy, vz, tmin - start, tmax - start)


@device
def _occluded_in_veiled_leaf(veiled, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax):
    scene, key = veiled.scene, veiled.key
    if leaf < scene.n_own_quadrics:
        quadric = own_quadric(scene, leaf)
        return closest_quadric(scene, key, quadric, ox, oy, oz, dx, dy, dz, tmin, tmax) < tmax
    i = leaf - scene.n_own_quadrics
    group, base = group_of(scene, i), np.int64(instance_number(scene, i, I_BASE))
    px, py, pz, vx, vy, vz, start = local_ray(scene, i, ox, oy, oz, dx, dy, dz)
    veil = group_veil(scene, key, group, base)
    nodes, blocks, n_blocks = group_tree(scene, group)
    return _occluded_in_tree(veil, nodes, blocks, n_blocks, px, py, pz, vx, vy, vz, tmin - start, tmax - start)


@specialised
def leaf_occludes(leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax):
    """Whether the ray meets what is no block."""
    if is_a(leaves, VeiledInstances):
        return lambda leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax: _occluded_in_veiled_leaf(
            leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax
        )
    if is_a(leaves, Veil):
        return lambda leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax: (
            closest_veiled_quadric(leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax) < tmax
        )
    if has_instances(leaves):
        return lambda leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax: _occluded_in_leaf(
            leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax
        )
    return lambda leaves, leaf, ox, oy, oz, dx, dy, dz, tmin, tmax: (
        intersect_quadric(leaves[0] + leaf * QUADRIC_BYTES, ox, oy, oz, dx, dy, dz, tmin, tmax) < tmax
    )


@specialised
def block_occludes(leaves, block, mask, scratch):
    """Whether one of the triangles that `hit_triangles` found in a block stops the ray."""
    if not (is_a(leaves, Veil) or is_a(leaves, VeiledInstances)):
        return lambda leaves, block, mask, scratch: mask != 0

    def veiled(leaves, block, mask, scratch):
        while mask != 0:
            lane = count_trailing_zeros(mask)
            mask &= mask - 1
            u, v = stack_get_f4(scratch, LANES + lane), stack_get_f4(scratch, 2 * LANES + lane)
            if triangle_counts(leaves, load_i4(block + ID_OFFSET, lane), u, v):
                return True
        return False

    return veiled


@specialised
def occluded(scene, ox, oy, oz, dx, dy, dz, tmin, tmax):
    """Whether the ray meets anything; False for a ray with a non-finite number."""
    if lets_pass(scene) and has_instances(scene):
        return lambda scene, ox, oy, oz, dx, dy, dz, tmin, tmax: _occluded_in_scene(
            VeiledInstances(scene, ray_key(ox, oy, oz, dx, dy, dz)), scene.bvh_nodes, scene.bvh_blocks,
            scene.bvh_n_blocks, ox, oy, oz, dx, dy, dz, tmin, tmax,
        )  # fmt: skip
    if lets_pass(scene):
        return lambda scene, ox, oy, oz, dx, dy, dz, tmin, tmax: _occluded_in_tree(
            Veil(scene.bvh_quadrics, scene.n_triangles, scene, ray_key(ox, oy, oz, dx, dy, dz), _0, _0, _0),
            scene.bvh_nodes, scene.bvh_blocks, scene.bvh_n_blocks, ox, oy, oz, dx, dy, dz, tmin, tmax,
        )  # fmt: skip
    if has_instances(scene):
        return lambda scene, ox, oy, oz, dx, dy, dz, tmin, tmax: _occluded_in_scene(
            scene, scene.bvh_nodes, scene.bvh_blocks, scene.bvh_n_blocks, ox, oy, oz, dx, dy, dz, tmin, tmax
        )
    return lambda scene, ox, oy, oz, dx, dy, dz, tmin, tmax: _occluded_in_tree(
        (scene.bvh_quadrics, scene.n_triangles), scene.bvh_nodes, scene.bvh_blocks, scene.bvh_n_blocks,
        ox, oy, oz, dx, dy, dz, tmin, tmax,
    )  # fmt: skip


def _occluded(leaves, nodes, blocks, n_blocks, ox, oy, oz, dx, dy, dz, tmin, tmax):
    if not is_finite(ox, oy, oz, dx, dy, dz):
        return False
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
    stack_put_i4(stack, 0, np.int32(0))
    size = 1
    while True:
        other = np.int64(-1)
        while size > 0:
            size -= 1
            child = stack_get_i4(stack, size)
            while child >= 0:
                node = nodes + np.int64(child) * NODE_BYTES
                mask = hit_boxes(node, nears, origin, inverse, tmin, tmax, scratch)
                if mask == 0:
                    break
                children = node + CHILD_OFFSET
                child = load_i4(children, count_trailing_zeros(mask))
                mask &= mask - 1
                while mask != 0:
                    stack_put_i4(stack, size, load_i4(children, count_trailing_zeros(mask)))
                    mask &= mask - 1
                    size += 1
            if child >= 0:
                continue
            leaf = np.int64(~child)
            if leaf >= n_blocks:
                other = leaf - n_blocks
                break
            block = blocks + leaf * BLOCK_BYTES
            mask = hit_triangles(block, ox, oy, oz, dx, dy, dz, tmin, tmax, scratch)
            if block_occludes(leaves, block, mask, scratch):
                return True
        if other < 0:
            return False
        if leaf_occludes(leaves, other, ox, oy, oz, dx, dy, dz, tmin, tmax):
            return True


_occluded_in_tree, _occluded_in_scene = device(_occluded), device(_occluded)


@kernel
def cast_occluded(scene, origins, directions, tmin, tmax, hit):
    """`occluded` of n rays into hit (n,) bool; the rest as in `cast_closest`."""
    for i in range(len(origins)):
        hit[i] = occluded(
            scene, origins[i, 0], origins[i, 1], origins[i, 2],
            directions[i, 0], directions[i, 1], directions[i, 2], tmin[i], tmax[i],
        )  # fmt: skip
