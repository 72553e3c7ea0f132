"""glTF materials as the program's: plain kinds where they say the same, "principled" for the rest, blends of glass."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pmviewer.scene.description import BLACK, RGB, Material, Principled
from pmviewer.scene.formats.gltf.buffers import Buffers
from pmviewer.scene.formats.gltf.document import Document, Json, name_of
from pmviewer.scene.formats.gltf.fields import Fields
from pmviewer.scene.formats.gltf.lobes import coat_of, directions_of, eta_of, sheen_of, specular_of
from pmviewer.scene.formats.gltf.opacity import with_opacity
from pmviewer.scene.formats.gltf.specular_glossiness import SPECULAR_GLOSSINESS
from pmviewer.scene.formats.gltf.surface import Surface, surface_of
from pmviewer.scene.formats.gltf.texture import GltfTextures, uv_set
from pmviewer.scene.formats.gltf.transmission import with_diffuse_transmission, with_transmission
from pmviewer.scene.formats.meshfile import DEFAULT_MATERIAL
from pmviewer.scene.texture import Texture

UNLIT = "KHR_materials_unlit"
_METAL, _SMOOTH, _DULL = 0.02, 0.1, 0.9
"""Metallic shares this near to 0 or 1 count as that; roughness below which a surface is smooth, and from which on the
coat of a plain dielectric is left out, since it hardly shows."""


@dataclass(frozen=True)
class Usage:
    """What a mesh adds to its material: colours at its vertices, their mean, and the mean of their alpha."""

    colours: bool = False
    tint: RGB = (1.0, 1.0, 1.0)
    alpha: float = 1.0


@dataclass(frozen=True)
class Look:
    """A material and what its surfaces emit: mean radiance (None if dark) and its texture. `uv_set` is the set of
    texture coordinates that the textures lie on."""

    material: Material
    radiance: RGB | None = None
    emission: Texture | None = None
    uv_set: int = 0

    @property
    def shines(self) -> bool:
        """Does it emit?"""
        return self.radiance is not None and max(self.radiance) > 0


class GltfMaterials:
    """Materials of one file, each built once for each way that meshes use it."""

    def __init__(self, document: Document, buffers: Buffers) -> None:
        self._document = document
        self._textures = GltfTextures(document, buffers)
        self._known: dict[tuple[int, Usage], Look] = {}
        self._sets: dict[int, int] = {}

    def uv_set(self, index: Any) -> int:
        """The set of texture coordinates that most of the material's textures lie on."""
        if index is None:
            return 0
        row = self._document.row("materials", index, "a mesh")
        if index not in self._sets:
            counted = [uv_set(info) for info in _textures_of(row)]
            self._sets[index] = max(counted, key=lambda n: (counted.count(n), -n)) if counted else 0
            if len(set(counted)) > 1:
                what = "Textures of one material lie on different sets of texture coordinates: those that are not on "
                self._document.warn(f"{what}the set of most are left out, or count by their means.")
        return self._sets[index]

    def of(self, index: Any, usage: Usage) -> Look:
        """Material `index` (None: no material) of a mesh that is so used. Raises SceneError if there is none."""
        if index is None:
            return _tinted(Look(DEFAULT_MATERIAL), usage)
        row = self._document.row("materials", index, "a mesh")
        key = (index, usage)
        if key not in self._known:
            self._known[key] = self._build(row, index, usage)
        return self._known[key]

    def _build(self, row: Json, index: int, usage: Usage) -> Look:
        name = name_of(row, f"material {index}")
        chosen_set = self.uv_set(index)
        fields = Fields(_on_one_set(row, chosen_set), f"the material '{name}'", self._document.diagnostics)
        surface = surface_of(fields, self._textures)
        if fields.has(UNLIT):
            look = self._unlit(name, surface, usage)
        else:
            look = self._lit(name, fields, surface)
        if look.shines and row.get("doubleSided"):
            self._document.warn("Surfaces that shine do so from their front only, where the file wants both sides.")
        material = with_opacity(look.material, fields, surface, usage.alpha, self._document.diagnostics)
        look = Look(material, look.radiance, look.emission, chosen_set)
        return look if fields.has(UNLIT) else _tinted(look, usage)

    def _unlit(self, name: str, surface: Surface, usage: Usage) -> Look:
        """The base colour as radiance: what viewers that don't light it show."""
        r, g, b = (c * t for c, t in zip(surface.colour, usage.tint))
        texture = surface.colour_map
        if texture is not None:
            sr, sg, sb = (c * t for c, t in zip(texture.scale, usage.tint))
            texture = replace(texture, scale=(sr, sg, sb))
        if usage.colours:
            self._document.warn("Colours at the vertices of unlit surfaces count by their mean.")
        return Look(Material(name, "diffuse", BLACK, two_sided=True), (r, g, b), texture)

    def _lit(self, name: str, fields: Fields, surface: Surface) -> Look:
        if "occlusionTexture" in fields.row:
            self._document.warn("Occlusion textures are ignored: light finds its way by itself.")
        material = self._opaque(name, fields, surface)
        material = with_diffuse_transmission(material, fields, surface, self._textures, self._document.diagnostics)
        material = with_transmission(material, fields, surface, self._textures, self._document.diagnostics)
        normal = self._normal(fields.texture("normalTexture"))
        if normal is not None:
            material = _with_normal(material, normal)
        radiance, emission = self._emission(fields)
        return Look(material, radiance, emission) if max(radiance) > 0 else Look(material)

    def _opaque(self, name: str, fields: Fields, surface: Surface) -> Material:
        """The surface as if nothing passed through it."""
        textures: dict[str, Texture] = {}
        if surface.colour_map is not None:
            textures["reflectance"] = surface.colour_map
        if surface.alpha_map is not None:
            textures["alpha"] = surface.alpha_map
        along, across = directions_of(fields, surface, self._textures, self._document.diagnostics)
        eta, specular = specular_of(fields, self._textures)
        coat, gloss = coat_of(fields, self._textures, self._document.diagnostics)
        sheen, tint = sheen_of(fields, self._textures, self._document.diagnostics)
        material = Material(name, "diffuse", surface.colour, two_sided=True, alpha=(along, across), eta=eta)
        smooth = surface.roughness < _SMOOTH and surface.alpha_map is None
        plain = surface.metallic_map is None and not coat and not sheen
        if plain and surface.metallic > 1 - _METAL:
            if smooth:
                textures.pop("alpha", None)
            return replace(material, kind="conductor" if smooth else "rough conductor", eta=1.5, textures=textures)
        if plain and surface.metallic < _METAL and along == across:
            coated = eta > 1 and max(specular) > 0
            if not coated or (surface.roughness >= _DULL and not fields.has(SPECULAR_GLOSSINESS)):
                textures.pop("alpha", None)
                return replace(material, eta=1.5, textures=textures)
            return replace(
                material, kind="plastic" if smooth else "rough plastic", specular=specular, textures=textures
            )
        if surface.metallic_map is not None:
            textures["metallic"] = surface.metallic_map
        details = Principled(
            metallic=surface.metallic, sheen=sheen, sheen_tint=tint, clearcoat=coat, clearcoat_gloss=gloss
        )
        eta = max(1.001, eta_of(_mean(specular) * ((eta - 1) / (eta + 1)) ** 2))
        if max(specular) - min(specular) > 0.05:
            self._document.warn("Coloured highlights of surfaces that are partly metal, coated or of cloth are white.")
        return replace(material, kind="principled", eta=eta, principled=details, textures=textures)

    def _emission(self, fields: Fields) -> tuple[RGB, Texture | None]:
        """Mean radiance, and its texture."""
        strength = fields.extension("KHR_materials_emissive_strength").number("emissiveStrength", 1.0, 0.0)
        r, g, b = (c * strength for c in fields.vector("emissiveFactor", (0.0, 0.0, 0.0), 0.0))
        texture = self._textures.colour(fields.texture("emissiveTexture"), (r, g, b)) if max(r, g, b) > 0 else None
        return ((r, g, b), None) if texture is None else (texture.mean, texture)

    def _normal(self, info: Json | None) -> Texture | None:
        bitmap = self._textures.numbers(info)
        strength = Fields(info or {}, "a normal texture", self._document.diagnostics).number("scale", 1.0)
        if bitmap is None or strength == 1:
            return bitmap
        pixels = np.broadcast_to(bitmap.pixels, (*bitmap.pixels.shape[:2], 3)).copy()
        pixels[..., :2] = 0.5 + strength * (pixels[..., :2] - 0.5)
        return replace(bitmap, pixels=pixels)


