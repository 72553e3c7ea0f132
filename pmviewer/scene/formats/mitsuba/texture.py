"""`<texture>` elements as descriptions: those that vary over a surface, and colours written as textures."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmviewer.scene.description import RGB
from pmviewer.scene.formats.mitsuba.bitmap import read_bitmap
from pmviewer.scene.formats.mitsuba.spectrum import spectrum_object
from pmviewer.scene.formats.mitsuba.texture_place import to_uv
from pmviewer.scene.texture import LUMINANCE, Bitmap, Checkerboard, Texture, scaled

if TYPE_CHECKING:
    from pmviewer.scene.formats.mitsuba.document import Document, Properties
    from pmviewer.scene.formats.mitsuba.xml import Element

_SPECTRA = frozenset(("rgb", "srgb", "uniform", "d65", "regular", "irregular", "blackbody", "spectrum", "rawconstant"))
_BITMAPS = frozenset(("bitmap", "ldrtexture", "exrtexture", "hdrtexture"))
_VERTEX_COLOURS = frozenset(("mesh_attribute", "vertexcolors"))
_ATTRIBUTE, _ATTRIBUTES = "vertex_color", ("vertex_", "face_")
_NUMBERS = frozenset((
    "alpha", "alpha_u", "alpha_v", "roughness", "metallic", "anisotropic", "specular", "spec_trans", "spec_tint",
    "sheen", "sheen_tint", "flatness", "clearcoat", "clearcoat_gloss", "diff_trans", "eta", "weight", "opacity",
))  # fmt: skip
"""Properties that are no colours: attributes of meshes are read as colours alone."""
_DEEPEST = 8
_MOST_GRID = 1024
WHITE: RGB = (1.0, 1.0, 1.0)


def read_texture(p: Properties) -> Texture | None:
    """The texture of a <texture> element, read once however many refer to it; None, with a warning, where only the
    property's default is left. What has the same colour everywhere is a bitmap of one pixel. Raises SceneError naming
    its line."""
    if p.type in _VERTEX_COLOURS and p.element.attributes.get("name") in _NUMBERS:
        name = p.element.attributes["name"]
        p.document.warn(f"'{name}' can't vary as {p.element} says: it keeps its default.", p.element)
        return None
    key = id(p.element.children)  # a reference makes an element of its own with the same children
    if key not in p.document.textures:
        p.document.textures[key] = _read(p), p.element.children
    return p.document.textures[key][0]


def _read(p: Properties) -> Texture | None:
    if p.type in _BITMAPS:
        return read_bitmap(p)
    if p.type == "checkerboard":
        return _checkerboard(p)
    if p.type == "gridtexture":
        return _grid(p)
    if p.type == "scale":
        return _scale(p)
    if p.type in _VERTEX_COLOURS:
        return _vertex_colours(p)
    if p.type == "wireframe":
        sentence = f"{p.element} is not supported: the colour between its lines is shown everywhere."
        p.document.warn(sentence, p.element)
        return constant(p.bounded_colour("interior_color", 0.5, None))
    if p.type == "volume":
        return _volume(p)
    if p.type in _SPECTRA:
        return constant(spectrum_object(p, (0.5, 0.5, 0.5)))
    p.document.warn(f"{p.element} is not supported: what it would colour keeps its default.", p.element)
    return None


def constant(colour: RGB) -> Bitmap:
    """The same linear colour everywhere."""
    return Bitmap(np.ones((1, 1, 3), np.float32), scale=colour, name="colour")


def is_constant(texture: Texture) -> bool:
    """Is the texture the same everywhere?"""
    return isinstance(texture, Bitmap) and texture.pixels.shape[:2] == (1, 1)


def squared_luminance(texture: Texture) -> Texture:
    """The texture whose luminance is the square of this one's: of roughness it makes the α of microfacets."""
    if isinstance(texture, Checkerboard):
        a, b = (float(np.dot(c, LUMINANCE)) ** 2 for c in (texture.color0, texture.color1))
        return replace(texture, color0=(a, a, a), color1=(b, b, b))
    colours = texture.pixels * np.array(texture.scale, np.float32)
    grey = (colours @ LUMINANCE.astype(np.float32))[..., None] ** 2
    return replace(texture, pixels=np.ascontiguousarray(grey, np.float32), scale=WHITE)


def has_vertex_colours(p: Properties, name: str) -> bool:
    """Does the value of that name come from a mesh's vertices or faces, whatever scales it?"""
    element = p.values.get(name)
    return element is not None and element.tag == "texture" and _from_mesh(element, p.document, 0)


def _from_mesh(element: Element, document: Document, depth: int) -> bool:
    kind = element.attributes.get("type")
    if kind in _VERTEX_COLOURS:
        return _attribute_of(element).startswith(_ATTRIBUTES)
    if kind != "scale" or depth > _DEEPEST:
        return False
    first = next((c for c in _inside(element, document) if c.tag == "texture"), None)
    return first is not None and _from_mesh(first, document, depth + 1)


