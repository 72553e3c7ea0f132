"""KHR_materials_transmission: glass, solid or thin, alone or in part; KHR_materials_dispersion of solid glass;
KHR_materials_diffuse_transmission: leaves and paper."""

from __future__ import annotations

import math
from dataclasses import replace

from pmviewer.scene.description import BLACK, RGB, Material
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.dispersion import LEAST_ABBE, Dispersion, by_abbe
from pmviewer.scene.formats.gltf.fields import Fields
from pmviewer.scene.formats.gltf.surface import Surface, even
from pmviewer.scene.formats.gltf.texture import GltfTextures
from pmviewer.scene.texture import Texture

_SMOOTH, _ALL, _NONE = 0.1, 0.98, 0.01


def with_transmission(
    opaque: Material, material: Fields, surface: Surface, textures: GltfTextures, diagnostics: Diagnostics
) -> Material:
    """The opaque material, glass in its place where all light is transmitted, or a blend of both."""
    extension = material.extension("KHR_materials_transmission")
    share = extension.number("transmissionFactor", 0.0, 0.0, 1.0)
    picture = textures.channel(extension.texture("transmissionTexture"), 0) if share > 0 else None
    share, weight = even(share * (1 - surface.metallic), picture)
    if weight is None and share < _NONE:
        return opaque
    glass = _glass(opaque.name, material, surface, diagnostics)
    if weight is None and share > _ALL:
        return glass
    return Material(
        opaque.name, "blend", parts=(opaque, glass), weight=share, textures={} if weight is None else {"weight": weight}
    )


def with_diffuse_transmission(
    opaque: Material, material: Fields, surface: Surface, textures: GltfTextures, diagnostics: Diagnostics
) -> Material:
    """The opaque material, and in the extension's share a sheet that lets light through in all directions."""
    extension = material.extension("KHR_materials_diffuse_transmission")
    share = extension.number("diffuseTransmissionFactor", 0.0, 0.0, 1.0)
    picture = textures.alpha(extension.texture("diffuseTransmissionTexture")) if share > 0 else None
    share, weight = even(share * (1 - surface.metallic), picture)
    if weight is None and share < _NONE:
        return opaque
    colour = extension.vector("diffuseTransmissionColorFactor", (1.0, 1.0, 1.0), 0.0, 1.0)
    tint = textures.colour(extension.texture("diffuseTransmissionColorTexture"), colour)
    through = Material(
        f"{opaque.name} (through)",
        "diffuse transmitter",
        BLACK,
        tint.mean if tint is not None else colour,
        textures={} if tint is None else {"transmittance": tint},
    )
    if opaque.kind != "diffuse":
        diagnostics.warn("Highlights of surfaces with diffuse transmission are dimmer by the share that it has.")
    weights = {} if weight is None else {"weight": weight}
    return Material(opaque.name, "blend", parts=(opaque, through), weight=share, textures=weights)


def _glass(name: str, material: Fields, surface: Surface, diagnostics: Diagnostics) -> Material:
    textures: dict[str, Texture] = {}
    if surface.colour_map is not None:
        textures["transmittance"] = surface.colour_map
    ior = max(1.0, material.extension("KHR_materials_ior").number("ior", 1.5, 0.0))
    volume = material.extension("KHR_materials_volume")
    rough = surface.roughness >= _SMOOTH or surface.alpha_map is not None
    glass = Material(name, "dielectric", (1.0, 1.0, 1.0), surface.colour, eta=ior, textures=textures)
    if volume.number("thicknessFactor", 0.0, 0.0) <= 0:
        if rough:
            diagnostics.warn("Thin sheets of rough glass are shown smooth: what is behind them is too sharp.")
        return replace(glass, kind="thin dielectric")
    glass = replace(glass, absorption=absorption(volume), dispersion=_dispersion(material, ior))
    if rough:
        if surface.alpha_map is not None:
            textures["alpha"] = surface.alpha_map
        glass = replace(glass, kind="rough dielectric", alpha=(surface.alpha, surface.alpha))
    return glass


def _dispersion(material: Fields, ior: float) -> Dispersion | None:
    """KHR_materials_dispersion: 20 over Abbe's number, the index being that at 587.6 nm."""
    strength = material.extension("KHR_materials_dispersion").number("dispersion", 0.0, 0.0, 20 / LEAST_ABBE)
    return by_abbe(ior, 20 / strength) if strength > 0 and ior > 1 else None


def absorption(volume: Fields) -> RGB:
    """σ per metre of KHR_materials_volume: what leaves the attenuation colour after the attenuation distance."""
    distance = volume.number("attenuationDistance", math.inf, 0.0)
    if not 0 < distance < math.inf:
        return BLACK
    colour = volume.vector("attenuationColor", (1.0, 1.0, 1.0), 0.0, 1.0)
    r, g, b = (max(0.0, -math.log(max(1e-4, c)) / distance) for c in colour)
    return (r, g, b)
