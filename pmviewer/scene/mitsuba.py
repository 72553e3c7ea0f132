"""The supported subset of Mitsuba 3's XML scene format (docs/scenes.md has it as a table).

What the subset lacks is named in one warning per kind with its lines and left out; what can't be left out is an error.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pmviewer.scene.clean import clean_lights, clean_shapes, on_a_surface
from pmviewer.scene.description import RGB, ConstantEnvironment, PointLight, Scene, Shape
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.framing import bounds, framed
from pmviewer.scene.mitsuba_bsdf import Materials
from pmviewer.scene.mitsuba_camera import DEFAULT_SIZE, View, film_size, view
from pmviewer.scene.mitsuba_document import SILENT_TAGS, Document, Properties
from pmviewer.scene.mitsuba_shape import SUPPORTED, geometry
from pmviewer.scene.mitsuba_xml import Element, read_xml, substitute

# Definitions that other objects refer to change nothing where they stand.
_SILENT = SILENT_TAGS | {"bsdf", "texture", "spectrum", "alias"}
_PERSPECTIVE = ("perspective", "thinlens")


def load_mitsuba(path: Path, parameters: Mapping[str, str]) -> Scene:
    """Read the file. `parameters` override its <default> values. Raises SceneError."""
    root = read_xml(path)
    diagnostics = Diagnostics(path)
    if root.tag != "scene":
        hint = "Is it a Mitsuba scene?"
        raise diagnostics.error(f"The file's outermost element is <{root.tag}>, expected <scene>.", root.line, hint)
    for name in substitute(root, parameters, path):
        diagnostics.warn(f"Parameter '{name}' was given, but the scene has no such <default>.")
    document = Document(root, path, diagnostics)
    scene = _Reader(document)
    shapes = clean_shapes(scene.shapes, diagnostics)
    lights = clean_lights(scene.lights, diagnostics)
    if not shapes:
        hint = diagnostics.left_out() or f"Add a <shape> of type {', '.join(SUPPORTED)}."
        raise diagnostics.error("The scene has no surface.", hint=hint)
    if not lights and not any(s.radiance for s in shapes):
        hint = diagnostics.left_out() or 'Add an <emitter> of type "area", "point" or "constant".'
        raise diagnostics.error("The scene has no light.", hint=hint)
    low, high = bounds(shapes)
    seen = scene.view((low + high) / 2, shapes)
    touched = on_a_surface(seen.camera.origin, shapes, float(np.linalg.norm(high - low)))
    if touched is not None:
        diagnostics.warn(f"The camera stands on the surface of '{touched}' and may see nothing.")
    return Scene(
        name=path.parent.name if path.stem == "scene" else path.stem,
        path=path,
        shapes=shapes,
        materials=tuple(scene.materials.list),
        lights=lights,
        camera=seen.camera,
        width=seen.width,
        height=seen.height,
        warnings=diagnostics.warnings(),
        dropped=dict(diagnostics.dropped),
    )


class _Reader:
    """Walks the top-level objects once."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.materials = Materials(document)
        self.shapes: list[Shape] = []
        self.lights: list[PointLight | ConstantEnvironment] = []
        self.sensors: list[Element] = []
        for child in document.root.children:
            element = document.resolve(child) if child.tag == "ref" else child
            if element.tag == "shape":
                self._shape(element)
            elif element.tag == "emitter":
                self._emitter(element)
            elif element.tag == "sensor":
                self.sensors.append(element)
            elif element.tag == "include":
                raise document.error(
                    "<include> is refused.", element, "Copy the included file's contents in its place."
                )
            elif element.tag not in _SILENT:
                document.ignore(element)

    def _shape(self, element: Element) -> None:
        p = Properties(element, self.document)
        if p.type not in SUPPORTED:
            self.document.ignore(element, "is not supported: the shape is left out")
            return
        emitters = p.objects("emitter")
        radiance = self._area_light(emitters[0]) if emitters else None
        bsdfs = p.objects("bsdf")
        if len(bsdfs) > 1:
            self.document.warn(f"{element} has more than one BSDF: the first is used.", element)
        material = self.materials.of(bsdfs[0]) if bsdfs else self.materials.default(emits=radiance is not None)
        file = p.values.get("filename")
        stem = Path(file.attributes.get("value", "")).stem if file is not None else p.type
        name = element.attributes.get("id") or f"{stem} (line {element.line})"
        self.shapes.append(Shape(name, geometry(p), material, radiance))
        p.known("silhouette_sampling_weight")
        p.warn_unused("bsdf", "emitter")

    def _area_light(self, element: Element) -> RGB | None:
        p = Properties(element, self.document)
        if p.type != "area":
            self.document.ignore(element, "inside a shape is not supported and was ignored")
            return None
        radiance = p.bounded_colour("radiance", 1.0, None)
        p.known("sampling_weight")
        p.warn_unused()
        return radiance

    def _emitter(self, element: Element) -> None:
        p = Properties(element, self.document)
        name = element.attributes.get("id") or f"{p.type} (line {element.line})"
        p.known("sampling_weight")
        if p.type == "point":
            if "position" in p and "to_world" in p:
                raise self.document.error(
                    f"{element} has both 'position' and 'to_world'.", element, "Keep one of them."
                )
            x, y, z = p.point("position", (0.0, 0.0, 0.0)) if "position" in p else p.transform()[:3, 3].tolist()
            self.lights.append(PointLight(name, (x, y, z), p.bounded_colour("intensity", 1.0, None)))
        elif p.type == "constant":
            if any(isinstance(light, ConstantEnvironment) for light in self.lights):
                self.document.ignore(element, "beside another one was ignored")
                return
            self.lights.append(ConstantEnvironment(name, p.bounded_colour("radiance", 1.0, None)))
        elif p.type == "area":
            self.document.ignore(element, "outside a shape has no surface to shine from and was ignored")
            return
        else:
            self.document.ignore(element)
            return
        p.warn_unused()

    def view(self, center: np.ndarray, shapes: tuple[Shape, ...]) -> View:
        """The first usable sensor, or a camera framed on the scene."""
        usable = [s for s in self.sensors if s.attributes.get("type") in _PERSPECTIVE]
        if usable:
            if len(self.sensors) > 1:
                sentence = f"{usable[0]} in line {usable[0].line} is used, the scene's other sensors are ignored."
                self.document.diagnostics.warn(sentence)
            return view(usable[0], self.document, center)
        width, height = DEFAULT_SIZE
        for sensor in self.sensors[:1]:
            self.document.ignore(sensor, "is not supported: a camera framed on the scene replaces it")
            width, height = film_size(Properties(sensor, self.document))
        if not self.sensors:
            self.document.diagnostics.warn("The scene has no camera: one framed on it is used.")
        return View(framed(shapes), width, height)