def _inside(element: Element, document: Document) -> list[Element]:
    """The elements inside, those that are referred to in their references' place."""
    found = (document.ids.get(c.attributes.get("id", "")) if c.tag == "ref" else c for c in element.children)
    return [c for c in found if c is not None]


def attributes_read(shape: Element, document: Document) -> list[str]:
    """Names of the attributes of the mesh ("vertex_color", "face_weight" …) that BSDFs of the shape read, first those
    for colours."""
    level, found = [(c, False) for c in _inside(shape, document) if c.tag == "bsdf"], []
    for _ in range(_DEEPEST):
        below = [(c, of or _colours(c, e)) for e, of in level for c in _inside(e, document)]
        level = [(c, of) for c, of in below if c.tag in ("bsdf", "texture")]
        found += [(not of, _attribute_of(c)) for c, of in level if c.attributes.get("type") in _VERTEX_COLOURS]
    found.sort(key=lambda pair: pair[0])
    return [name for name in dict.fromkeys(name for _, name in found) if name.startswith(_ATTRIBUTES)]


def _colours(texture: Element, of: Element) -> bool:
    """Is the texture what a BSDF shows as its colour?"""
    names = ("reflectance", "base_color", "diffuse_reflectance", "diffuseReflectance")
    return of.tag == "bsdf" and texture.tag != "bsdf" and texture.attributes.get("name") in names


def _attribute_of(element: Element) -> str:
    """Name of the attribute that a texture reads; the texture of version 0.6 has no choice."""
    names = [c.attributes.get("value", "") for c in element.children if c.attributes.get("name") == "name"]
    return names[0].strip() if names else _ATTRIBUTE


def _checkerboard(p: Properties) -> Texture:
    colours = p.bounded_colour("color0", 0.4, None), p.bounded_colour("color1", 0.2, None)
    for name in ("color0", "color1"):
        if name in p.textures:
            p.document.warn(f"'{name}' of {p.element} is a texture: its mean colour is shown.", p.element)
    texture = Checkerboard(*colours, to_uv(p))
    p.warn_unused()
    return texture


def _grid(p: Properties) -> Texture:
    """Lines of `color1` around cells of 1 × 1 filled with `color0`, as a bitmap of one cell."""
    ground, line = p.bounded_colour("color0", 0.2, None), p.bounded_colour("color1", 0.4, None)
    width = min(max(p.number("line_width", 0.01), 0.0), 0.5)
    sizes = np.arange(2, _MOST_GRID + 1)
    side = int(sizes[np.argmin(np.abs(np.round(sizes * width) / sizes - width))])
    border = round(side * width)
    pixels = np.empty((side, side, 3), np.float32)
    pixels[:] = line
    pixels[border : side - border, border : side - border] = ground
    texture = Bitmap(pixels, "repeat", "nearest", to_uv(p), name="grid")
    p.warn_unused()
    return texture


def _scale(p: Properties) -> Texture | None:
    """A nested texture times a number or a colour (version 0.6)."""
    name = "value" if p.tag_of("value") is not None else "scale"
    inner = [t for n in p.values if n != name and (t := p.texture(n)) is not None] + p.unnamed_textures()
    if p.tag_of(name) == "texture":
        inner = [t for t in [p.texture(name)] if t is not None] + inner
        factor = p.bounded_colour("scale", 1.0, None) if name != "scale" else WHITE
    else:
        factor = p.bounded_colour(name, 1.0, None)
        if name == "value":  # a colour in place of the texture
            inner = inner or [constant(factor)]
            factor = p.bounded_colour("scale", 1.0, None)
    p.warn_unused("texture")
    if not inner:
        if not p.objects("texture"):
            p.document.warn(f"{p.element} has no texture inside: what it would colour keeps its default.", p.element)
        return None
    return scaled(inner[0], factor)


def _vertex_colours(p: Properties) -> Texture | None:
    """White, which the colours at the corners of the triangles multiply (`Material.vertex_colours`)."""
    attribute = _attribute_of(p.element)
    p.known("name")
    factor = p.number("scale", 1.0)
    p.warn_unused()
    if attribute.startswith(_ATTRIBUTES):
        return constant((factor, factor, factor))
    what = f"The attribute '{attribute[:40]}' of {p.element} is not read: what it would colour keeps its default."
    p.document.warn(what, p.element)
    return None


def _volume(p: Properties) -> Texture | None:
    """The colour of a constant volume; grids are not read."""
    for element in p.objects("volume"):
        inner = type(p)(element, p.document)
        if inner.type == "constvolume":
            return constant(inner.bounded_colour("value", 1.0, None))
    p.document.warn(f"{p.element} is not supported: what it would colour keeps its default.", p.element)
    return None
