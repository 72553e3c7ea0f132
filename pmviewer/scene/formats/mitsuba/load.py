"""The supported subset of Mitsuba 3's XML scene format (docs/scenes.md has it as a table).

What the subset lacks is named in one warning per kind with its lines and left out; what can't be left out is an error.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pmviewer.scene.clean import clean_lights, clean_shapes, on_a_surface
from pmviewer.scene.description import RGB, Light, NamedCamera, Scene, Shape
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.mitsuba.bsdf import Materials
from pmviewer.scene.formats.mitsuba.camera import read_cameras
from pmviewer.scene.formats.mitsuba.document import SILENT_TAGS, Document, Properties
from pmviewer.scene.formats.mitsuba.emitter import add_lights
from pmviewer.scene.formats.mitsuba.group import GROUP, INSTANCE, Groups
from pmviewer.scene.formats.mitsuba.shape import SUPPORTED, geometry
from pmviewer.scene.formats.mitsuba.xml import Element, read_xml, substitute
from pmviewer.scene.framing import framed
from pmviewer.scene.instances import joint_bounds
from pmviewer.scene.texture import Texture

# Definitions that other objects refer to change nothing where they stand.
_SILENT = SILENT_TAGS | {"bsdf", "texture", "spectrum", "alias"}


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
    instances = scene.groups.checked()
    if not shapes and not instances:
        hint = diagnostics.left_out() or f"Add a <shape> of type {', '.join(SUPPORTED)}."
        raise diagnostics.error("The scene has no surface.", hint=hint)
    if not lights and not any(s.radiance for s in shapes):
        hint = diagnostics.left_out() or 'Add an <emitter>, for example of type "area", "point" or "envmap".'
        raise diagnostics.error("The scene has no light.", hint=hint)
    low, high = box = joint_bounds(shapes, instances)
    cameras, size = read_cameras(scene.sensors, document, box)
    seen = cameras[0] if cameras else NamedCamera("framed", framed((), box=box), *size)
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
        instances=instances,
        cameras=tuple(cameras),
    )


class _Reader:
    """Walks the top-level objects once."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.materials = Materials(document)
        self.shapes: list[Shape] = []
        self.groups = Groups(document, self._shape)
        self.lights: list[Light] = []
        self.sensors: list[Element] = []
        for child in document.root.children:
            element = document.resolve(child) if child.tag == "ref" else child
            kind = element.attributes.get("type")
            if element.tag == "shape" and kind == INSTANCE:
                self.groups.add(element)
            elif element.tag == "shape" and kind == GROUP:
                continue  # a definition; read when an instance shows it
            elif element.tag == "shape":
                shape = self._shape(element)
                if shape is not None:
                    self.shapes.append(shape)
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

    def _shape(self, element: Element) -> Shape | None:
        p = Properties(element, self.document)
        if p.type not in SUPPORTED:
            self.document.ignore(element, "is not supported: the shape is left out")
            return None
        emitters = p.objects("emitter")
        radiance, emission = self._area_light(emitters[0]) if emitters else (None, None)
        bsdfs = p.objects("bsdf")
        if len(bsdfs) > 1:
            self.document.warn(f"{element} has more than one BSDF: the first is used.", element)
        material = self.materials.of(bsdfs[0]) if bsdfs else self.materials.default(emits=radiance is not None)
        file = p.values.get("filename")
        stem = Path(file.attributes.get("value", "")).stem if file is not None else p.type
        name = element.attributes.get("id") or f"{stem} (line {element.line})"
        shape = Shape(name, geometry(p), material, radiance, emission)
        p.known("silhouette_sampling_weight")
        p.warn_unused("bsdf", "emitter")
        return shape

    def _area_light(self, element: Element) -> tuple[RGB | None, Texture | None]:
        p = Properties(element, self.document)
        if p.type != "area":
            self.document.ignore(element, "inside a shape is not supported and was ignored")
            return None, None
        radiance = p.bounded_colour("radiance", 1.0, None)
        p.known("sampling_weight")
        p.warn_unused()
        return radiance, p.textures.get("radiance")

    def _emitter(self, element: Element) -> None:
        add_lights(Properties(element, self.document), self.lights)
