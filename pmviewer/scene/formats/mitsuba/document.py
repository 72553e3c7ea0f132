"""One scene file while it is read: identifiers, references, and the typed properties of its objects."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.description import RGB, Vec3
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.mitsuba.spectrum import spectrum_object
from pmviewer.scene.formats.mitsuba.texture import is_constant, read_texture
from pmviewer.scene.formats.mitsuba.transform import Matrix, is_unit_rotation, operation
from pmviewer.scene.formats.mitsuba.values import (
    LARGEST,
    is_sampled,
    parse_boolean,
    parse_float,
    parse_integer,
    parse_rgb,
    parse_spectrum,
    parse_srgb,
    parse_vector,
)
from pmviewer.scene.formats.mitsuba.xml import Element
from pmviewer.scene.texture import LUMINANCE, Texture, limited

T = TypeVar("T")
MOST_NESTED = 32
VALUE_TAGS = frozenset(
    ("boolean", "integer", "float", "string", "point", "vector", "rgb", "srgb", "spectrum", "transform")
)
OBJECT_TAGS = frozenset(
    ("bsdf", "shape", "emitter", "sensor", "film", "integrator", "sampler", "rfilter", "texture", "medium", "phase",
     "volume", "ref")
)  # fmt: skip
# Objects that change nothing here: they belong to Mitsuba's own integrators.
SILENT_TAGS = frozenset(("integrator", "sampler", "rfilter"))


def snake_case(name: str) -> str:
    """toWorld → to_world, the naming of version 2 and later."""
    return re.sub(r"(?<=[a-z0-9])([A-Z]+)", lambda m: "_" + m[1], name).lower()


class Document:
    """The tree with everything that reading it needs. `folder` is what file names are relative to."""

    def __init__(self, root: Element, path: Path | None, diagnostics: Diagnostics) -> None:
        self.root = root
        self.folder = path.parent if path is not None else Path()
        self.diagnostics = diagnostics
        self.pictures: dict[tuple[str, bool], NDArray[np.float32]] = {}
        self.ids: dict[str, Element] = {}
        self._index(root)
        for alias in (c for c in root.children if c.tag == "alias"):
            name, target = alias.attributes.get("id", ""), alias.attributes.get("as", "")
            if name not in self.ids:
                raise self.error(f"<alias> refers to the id '{name}', which is not defined.", alias)
            self.ids[target] = self.ids[name]

    def _index(self, element: Element) -> None:
        name = element.attributes.get("id")
        if name is not None and element.tag not in ("ref", "alias"):
            if name in self.ids:
                what = f"The id '{name}' of {element} is already taken in line {self.ids[name].line}."
                raise self.error(what, element, "Give each object an id of its own.")
            self.ids[name] = element
        for child in element.children:
            self._index(child)

    def error(self, what: str, element: Element, hint: str = "") -> SceneError:
        return self.diagnostics.error(what, element.line, hint)

    def warn(self, sentence: str, element: Element, kind: str | None = None) -> None:
        self.diagnostics.warn(sentence, element.line, kind)

    def ignore(self, element: Element, reason: str = "is not supported and was ignored") -> None:
        """Name what is not read, once a kind."""
        self.warn(f"{element} {reason}.", element, kind=str(element) + reason)

    def resolve(self, reference: Element) -> Element:
        """The object a <ref> stands for."""
        name = reference.attributes.get("id")
        if name is None:
            raise self.error("<ref> needs an id.", reference)
        target = self.ids.get(name)
        if target is None:
            known = ", ".join(sorted(self.ids)[:8])
            hint = f"Known ids: {known}." if known else "The file defines no id."
            raise self.error(f"<ref> refers to the id '{name}', which is not defined.", reference, hint)
        return target

    def file(self, name: str, element: Element) -> Path:
        """Existing regular file that an object names, relative to the scene's folder."""
        for candidate in (name, name.replace("\\", "/")):
            try:
                path = self.folder / candidate
                # Devices and pipes would block for ever, so only plain files count.
                if path.is_file():
                    return path
            except (OSError, ValueError):
                break
        hint = f"Put it there, relative to {self.folder or '.'}, or correct the name."
        raise self.error(f"The file {name[:200]!r} named by {element} does not exist.", element, hint)


