"""KHR_materials_pbrSpecularGlossiness as metallic-roughness, pixel by pixel.

The metallic share is the root of the quadratic that follows from both workflows' sums of diffuse and specular colour,
with dielectrics reflecting 4 % (the conversion that the extension's authors give in its examples).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import RGB
from pmviewer.scene.formats.gltf.fields import Fields
from pmviewer.scene.formats.gltf.texture import GltfTextures
from pmviewer.scene.texture import Bitmap

SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
_DIELECTRIC = 0.04
_BRIGHTNESS = np.array([0.299, 0.587, 0.114], np.float32)
Array = NDArray[np.float32]


def converted(
    material: Fields, textures: GltfTextures
) -> tuple[RGB, Bitmap | None, float, Bitmap | None, tuple[float, Bitmap | None], tuple[float, Bitmap | None]]:
    """Colour, its map, opacity, its map, and factor and map of metallic and of roughness."""
    r, g, b, opacity = material.vector("diffuseFactor", (1.0, 1.0, 1.0, 1.0), 0.0, 1.0)
    sr, sg, sb = material.vector("specularFactor", (1.0, 1.0, 1.0), 0.0, 1.0)
    gloss = material.number("glossinessFactor", 1.0, 0.0, 1.0)
    base, shiny = material.texture("diffuseTexture"), material.texture("specularGlossinessTexture")
    diffuse, specular, glossiness = textures.colour(base, (r, g, b)), textures.colour(shiny), textures.alpha(shiny)
    alpha = textures.alpha(base)
    rough: tuple[float, Bitmap | None] = (1.0 - gloss, None)
    if glossiness is not None:
        rough = (1.0, replace(glossiness, pixels=1 - np.float32(gloss) * glossiness.pixels))
    if specular is None and diffuse is None:
        colour, metal = workflow(np.array([r, g, b], np.float32), np.array([sr, sg, sb], np.float32))
        c = [float(x) for x in colour]
        return (c[0], c[1], c[2]), None, opacity, alpha, (float(metal[0]), None), rough
    if diffuse is not None and specular is not None and diffuse.to_uv != specular.to_uv:
        specular = replace(specular, pixels=specular.pixels.mean(axis=(0, 1), keepdims=True))
    model = diffuse or specular
    assert model is not None
    d = np.array([[[r, g, b]]], np.float32)
    d = d if diffuse is None else _rgb(diffuse) * d
    s = np.array([[[sr, sg, sb]]], np.float32)
    s = s if specular is None else _rgb(specular) * s
    d, s = _of_one_size(d, s)
    colour, metal = workflow(d, s)
    colour_map = replace(model, pixels=np.ascontiguousarray(colour), scale=(1.0, 1.0, 1.0))
    metal_map = replace(model, pixels=np.ascontiguousarray(metal), scale=(1.0, 1.0, 1.0))
    return colour_map.mean, colour_map, opacity, alpha, (1.0, metal_map), rough


def workflow(diffuse: Array, specular: Array) -> tuple[Array, Array]:
    """Base colour (…, 3) and metallic share (…, 1) of diffuse and specular colours (…, 3)."""
    strongest = specular.max(axis=-1, keepdims=True)
    d = np.sqrt((diffuse * diffuse) @ _BRIGHTNESS)[..., None]
    s = np.sqrt((specular * specular) @ _BRIGHTNESS)[..., None]
    b = d * (1 - strongest) / (1 - _DIELECTRIC) + s - 2 * _DIELECTRIC
    root = np.sqrt(np.maximum(b * b - 4 * _DIELECTRIC * (_DIELECTRIC - s), 0))
    metal = np.where(s < _DIELECTRIC, 0, np.clip((root - b) / (2 * _DIELECTRIC), 0, 1))
    from_diffuse = diffuse * ((1 - strongest) / (1 - _DIELECTRIC) / np.maximum(1 - metal, 1e-4))
    from_specular = (specular - _DIELECTRIC * (1 - metal)) / np.maximum(metal, 1e-4)
    share = metal * metal
    colour = np.clip((1 - share) * from_diffuse + share * from_specular, 0, 1)
    return colour.astype(np.float32), metal.astype(np.float32)


def _rgb(bitmap: Bitmap) -> Array:
    return np.broadcast_to(bitmap.pixels, (*bitmap.pixels.shape[:2], 3))


def _of_one_size(a: Array, b: Array) -> tuple[Array, Array]:
    """Both pictures at the larger one's height and width, by the nearest pixel."""
    height, width = max(a.shape[0], b.shape[0]), max(a.shape[1], b.shape[1])
    rows, columns = np.arange(height), np.arange(width)

    def grown(x: Array) -> Array:
        return x[(rows * x.shape[0] // height)[:, None], columns * x.shape[1] // width]

    return grown(a), grown(b)
