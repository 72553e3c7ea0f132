"""glTF's metallic-roughness materials as the nearest supported one: metal, coated base or glass, smooth or rough."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pmviewer.scene.description import BLACK, RGB, Material, MaterialKind
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.gltf.texture import GltfTextures
from pmviewer.scene.texture import Bitmap, Texture, limited

Json = dict[str, Any]
_METALLIC, _SMOOTH, _TRANSMISSIVE = 0.9, 0.1, 0.5
_DULL = 0.9
"""Coats of this roughness or more are left out: they hardly show."""
_ROUGHNESS, _METAL = 1, 2
"""Channels of the metallic-roughness texture."""


class GltfMaterials:
    """Materials of one file by index, each with the radiance that its surfaces emit (None if dark) and its texture."""

    def __init__(self, header: Json, binary: bytes, path: Path, diagnostics: Diagnostics) -> None:
        self._header, self._diagnostics = header, diagnostics
        self._textures = GltfTextures(header, binary, path, diagnostics)
        self._known: dict[int, tuple[Material, RGB | None, Texture | None]] = {}

    def of(self, index: int) -> tuple[Material, RGB | None, Texture | None]:
        """Material `index` and its emission."""
        if index not in self._known:
            self._known[index] = self._build(self._header["materials"][index], index)
        return self._known[index]

    def _build(self, m: Json, index: int) -> tuple[Material, RGB | None, Texture | None]:
        name = str(m.get("name") or f"material {index}")
        pbr, extensions = m.get("pbrMetallicRoughness", {}), m.get("extensions", {})
        colour, base = self._colour(pbr.get("baseColorFactor", (1, 1, 1))[:3], pbr.get("baseColorTexture"), 1.0)
        textures: dict[str, Texture] = {} if base is None else {"reflectance": base}
        if "occlusionTexture" in m:
            self._diagnostics.warn("Occlusion textures are ignored: light finds its way by itself.")
        transmission = float(extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0))
        metallic, roughness = float(pbr.get("metallicFactor", 1)), float(pbr.get("roughnessFactor", 1))
        both = self._textures.bitmap(pbr.get("metallicRoughnessTexture"), raw=True)
        rough_map = None
        if both is not None:
            metallic *= both.mean[_METAL]
            rough_map = _alpha(both, roughness)
            roughness *= both.mean[_ROUGHNESS]
        alpha = (roughness**2, roughness**2)
        if transmission > _TRANSMISSIVE:
            ior = float(extensions.get("KHR_materials_ior", {}).get("ior", 1.5))
            textures = {} if base is None else {"transmittance": base}
            material = Material(name, "dielectric", (1.0, 1.0, 1.0), colour, eta=max(1.0, ior))
            material = replace(material, absorption=_absorption(extensions.get("KHR_materials_volume", {})))
            if roughness >= _SMOOTH:
                material = replace(material, kind="rough dielectric", alpha=alpha)
        elif metallic > _METALLIC:
            smooth = Material(name, "conductor", colour, two_sided=True)
            material = smooth if roughness < _SMOOTH else replace(smooth, kind="rough conductor", alpha=alpha)
        else:
            if m.get("alphaMode", "OPAQUE") != "OPAQUE":
                self._diagnostics.warn("Transparency by alpha is ignored: such surfaces are opaque.")
            material = Material(name, "diffuse", colour, two_sided=True)
            if roughness < _DULL:
                ior = float(extensions.get("KHR_materials_ior", {}).get("ior", 1.5))
                kind: MaterialKind = "plastic" if roughness < _SMOOTH else "rough plastic"
                if ior > 1:
                    material = replace(material, kind=kind, eta=ior, alpha=alpha)
        if rough_map is not None:
            if material.kind.startswith("rough"):
                textures["alpha"] = rough_map
            else:
                self._diagnostics.warn("Metallic-roughness textures count by their means on smooth surfaces.")
        normal = self._normal(m.get("normalTexture"))
        if normal is not None:
            textures["normal"] = normal
        strength = float(extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1))
        emission, glow = self._colour(m.get("emissiveFactor", (0, 0, 0)), m.get("emissiveTexture"), None, strength)
        material = replace(material, textures=textures)
        return (material, emission, glow) if max(emission) > 0 else (material, None, None)

    def _colour(
        self, factor: Any, info: Json | None, most: float | None, scale: float = 1.0
    ) -> tuple[RGB, Texture | None]:
        """Factor (times the texture's mean), not negative and at most `most`, and the texture times the factor."""
        r, g, b = (max(0.0, float(f) * scale) for f in factor)
        texture: Texture | None = self._textures.bitmap(info, False, (r, g, b)) if max(r, g, b) > 0 else None
        if texture is None:
            return ((r, g, b) if most is None else (min(r, most), min(g, most), min(b, most))), None
        texture, changed = limited(texture, most)
        if changed:
            self._diagnostics.warn(f"Texture '{texture.name}': {changed}")
        return texture.mean, texture

    def _normal(self, info: Json | None) -> Texture | None:
        bitmap = self._textures.bitmap(info, raw=True)
        strength = float((info or {}).get("scale", 1))
        if bitmap is None or strength == 1:
            return bitmap
        pixels = np.broadcast_to(bitmap.pixels, (*bitmap.pixels.shape[:2], 3)).copy()
        pixels[..., :2] = 0.5 + strength * (pixels[..., :2] - 0.5)
        return replace(bitmap, pixels=pixels)


def _absorption(volume: Json) -> RGB:
    """σ per metre of KHR_materials_volume: what leaves the attenuation colour after the attenuation distance."""
    distance = float(volume.get("attenuationDistance", math.inf))
    if not 0 < distance < math.inf:
        return BLACK
    r, g, b = (-math.log(min(1.0, max(1e-4, float(c)))) / distance for c in volume.get("attenuationColor", (1, 1, 1)))
    return (r, g, b)


def _alpha(both: Bitmap, factor: float) -> Bitmap:
    """Microfacet roughness: the square of what the texture says."""
    channel = _ROUGHNESS if both.pixels.shape[2] == 3 else 0
    rough = np.float32(factor) * both.pixels[..., channel : channel + 1]
    return replace(both, pixels=np.ascontiguousarray(rough * rough))
