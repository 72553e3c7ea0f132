"""How kernels see the scene: one record of addresses, lengths and a few numbers, and accessors that read through it.

A record by reference is faster than passing twenty arrays, and compiles once. `pmviewer.scene.arrays.flatten` fills it
and keeps the arrays alive.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.bvh import BVH_FIELDS
from pmviewer.kernels.accel.instance import INSTANCE_FIELDS, is_own, stored_prim
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4, load_i4

_f4 = np.float32

_FIELDS = [
    *BVH_FIELDS,
    ("vertices", "i8"),  # float32 (n_triangles, 9)
    ("normals", "i8"),  # float32 (n_triangles, 9), or 0 when every triangle is flat
    ("prim_material", "i8"),  # int32 per primitive: triangles, then quadrics
    ("prim_light", "i8"),  # int32 per primitive, -1 for no light
    ("materials", "i8"),  # float32 (n_materials, MATERIAL_COLUMNS)
    ("lights", "i8"),  # float32 (n_lights, LIGHT_COLUMNS)
    ("light_cdf", "i8"),  # float32 (n_lights + 1): distribution over power
    ("light_places", "i8"),  # float32 (n_lights, PLACE_COLUMNS): where lights are
    ("light_triangles", "i8"),  # int32: triangles of mesh lights
    ("light_triangle_cdf", "i8"),  # float32, per mesh light: cumulative area up to and including the triangle
    ("n_lights", "i8"),
    ("environment", "i8"),  # index of the environment light, -1 without one
    ("center_x", "f4"),
    ("center_y", "f4"),
    ("center_z", "f4"),
    ("radius", "f4"),  # of the bounding sphere
    ("lit_low_x", "f4"),  # box around the surfaces that emit: infinite with an environment, low > high without any
    ("lit_low_y", "f4"),
    ("lit_low_z", "f4"),
    ("lit_high_x", "f4"),
    ("lit_high_y", "f4"),
    ("lit_high_z", "f4"),
    ("lit_spread", "f4"),  # the largest area of a light over its probability
]

BSDF_FIELDS: list[tuple[str, str]] = [
    ("bsdfs", "i8"),  # 1; its presence says that materials are not all diffuse, mirror or smooth glass
    ("bsdf_tables", "i8"),  # float32 (n_tables, BSDF_TABLE_SIZE), see `pmviewer.scene.bsdf_tables`
]
PRINCIPLED_FIELDS: list[tuple[str, str]] = [("principled", "i8")]
"""1; its presence says that there are principled materials."""
BLEND_FIELDS: list[tuple[str, str]] = [("blends", "i8")]
"""1; its presence says that there are blends of materials."""
LIGHT_FIELDS: list[tuple[str, str]] = [
    ("more_lights", "i8"),  # 1; its presence says that there are spot, directional or image environment lights
    ("sky_texels", "i8"),  # float32 (sky_height, sky_width, 3): radiance of the image environment
    ("sky_rows", "i8"),  # float32 (sky_height − 1,): its distribution, see `pmviewer.kernels.lights.environment`
    ("sky_cells", "i8"),  # float32 (sky_height − 1, sky_width)
    ("sky_guide", "i8"),  # int32 (sky_height − 1, sky_steps): where in a row of cells to look for a number
    ("sky_steps", "i8"),
    ("sky_facings", "i8"),  # float32: how surfaces sample it, see `pmviewer.kernels.lights.sky_facing`; 0 without one
    ("sky_frame", "i8"),  # float32 (4,): where cubes begin, and how many there are to a unit of length; 0 without them
    ("sky_cubes", "i8"),  # int32 (CUBES, CUBES, CUBES) by z, y, x: number of a cube's tables, −1 for none
    ("sky_seen", "i8"),  # float32: how surfaces in cubes sample it, see `pmviewer.kernels.lights.sky_seen`
    ("sky_width", "i8"),
    ("sky_height", "i8"),
]
PROJECTOR_FIELDS: list[tuple[str, str]] = [
    ("projectors", "i8"),  # int64 (n_projectors, PROJECTOR_COLUMNS): first of its numbers, columns, rows
    ("projector_numbers", "i8"),  # float32: pictures and their tables, see `pmviewer.kernels.lights.projector`
]
"""Of scenes with projectors; they have LIGHT_FIELDS, too."""
TEXTURE_FIELDS: list[tuple[str, str]] = [
    ("uvs", "i8"),  # float32 (n_triangles, 6): corners' texture coordinates; NaN for a triangle that has none
    ("quadric_frames", "i8"),  # float32 (n_quadrics, 9): unit axes that a quadric's texture coordinates refer to
    ("textures", "i8"),  # float32 (n_textures, TEXTURE_COLUMNS)
    ("texel_starts", "i8"),  # int64 (n_textures,): a bitmap's first number in `texels`
    ("texels", "i8"),  # float32, all bitmaps row by row
    ("light_textures", "i8"),  # int64 (n_lights, LIGHT_TEXTURE_COLUMNS), or 0 when no light is textured
    ("light_frames", "i8"),  # float32 (n_lights, 9): see `pmviewer.kernels.lights.textured_light`
    ("light_tables", "i8"),  # float32: distributions over textured lights
]
"""Of scenes with textures, or with materials that have a direction."""
COLOUR_FIELDS: list[tuple[str, str]] = [
    ("colours", "i8"),  # float32 (n_triangles, 9): RGB at the corners
]
"""Of scenes with colours at vertices; they have TEXTURE_FIELDS and BSDF_FIELDS, too."""
OPACITY_FIELDS: list[tuple[str, str]] = [
    ("passable", "i8"),  # 1; its presence says that rays pass some surfaces, see `pmviewer.kernels.accel.opacity`
]

THIN_FIELDS: list[tuple[str, str]] = [
    ("thin", "i8"),  # the rule of panes that go by the setting, THIN_EXACT to THIN_REFLECTING
]
"""Of scenes where some rays pass panes of glass straight, see `pmviewer.kernels.bsdf.thin_glass`."""

MEDIA_FIELDS: list[tuple[str, str]] = [
    ("media", "i8"),  # float32 (n_media, MEDIUM_COLUMNS), see `pmviewer.kernels.media.medium`
    ("prim_media", "i8"),  # int32 (n_prims, 2): the media inside and outside of each primitive, SAME where none ends
    ("emits", "i8"),  # how many of them emit light
    ("glows", "i8"),  # float64 (emits, GLOW_COLUMNS), see `pmviewer.kernels.media.glow`
    ("glow_cdf", "i8"),  # float64: cumulative shares of the numbers of their lattices
    ("light_media", "i8"),  # int32 (n_lights,): the medium that photons of a light start in
]
"""Of scenes with participating media."""
GRID_FIELDS: list[tuple[str, str]] = [
    ("voxels", "i8"),  # float32: numbers of all lattices, see `pmviewer.kernels.media.lattice`
    ("grid_blocks", "i8"),  # float32: the greatest of each block of cells
    ("grid_frames", "i8"),  # float64 (n_grids, GRID_FRAME)
    ("grid_sizes", "i8"),  # int64 (n_grids, GRID_SIZES)
    ("medium_grids", "i8"),  # int32 (n_media, GRID_NUMBERS): lattices of extinction, albedo, emission, -1 for none
]
"""Of scenes with media whose numbers vary in space; they have MEDIA_FIELDS, too."""

DISPERSION_FIELDS: list[tuple[str, str]] = [
    ("glasses", "i8"),  # float32 (n_glasses + 1, SPECTRUM_NODES): relative indices over the spectrum, row 0 unused
    ("spectrum", "i8"),  # float32 (SPECTRUM_NODES, SPECTRUM_COLUMNS): wavelength in nm, and its colour
]
"""Of scenes with dispersive glass, see `pmviewer.kernels.bsdf.dispersion`."""


def scene_dtype(
    bsdfs: bool = False,
    lights: bool = False,
    instances: bool = False,
    textures: bool = False,
    colours: bool = False,
    opacity: bool = False,
    principled: bool = False,
    blends: bool = False,
    media: bool = False,
    dispersion: bool = False,
    grids: bool = False,
    projectors: bool = False,
) -> np.dtype:
    """The record of a scene with or without these features.

    Kernels are compiled for the record's type, so that simple scenes neither run nor compile what they don't use.
    """
    extra = [
        *(PRINCIPLED_FIELDS if principled else []),
        *(BLEND_FIELDS if blends else []),
        *(BSDF_FIELDS if bsdfs else []),
        *(LIGHT_FIELDS if lights else []),
        *(PROJECTOR_FIELDS if projectors else []),
        *(TEXTURE_FIELDS if textures else []),
        *(INSTANCE_FIELDS if instances else []),
        *(COLOUR_FIELDS if colours else []),
        *(OPACITY_FIELDS if opacity else []),
        *(MEDIA_FIELDS if media else []),
        *(DISPERSION_FIELDS if dispersion else []),
        *(GRID_FIELDS if grids else []),
    ]
    # In front, since numba warns where one record begins like another.
    return np.dtype([*extra, *_FIELDS], align=True)


def thin_dtype(of_record: np.dtype) -> np.dtype:
    """The type of such a record with THIN_FIELDS."""
    return np.dtype([*THIN_FIELDS, *((name, of_record[name].str) for name in of_record.names or ())], align=True)


SCENE_DTYPE = scene_dtype()
"""Of a scene of diffuse surfaces, mirrors and smooth glass under uniform area, point and environment lights."""

# Columns are numpy integers: numba would compile an accessor anew for each literal one.
_columns = np.arange(48, dtype=np.int64)

GGX, BECKMANN = 0, 1
MATERIAL_COLUMNS = 48
M_KIND, M_TWO_SIDED, M_ETA, M_REFLECTANCE, M_TRANSMITTANCE = _columns[[0, 1, 2, 4, 8]]
M_ALPHA_X, M_ALPHA_Y, M_ETA_RGB, M_NONLINEAR, M_K_RGB, M_DISTRIBUTION = _columns[[7, 11, 12, 15, 16, 19]]
M_SPECULAR, M_TABLE, M_INNER, M_MAPPED = _columns[[20, 23, 31, 3]]
"""M_ETA_RGB, M_K_RGB: complex index of a conductor. M_SPECULAR: colour of a coat or of the glossy lobe; for a
dielectric its absorption per unit length. M_TABLE: row of `bsdf_tables`. M_INNER: diffuse reflectance of a coat from
below. M_MAPPED: 0 without bump and normal maps, MIRRORED_MAPS with `Material.mirrored_maps`, else 1."""
MIRRORED_MAPS = 2
M_REFLECTANCE_MAP, M_SPECULAR_MAP, M_ALPHA_MAP, M_NORMAL_MAP, M_BUMP_MAP, M_BUMP_SCALE = _columns[24:30]
M_TRANSMITTANCE_MAP = _columns[30]
"""The maps are texture numbers, -1 for none."""
M_OPACITY, M_OPACITY_MAP, M_ALPHA_CUTOFF, M_COLOURED = _columns[44:48]
"""M_ALPHA_CUTOFF: −1 for none. M_COLOURED: whether colours at vertices multiply the reflectance."""
M_METALLIC, M_SPEC_TRANS, M_SPEC_TINT, M_SHEEN, M_SHEEN_TINT, M_FLATNESS, M_CLEARCOAT, M_COAT_ALPHA = _columns[32:40]
"""Of a principled material; M_SPECULAR is the absorption inside."""
M_PART_0, M_PART_1, M_WEIGHT, M_STORES_FRONT, M_STORES_BACK, M_FOLLOWS_FRONT, M_FOLLOWS_BACK = _columns[32:39]
"""Of a blend: the rows of its parts, the share of the second, and by side the roughness up to which some part has
STORED lobes, and that above which one has FOLLOWED lobes that are no deltas. M_SPECULAR is the absorption inside."""
BY_SIDE = 2.0
"""M_WEIGHT of a blend whose first part is the front and whose second is the back."""
M_THIN = _columns[42]
THIN_EXACT, THIN_IGNORED, THIN_TINTED, THIN_REFLECTING, THIN_BY_SETTING = range(5)
"""What M_THIN may be, see `pmviewer.kernels.bsdf.thin_glass`."""
M_METALLIC_MAP, M_WEIGHT_MAP = _columns[40:42]
M_ACROSS_MAP = M_METALLIC_MAP
"""Of other than principled materials: texture of the roughness across the tangent, M_ALPHA_MAP being that along it."""
M_GLASS = _columns[43]
"""Row of `glasses`, 0 where the index is the same for all wavelengths. Then M_ETA_RGB are the channels' mean indices.
"""
BSDF_TABLE_SIZE = 64

PARALLELOGRAM, DISK, SPHERE, CYLINDER, MESH, POINT, ENVIRONMENT, SPOT, DIRECTIONAL, IMAGE, GLOW, PROJECTOR = range(12)
"""Kinds of lights; SPOT, DIRECTIONAL and IMAGE are in scenes whose record has LIGHT_FIELDS alone, GLOW (a medium that
emits, its row in `glows` being L_FIRST) where it has MEDIA_FIELDS, PROJECTOR where it has PROJECTOR_FIELDS."""
LIGHT_COLUMNS = 20
L_KIND, L_RADIANCE, L_A, L_B, L_C = _columns[[0, 1, 4, 7, 10]]
L_AREA, L_RADIUS, L_LENGTH, L_FLIP, L_FIRST, L_COUNT = _columns[13:19]
L_CUTOFF, L_BEAM = _columns[[10, 11]]
"""Half angles in radians, of a spot. Of a projector L_A, L_B and L_C are its place and two axes, L_FLIP −1 where the
third is −L_B × L_C; L_RADIUS and L_LENGTH half the picture's width and height on the plane at distance 1, L_AREA the
luminance of the power, L_FIRST its row of `projectors`."""
PROJECTOR_COLUMNS = 3
PLACE_COLUMNS = 5
P_RADIUS, P_AREA = _columns[[3, 4]]
"""Of a light's place after the centre, see `pmviewer.scene.arrays.light_places`."""

