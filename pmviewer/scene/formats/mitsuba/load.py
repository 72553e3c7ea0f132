"""The supported subset of Mitsuba's XML scene format (docs/scenes.md has it as a table).

What the subset lacks is named in one warning per kind with its lines and left out; only a file that is no scene, or of
which nothing can be shown, is an error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pmviewer.scene.arrays.instances import joint_bounds
from pmviewer.scene.clean import clean_lights, clean_shapes, on_a_surface
from pmviewer.scene.defaults.framing import framed
from pmviewer.scene.description import NamedCamera, Scene
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.mitsuba.camera import read_cameras
from pmviewer.scene.formats.mitsuba.document import Document
from pmviewer.scene.formats.mitsuba.expand import Expansion
from pmviewer.scene.formats.mitsuba.folders import Folders
from pmviewer.scene.formats.mitsuba.reader import Reader
from pmviewer.scene.formats.mitsuba.shape import SUPPORTED
from pmviewer.scene.formats.mitsuba.xml import read_xml


def load_mitsuba(path: Path, parameters: Mapping[str, str], search_paths: Sequence[Path] = ()) -> Scene:
    """Read the file. `parameters` override its <default> values; files are looked for in `search_paths` too. Raises
    SceneError."""
    root = read_xml(path)
    diagnostics = Diagnostics(path)
    if root.tag != "scene":
        hint = "Is it a Mitsuba scene?"
        raise diagnostics.error(f"The file's outermost element is <{root.tag}>, expected <scene>.", root.line, hint)
    folders = Folders(path.parent, search_paths)
    expansion = Expansion(parameters, folders, diagnostics)
    expansion.expand(root, path)
    for name in parameters:
        if name not in expansion.used:
            diagnostics.warn(f"Parameter '{name}' was given, but the scene has no such <default>.")
    document = Document(root, path, diagnostics, folders)
    scene = Reader(document)
    for name, element in expansion.missing:
        document.missing(name, element)
    shapes = clean_shapes(scene.shapes, diagnostics)
    lights = clean_lights(scene.lights, diagnostics)
    instances = scene.groups.checked()
    if not shapes and not instances:
        if len(scene.failures) == 1:
            raise scene.failures[0]
        hint = diagnostics.left_out() or f"Add a <shape> of type {', '.join(SUPPORTED)}."
        raise diagnostics.error("The scene has no surface.", hint=hint)
    low, high = box = joint_bounds(shapes, instances)
    cameras, size = read_cameras(scene.sensors, document, box, scene.media)
    cameras = [_hiding(named, scene.hides_lights) for named in cameras]
    seen = cameras[0] if cameras else _hiding(NamedCamera("framed", framed((), box=box), *size), scene.hides_lights)
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
        media=tuple(scene.media.list),
    )


def _hiding(named: NamedCamera, lights: bool) -> NamedCamera:
    """The camera, which does not see lights if the file says so."""
    return replace(named, camera=replace(named.camera, hides_lights=lights))
