"""Index, coat, sheen and direction of brushing from material extensions, as far as the program's lobes go."""

from __future__ import annotations

import math

from pmviewer.scene.description import RGB
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.gltf.fields import Fields
from pmviewer.scene.formats.gltf.surface import LEAST_ALPHA, Surface
from pmviewer.scene.formats.gltf.texture import GltfTextures

_SHOWS = 0.01
_COAT_SHARE = 0.25
"""Of a Fresnel coat's reflection, that of a principled coat of 1 (Burley 2012)."""
_ROUGHEST_COAT, _SMOOTHEST_COAT = 0.1, 0.001
"""Roughness of a principled coat of gloss 0 and 1."""
_MOST_F0 = 0.9


def eta_of(f0: float) -> float:
    """The index that reflects `f0` at normal incidence."""
    root = math.sqrt(min(_MOST_F0, max(0.0, f0)))
    return (1 + root) / (1 - root)


def specular_of(material: Fields, textures: GltfTextures) -> tuple[float, RGB]:
    """Index and colour of a dielectric's reflection, by KHR_materials_ior and KHR_materials_specular; the colour is 1
    in its strongest channel, and black where nothing is reflected. An index of 0 means total reflection there."""
    ior = material.extension("KHR_materials_ior").number("ior", 1.5, 0.0)
    f0 = ((ior - 1) / (ior + 1)) ** 2 if ior >= 1 else 1.0 if ior == 0 else 0.0
    if not material.has("KHR_materials_specular"):
        return (ior if ior >= 1 else eta_of(f0)), (1.0, 1.0, 1.0)
    extension = material.extension("KHR_materials_specular")
    factor = extension.number("specularFactor", 1.0, 0.0, 1.0)
    strength = textures.alpha(extension.texture("specularTexture"))
    if strength is not None:
        factor *= strength.mean[0]
    colour = extension.vector("specularColorFactor", (1.0, 1.0, 1.0), 0.0)
    picture = textures.colour(extension.texture("specularColorTexture"))
    if picture is not None:
        colour = tuple(c * m for c, m in zip(colour, picture.mean))
    r, g, b = (min(1.0, c * f0) * factor for c in colour)
    most = max(r, g, b)
    if most <= 0:
        return 1.0, (0.0, 0.0, 0.0)
    return eta_of(most), (r / most, g / most, b / most)


def coat_of(material: Fields, textures: GltfTextures, diagnostics: Diagnostics) -> tuple[float, float]:
    """Strength and gloss of a principled coat for KHR_materials_clearcoat; (0, 0) for none."""
    extension = material.extension("KHR_materials_clearcoat")
    factor = extension.number("clearcoatFactor", 0.0, 0.0, 1.0)
    amount = textures.channel(extension.texture("clearcoatTexture"), 0) if factor > 0 else None
    if amount is not None:
        factor *= amount.mean[0]
    if factor < _SHOWS:
        return 0.0, 0.0
    roughness = extension.number("clearcoatRoughnessFactor", 0.0, 0.0, 1.0)
    spread = textures.channel(extension.texture("clearcoatRoughnessTexture"), 1)
    if spread is not None:
        roughness *= spread.mean[0]
    alpha = roughness**2
    gloss = (_ROUGHEST_COAT - alpha) / (_ROUGHEST_COAT - _SMOOTHEST_COAT)
    if factor > _COAT_SHARE or amount is not None or spread is not None or "clearcoatNormalTexture" in extension.row:
        what = "Clear coats reflect up to a quarter of what the file says, evenly and with the surface's own normals."
        diagnostics.warn(what)
    return min(1.0, factor / _COAT_SHARE), min(1.0, max(0.0, gloss))


def sheen_of(material: Fields, textures: GltfTextures, diagnostics: Diagnostics) -> tuple[float, float]:
    """Strength and tint of a principled sheen for KHR_materials_sheen; (0, 0) for none."""
    extension = material.extension("KHR_materials_sheen")
    colour = extension.vector("sheenColorFactor", (0.0, 0.0, 0.0), 0.0, 1.0)
    picture = textures.colour(extension.texture("sheenColorTexture")) if max(colour) > 0 else None
    if picture is not None:
        colour = tuple(c * m for c, m in zip(colour, picture.mean))
    strongest = max(colour)
    if strongest < _SHOWS:
        return 0.0, 0.0
    diagnostics.warn(
        "The sheen of cloth is the same all over, its hue is the surface's own and its roughness does not count."
    )
    return strongest, 1 - min(colour) / strongest


def directions_of(
    material: Fields, surface: Surface, textures: GltfTextures, diagnostics: Diagnostics
) -> tuple[float, float]:
    """Microfacet roughness along the tangent and across it, by KHR_materials_anisotropy (which stretches highlights
    along its direction)."""
    alpha = surface.alpha
    extension = material.extension("KHR_materials_anisotropy")
    strength = extension.number("anisotropyStrength", 0.0, 0.0, 1.0)
    if strength < _SHOWS:
        return alpha, alpha
    picture = textures.channel(extension.texture("anisotropyTexture"), 2)
    turn = extension.number("anisotropyRotation", 0.0)
    if picture is not None:
        strength *= picture.mean[0]
    quarters = turn / (math.pi / 2)
    if picture is not None or abs(quarters - round(quarters)) > 0.01 or surface.alpha_map is not None:
        diagnostics.warn("Brushed surfaces are brushed along their texture coordinates, by one strength and roughness.")
    stretched = max(LEAST_ALPHA, alpha + (1 - alpha) * strength**2)
    return (stretched, alpha) if round(quarters) % 2 == 0 else (alpha, stretched)
