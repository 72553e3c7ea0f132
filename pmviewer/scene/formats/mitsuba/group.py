"""Shape groups and their instances. Groups may show other groups: that is flattened into copies of what they hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.instances import singular
from pmviewer.scene.clean import clean_shapes
from pmviewer.scene.description import Group, Instance, Shape
from pmviewer.scene.formats.mitsuba.document import Document, Properties
from pmviewer.scene.formats.mitsuba.transform import Matrix
from pmviewer.scene.formats.mitsuba.xml import Element

GROUP, INSTANCE = "shapegroup", "instance"
MOST_INSTANCES = 1 << 20
DEEPEST = 64


@dataclass(eq=False)
class _Content:
    """What a group holds: its own shapes, and other groups by their places in it. `copies` counts the groups of shapes
    that one instance of it comes to."""

    own: Group | None
    nested: list[tuple[Matrix, _Content]]
    copies: int
    _flat: dict[Group, NDArray[np.float64]] | None = None

    def flat(self) -> dict[Group, NDArray[np.float64]]:
        """The groups of shapes in it with their places (n, 4, 4)."""
        if self._flat is None:
            found: dict[Group, list[NDArray[np.float64]]] = {}
            if self.own is not None:
                found[self.own] = [np.eye(4)[None]]
            for matrix, content in self.nested:
                for group, places in content.flat().items():
                    found.setdefault(group, []).append(matrix @ places)
            self._flat = {group: np.concatenate(places) for group, places in found.items()}
        return self._flat


class Groups:
    """Reads groups when an instance first asks for them. `read_shape` reads a <shape> of a plain type, None if it is
    left out."""

    def __init__(self, document: Document, read_shape: Callable[[Element], Shape | None]) -> None:
        self.document = document
        self._instances: list[Instance] = []
        self._elements: list[Element] = []
        self._read_shape = read_shape
        self._contents: dict[int, _Content] = {}
        self._open: list[Element] = []

    def add(self, element: Element) -> None:
        """An <shape type="instance"> of the scene. Raises SceneError for one that can't be shown."""
        name = element.attributes.get("id") or f"instance (line {element.line})"
        matrix, content = self._instance(element)
        if len(self._instances) + content.copies > MOST_INSTANCES:
            what = f"The scene has more than {MOST_INSTANCES:,} instances once nested groups are written out."
            hint = "Put more triangles into the innermost group and use fewer copies."
            raise self.document.error(what, element, hint)
        for group, places in content.flat().items():
            self._instances += [Instance(name, group, place) for place in matrix @ places]
            self._elements += [element] * len(places)

    def checked(self) -> tuple[Instance, ...]:
        """All instances but those whose transformation has no inverse, which one warning names."""
        bad = singular(self._instances)
        for i in np.flatnonzero(bad):
            what = "'to_world' of <shape type=\"instance\"> squeezes the group flat: the instance is left out."
            self.document.warn(what, self._elements[i])
        return tuple(instance for instance, left_out in zip(self._instances, bad) if not left_out)

    def _instance(self, element: Element) -> tuple[Matrix, _Content]:
        for child in element.children:
            if child.tag == "ref":
                self.document.resolve(child)  # an error says more than a missing group
        p = Properties(element, self.document)
        groups = [s for s in p.objects("shape") if s.attributes.get("type") == GROUP]
        if len(groups) != 1 or len(p.objects("shape")) != 1:
            hint = 'Write <ref id="…"/> with the id of a <shape type="shapegroup">.'
            raise self.document.error(f"{element} needs exactly one shapegroup.", element, hint)
        self._no_light(p)
        matrix = p.transform()
        p.warn_unused("shape", "emitter")
        return matrix, self._of(groups[0])

    def _no_light(self, p: Properties) -> None:
        for emitter in p.objects("emitter"):
            what = f"{emitter} inside {p.element} is left out: lights can't be instanced."
            self.document.warn(what, emitter)

    def _of(self, element: Element) -> _Content:
        if id(element) in self._contents:
            return self._contents[id(element)]
        if any(element is outer for outer in self._open):
            raise self.document.error(f"{element} contains an instance of itself.", element, "Remove the circle.")
        if len(self._open) >= DEEPEST:
            what = f"{element} lies within more than {DEEPEST} other groups."
            raise self.document.error(what, element, "Put its shapes into fewer groups.")
        self._open.append(element)
        try:
            content = self._contents[id(element)] = self._read(element)
        finally:
            self._open.pop()
        return content

    def _read(self, element: Element) -> _Content:
        p = Properties(element, self.document)
        self._no_light(p)
        shapes: list[Shape] = []
        nested: list[tuple[Matrix, _Content]] = []
        copies = 0
        for child in p.objects("shape"):
            kind = child.attributes.get("type")
            if kind == INSTANCE:
                matrix, content = self._instance(child)
                nested.append((matrix, content))
                copies += content.copies
            elif kind == GROUP:
                raise self.document.error(f"{child} stands inside {element}.", child, "Show it with an instance.")
            else:
                self._no_light(Properties(child, self.document))
                shape = self._read_shape(child)
                if shape is not None:
                    shapes.append(shape)
        p.warn_unused("shape", "emitter")
        kept = clean_shapes([_dark(shape) for shape in shapes], self.document.diagnostics)
        name = element.attributes.get("id") or f"group (line {element.line})"
        if not kept and not copies:
            self.document.warn(f"The group '{name}' has no surface: its instances are left out.", element)
        return _Content(Group(name, kept) if kept else None, nested, copies + bool(kept))


def _dark(shape: Shape) -> Shape:
    """The shape as no light."""
    return replace(shape, radiance=None, emission=None)