def _with_normal(material: Material, normal: Texture) -> Material:
    if material.parts:
        return replace(material, parts=tuple(_with_normal(part, normal) for part in material.parts))
    return replace(material, textures={**material.textures, "normal": normal})


def _tinted(look: Look, usage: Usage) -> Look:
    """The look with colours at vertices, if the mesh has them."""
    if not usage.colours:
        return look

    def coloured(material: Material) -> Material:
        return replace(material, vertex_colours=True, parts=tuple(coloured(part) for part in material.parts))

    return replace(look, material=coloured(look.material))


def _textures_of(row: Json) -> list[Json]:
    """All references to textures in a material that count; that to the occlusion doesn't."""
    found: list[Json] = []
    for key, value in row.items():
        if key.endswith("Texture") and isinstance(value, dict):
            found += [value] if key != "occlusionTexture" else []
        elif isinstance(value, dict) and key not in ("extras", "KHR_texture_transform"):
            found += _textures_of(value)
    return found


def _on_one_set(row: Json, chosen: int) -> Json:
    """The material without its textures on other sets of texture coordinates."""
    kept: Json = {}
    for key, value in row.items():
        if key.endswith("Texture") and isinstance(value, dict):
            if uv_set(value) == chosen or key == "occlusionTexture":
                kept[key] = value
        elif isinstance(value, dict) and key != "extras":
            kept[key] = _on_one_set(value, chosen)
        else:
            kept[key] = value
    return kept


def _mean(colour: RGB) -> float:
    return math.fsum(colour) / 3
