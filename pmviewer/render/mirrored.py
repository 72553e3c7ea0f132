"""Which pixels show mirrors and glass: known from scene and camera before there is a sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.scene import material_of
from pmviewer.render.camera import CameraPose
from pmviewer.render.closest_hits import closest_hits
from pmviewer.render.pixel_samples import MIRRORED
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.scene.arrays.material_lobes import always_followed, glossy_roughness, has_diffuse_lobe
from pmviewer.scene.description import Material

BLOCK, BLOCKS = 4, 64
"""Pixels along the sides of the squares that one ray marks, at most, and such squares along the shorter side of the
picture, at least: wrong marks at the rims of mirrors cost time or noise and nothing else."""
_i8 = np.int64


@kernel
def mark_mirrors(scenes, prims, mirrors, marks):
    """Set MIRRORED in marks, uint8 (n,), for primitives (n,) int32, −1 for none, whose material is one of the mirrors,
    bool by material. scenes: SCENE_DTYPE (1,)."""
    scene = scenes[0]
    for i in range(len(prims)):
        if prims[i] >= 0 and mirrors[material_of(scene, _i8(prims[i]))]:
            marks[i] |= np.uint8(MIRRORED)


def is_mirror(material: Material, glossy: float) -> bool:
    """Whether all that a material reflects and transmits is followed, with roughness from `glossy` on stored."""
    alphas = glossy_roughness(material)
    followed = always_followed(material) or any(alpha < glossy for alpha in alphas)
    return followed and not has_diffuse_lobe(material) and not any(alpha >= glossy for alpha in alphas)


def mirrors_of(scene: FlatScene, glossy: float) -> NDArray[np.bool_]:
    """Which of its materials are mirrors (`is_mirror`), by material."""
    return np.array([is_mirror(material, glossy) for material in scene.owner.materials], bool)


def block_of(camera: CameraPose) -> int:
    """Pixels along the sides of the squares that one ray marks; 1 where pixels lie apart."""
    return max(1, min(BLOCK, min(camera.width, camera.height) // BLOCKS)) if camera.pixel_side == 1.0 else 1


def mirrored_pixels(scene: FlatScene, camera: CameraPose, glossy: float) -> NDArray[np.uint8]:
    """(width · height,) uint8, MIRRORED where the middle of the pixel's square shows a mirror or glass; (0,)
    where none does."""
    mirrors = mirrors_of(scene, glossy)
    if not mirrors.any():
        return np.zeros(0, np.uint8)
    block = block_of(camera)
    columns, rows = (-(-side // block) for side in (camera.width, camera.height))
    x, y = (block * (places.ravel() + 0.5) for places in np.meshgrid(np.arange(columns), np.arange(rows)))
    prims = closest_hits(scene.record[0], *camera.rays(x, y)).prims
    blocks = np.zeros(len(prims), np.uint8)
    mark_mirrors(scene.record, prims, mirrors, blocks)
    if not blocks.any():
        return np.zeros(0, np.uint8)
    marks = blocks.reshape(rows, columns).repeat(block, axis=0).repeat(block, axis=1)
    return np.ascontiguousarray(marks[: camera.height, : camera.width]).ravel()
