"""How kernels see the scene: one record of addresses, lengths and a few numbers, and accessors that read through it.

A record by reference is faster than passing twenty arrays, and compiles once. `pmviewer.scene.flatten` fills it and
keeps the arrays alive.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bvh import BVH_FIELDS
from pmviewer.kernels.jit import device
from pmviewer.kernels.memory import load_f4, load_i4

_f4 = np.float32

SCENE_DTYPE = np.dtype(
    [
        *BVH_FIELDS,
        ("vertices", "i8"),  # float32 (n_triangles, 9)
        ("normals", "i8"),  # float32 (n_triangles, 9), or 0 when every triangle is flat
        ("prim_material", "i8"),  # int32 per primitive: triangles, then quadrics
        ("prim_light", "i8"),  # int32 per primitive, -1 for no light
        ("materials", "i8"),  # float32 (n_materials, MATERIAL_COLUMNS)
        ("lights", "i8"),  # float32 (n_lights, LIGHT_COLUMNS)
        ("light_cdf", "i8"),  # float32 (n_lights + 1): distribution over power
        ("light_triangles", "i8"),  # int32: triangles of mesh lights
        ("light_triangle_cdf", "i8"),  # float32, per mesh light: cumulative area up to and including the triangle
        ("n_lights", "i8"),
        ("environment", "i8"),  # index of the environment light, -1 without one
        ("center_x", "f4"),
        ("center_y", "f4"),
        ("center_z", "f4"),
        ("radius", "f4"),  # of the bounding sphere
    ],
    align=True,
)

# Columns are numpy integers: numba would compile an accessor anew for each literal one.
_columns = np.arange(20, dtype=np.int64)

DIFFUSE, CONDUCTOR, DIELECTRIC = 0, 1, 2
MATERIAL_COLUMNS = 12
M_KIND, M_TWO_SIDED, M_ETA, M_REFLECTANCE, M_TRANSMITTANCE = _columns[[0, 1, 2, 4, 8]]

PARALLELOGRAM, DISK, SPHERE, CYLINDER, MESH, POINT, ENVIRONMENT = range(7)
LIGHT_COLUMNS = 20
L_KIND, L_RADIANCE, L_A, L_B, L_C = _columns[[0, 1, 4, 7, 10]]
L_AREA, L_RADIUS, L_LENGTH, L_FLIP, L_FIRST, L_COUNT = _columns[13:19]


@device
def load3(address, index):
    """Three consecutive float32 as a vector."""
    return load_f4(address, index), load_f4(address, index + 1), load_f4(address, index + 2)


@device
def material_of(scene, prim):
    return np.int64(load_i4(scene.prim_material, np.int64(prim)))


@device
def light_of(scene, prim):
    return np.int64(load_i4(scene.prim_light, np.int64(prim)))


@device
def material_kind(scene, material):
    return np.int32(load_f4(scene.materials, material * MATERIAL_COLUMNS + M_KIND))


@device
def material_two_sided(scene, material):
    return load_f4(scene.materials, material * MATERIAL_COLUMNS + M_TWO_SIDED) != _f4(0.0)


@device
def material_eta(scene, material):
    return load_f4(scene.materials, material * MATERIAL_COLUMNS + M_ETA)


@device
def reflectance(scene, material):
    return load3(scene.materials, material * MATERIAL_COLUMNS + M_REFLECTANCE)


@device
def transmittance(scene, material):
    return load3(scene.materials, material * MATERIAL_COLUMNS + M_TRANSMITTANCE)


@device
def light_number(scene, light, column):
    return load_f4(scene.lights, light * LIGHT_COLUMNS + column)


@device
def light_vector(scene, light, column):
    return load3(scene.lights, light * LIGHT_COLUMNS + column)
