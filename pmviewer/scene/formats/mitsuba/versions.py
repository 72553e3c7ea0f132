"""Files of older versions of Mitsuba, written in today's names.

Versions 0.4 to 1 as Mitsuba 3 upgrades them (src/core/parser.cpp), those before as Mitsuba 0.6 did (data/schema).
"""

from __future__ import annotations

import re
from functools import lru_cache

from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.mitsuba.xml import Element

Version = tuple[int, ...]
_CURRENT: Version = (3, 0, 0)

# New tag by old tag, new type by (tag, old type), new name by (tag, type or "" for any, old name); each with the
# version that brought it.
_TAGS: list[tuple[Version, dict[str, str]]] = [((0, 4), {"camera": "sensor", "luminaire": "emitter"})]
_TYPES: list[tuple[Version, dict[tuple[str, str], str]]] = [
    (
        (0, 3),
        {
            ("bsdf", "lambertian"): "diffuse",
            ("bsdf", "microfacet"): "roughplastic",
            ("bsdf", "mirror"): "conductor",
            ("bsdf", "roughmetal"): "roughconductor",
            ("bsdf", "roughglass"): "roughdielectric",
            ("bsdf", "composite"): "mixturebsdf",
            ("texture", "exrtexture"): "bitmap",
            ("texture", "ldrtexture"): "bitmap",
        },
    ),
    ((0, 4), {("film", "exrfilm"): "hdrfilm", ("film", "pngfilm"): "ldrfilm"}),
    ((0, 5), {("bsdf", "bump"): "bumpmap"}),
]
_NAMES: list[tuple[Version, dict[tuple[str, str, str], str]]] = [
    (
        (0, 3),
        {
            ("shape", "sphere", "inverted"): "flip_normals",
            ("texture", "checkerboard", "bright_color"): "color0",
            ("texture", "checkerboard", "dark_color"): "color1",
            ("texture", "gridtexture", "bright_color"): "color0",
            ("texture", "gridtexture", "dark_color"): "color1",
            ("bsdf", "ward", "alpha_x"): "alpha_u",
            ("bsdf", "ward", "alpha_y"): "alpha_v",
            ("bsdf", "", "alpha_b"): "alpha",
        },
    ),
    (
        (0, 4),
        {
            ("emitter", "area", "intensity"): "radiance",
            ("emitter", "constant", "intensity"): "radiance",
            ("emitter", "directional", "intensity"): "irradiance",
            ("emitter", "", "intensity_scale"): "scale",
            ("sensor", "", "focus_depth"): "focus_distance",
        },
    ),
    ((2, 0), {("bsdf", "diffuse", "diffuse_reflectance"): "reflectance"}),
]


@lru_cache(4096)
def snake_case(name: str) -> str:
    """toWorld → to_world, the naming of version 2 and later."""
    return re.sub(r"(?<=[a-z0-9])([A-Z]+)", lambda m: "_" + m[1], name).lower()


def upgrade(root: Element, diagnostics: Diagnostics) -> None:
    """Change a file's tree, as it was read, to the names of version 3."""
    version = _version(root, diagnostics)
    todo = [root]
    while todo:
        element = todo.pop()
        if version < (2,):
            _rename(element, version)
            _clear_boundary(element, diagnostics)
        if element.tag == "shape" and "type" in element.attributes:
            element.attributes["type"] = element.attributes["type"].lower()  # "shapeGroup", "Rectangle"
        _texture_scale(element)
        todo += element.children


def _version(root: Element, diagnostics: Diagnostics) -> Version:
    text = root.attributes.get("version")
    if text is None:
        sentence = f"{root} says nothing of Mitsuba's version: the file is read as one of version 3."
    elif re.fullmatch(r"\d{1,6}(\.\d{1,6}){0,3}", text.strip(), re.ASCII):
        return tuple(int(part) for part in text.strip().split("."))
    else:
        sentence = f"The version {text[:40]!r} is not one of Mitsuba's: the file is read as one of version 3."
    if "$" not in (text or ""):
        diagnostics.warn(sentence, root.line, file=root.file)
    return _CURRENT


