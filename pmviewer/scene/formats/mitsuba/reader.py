"""The shapes, lights and sensors of a scene file. What can't be read is left out, with a warning that says why."""

from __future__ import annotations

from pathlib import Path

from pmviewer.errors import SceneError
from pmviewer.scene.description import RGB, Light, Shape
from pmviewer.scene.formats.mitsuba.bsdf import Materials
from pmviewer.scene.formats.mitsuba.document import SILENT_TAGS, Document, MissingFile, Properties
from pmviewer.scene.formats.mitsuba.emitter import add_lights
from pmviewer.scene.formats.mitsuba.group import GROUP, INSTANCE, Groups
from pmviewer.scene.formats.mitsuba.medium import Media
from pmviewer.scene.formats.mitsuba.mesh_file import BrokenMesh
from pmviewer.scene.formats.mitsuba.older import is_clear
from pmviewer.scene.formats.mitsuba.shape import SUPPORTED, geometry
from pmviewer.scene.formats.mitsuba.xml import Element
from pmviewer.scene.texture import Texture

# Definitions that other objects refer to change nothing where they stand.
_SILENT = SILENT_TAGS | {"bsdf", "texture", "spectrum", "alias", "medium", "phase", "volume"}
_MERGE = "merge"
_WITHOUT_SURFACE = ("point", "spot", "directional", "projector")
"""Emitters that Mitsuba takes for lights of their own wherever they stand."""
MOST_MERGED = 1 << 17
BROKEN = "Meshes that can't be used, whose shapes are left out: {names}."


class Reader:
    """Walks the top-level objects once. `failures` are the errors of what was left out, in the order of the file."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.materials = Materials(document)
        self.media = Media(document)
        self.shapes: list[Shape] = []
        self.groups = Groups(document, self._shape)
        self.lights: list[Light] = []
        self.sensors: list[Element] = []
        self.hides_lights = False
        self.failures: list[SceneError] = []
        self._grey: set[int] = set()
        self._merges = 0
        for child in document.root.children:
            element = document.find(child) if child.tag == "ref" else child
            if element is not None:
                self._read(element)

    def _read(self, element: Element) -> None:
        if element.tag == "shape":
            self._surface(element)
        elif element.tag == "emitter":
            if element.attributes.get("type") != "area" or "id" not in element.attributes:  # else shapes refer to it
                self._emitter(element)
        elif element.tag == "sensor":
            self.sensors.append(element)
        elif element.tag == "integrator":
            self._integrator(element)
        elif element.tag not in _SILENT:
            self.document.ignore(element)

    def _integrator(self, element: Element) -> None:
        """The program has its own; what the file's leaves out of the picture is."""
        hidden = (c for c in element.children if c.attributes.get("name") in ("hide_emitters", "hideEmitters"))
        if any(c.attributes.get("value", "").strip().lower() == "true" for c in hidden):
            self.hides_lights = True

    def _failed(self, element: Element, error: SceneError, instead: str) -> None:
        """Say what was left out and why."""
        self.failures.append(error)
        if isinstance(error, MissingFile):
            self.document.missing(error.name, element)
        elif isinstance(error, BrokenMesh):
            self.document.diagnostics.warn_of(error.name, BROKEN, element.line, element.file)
        else:
            self.document.warn(f"{error.what} {instead}", element, kind=f"{element}{error.what}")

    def _surface(self, element: Element, depth: int = 0) -> None:
        kind = element.attributes.get("type")
        if kind == INSTANCE:
            try:
                self.groups.add(element)
            except SceneError as error:
                self._failed(element, error, "The instance is left out.")
        elif kind == _MERGE:
            self._merged(element, depth)
        elif kind != GROUP:  # a definition, which is read when an instance shows it
            shape = self._shape(element)
            if shape is not None:
                self.shapes.append(shape)

    def _merged(self, element: Element, depth: int) -> None:
        """A <shape type="merge"> is what it holds. Raises SceneError for one that holds too much."""
        p = Properties(element, self.document, depth)
        for child in p.objects("shape"):
            self._merges += 1
            if self._merges > MOST_MERGED:
                what = f"{element} holds more than {MOST_MERGED:,} shapes once all of it is written out."
                raise self.document.error(what, element, "Use instances of a shapegroup.")
            self._surface(child, depth + 1)
        p.warn_unused("shape")

    def _shape(self, element: Element) -> Shape | None:
        """A shape of a plain type, None if it is left out."""
        if element.attributes.get("type") not in SUPPORTED:
            self.document.ignore(element, "is not supported: the shape is left out")
            return None
        try:
            p = Properties(element, self.document)
            surface = geometry(p)
            radiance, emission = self._light_of(p)
            material = self._material(p, radiance)
            media = self.media.beside(p, self.materials.list[material])
            if media is not None:
                material = self.materials.boundary(material)
        except SceneError as error:
            self._failed(element, error, "The shape is left out.")
            return None
        file = p.values.get("filename")
        stem = Path(file.attributes.get("value", "").replace("\\", "/")).stem if file is not None else p.type
        name = element.attributes.get("id") or f"{stem} (line {element.line})"
        p.known("silhouette_sampling_weight", "face_normals")
        p.warn_unused("bsdf", "emitter", "medium")
        return Shape(name, surface, material, radiance, emission, media)

    def _material(self, p: Properties, radiance: RGB | None) -> int:
        bsdfs = p.objects("bsdf")
        if len(bsdfs) > 1:
            self.document.warn(f"{p.element} has more than one BSDF: the first is used.", p.element)
        if not bsdfs or id(bsdfs[0]) in self._grey:
            return self.materials.default(emits=not bsdfs and bool(p.objects("emitter")))
        try:
            number = self.materials.of(bsdfs[0])
            if radiance is not None and is_clear(self.materials.list[number]):
                # What rays never stop at would never be seen to shine.
                self.document.warn(f"{bsdfs[0]} on a light is black here: light does not pass it.", bsdfs[0])
                return self.materials.default(emits=True)
            return number
        except SceneError as error:
            self._grey.add(id(bsdfs[0]))
            self._failed(bsdfs[0], error, "A grey diffuse surface replaces it.")
            return self.materials.default(emits=False)

    def _light_of(self, p: Properties) -> tuple[RGB | None, Texture | None]:
        """Radiance of the shape's area light and the texture of it, (None, None) without one."""
        emitters = p.objects("emitter")
        if not emitters:
            return None, None
        element = emitters[0]
        light = Properties(element, self.document)
        if light.type in _WITHOUT_SURFACE:
            self._emitter(element)  # as Mitsuba 3: it shines from its own place
            return None, None
        if light.type != "area":
            self.document.ignore(element, "inside a shape is not supported: the shape gives no light")
            return None, None
        radiance = light.bounded_colour("radiance", 1.0, None)
        light.known("sampling_weight")
        light.warn_unused()
        return radiance, light.textures.get("radiance")

    def _emitter(self, element: Element) -> None:
        try:
            add_lights(Properties(element, self.document), self.lights)
        except SceneError as error:
            self._failed(element, error, "The light is left out.")
