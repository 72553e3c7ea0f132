"""Shape groups and their instances. Groups may show other groups: that is flattened into copies of what they hold."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pmviewer.scene.clean import clean_shapes
from pmviewer.scene.description import Group, Instance, Shape
from pmviewer.scene.formats.mitsuba.document import Document, Properties
from pmviewer.scene.formats.mitsuba.transform import Matrix
from pmviewer.scene.formats.mitsuba.xml import Element
from pmviewer.scene.instances import first_singular

GROUP, INSTANCE = "shapegroup", "instance"
MOST_INSTANCES = 1 << 22

Copies = list[tuple[Group, Matrix]]


class Groups:
    """Reads groups when an instance first asks for them. `read_shape` reads a <shape> of a plain type."""

    def __init__(self, document: Document, read_shape: Callable[[Element], Shape | None]) -> None:
        self.document = document
        self.instances: list[Instance] = []
        self._lines: list[int] = []
        self._read_shape = read_shape
        self._contents: dict[int, Copies] = {}
        self._open: list[Element] = []

    def add(self, element: Element) -> None:
        """An <shape type="instance"> of the scene."""
        name = element.attributes.get("id") or f"instance (line {element.line})"
        copies = self._copies(element)
        if len(self.instances) + len(copies) > MOST_INSTANCES:
            raise self._too_many(element)
        self.instances += [Instance(name, group, matrix) for group, matrix in copies]
        self._lines += [element.line] * len(copies)

    def checked(self) -> tuple[Instance, ...]:
        """All instances. Raises SceneError when one has no inverse."""
        bad = first_singular(self.instances)
        if bad is not None:
            raise self.document.diagnostics.error(
                "'to_world' of <shape type=\"instance\"> is singular: it squeezes the group flat.",
                self._lines[bad],
                "Give each axis a scale other than zero.",
            )
        return tuple(self.instances)

    def _too_many(self, element: Element) -> Exception:
        what = f"The scene has more than {MOST_INSTANCES:,} instances once nested groups are written out."
        return self.document.error(what, element, "Put more triangles into the innermost group and use fewer copies.")

    def _copies(self, element: Element) -> Copies:
        p = Properties(element, self.document)
        groups = [s for s in p.objects("shape") if s.attributes.get("type") == GROUP]
        if len(groups) != 1 or len(p.objects("shape")) != 1:
            hint = 'Write <ref id="…"/> with the id of a <shape type="shapegroup">.'
            raise self.document.error(f"{element} needs exactly one shapegroup.", element, hint)
        if p.objects("emitter"):
            raise self._light(p.objects("emitter")[0], element)
        matrix = p.transform()
        p.warn_unused("shape")
        return [(group, matrix @ inner) for group, inner in self._of(groups[0])]

    def _light(self, emitter: Element, inside: Element) -> Exception:
        what = f"{emitter} inside {inside} is refused: lights can't be instanced."
        return self.document.error(what, emitter, "Move the light out of the group.")

    def _of(self, element: Element) -> Copies:
        """What a group holds: its own shapes as one group, and the copies of the groups that it shows."""
        if id(element) in self._contents:
            return self._contents[id(element)]
        if any(element is outer for outer in self._open):
            raise self.document.error(f"{element} contains an instance of itself.", element, "Remove the circle.")
        self._open.append(element)
        p = Properties(element, self.document)
        if p.objects("emitter"):
            raise self._light(p.objects("emitter")[0], element)
        shapes: list[Shape] = []
        found: Copies = []
        for child in p.objects("shape"):
            if child.attributes.get("type") == INSTANCE:
                found += self._copies(child)
                if len(found) > MOST_INSTANCES:
                    raise self._too_many(element)
                continue
            if child.attributes.get("type") == GROUP:
                raise self.document.error(f"{child} stands inside {element}.", child, "Show it with an instance.")
            emitters = Properties(child, self.document).objects("emitter")
            if emitters:
                raise self._light(emitters[0], element)
            shape = self._read_shape(child)
            if shape is not None:
                shapes.append(shape)
        p.warn_unused("shape")
        kept = clean_shapes(shapes, self.document.diagnostics)
        name = element.attributes.get("id") or f"group (line {element.line})"
        if kept:
            found.insert(0, (Group(name, kept), np.eye(4)))
        elif not found:
            self.document.warn(f"The group '{name}' has no surface: its instances are left out.", element)
        self._open.pop()
        self._contents[id(element)] = found
        return found