def _rename(element: Element, version: Version) -> None:
    attributes = element.attributes
    if "name" in attributes and element.tag != "default":
        attributes["name"] = snake_case(attributes["name"])
    for since, tags in _TAGS:
        if version < since and element.tag in tags:
            _old_camera(element)
            element.tag = tags[element.tag]
    kind = attributes.get("type", "")
    if version < (0, 3):
        _before_0_3(element, kind)
    for since, types in _TYPES:
        if version < since and (element.tag, kind) in types:
            kind = attributes["type"] = types[element.tag, kind]
    for since, names in _NAMES:
        if version < since:
            for child in element.children:
                name = snake_case(child.attributes.get("name", ""))
                new = names.get((element.tag, kind, name)) or names.get((element.tag, "", name))
                if new:
                    child.attributes["name"] = new


def _clear_boundary(element: Element, diagnostics: Diagnostics) -> None:
    """Before version 2 a shape at which a medium begins or ends lets light pass if it has no BSDF; today it is grey."""
    names = {child.attributes.get("name") for child in element.children if child.tag in ("medium", "ref")}
    others = any(
        child.tag in ("bsdf", "emitter", "luminaire", "sensor", "camera", "subsurface")
        or (child.tag == "ref" and child.attributes.get("name") not in ("interior", "exterior"))
        for child in element.children
    )
    if element.tag == "shape" and names & {"interior", "exterior"} and not others:
        element.children.append(Element("bsdf", {"type": "null"}, element.line, [], element.file))
        sentence = f"{element} has a medium and no BSDF: light passes it, as in version 0.6."
        diagnostics.warn(sentence, element.line, file=element.file)


def _old_camera(element: Element) -> None:
    """The cameras of 0.3 and before were mirrored, and their field of view was that of the smaller side."""
    if element.tag != "camera":
        return
    axis = "smaller"
    for child in element.children:
        name = snake_case(child.attributes.get("name", ""))
        if child.tag == "transform":
            child.children.insert(0, Element("scale", {"x": "-1"}, child.line, [], child.file))
        if name == "map_smaller_side" and child.attributes.get("value") == "false":
            axis = "larger"
    element.children = [
        c for c in element.children if snake_case(c.attributes.get("name", "")) != "map_smaller_side"
    ] + [Element("string", {"name": "fov_axis", "value": axis}, element.line, [], element.file)]


def _before_0_3(element: Element, kind: str) -> None:
    a = element.attributes
    if element.tag == "lookAt" and {"ox", "oy", "oz", "tx", "ty", "tz"} <= a.keys():
        vectors = {"origin": "o", "target": "t", "up": "u"}
        element.attributes = {
            name: " ".join(a[letter + c] for c in "xyz")
            for name, letter in vectors.items()
            if {letter + c for c in "xyz"} <= a.keys()
        }
    if element.tag == "transform":
        old = [i for i, c in enumerate(element.children) if c.tag == "lookAt" and "ox" in c.attributes]
        for i in reversed(old):
            child = element.children[i]
            element.children.insert(i, Element("scale", {"x": "-1"}, child.line, [], child.file))
    if element.tag == "shape" and kind == "cylinder":
        for child in element.children:
            name = child.attributes.get("name")
            child.attributes.update({"name": {"p1": "p0", "p2": "p1"}[name]} if name in ("p1", "p2") else {})
    if element.tag == "shape" and kind == "obj":
        element.children.append(
            Element("boolean", {"name": "flip_tex_coords", "value": "false"}, element.line, [], element.file)
        )
    if element.tag == "bsdf" and kind == "mirror":
        element.children.append(Element("string", {"name": "material", "value": "Cr"}, element.line, [], element.file))


def _texture_scale(element: Element) -> None:
    """uscale, vscale, uoffset and voffset as a transformation: first the offset, then the scale."""
    if element.tag != "texture":
        return
    found: dict[str, str] = {}
    kept = []
    for child in element.children:
        name = child.attributes.get("name", "").lower()
        if child.tag in ("float", "integer") and name in ("uscale", "vscale", "uoffset", "voffset"):
            found[name] = child.attributes.get("value", "")
        else:
            kept.append(child)
    if not found or any(child.attributes.get("name") in ("to_uv", "toUV") for child in kept):
        return
    line, file = element.line, element.file
    operations = [
        Element(tag, {c: found[a + what] for c, a in (("x", "u"), ("y", "v")) if a + what in found}, line, [], file)
        for tag, what in (("translate", "offset"), ("scale", "scale"))
    ]
    element.children = [*kept, Element("transform", {"name": "to_uv"}, line, operations, file)]