class Properties:
    """Typed access to the values inside one object element. What nobody asks for ends up in a warning.

    `textures` has those that were found where a colour or number was asked for, by its name; the answer is their mean.
    """

    def __init__(self, element: Element, document: Document, depth: int = 0) -> None:
        if depth > MOST_NESTED:
            what = f"{element} contains itself, or objects are nested deeper than {MOST_NESTED}."
            raise document.error(what, element, "Remove the circular <ref>.")
        self.element = element
        self.document = document
        self._depth = depth
        self.type = element.attributes.get("type", "")
        self.values: dict[str, Element] = {}
        self.textures: dict[str, Texture] = {}
        self._read: dict[str, Texture | None] = {}
        self._objects: list[tuple[Element, Element]] = []
        self._asked: set[str] = set()
        for child in element.children:
            if child.tag in VALUE_TAGS or (child.tag == "texture" and "name" in child.attributes):
                self._add_value(child)
            elif child.tag == "ref":
                target = document.resolve(child)
                if target.tag in ("texture", "spectrum") and "name" in child.attributes:
                    self._add_value(Element(target.tag, {**target.attributes, "name": child.attributes["name"]},
                                            child.line, target.children))  # fmt: skip
                else:
                    self._objects.append((child, target))
            elif child.tag in OBJECT_TAGS:
                self._objects.append((child, child))
            else:
                document.ignore(child)

    def _add_value(self, child: Element) -> None:
        name = child.attributes.get("name")
        if not name:
            raise self.document.error(f"{child} inside {self.element} needs a name.", child)
        name = snake_case(name)
        if name in self.values:
            raise self.document.error(f"{self.element} has two values for '{name}'.", child, "Remove one of them.")
        self.values[name] = child

    def __contains__(self, name: str) -> bool:
        return name in self.values

    def objects(self, *tags: str) -> list[Element]:
        """Nested objects of these kinds, references resolved."""
        return [target for _, target in self._objects if target.tag in tags]

    def known(self, *names: str) -> None:
        """Names that may stand in the file but change nothing here."""
        self._asked.update(names)

    def warn_unused(self, *understood_tags: str) -> None:
        """One warning for each kind of property or nested object that was not read."""
        for name, value in self.values.items():
            if name not in self._asked:
                sentence = f"'{name}' of {self.element} is not supported and was ignored."
                self.document.warn(sentence, value)
        for at, target in self._objects:
            if target.tag not in understood_tags and target.tag not in SILENT_TAGS:
                self.document.warn(f"{target} inside {self.element} is not supported and was ignored.", at)

    def _take(self, name: str, tags: tuple[str, ...], parse: Callable[[str], T], default: T) -> T:
        self._asked.add(name)
        element = self.values.get(name)
        if element is None:
            return default
        if element.tag not in tags:
            expected = " or ".join(f"<{t}>" for t in tags)
            raise self.document.error(f"'{name}' of {self.element} must be {expected}, not {element}.", element)
        return self._parsed(element, name, parse, _value_text(element))

    def _parsed(self, element: Element, name: str, parse: Callable[[str], T], text: str | None) -> T:
        if text is None:
            raise self.document.error(f"'{name}' of {self.element} has no value.", element)
        try:
            return parse(text)
        except ValueError as error:
            raise self.document.error(f"'{name}' of {self.element}: {error}.", element) from None

    def choice(self, name: str, words: tuple[str, ...]) -> str:
        """One of these words; the first one if nothing is given."""
        word = self.string(name, words[0])
        if word not in words:
            what = f"'{name}' of {self.element}: expected {' or '.join(words)}, found '{word[:40]}'."
            raise self.document.error(what, self.values[name])
        return word

    def texture(self, name: str) -> Texture | None:
        """The value of that name if it is a texture; None for anything else, and for one that can't be used."""
        element = self.values.get(name)
        if element is None or element.tag != "texture":
            return None
        self._asked.add(name)
        if name not in self._read:
            self._read[name] = read_texture(Properties(element, self.document, self._depth + 1))
        texture = self._read[name]
        if texture is not None and not is_constant(texture):
            self.textures.setdefault(name, texture)
        return texture

    def unnamed_textures(self) -> list[Texture]:
        """Nested textures that can be used and have no name of a property."""
        found = [read_texture(Properties(e, self.document, self._depth + 1)) for e in self.objects("texture")]
        return [texture for texture in found if texture is not None]

    def roughness(self, name: str, default: float) -> float:
        """A number, or a texture's mean luminance."""
        texture = self.texture(name)
        if texture is None:
            return default if self.tag_of(name) == "texture" else self.number(name, default)
        return float(np.dot(texture.mean, LUMINANCE))

    def number(self, name: str, default: float) -> float:
        return self._take(name, ("float", "integer"), parse_float, default)

    def integer(self, name: str, default: int) -> int:
        return self._take(name, ("integer",), parse_integer, default)

    def boolean(self, name: str, default: bool) -> bool:
        return self._take(name, ("boolean",), parse_boolean, default)

    def string(self, name: str, default: str) -> str:
        return self._take(name, ("string",), str.strip, default)

    def point(self, name: str, default: Vec3) -> Vec3:
        return self._take(name, ("point", "vector"), parse_vector, default)

    def tag_of(self, name: str) -> str | None:
        """How the value is written in the file: "float", "string", …; None if it is not there."""
        return self.values[name].tag if name in self.values else None

    def colour(self, name: str, default: float) -> RGB:
        """RGB value written in any of Mitsuba's ways; textures give their mean."""
        self._asked.add(name)
        element = self.values.get(name)
        if element is None:
            return (default, default, default)
        texture = self.texture(name)
        if texture is not None:
            return texture.mean
        text = element.attributes.get("value")
        if element.tag == "texture":
            return (default, default, default)
        if "type" in element.attributes:
            nested = Properties(element, self.document, self._depth + 1)
            return spectrum_object(nested, (default, default, default))
        if element.tag == "rgb":
            return self._parsed(element, name, parse_rgb, text)
        if element.tag == "srgb":
            return self._parsed(element, name, parse_srgb, text)
        if element.tag == "float":
            value = self._parsed(element, name, parse_float, text)
            return (value, value, value)
        if element.tag == "spectrum":
            if text is not None and is_sampled(text):
                self.document.warn(
                    "A sampled spectrum is approximated by its means over 600–700, 500–600 and 400–500 nm.",
                    element,
                )
            if text is None and "filename" in element.attributes:
                self.document.warn(f"A spectrum in a file is not supported: '{name}' keeps {default:g}.", element)
                return (default, default, default)
            return self._parsed(element, name, parse_spectrum, text)
        what = f"'{name}' of {self.element} must be <rgb>, <spectrum>, <srgb> or <float>, not {element}."
        raise self.document.error(what, element)

    def bounded_colour(self, name: str, default: float, most: float | None) -> RGB:
        """Colour that must not be negative; values above `most` are cut with a warning."""
        value = self.colour(name, default)
        at = self.values.get(name, self.element)
        if name in self.textures:
            texture, changed = limited(self.textures[name], most)
            if changed:
                self.document.warn(f"'{name}' of {self.element}: {changed}", at)
            self.textures[name] = texture
            return texture.mean
        if min(value) < 0:
            self.document.warn(f"'{name}' of {self.element}: negative numbers count as 0.", at)
            value = (max(value[0], 0.0), max(value[1], 0.0), max(value[2], 0.0))
        if most is not None and max(value) > most:
            self.document.warn(f"'{name}' of {self.element} above {most:g} was cut: it would create energy.", at)
            r, g, b = (min(c, most) for c in value)
            return (r, g, b)
        return value

    def texture_properties(self, name: str) -> Properties | None:
        """What stands inside the <texture> of this name; None if it is not there."""
        self._asked.add(name)
        element = self.values.get(name)
        if element is None:
            return None
        if element.tag != "texture":
            raise self.document.error(f"'{name}' of {self.element} must be <texture>, not {element}.", element)
        return Properties(element, self.document, self._depth + 1)

    def transform(self, name: str = "to_world") -> Matrix:
        """World from object, (4, 4)."""
        self._asked.add(name)
        element = self.values.get(name)
        matrix = np.eye(4)
        if element is None:
            return matrix
        if element.tag != "transform":
            raise self.document.error(f"'{name}' of {self.element} must be a <transform>, not {element}.", element)
        for child in element.children:
            try:
                with np.errstate(over="ignore", invalid="ignore"):
                    matrix = operation(child) @ matrix
            except ValueError as error:
                raise self.document.error(f"<{child.tag}> of {self.element}: {error}.", child) from None
            if not is_unit_rotation(child):
                what = "The axis of <rotate> is not of unit length: it stretches and shears, as it does in Mitsuba 3."
                self.document.warn(what, child)
            if not np.abs(matrix).max() <= LARGEST:
                what = f"'{name}' of {self.element} grows beyond {LARGEST:g}."
                raise self.document.error(what, child, "Use smaller numbers.")
        return matrix


def _value_text(element: Element) -> str | None:
    if "value" in element.attributes:
        return element.attributes["value"]
    if {"x", "y", "z"} <= element.attributes.keys():
        return " ".join(element.attributes[c] for c in "xyz")
    return None