BITMAP, CHECKERBOARD = 0, 1
REPEAT, MIRROR, CLAMP = 0, 1, 2
TEXTURE_COLUMNS = 20
T_KIND, T_WIDTH, T_HEIGHT, T_CHANNELS, T_WRAP, T_NEAREST, T_TO_UV = _columns[:7]
T_COLOR0, T_COLOR1 = _columns[[12, 15]]
"""`T_TO_UV`: six numbers a … f with u' = a u + b v + c, v' = d u + e v + f. `T_COLOR0`: a bitmap's scale."""
LIGHT_TEXTURE_COLUMNS = 4
LT_TEXTURE, LT_FIRST, LT_ROWS, LT_COLUMNS = _columns[:4]


@device
def load3(address, index):
    """Three consecutive float32 as a vector."""
    return load_f4(address, index), load_f4(address, index + 1), load_f4(address, index + 2)


@device
def material_of(scene, prim):
    """Number of the material; for a primitive of an instance, that of the stored one."""
    return np.int64(load_i4(scene.prim_material, stored_prim(scene, prim)))


@device
def light_of(scene, prim):
    """Number of the light that the primitive is, −1 for none; primitives of instances are none."""
    if not is_own(scene, prim):
        return np.int64(-1)
    return np.int64(load_i4(scene.prim_light, np.int64(prim)))


