"""A scene with edits: the description as the file has it goes in, another one comes out, and nothing is lost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.arrays.instances import instance_bounds
from pmviewer.scene.arrays.shape_bounds import shape_bounds
from pmviewer.scene.description import ImageEnvironment, Light, Material, ProjectorLight, Scene, Shape
from pmviewer.scene.editing.catalogue import Target, catalogue_of, refusal
from pmviewer.scene.editing.recolour import dispersed, recoloured, roughened, with_emission, with_radiance
from pmviewer.scene.editing.transform import Similarity, similarity, transformed
from pmviewer.settings.edits import Edits, parts

Values = Mapping[str, Any]
"""What is changed of one thing, by property; single numbers as such."""


def edited(scene: Scene, edits: Edits) -> Scene:
    """The scene with these edits (`pmviewer.settings.edits`); itself without any. Names and places are those of the
    scene as it is given, whatever is edited, and middles too. Raises SceneError for what the scene does not have."""
    if not edits:
        return scene
    catalogue = catalogue_of(scene)
    wanted: dict[Target, dict[str, Any]] = {}
    for name, numbers in edits.items():
        kind, what, prop = parts(name)
        target = catalogue.find(kind, what)
        problem = refusal(scene, target, prop)
        if problem is not None:
            raise SceneError(f"{name} can't be changed. {problem}", scene.path)
        wanted.setdefault(target, {})[prop] = numbers[0] if len(numbers) == 1 else numbers
    shapes, lights, instances = list(scene.shapes), list(scene.lights), list(scene.instances)
    materials = list(scene.materials)
    for target, values in wanted.items():
        place = target.place
        if target.of == "material":
            materials[place] = _material(materials[place], values)
        elif target.of == "light":
            lights[place] = _light(lights[place], values)
        elif target.of == "instance":
            moved = _similarity(middle_of(scene, target), values).matrix()
            instances[place] = replace(instances[place], to_world=moved @ instances[place].to_world)
        else:
            shapes[place] = _shape(shapes[place], middle_of(scene, target), values)
    return replace(
        scene,
        shapes=tuple(shapes),
        lights=tuple(lights),
        instances=tuple(instances),
        materials=tuple(materials),
    )


def middle_of(scene: Scene, target: Target) -> NDArray[np.float64]:
    """What it turns and grows around, (3,): the middle of the box around it."""
    if target.of == "instance":
        low, high = instance_bounds((scene.instances[target.place],))
        return np.asarray((low + high) / 2)
    if target.of == "shape":
        corners = np.asarray(shape_bounds(scene.shapes[target.place]))
        return np.asarray(corners.mean(axis=0))
    return np.asarray(getattr(scene.lights[target.place], "position", (0.0, 0.0, 0.0)), float)


def _similarity(middle: NDArray[np.float64], values: Values) -> Similarity:
    return similarity(middle, **{name: values[name] for name in ("move", "turn", "size") if name in values})


def _shape(shape: Shape, middle: NDArray[np.float64], values: Values) -> Shape:
    if "power" in values or "colour" in values:
        shape = with_radiance(shape, values.get("power", 1.0), values.get("colour"))
    if not values.keys() & {"move", "turn", "size"}:
        return shape
    return replace(shape, geometry=transformed(shape.geometry, _similarity(middle, values)))


def _light(light: Light, values: Values) -> Light:
    if "power" in values or "colour" in values:
        light = with_emission(light, values.get("power", 1.0), values.get("colour"))
    if not values.keys() & {"move", "turn"}:
        return light
    by = _similarity(np.asarray(getattr(light, "position", (0.0, 0.0, 0.0)), float), values)
    turned: dict[str, Any] = {}
    if hasattr(light, "position"):
        turned["position"] = by.point(light.position)
    for name in ("axis", "direction"):
        if hasattr(light, name):
            turned[name] = by.direction(getattr(light, name))
    if isinstance(light, ImageEnvironment | ProjectorLight):
        turned["to_world"] = by.turn @ light.to_world
    return replace(light, **turned)


def _material(material: Material, values: Values) -> Material:
    if "colour" in values:
        material = recoloured(material, values["colour"])
    if "roughness" in values:
        material = roughened(material, values["roughness"])
    if "index" in values:
        material = replace(material, eta=values["index"])
    if "dispersion" in values:
        material = dispersed(material, values["dispersion"])
    return material
