"""Textures, texture coordinates and frames as the arrays that kernels read (`TEXTURE_FIELDS` of the scene's record)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.kernels import scene as K
from pmviewer.resources import available_memory
from pmviewer.scene.arrays.material_row import used_materials
from pmviewer.scene.arrays.texture_coordinates import corner_uv, frame_of
from pmviewer.scene.arrays.textured_emission import Emission
from pmviewer.scene.description import Geometry, Material, Mesh, Scene
from pmviewer.scene.texture import Checkerboard, Texture

_WRAP = {"repeat": K.REPEAT, "mirror": K.MIRROR, "clamp": K.CLAMP}
_COLUMN = {
    "reflectance": K.M_REFLECTANCE_MAP,
    "specular_reflectance": K.M_SPECULAR_MAP,
    "alpha": K.M_ALPHA_MAP,
    "alpha_across": K.M_ACROSS_MAP,
    "transmittance": K.M_TRANSMITTANCE_MAP,
    "normal": K.M_NORMAL_MAP,
    "bump": K.M_BUMP_MAP,
    "opacity": K.M_OPACITY_MAP,
    "metallic": K.M_METALLIC_MAP,
    "weight": K.M_WEIGHT_MAP,
}


def needs_tangents(scene: Scene) -> bool:
    """Does any surface's material have a texture, colours at vertices, or a direction of its own?"""
    return any(m.textures or m.vertex_colours or m.alpha[0] != m.alpha[1] for m in used_materials(scene))


class TextureTable:
    """Textures by number, each bitmap's pixels once however many textures use them."""

    def __init__(self) -> None:
        self._number: dict[int, int] = {}
        self._start: dict[int, int] = {}
        self._kept: list[Texture] = []
        self._pixels: list[NDArray[np.float32]] = []
        self._rows: list[list[float]] = []
        self._starts: list[int] = []
        self._count = 0

    def add(self, texture: Texture) -> int:
        """The texture's number."""
        key = id(texture)
        if key not in self._number:
            self._number[key] = len(self._rows)
            self._kept.append(texture)  # an id is good as long as its object lives
            self._starts.append(0 if isinstance(texture, Checkerboard) else self._store(texture.pixels))
            self._rows.append(_row(texture))
        return self._number[key]

    def _store(self, pixels: NDArray[np.float32]) -> int:
        if id(pixels) not in self._start:
            self._start[id(pixels)] = self._count
            self._pixels.append(pixels)
            self._count += pixels.size
        return self._start[id(pixels)]

    def write_rows(self, rows: NDArray[np.float32], materials: Sequence[Material]) -> None:
        """Write the materials' texture numbers into their rows (n, MATERIAL_COLUMNS)."""
        rows[:, list(_COLUMN.values())] = -1
        for row, material in zip(rows, materials):
            for slot, texture in material.textures.items():
                if slot == "opacity" and not material.passable:
                    continue
                row[_COLUMN[slot]] = self.add(texture)
            row[K.M_BUMP_SCALE] = material.bump_scale

    def arrays(self, scene: Scene) -> dict[str, NDArray]:
        """By field of the record. Raises SceneError when the texels don't fit into memory."""
        if not self._rows:
            return {}
        available = available_memory()
        if available is not None and 4 * self._count > available:
            what = f"The textures need {4e-9 * self._count:.1f} GB of memory and {available / 1e9:.1f} GB are free."
            raise SceneError(what, scene.path, hint="Use smaller pictures.")
        texels = [np.ravel(p) for p in self._pixels] or [np.zeros(1, np.float32)]
        return {
            "textures": np.array(self._rows, np.float32),
            "texel_starts": np.array(self._starts, np.int64),
            "texels": np.concatenate(texels).astype(np.float32, copy=False),
        }


def _row(texture: Texture) -> list[float]:
    row = [0.0] * K.TEXTURE_COLUMNS
    row[K.T_TO_UV : K.T_TO_UV + 6] = texture.to_uv
    if isinstance(texture, Checkerboard):
        row[K.T_KIND] = K.CHECKERBOARD
        row[K.T_COLOR0 : K.T_COLOR0 + 3], row[K.T_COLOR1 : K.T_COLOR1 + 3] = texture.color0, texture.color1
        return row
    row[K.T_KIND] = K.BITMAP
    row[K.T_HEIGHT], row[K.T_WIDTH], row[K.T_CHANNELS] = texture.pixels.shape
    row[K.T_WRAP], row[K.T_NEAREST] = _WRAP[texture.wrap], texture.filter == "nearest"
    row[K.T_COLOR0 : K.T_COLOR0 + 3] = texture.scale
    return row


def coordinates(triangles: list[Geometry], quadrics: list) -> dict[str, NDArray]:
    """`uvs` and `quadric_frames` of shapes in the order of the primitives."""
    corners = [corner_uv(g) for g in triangles] or [np.zeros((0, 3, 2))]
    frames = [frame_of(g) for g in quadrics] or [np.zeros((0, 3, 3))]
    return {
        "uvs": np.concatenate(corners).astype(np.float32).reshape(-1, 6),
        "quadric_frames": np.stack(frames).astype(np.float32).reshape(-1, 9) if quadrics else np.zeros(9, np.float32),
    }


def corner_colours(triangles: list[Geometry]) -> NDArray[np.float32]:
    """`colours` of shapes in the order of the primitives: white where there are none."""
    parts = [np.zeros((0, 3, 3))]
    for g in triangles:
        if isinstance(g, Mesh):
            parts.append(np.ones((len(g.faces), 3, 3)) if g.colours is None else g.colours[g.faces])
        else:
            parts.append(np.ones((2, 3, 3)))
    return np.concatenate(parts).astype(np.float32).reshape(-1, 9)


def light_arrays(
    emissions: dict[int, Emission], light_of_shape: NDArray[np.int64], n_lights: int, textures: TextureTable
) -> dict[str, NDArray]:
    """`light_textures`, `light_frames` and `light_tables`; nothing for a scene without textured lights."""
    if not emissions:
        return {}
    settings = np.full((n_lights, K.LIGHT_TEXTURE_COLUMNS), -1, np.int64)
    frames = np.zeros((n_lights, 9), np.float32)
    tables: list[NDArray[np.float32]] = [np.zeros(1, np.float32)]
    filled = 1
    for shape, emission in emissions.items():
        light = light_of_shape[shape]
        if light < 0:  # black all over
            continue
        settings[light, K.LT_TEXTURE], frames[light] = textures.add(emission.texture), emission.frame
        if len(emission.table):
            settings[light, K.LT_FIRST : K.LT_COLUMNS + 1] = filled, emission.rows, emission.columns
            tables.append(emission.table)
            filled += len(emission.table)
    return {"light_textures": settings, "light_frames": frames, "light_tables": np.concatenate(tables)}