@device
def material_kind(scene, material):
    """One of the numbers of `pmviewer.kernels.bsdf.kinds`."""
    return np.int32(load_f4(scene.materials, material * MATERIAL_COLUMNS + M_KIND))


@device
def material_two_sided(scene, material):
    """Whether the back scatters as the front does; else it is black."""
    return load_f4(scene.materials, material * MATERIAL_COLUMNS + M_TWO_SIDED) != _f4(0.0)


@device
def material_eta(scene, material):
    """Index of the inside relative to the outside."""
    return load_f4(scene.materials, material * MATERIAL_COLUMNS + M_ETA)


@device
def reflectance(scene, material):
    """(red, green, blue) without textures, see `pmviewer.kernels.bsdf.material_textures`."""
    return load3(scene.materials, material * MATERIAL_COLUMNS + M_REFLECTANCE)


@device
def transmittance(scene, material):
    """(red, green, blue) of light that goes through glass."""
    return load3(scene.materials, material * MATERIAL_COLUMNS + M_TRANSMITTANCE)


@device
def light_number(scene, light, column):
    """A float32 of a light's row; `column` is one of the L_ names."""
    return load_f4(scene.lights, light * LIGHT_COLUMNS + column)


@device
def light_vector(scene, light, column):
    """Three float32 of a light's row from `column` on."""
    return load3(scene.lights, light * LIGHT_COLUMNS + column)
