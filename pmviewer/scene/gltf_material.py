"""glTF's metallic-roughness materials as the nearest supported one."""

from __future__ import annotations

import base64
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from pmviewer.scene.description import RGB, Material
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.texture import mean_of_image

Json = dict[str, Any]
_METALLIC, _SMOOTH, _TRANSMISSIVE = 0.9, 0.1, 0.5


class GltfMaterials:
    """Materials of one file by index, each with the radiance that its surfaces emit (None if dark)."""

    def __init__(self, header: Json, binary: bytes, path: Path, diagnostics: Diagnostics) -> None:
        self._header, self._binary, self._path, self._diagnostics = header, binary, path, diagnostics
        self._known: dict[int, tuple[Material, RGB | None]] = {}
        self._means: dict[int, RGB] = {}

    def of(self, index: int) -> tuple[Material, RGB | None]:
        """Material `index` and its emission."""
        if index not in self._known:
            self._known[index] = self._build(self._header["materials"][index], index)
        return self._known[index]

    def _build(self, m: Json, index: int) -> tuple[Material, RGB | None]:
        name = str(m.get("name") or f"material {index}")
        pbr, extensions = m.get("pbrMetallicRoughness", {}), m.get("extensions", {})
        colour = self._colour(pbr.get("baseColorFactor", (1, 1, 1))[:3], pbr.get("baseColorTexture"), 1.0)
        if any(key in m for key in ("normalTexture", "occlusionTexture")) or "metallicRoughnessTexture" in pbr:
            self._diagnostics.warn("Normal, occlusion and roughness textures are ignored.")
        transmission = float(extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0))
        metallic = float(pbr.get("metallicFactor", 1)) * ("metallicRoughnessTexture" not in pbr)
        if transmission > _TRANSMISSIVE:
            ior = float(extensions.get("KHR_materials_ior", {}).get("ior", 1.5))
            material = Material(name, "dielectric", (1.0, 1.0, 1.0), colour, eta=max(1.0, ior))
        elif metallic > _METALLIC and float(pbr.get("roughnessFactor", 1)) < _SMOOTH:
            material = Material(name, "conductor", colour, two_sided=True)
        else:
            if m.get("alphaMode", "OPAQUE") != "OPAQUE":
                self._diagnostics.warn("Transparency by alpha is ignored: such surfaces are opaque.")
            material = Material(name, "diffuse", colour, two_sided=True)
        strength = float(extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1))
        emission = self._colour(m.get("emissiveFactor", (0, 0, 0)), m.get("emissiveTexture"), None, strength)
        return material, emission if max(emission) > 0 else None

    def _colour(self, factor: Any, texture: Json | None, most: float | None, scale: float = 1.0) -> RGB:
        """Factor times the texture's mean, not negative and at most `most`."""
        mean = self._mean(texture["index"]) if texture is not None and max(factor) > 0 else (1.0, 1.0, 1.0)
        r, g, b = (max(0.0, float(f) * m * scale) for f, m in zip(factor, mean))
        return (r, g, b) if most is None else (min(r, most), min(g, most), min(b, most))

    def _mean(self, texture: int) -> RGB:
        self._diagnostics.warn("Textures are not supported: their mean colours are used.")
        if texture not in self._means:
            try:
                from PIL import Image

                image = self._header["images"][self._header["textures"][texture]["source"]]
                with Image.open(BytesIO(self._image_bytes(image))) as picture:
                    self._means[texture] = mean_of_image(picture)
            except Exception:  # a texture is never worth refusing a scene
                self._diagnostics.warn("Some textures can't be read: white replaces them.")
                self._means[texture] = (1.0, 1.0, 1.0)
        return self._means[texture]

    def _image_bytes(self, image: Json) -> bytes:
        uri = image.get("uri")
        if uri is None:
            view = self._header["bufferViews"][image["bufferView"]]
            start = view.get("byteOffset", 0)
            return self._binary[start : start + view["byteLength"]]
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        file = self._path.parent / unquote(uri)
        if not file.is_file():
            raise FileNotFoundError(uri)
        return file.read_bytes()
