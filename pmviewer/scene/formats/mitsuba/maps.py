"""What textures make of a Mitsuba BSDF: colours and roughness that vary, bump and normal maps."""

from __future__ import annotations

from dataclasses import replace

from pmviewer.scene.description import Material
from pmviewer.scene.formats.mitsuba.compound import leaves, on_parts
from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.formats.mitsuba.texture import has_vertex_colours
from pmviewer.scene.texture import Checkerboard, Texture, scaled

_TRANSMITTANCES = ("specular_transmittance", "diffuse_transmittance", "transmittance")
_ALPHAS = ("alpha_u", "alpha_v")


def _slots(material: Material) -> dict[str, str]:
    """Slot by property name. Where there is no diffuse part, `reflectance` is that of the surface itself."""
    bare = material.transparent or material.kind in ("conductor", "rough conductor")
    specular = "reflectance" if bare else "specular_reflectance"
    return {
        "reflectance": "reflectance",
        "diffuse_reflectance": "reflectance",
        "specular_reflectance": specular,
        **dict.fromkeys(_TRANSMITTANCES, "transmittance"),
        "alpha": "alpha",
    }


def with_textures(p: Properties, material: Material) -> Material:
    """The material with the textures that were found while its numbers were read.

    A metal's colour multiplies its `specular_reflectance`; the texture is scaled so that its mean is the material's.
    """
    if p.type in ("principled", "principledthin"):  # they have put theirs in place
        return material
    found: dict[str, Texture] = {}
    for name, slot in _slots(material).items():
        if name in p.textures:
            found[slot] = p.textures[name]
        if has_vertex_colours(p, name):
            if slot == "reflectance":
                material = replace(material, vertex_colours=True)
            else:
                what = f"'{name}' of {p.element}: colours at the vertices have no effect here, it is white."
                p.document.warn(what, p.values[name])
    if "reflectance" in found:
        r, g, b = (c / m if m > 0 else 1.0 for c, m in zip(material.reflectance, found["reflectance"].mean))
        if max(abs(r - 1), abs(g - 1), abs(b - 1)) > 1e-6:
            found["reflectance"] = scaled(found["reflectance"], (r, g, b))
    found |= _roughness(p, material)
    return replace(material, textures={**material.textures, **found}) if found else material


def _roughness(p: Properties, material: Material) -> dict[str, Texture]:
    """Textures of roughness along and across the tangent. Where one of them is a number, that everywhere."""
    there = [p.textures.get(name) for name in _ALPHAS]
    if not any(there):
        return {}
    if len([name for name in _ALPHAS if name in p]) == 1:
        return {"alpha": next(texture for texture in there if texture is not None)}
    constant = [Checkerboard((a, a, a), (a, a, a)) for a in material.alpha]
    along, across = (texture or number for texture, number in zip(there, constant, strict=True))
    return {"alpha": along, "alpha_across": across}


def mapped(p: Properties, material: Material) -> Material:
    """A `bumpmap` or `normalmap` around a material, on every part of a blend."""
    slot = "normal" if p.type == "normalmap" else "bump"
    found = [texture for name in p.values if (texture := p.texture(name)) is not None] + p.unnamed_textures()
    p.known("use_shadowing_function")
    if not p.boolean("flip_invalid_normals", True):
        p.document.warn(f"{p.element}: 'flip_invalid_normals' is always true here.", p.element)
    scale = p.number("scale", 1.0) if slot == "bump" else 1.0
    p.warn_unused("bsdf", "texture")
    if not found:
        p.document.warn(f"{p.element} has no texture that can be used: the BSDF inside is shown flat.", p.element)
        return material
    if len(found) > 1:
        p.document.warn(f"{p.element} has more than one texture: the first is used.", p.element)
    if any(slot in leaf.textures for leaf in leaves(material)):
        p.document.warn(f"{p.element} around another one replaces it.", p.element)

    def with_map(m: Material) -> Material:
        bump = scale if slot == "bump" else m.bump_scale
        return replace(m, textures={**m.textures, slot: found[0]}, bump_scale=bump)

    return on_parts(material, with_map)
