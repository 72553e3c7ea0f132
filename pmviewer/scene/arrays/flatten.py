"""From a scene's description to the arrays and the record that kernels read (`pmviewer.kernels.scene`).

Primitives are numbered triangles first, then quadrics (spheres, cylinders, disks).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels import scene as K
from pmviewer.kernels.accel.bvh import Bvh, build
from pmviewer.kernels.lights.in_media import shares_in_media
from pmviewer.progress import stage
from pmviewer.scene.arrays.covered_emission import with_covered_emission
from pmviewer.scene.arrays.flatten_textures import (
    TextureTable,
    coordinates,
    corner_colours,
    light_arrays,
    needs_tangents,
)
from pmviewer.scene.arrays.glows import PHOTONS, Glow, glow_arrays, glows_of, weaken
from pmviewer.scene.arrays.grids import grid_arrays, has_grids, numbers_of_grids
from pmviewer.scene.arrays.instances import build_instanced, instance_bounds
from pmviewer.scene.arrays.light_table import LightTable
from pmviewer.scene.arrays.material_row import MaterialTable, is_rich, material_table, used_materials
from pmviewer.scene.arrays.media import has_media, light_media, media_of_prims, medium_rows
from pmviewer.scene.arrays.shape_bounds import box_around, box_to_be_met
from pmviewer.scene.arrays.stored_geometry import StoredGeometry, same_surfaces, stored_geometry
from pmviewer.scene.arrays.textured_emission import Emission, textured_lights
from pmviewer.scene.arrays.tree_ahead import TreeAhead
from pmviewer.scene.description import LUMINANCE, Scene
from pmviewer.scene.grid import Grid
from pmviewer.scene.spectrum import spectrum

Float = NDArray[np.float32]


@dataclass(frozen=True)
class FlatScene:
    """A scene's `arrays` by name. `record` is the one-element record array for kernels; the other fields keep its
    memory alive.

    `light_power` is (n_lights, 3) float64 in watts, in the order of the light table; `light_names` and
    the table's rows `lights` (n_lights, LIGHT_COLUMNS) likewise; `prim_light` is each stored primitive's light, −1 for
    none. `light_corners` (n, 3, 3) are the triangles of mesh
    lights.
    """

    record: NDArray[np.void]
    bvh: Bvh
    arrays: Mapping[str, NDArray]
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
    stored: StoredGeometry = field(repr=False)
    n_instances: int = 0
    n_elements: int = 0
    """Triangles and quadrics that rays can meet, those of instances counted as often as they are shown."""
    trees: tuple[Bvh, ...] = field(default=(), repr=False)
    """Of the instanced groups."""
    shape_of_prim: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32), repr=False)
    """The shape of each stored primitive."""
    said: tuple[str, ...] = ()
    """Sentences about what can't be shown right."""

    @property
    def has_media(self) -> bool:
        """Whether there are participating media."""
        return "media" in (self.record.dtype.names or ())

    @property
    def disperses(self) -> bool:
        """Whether there is glass that splits light into colours."""
        return "glasses" in (self.record.dtype.names or ())

    @property
    def delta_lights(self) -> bool:
        """Whether there are lights that no ray can meet."""
        return bool(np.isin(self.lights[:, K.L_KIND], (K.POINT, K.SPOT, K.DIRECTIONAL, K.PROJECTOR)).any())

    @property
    def total_luminance(self) -> float:
        """Luminance of the power of all lights, in watts: what photon powers are measured in while they travel."""
        return float((self.light_power @ LUMINANCE).sum())


def bounding_sphere(scene: Scene) -> tuple[NDArray[np.float64], float]:
    """Centre and radius of the sphere around the bounding box of all shapes and instances."""
    low, high = box_around(scene.shapes)
    if scene.instances:
        more_low, more_high = instance_bounds(scene.instances)
        low, high = np.minimum(low, more_low), np.maximum(high, more_high)
    center = (low + high) / 2
    return center, max(float(np.linalg.norm(high - low)) / 2, 1e-30)


LIT_BOX = ("lit_low_x", "lit_low_y", "lit_low_z", "lit_high_x", "lit_high_y", "lit_high_z")


