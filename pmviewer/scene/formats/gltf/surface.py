"""What a glTF material says, gathered: metallic-roughness numbers and textures, whichever extension they come from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pmviewer.scene.description import RGB
from pmviewer.scene.formats.gltf.document import Json
from pmviewer.scene.formats.gltf.fields import Fields
from pmviewer.scene.formats.gltf.specular_glossiness import SPECULAR_GLOSSINESS, converted
from pmviewer.scene.formats.gltf.texture import GltfTextures
from pmviewer.scene.texture import Bitmap

ROUGHNESS, METALLIC = 1, 2
"""Channels of the metallic-roughness texture."""
LEAST_ALPHA = 1e-3
_EVEN = 0.02
"""A channel that varies less than this is one number: textures cost time."""


@dataclass(frozen=True)
class Surface:
    """Colour and metallic-roughness of a material. Maps are None where a number says all; numbers are then theirs, else
    the maps' means. `roughness` is perceptual, `alpha_map` holds its square. `opacity_map` is the alpha of the colour's
    texture, without `opacity`."""

    colour: RGB
    colour_map: Bitmap | None
    opacity: float
    opacity_map: Bitmap | None
    metallic: float
    metallic_map: Bitmap | None
    roughness: float
    alpha_map: Bitmap | None

    @property
    def alpha(self) -> float:
        """Microfacet roughness."""
        return max(LEAST_ALPHA, self.roughness**2)


def surface_of(material: Fields, textures: GltfTextures) -> Surface:
    """The surface of a material of either workflow; pictures that can't be read have left their warnings."""
    if material.has(SPECULAR_GLOSSINESS):
        return _even(converted(material.extension(SPECULAR_GLOSSINESS), textures))
    pbr = material.table("pbrMetallicRoughness")
    r, g, b, opacity = pbr.vector("baseColorFactor", (1.0, 1.0, 1.0, 1.0), 0.0, 1.0)
    base = pbr.texture("baseColorTexture")
    both = textures.numbers(pbr.texture("metallicRoughnessTexture"))
    return _even(
        (
            (r, g, b),
            textures.colour(base, (r, g, b)),
            opacity,
            textures.alpha(base) if wants_alpha(material.row) else None,
            (pbr.number("metallicFactor", 1.0, 0.0, 1.0), channel(both, METALLIC)),
            (pbr.number("roughnessFactor", 1.0, 0.0, 1.0), channel(both, ROUGHNESS)),
        )
    )


Parts = tuple[RGB, Bitmap | None, float, Bitmap | None, tuple[float, Bitmap | None], tuple[float, Bitmap | None]]
"""Colour and its map (with the colour in it), opacity and its map, and (factor, map) of metallic and roughness."""


def wants_alpha(row: Json) -> bool:
    """Does the material's alpha count?"""
    return row.get("alphaMode", "OPAQUE") in ("MASK", "BLEND")


def channel(bitmap: Bitmap | None, index: int) -> Bitmap | None:
    """One channel of a texture of numbers, (h, w, 1)."""
    if bitmap is None:
        return None
    index = min(index, bitmap.pixels.shape[2] - 1)
    return replace(bitmap, pixels=np.ascontiguousarray(bitmap.pixels[..., index : index + 1]))


def even(factor: float, bitmap: Bitmap | None) -> tuple[float, Bitmap | None]:
    """A factor times a one-channel map: the mean, and the map with the factor in its pixels, or None if it hardly
    varies."""
    if bitmap is None:
        return factor, None
    low, high = float(bitmap.pixels.min()), float(bitmap.pixels.max())
    if (high - low) * factor < _EVEN:
        return factor * (low + high) / 2, None
    return factor * bitmap.mean[0], replace(bitmap, pixels=np.float32(factor) * bitmap.pixels)


def _even(parts: Parts) -> Surface:
    colour, colour_map, opacity, opacity_map, metal, rough = parts
    metallic, metallic_map = even(*metal)
    roughness, rough_map = even(*rough)
    if rough_map is not None:
        squared = np.maximum(rough_map.pixels * rough_map.pixels, np.float32(LEAST_ALPHA))
        rough_map = replace(rough_map, pixels=squared)
    if opacity_map is not None and float(opacity_map.pixels.min()) >= 1:
        opacity_map = None
    if colour_map is not None and float(colour_map.pixels.max()) > 1:  # pictures of floats
        colour_map = replace(colour_map, pixels=np.minimum(colour_map.pixels, np.float32(1)))
    mean = colour if colour_map is None else colour_map.mean
    return Surface(mean, colour_map, opacity, opacity_map, metallic, metallic_map, roughness, rough_map)
