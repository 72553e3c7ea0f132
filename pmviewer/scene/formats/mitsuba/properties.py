"""The typed values inside one object of a scene file.

What can't be read as it should be counts as not given, with a warning; only shapes are better left out than shown
wrong, so theirs is an error, which leaves out the shape.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from pmviewer.errors import SceneError
from pmviewer.scene.description import RGB, Vec3
from pmviewer.scene.formats.mitsuba.spectrum import blackbody_tag, spectrum_file, spectrum_object, spectrum_text
from pmviewer.scene.formats.mitsuba.texture import is_constant, read_texture
from pmviewer.scene.formats.mitsuba.transform import Matrix, operation
from pmviewer.scene.formats.mitsuba.values import (
    LARGEST,
    parse_boolean,
    parse_float,
    parse_integer,
    parse_rgb,
    parse_srgb,
    parse_vector,
)
from pmviewer.scene.formats.mitsuba.versions import snake_case
from pmviewer.scene.formats.mitsuba.xml import Element
from pmviewer.scene.texture import LUMINANCE, Texture, limited

if TYPE_CHECKING:
    from pmviewer.scene.formats.mitsuba.document import Document

T = TypeVar("T")
MOST_NESTED = 32
VALUE_TAGS = frozenset(
    ("boolean", "integer", "float", "string", "point", "vector", "rgb", "srgb", "spectrum", "blackbody", "transform",
     "animation")
)  # fmt: skip
OBJECT_TAGS = frozenset(
    ("bsdf", "shape", "emitter", "sensor", "film", "integrator", "sampler", "rfilter", "texture", "medium", "phase",
     "volume", "ref")
)  # fmt: skip
_SPECTRA = ("uniform", "d65", "regular", "irregular", "blackbody", "rgb", "srgb", "rawconstant")
# Objects that change nothing here: they belong to Mitsuba's own integrators.
SILENT_TAGS = frozenset(("integrator", "sampler", "rfilter"))


class Properties:
    """Typed access to the values inside one object element. What nobody asks for ends up in a warning.

    `textures` has those that were found where a colour or number was asked for, by its name; the answer is their mean.
    `emitted`: is it a spectrum of light?
    """

    def __init__(self, element: Element, document: Document, depth: int = 0, emitted: bool = False) -> None:
        if depth > MOST_NESTED:
            if document.circular(element):
                raise document.error(f"{element} contains itself.", element, "Remove the circular <ref>.")
            what = f"{element} lies within more than {MOST_NESTED} objects."
            raise document.error(what, element, "Flatten what is around it.")
        self.element = element
        self.document = document
        self.emitted = emitted or element.tag == "emitter"
        self._depth = depth
        self.type = element.attributes.get("type", "")
        self.values: dict[str, Element] = {}
        self.textures: dict[str, Texture] = {}
        self._read: dict[str, Texture | None] = {}
        self._objects: list[tuple[Element, Element]] = []
        self._asked: set[str] = set()
        for child in element.children:
            if child.tag == "spectrum" and child.attributes.get("type", _SPECTRA[0]) not in _SPECTRA:
                child.tag = "texture"  # as Mitsuba 2 wrote them
            if child.tag == "spectrum" and "name" not in child.attributes:
                self._objects.append((child, child))
            elif child.tag in VALUE_TAGS or (child.tag == "texture" and "name" in child.attributes):
                self._add_value(child)
            elif child.tag == "ref":
                target = document.find(child)
                if target is None:
                    continue
                if target.tag in ("texture", "spectrum") and "name" in child.attributes:
                    self._add_value(Element(target.tag, {**target.attributes, "name": child.attributes["name"]},
                                            child.line, target.children, child.file))  # fmt: skip
                else:
                    self._objects.append((child, target))
            elif child.tag in OBJECT_TAGS:
                self._objects.append((child, child))
            else:
                document.ignore(child)

    def _add_value(self, child: Element) -> None:
        name = child.attributes.get("name")
        if not name:
            self.document.warn(f"{child} inside {self.element} needs a name: it was ignored.", child)
            return
        name = snake_case(name)
        if name in self.values:
            self.document.warn(f"{self.element} has two values for '{name}': the first one counts.", child)
            return
        self.values[name] = child

    def __contains__(self, name: str) -> bool:
        return name in self.values

    def objects(self, *tags: str) -> list[Element]:
        """Nested objects of these kinds, references resolved."""
        return [target for _, target in self._objects if target.tag in tags]

    def named_objects(self, tag: str) -> list[tuple[str, Element]]:
        """Nested objects of a kind with the names that they are given here, "" for none."""
        return [(at.attributes.get("name", ""), target) for at, target in self._objects if target.tag == tag]

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

    # Words and numbers

    def _take(self, name: str, expected: str, parse: Callable[[str], T], default: T) -> T:
        self._asked.add(name)
        element = self.values.get(name)
        if element is None:
            return default
        text = _value_text(element)
        if text is None or element.tag in ("transform", "animation", "texture"):
            return self._refused(name, f"expected {expected}, found {element}", default)
        return self._parsed(name, parse, text, default)

    def _parsed(self, name: str, parse: Callable[[str], T], text: str, default: T) -> T:
        try:
            return parse(text)
        except ValueError as error:
            return self._refused(name, str(error), default)

    def _refused(self, name: str, reason: str, default: T) -> T:
        element = self.values[name]
        what = f"'{name}' of {self.element}: {reason}"
        if self.element.tag == "shape":
            raise self.document.error(f"{what}.", element)
        self.document.warn(f"{what}; {_written(default)} is used.", element)
        return default

    def choice(self, name: str, words: tuple[str, ...]) -> str:
        """One of these words; the first one if nothing is given, or, with a warning, something else."""
        word = self.string(name, words[0])
        return word if word in words else self._refused(name, f"expected {_or(words)}, found '{word}'", words[0])

    def number(self, name: str, default: float) -> float:
        """A float; see the module for what can't be read."""
        return self._take(name, "a number", parse_float, default)

    def integer(self, name: str, default: int) -> int:
        """A whole number, likewise."""
        return self._take(name, "a whole number", parse_integer, default)

    def boolean(self, name: str, default: bool) -> bool:
        """ "true" or "false", likewise."""
        return self._take(name, "true or false", parse_boolean, default)

    def string(self, name: str, default: str) -> str:
        """Text without the blanks around it."""
        return self._take(name, "text", str.strip, default)

    def point(self, name: str, default: Vec3) -> Vec3:
        """Three numbers, or one for all three, likewise."""
        return self._take(name, "a point or vector", parse_vector, default)

    def tag_of(self, name: str) -> str | None:
        """How the value is written in the file: "float", "string", …; None if it is not there."""
        return self.values[name].tag if name in self.values else None

    # Textures and colours

    def _lit(self, name: str) -> Element | None:
        """The value of that name; of daylight shining through a texture, that texture (Mitsuba's RGB variants)."""
        element = self.values.get(name)
        if element is not None and element.attributes.get("type") == "d65":
            return next((c for c in element.children if c.tag == "texture"), element)
        return element

    def texture(self, name: str) -> Texture | None:
        """The value of that name if it is a texture; None for anything else, and for one that can't be used."""
        element = self._lit(name)
        if element is None or element.tag != "texture":
            return None
        self._asked.add(name)
        if name not in self._read:
            emitted = self.element.tag == "emitter"
            self._read[name] = self._usable(element, emitted)
        texture = self._read[name]
        if texture is not None and not is_constant(texture):
            self.textures.setdefault(name, texture)
        return texture

    def _usable(self, element: Element, emitted: bool = False) -> Texture | None:
        try:
            return read_texture(Properties(element, self.document, self._depth + 1, emitted))
        except SceneError as error:
            self.document.warn(f"{error.what} The texture is left out.", element)
            return None

    def unnamed_textures(self) -> list[Texture]:
        """Nested textures that can be used and have no name of a property."""
        found = [self._usable(element) for element in self.objects("texture")]
        return [texture for texture in found if texture is not None]

    def texture_properties(self, name: str) -> Properties | None:
        """What stands inside the <texture> of this name; None if it is not there."""
        self._asked.add(name)
        element = self.values.get(name)
        if element is None:
            return None
        if element.tag != "texture":
            raise self.document.error(f"'{name}' of {self.element} must be <texture>, not {element}.", element)
        return Properties(element, self.document, self._depth + 1)

    def roughness(self, name: str, default: float) -> float:
        """A number, or a texture's mean luminance."""
        texture = self.texture(name)
        if texture is None:
            return default if self.tag_of(name) == "texture" else self.number(name, default)
        return float(np.dot(texture.mean, LUMINANCE))

    def colour(self, name: str, default: float) -> RGB:
        """RGB value written in any of Mitsuba's ways; textures give their mean. Spectra of emitters are light, others
        what surfaces make of it."""
        self._asked.add(name)
        element, grey = self._lit(name), (default, default, default)
        if element is None:
            return grey
        texture = self.texture(name)
        if texture is not None:
            return texture.mean
        if element.tag == "texture":
            return grey  # why it can't be used has been said
        return self._colour(name, element, grey, self.element.tag == "emitter")

    def nested_spectrum(self, element: Element) -> RGB:
        """Colour in daylight of a spectrum that stands in here without a name."""
        if "type" not in element.attributes:
            self.document.ignore(element, "without a name was ignored")
            return (1.0, 1.0, 1.0)
        return spectrum_object(Properties(element, self.document, self._depth + 1), (1.0, 1.0, 1.0))

    def _colour(self, name: str, element: Element, default: RGB, emitted: bool) -> RGB:
        document = self.document
        if "type" in element.attributes:
            return spectrum_object(Properties(element, document, self._depth + 1, emitted), default)
        emitted = {"illuminant": True, "reflectance": False}.get(element.attributes.get("intent", ""), emitted)
        if element.tag == "blackbody":
            return self._parsed(name, lambda _: blackbody_tag(element, document), "", default)
        if element.tag == "spectrum" and "filename" in element.attributes:
            return self._file(name, element, default, emitted)
        text = _value_text(element)
        if text is None or element.tag in ("transform", "animation", "boolean"):
            return self._refused(name, f"expected a colour, found {element}", default)
        if element.tag == "srgb":
            return self._parsed(name, parse_srgb, text, default)
        if element.tag == "spectrum":
            return self._parsed(name, lambda t: spectrum_text(t, emitted, element, document), text, default)
        return self._parsed(name, parse_rgb, text, default)

    def _file(self, name: str, element: Element, default: RGB, emitted: bool) -> RGB:
        try:
            path = self.document.file(element.attributes["filename"], element)
            return spectrum_file(path, emitted, element, self.document)
        except SceneError:
            self.document.missing(element.attributes["filename"][:200], element)
            return default
        except (ValueError, OSError) as error:
            reason = str(error) if isinstance(error, ValueError) else "expected a file that can be read"
            return self._refused(name, reason, default)

    def bounded_colour(self, name: str, default: float, most: float | None) -> RGB:
        """Colour that is not negative and at most `most`; what is outside is cut, with a warning."""
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
        if most is not None and max(value) > most:
            self.document.warn(f"'{name}' of {self.element} above {most:g} was cut: it would create energy.", at)
        r, g, b = (max(0.0, c if most is None else min(c, most)) for c in value)
        return (r, g, b)

    # Transformations

    def transform(self, name: str = "to_world") -> Matrix:
        """World from object, (4, 4). Raises SceneError for one that can't be read: nobody knows where things are."""
        self._asked.add(name)
        element = self.values.get(name)
        matrix = np.eye(4)
        if element is None:
            return matrix
        if element.tag == "animation":
            self.document.warn(f"'{name}' of {self.element} moves: its first place is shown.", element)
            element = next((c for c in element.children if c.tag == "transform"), element)
        elif element.tag != "transform":
            raise self.document.error(f"'{name}' of {self.element} must be a <transform>, not {element}.", element)
        for child in element.children:
            try:
                with np.errstate(over="ignore", invalid="ignore"):
                    matrix = operation(child, partial(self.document.warn, element=child)) @ matrix
            except ValueError as error:
                raise self.document.error(f"<{child.tag}> of {self.element}: {error}.", child) from None
            if not np.abs(matrix).max() <= LARGEST:
                what = f"'{name}' of {self.element} grows beyond {LARGEST:g}."
                raise self.document.error(what, child, "Use smaller numbers.")
        return matrix


def _value_text(element: Element) -> str | None:
    if "value" in element.attributes:
        return element.attributes["value"]
    if element.tag in ("point", "vector") and not element.attributes.keys().isdisjoint("xyz"):
        return " ".join(element.attributes.get(c, "0") for c in "xyz")
    return None


def _or(words: tuple[str, ...]) -> str:
    return f"{', '.join(words[:-1])} or {words[-1]}" if len(words) > 1 else words[0]


def _written(value: object) -> str:
    """A value as it stands in a scene file."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return " ".join(f"{c:g}" for c in value)
    return f"{value:g}" if isinstance(value, int | float) else f"'{value}'" if value else "nothing"