def lit_box(scene: Scene, lights: LightTable, largest: float) -> tuple[float, ...]:
    """What a ray must meet to meet a light, by the record's LIT_BOX: rays into the sky meet an environment. Coordinates
    go up to `largest`."""
    if lights.environment >= 0:
        return (-np.inf,) * 3 + (np.inf,) * 3
    emit = (shape for shape, light in zip(scene.shapes, lights.of_shape, strict=True) if light >= 0)
    low, high = box_to_be_met(emit, largest)
    return (*low, *high)


def flatten(
    scene: Scene,
    on_type: Callable[[np.dtype], None] = lambda of_record: None,
    like: FlatScene | None = None,
    features_at_least: Collection[str] = (),
    ahead: TreeAhead | None = None,
) -> FlatScene:
    """Build arrays, acceleration structure and light table. `on_type` hears of what type the record will be, before the
    tree is built. The tree of `like` serves for the same surfaces. With `features_at_least` the record is that of
    a scene with those SURFACES, too: what isn't there is not met and changes nothing but which kernels run. `ahead` is
    the tree of the scene before it was completed, which is used if it fits.

    Raises SceneError when the scene has no surface or no light that emits.
    """
    known = like if like is not None and same_surfaces(like.owner, scene) else None
    if known is not None or ahead is None or not ahead.fits(scene):
        ahead = None
    stored = stored_geometry(scene, ahead) if known is None else replace(known.stored, shapes=scene.shapes)
    materials = material_table(scene)
    prim_material = np.array([s.material for s in stored.shapes], np.int32)[stored.shape_of_prim]
    center, radius = bounding_sphere(scene)
    glows = glows_of(scene) if has_media(scene) else ()
    lit, emissions = textured_lights(with_covered_emission(scene))
    lights = LightTable(lit, stored.vertices, stored.shape_of_prim, radius, glows)
    of_shape = np.concatenate([lights.of_shape, np.full(len(stored.shapes) - len(scene.shapes), -1)])
    prim_light = of_shape.astype(np.int32)[stored.shape_of_prim]
    features = {**_features(scene, materials, lights, bool(emissions)), **dict.fromkeys(features_at_least, True)}
    record = np.zeros(1, K.scene_dtype(**features))
    r = record[0]
    on_type(record.dtype)
    if known is None:
        stage(f"building the tree over {len(stored.vertices):,} triangles")
    if known is not None:
        bvh, shown = known.bvh, None
        bvh.store(r)
    elif stored.groups:
        bvh, shown = build_instanced(scene, stored.groups, stored.vertices, stored.quadrics, stored.shape_of_prim, r)
    else:
        bvh, shown = build(stored.vertices, stored.quadrics, started=ahead.begun() if ahead else None), None
        bvh.store(r)
    arrays: dict[str, NDArray] = {
        "vertices": stored.vertices,
        "prim_material": prim_material,
        "prim_light": prim_light,
        "materials": materials.rows,
        **lights.arrays(),
        **lights.sky_arrays(),
        **lights.projector_arrays(),
        **_shading_arrays(scene, features, stored, materials, lights, emissions),
        **(_media_arrays(scene, stored, glows) if features["media"] else {}),
        **(grid_arrays(scene.media, _more_grids(glows)) if features["grids"] else {}),
    }
    for name, array in arrays.items():
        arrays[name] = np.ascontiguousarray(array)
        r[name] = arrays[name].ctypes.data
    for feature, field_ in _FLAGS.items():
        if features[feature]:
            r[field_] = 1
    r["n_lights"], r["environment"] = len(lights.rows), lights.environment
    if lights.sky is not None:
        r["sky_height"], r["sky_width"] = lights.sky.pixels.shape[:2]
        r["sky_steps"] = arrays["sky_guide"].shape[1]
    r["center_x"], r["center_y"], r["center_z"], r["radius"] = *center, radius
    r["lit_spread"] = lights.spread
    for name, number in zip(LIT_BOX, lit_box(scene, lights, float(np.abs(center).max()) + radius), strict=True):
        r[name] = number
    said: list[str] = []
    if features["media"]:
        r["emits"] = len(glows)
        shares = np.ones(len(glows))
        shares_in_media(record, lights.first_glow, PHOTONS, shares)
        weaken(arrays["glows"], shares)
        lights.weaken_glows(shares)
        arrays["lights"][:], arrays["light_cdf"][:] = lights.rows, lights.cdf
        arrays["light_media"], said = light_media(record, lights.names, scene.camera.medium, arrays["glows"])
        r["light_media"] = arrays["light_media"].ctypes.data
    n_elements = shown.n_elements if shown else len(stored.vertices) + len(stored.quadrics)
    return FlatScene(
        record=record,
        bvh=bvh,
        arrays={**arrays, "quadrics": stored.quadrics, **(shown.arrays if shown else {})},
        light_power=lights.power,
        light_names=lights.names,
        lights=lights.rows,
        light_corners=stored.vertices[lights.triangles],
        prim_light=prim_light,
        center=center,
        radius=radius,
        n_triangles=len(stored.vertices),
        n_quadrics=len(stored.quadrics),
        owner=scene,
        stored=stored,
        n_instances=len(scene.instances),
        n_elements=n_elements,
        trees=shown.trees if shown else (),
        shape_of_prim=stored.shape_of_prim,
        said=tuple(said),
    )


