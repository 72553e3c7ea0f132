"""Lights and materials with other numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pmviewer.scene.description import (
    LUMINANCE,
    RGB,
    DirectionalLight,
    ImageEnvironment,
    Light,
    Material,
    PointLight,
    ProjectorLight,
    Shape,
    SpotLight,
)
from pmviewer.scene.dispersion import by_abbe
from pmviewer.scene.texture import Checkerboard, Texture, limited, scaled

GREY: RGB = (1.0, 1.0, 1.0)


def brightened(emitted: RGB, power: float, colour: RGB | None) -> RGB:
    """What a light emits, times `power`, with the hue of `colour` at the luminance that it had. Black has no hue: grey
    then."""
    rgb = np.asarray(emitted, float)
    if colour is not None:
        hue = np.asarray(colour if max(colour) > 0 else GREY, float)
        rgb = hue * float(rgb @ LUMINANCE) / float(hue @ LUMINANCE)
    r, g, b = (float(c) * power for c in rgb)
    return r, g, b


def with_radiance(shape: Shape, power: float, colour: RGB | None) -> Shape:
    """A glowing surface that emits otherwise; a texture is tinted."""
    assert shape.radiance is not None
    radiance = brightened(shape.radiance, power, colour)
    emission = None if shape.emission is None else tinted(shape.emission, shape.radiance, radiance)
    return replace(shape, radiance=radiance, emission=emission)


def with_emission(light: Light, power: float, colour: RGB | None) -> Light:
    """Any other light that emits otherwise."""
    if isinstance(light, PointLight | SpotLight):
        return replace(light, intensity=brightened(light.intensity, power, colour))
    if isinstance(light, DirectionalLight):
        return replace(light, irradiance=brightened(light.irradiance, power, colour))
    if not isinstance(light, ImageEnvironment | ProjectorLight):
        return replace(light, radiance=brightened(light.radiance, power, colour))
    pixels = light.pixels
    if colour is not None:
        pixels = (pixels @ LUMINANCE.astype(np.float32))[..., None] * np.array(brightened(GREY, 1.0, colour))
    return replace(light, pixels=np.ascontiguousarray(pixels * power, np.float32))


def tinted(texture: Texture, before: RGB, after: RGB) -> Texture:
    """The texture, whose mean is `before`, with the mean `after`: each channel scaled; grey first where a channel that
    is needed is empty."""
    if any(old <= 0 < new for old, new in zip(before, after)):
        texture, before = _grey(texture)
    r, g, b = (new / old if old > 0 else 0.0 for old, new in zip(before, after))
    return scaled(texture, (r, g, b))


def recoloured(material: Material, colour: RGB) -> Material:
    """The material with another colour: of what it transmits, if that is what it shows, else of what it reflects."""
    if material.transparent:
        texture = material.textures.get("transmittance")
        return replace(material, transmittance=colour, textures=_textures(material, "transmittance", texture, colour))
    texture = material.textures.get("reflectance")
    return replace(material, reflectance=colour, textures=_textures(material, "reflectance", texture, colour))


def colour_of(material: Material) -> RGB:
    """What `recoloured` changes."""
    return material.transmittance if material.transparent else material.reflectance


def roughened(material: Material, alpha: float) -> Material:
    """The material with another roughness; 0 makes mirrors, clear glass and smooth coats."""
    kind = material.kind.removeprefix("rough ")
    if kind in ("conductor", "dielectric", "plastic"):
        kind = kind if alpha == 0 else f"rough {kind}"
    return replace(material, kind=kind, alpha=(alpha, alpha))


def dispersed(material: Material, strength: float) -> Material:
    """The glass with another Abbe number, 20 over the strength; 0 bends all light alike."""
    if strength <= 0 or material.eta <= 1:
        return replace(material, dispersion=None)
    return replace(material, dispersion=by_abbe(material.eta, 20 / strength))


def strength_of(material: Material) -> float:
    """What `dispersed` changes."""
    return 0.0 if material.dispersion is None else max(0.0, 20 / material.dispersion.abbe)


def _textures(material: Material, slot: str, texture: Texture | None, colour: RGB) -> dict[str, Texture]:
    textures = dict(material.textures)
    if texture is not None:
        textures[slot] = limited(tinted(texture, texture.mean, colour), 1.0)[0]
    return textures


def _grey(texture: Texture) -> tuple[Texture, RGB]:
    """The luminance of the texture, and its mean."""

    def level(colour: RGB) -> RGB:
        value = float(np.dot(colour, LUMINANCE))
        return value, value, value

    if isinstance(texture, Checkerboard):
        grey: Texture = replace(texture, color0=level(texture.color0), color1=level(texture.color1))
    else:
        colours = np.broadcast_to(texture.pixels, (*texture.pixels.shape[:2], 3)) * np.array(texture.scale)
        grey = replace(texture, pixels=(colours @ LUMINANCE).astype(np.float32)[..., None], scale=GREY)
    return grey, grey.mean
