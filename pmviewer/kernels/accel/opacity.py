"""Surfaces that rays pass in part: which hits count.

A ray meets a surface with the probability of its opacity there and passes straight on otherwise. A hash of the ray and
of the primitive decides, so that casts need no random numbers: the same ray always passes the same surfaces, and for
any others the decisions are independent (tests/kernels/test_opacity.py). The decision is taken inside the traversal,
for every hit that is nearer than the nearest so far: however many layers there are, none is met twice, and coincident
ones are passed one by one.

Scenes without such surfaces have records without `passable` and compile none of this.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.accel.instance import I_TO_LOCAL, find_instance, has_instances, stored_of, transform_point
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, is_a, specialised
from pmviewer.kernels.dimensions import OPACITY_SALT
from pmviewer.kernels.memory import bits_of_float, load_f4, load_i4
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.kernels.scene import M_ALPHA_CUTOFF, M_OPACITY, M_OPACITY_MAP, MATERIAL_COLUMNS, material_of
from pmviewer.kernels.textures.texture import texture_value
from pmviewer.kernels.textures.uv import stored_uv
from pmviewer.kernels.vector import scale

_f4 = np.float32
_u4 = np.uint32
_i8 = np.int64

NEARLY_ONE = _f4(1.0 - 1e-6)
"""What a white texture's luminance may round to: from here on nothing passes."""


LEAST = _f4(1e-3)
"""Opacity by which a ray that is stopped counts at most: fewer would be as bright as that makes up for."""


class Veil(NamedTuple):
    """What a tree's traversal knows of its surfaces when some let rays pass.

    quadrics, n_triangles: as without; scene: the record; key: of the ray (`ray_key`); first_triangle, first_quadric:
    which stored ones are the tree's first; base: id of its first primitive.
    """

    quadrics: Any
    n_triangles: Any
    scene: Any
    key: Any
    first_triangle: Any
    first_quadric: Any
    base: Any


class VeiledInstances(NamedTuple):
    """The same for the tree over a scene's own surfaces and its instances."""

    scene: Any
    key: Any


def lets_pass(scene: Any) -> bool:
    """Does a scene's record, or its type, hold surfaces that rays pass?"""
    return has(scene, "passable")


@device
def ray_key(ox, oy, oz, dx, dy, dz):
    """A number that tells rays apart: 32 well-mixed bits of origin and direction."""
    start = hash3(bits_of_float(ox), bits_of_float(oy), bits_of_float(oz))
    return hash3(_u4(start ^ bits_of_float(dx)), bits_of_float(dy), bits_of_float(dz))


@specialised
def opacity_of(scene, material, stored, b1, b2, p):
    """Opacity of the stored primitive's material at a triangle's barycentric coordinates, or at a quadric's point p, in
    the coordinates that the primitive is stored in."""
    if not has(scene, "textures"):
        return lambda scene, material, stored, b1, b2, p: load_f4(
            scene.materials, material * MATERIAL_COLUMNS + M_OPACITY
        )

    def textured(scene, material, stored, b1, b2, p):
        row = material * MATERIAL_COLUMNS
        value = load_f4(scene.materials, row + M_OPACITY)
        texture = _i8(load_f4(scene.materials, row + M_OPACITY_MAP))
        if texture < 0:
            return value
        u, v = stored_uv(scene, stored, b1, b2, p)
        value = texture_value(scene, texture, u, v)
        cutoff = load_f4(scene.materials, row + M_ALPHA_CUTOFF)
        if cutoff >= _f4(0.0):  # after the texture's filter, so that edges stay sharp between its texels
            value = _f4(1.0) if value >= cutoff else _f4(0.0)
        return value

    return textured


@specialised
def over_opacity(scene, prim, b1, b2, p, value):
    """A colour over the opacity of the primitive that was hit at p: of a ray's radiance or power, where as many rays
    as the opacity says stop, so that the mean is that of all."""
    if not lets_pass(scene):
        return lambda scene, prim, b1, b2, p, value: value

    def divided(scene, prim, b1, b2, p, value):
        stored, q = as_stored(scene, prim, p)
        opacity = opacity_of(scene, material_of(scene, prim), stored, b1, b2, q)
        return scale(value, _f4(1.0) / max(opacity, LEAST))

    return divided


@specialised
def as_stored(scene, prim, p):
    """The stored primitive of a hit, and its point in the coordinates that this is stored in."""
    if not has_instances(scene):
        return lambda scene, prim, p: (_i8(prim), p)

    def through(scene, prim, p):
        if prim < scene.n_stored:
            return _i8(prim), p
        i = find_instance(scene, prim)
        x, y, z = transform_point(scene, i, I_TO_LOCAL, np.float64(p[0]), np.float64(p[1]), np.float64(p[2]))
        return stored_of(scene, i, prim), (_f4(x), _f4(y), _f4(z))

    return through


@device
def hit_counts(scene, key, ident, stored, b1, b2, px, py, pz):
    """Whether a ray is stopped by the primitive of id `ident` there."""
    material = _i8(load_i4(scene.prim_material, stored))
    opacity = opacity_of(scene, material, stored, b1, b2, (px, py, pz))
    if opacity >= NEARLY_ONE:
        return True
    return unit_float(hash3(key, _u4(ident), _u4(OPACITY_SALT))) < opacity


@specialised
def triangle_counts(leaves, triangle, u, v):
    """Whether a tree's triangle stops the ray at its barycentric coordinates (u, v)."""
    if is_a(leaves, Veil):

        def of_tree(leaves, triangle, u, v):
            zero = _f4(0.0)
            stored = leaves.first_triangle + _i8(triangle)
            ident = leaves.base + _i8(triangle)
            return hit_counts(leaves.scene, leaves.key, ident, stored, u, v, zero, zero, zero)

        return of_tree
    if is_a(leaves, VeiledInstances):

        def own(leaves, triangle, u, v):
            zero = _f4(0.0)
            stored = _i8(triangle)
            return hit_counts(leaves.scene, leaves.key, stored, stored, u, v, zero, zero, zero)

        return own
    return lambda leaves, triangle, u, v: True