SURFACES = ("bsdfs", "lights", "textures", "opacity", "principled", "blends")
"""All kinds of materials, textures and lights but projectors, by the names that `_features` has for them."""

_FLAGS = {
    "bsdfs": "bsdfs",
    "lights": "more_lights",
    "opacity": "passable",
    "principled": "principled",
    "blends": "blends",
}
"""Features whose field in the record has no other number to hold."""


def _features(scene: Scene, materials: MaterialTable, lights: LightTable, emits_textures: bool) -> dict[str, bool]:
    """What `pmviewer.kernels.scene.scene_dtype` is asked for."""
    rich, used = is_rich(scene), used_materials(scene)
    return {
        "bsdfs": rich,
        "lights": lights.more,
        "projectors": bool(lights.projectors),
        "instances": bool(scene.instances and scene.groups),
        "textures": emits_textures or (rich and needs_tangents(scene)),
        "colours": any(m.vertex_colours for m in used),
        "opacity": any(m.passable for m in used),
        "principled": "principled" in materials.kinds,
        "blends": "blend" in materials.kinds,
        "media": has_media(scene),
        "dispersion": any(m.disperses for m in used),
        "grids": has_media(scene) and has_grids(scene.media),
    }


def _more_grids(glows: tuple[Glow, ...]) -> tuple[Grid, ...]:
    return tuple(glow.density for glow in glows if not glow.whole)


def _media_arrays(scene: Scene, stored: StoredGeometry, glows: tuple[Glow, ...]) -> dict[str, NDArray]:
    of_glows = glow_arrays(glows, numbers_of_grids(scene.media, _more_grids(glows)))
    return {
        **of_glows,
        "media": medium_rows(scene.media, of_glows["glows"]),
        "prim_media": media_of_prims(stored.shapes, stored.shape_of_prim),
    }


def _shading_arrays(
    scene: Scene,
    features: dict[str, bool],
    stored: StoredGeometry,
    materials: MaterialTable,
    lights: LightTable,
    emissions: dict[int, Emission],
) -> dict[str, NDArray]:
    """Arrays that not every scene has: normals, colours, tables of BSDFs, textures. Textures' numbers are written into
    the rows of the materials."""
    arrays: dict[str, NDArray] = {}
    normals = stored.corner_normals()
    if normals is not None:
        arrays["normals"] = normals
    meshes = [stored.shapes[i].geometry for i, _ in stored.meshes]
    if features["colours"]:
        arrays["colours"] = corner_colours(meshes)
    if features["dispersion"]:
        arrays |= {"glasses": materials.glasses, "spectrum": spectrum().astype(np.float32)}
    textures = TextureTable()
    if features["bsdfs"]:
        arrays["bsdf_tables"] = materials.tables
        textures.write_rows(materials.rows, materials.materials)
    if features["textures"]:
        arrays |= coordinates(meshes, [stored.shapes[i].geometry for i in stored.round_shapes])
        arrays |= light_arrays(emissions, lights.of_shape, len(lights.rows), textures)
        arrays |= textures.arrays(scene)
    return arrays
