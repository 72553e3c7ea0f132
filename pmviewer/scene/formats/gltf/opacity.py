"""alphaMode: what alpha leaves out of a surface, in all or in part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pmviewer.scene.description import Material
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.gltf.fields import Fields
from pmviewer.scene.formats.gltf.surface import Surface, wants_alpha


def with_opacity(
    material: Material, fields: Fields, surface: Surface, vertex_alpha: float, diagnostics: Diagnostics
) -> Material:
    """The material with its opacity. MASK cuts each pixel of the picture at `alphaCutoff`; BLEND lets the share 1 −
    alpha pass straight through."""
    if not wants_alpha(fields.row):
        return material
    factor = surface.opacity * vertex_alpha
    picture = surface.opacity_map
    if fields.row["alphaMode"] == "MASK":
        cutoff = fields.number("alphaCutoff", 0.5, 0.0)
        if picture is None:
            return material if factor >= cutoff else replace(material, opacity=0.0)
        kept = (np.float32(factor) * picture.pixels >= cutoff).astype(np.float32)
        picture, factor = replace(picture, pixels=kept), 1.0
    if picture is None:
        return replace(material, opacity=factor)
    picture = replace(picture, scale=(factor,) * 3)
    if float(picture.pixels.min()) * factor >= 1:
        return material
    return replace(material, opacity=picture.mean[0], textures={**material.textures, "opacity": picture})
