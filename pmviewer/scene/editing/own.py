"""What the file says of a property that can be edited: the value from which edits begin."""

from __future__ import annotations

from pmviewer.scene.description import (
    RGB,
    DirectionalLight,
    ImageEnvironment,
    PointLight,
    ProjectorLight,
    Scene,
    SpotLight,
)
from pmviewer.scene.editing.catalogue import Target, catalogue_of
from pmviewer.scene.editing.recolour import GREY, colour_of, strength_of
from pmviewer.scene.projector import projector_power
from pmviewer.settings.edits import PROPERTIES, parts


def own_numbers(scene: Scene, name: str) -> tuple[float, ...]:
    """Of "light.lamp.power", for example. Raises SceneError for what the scene does not have."""
    kind, what, prop = parts(name)
    return own_of(scene, catalogue_of(scene).find(kind, what), prop)


def own_of(scene: Scene, target: Target, prop: str) -> tuple[float, ...]:
    """Of a property of what the catalogue lists."""
    neutral = PROPERTIES[target.kind][prop].neutral
    if neutral is not None:
        return neutral
    if target.kind == "light":
        return _hue(scene, target)
    material = scene.materials[target.place]
    if prop == "colour":
        return colour_of(material)
    if prop == "index":
        return (material.eta,)
    if prop == "dispersion":
        return (strength_of(material),)
    smooth = material.kind in ("conductor", "dielectric", "plastic")
    return (0.0 if smooth else sum(material.alpha) / 2,)


def _hue(scene: Scene, target: Target) -> RGB:
    """The colour that a light emits, its largest channel 1."""
    if target.of == "shape":
        emitted = scene.shapes[target.place].radiance or GREY
    else:
        light = scene.lights[target.place]
        if isinstance(light, PointLight | SpotLight):
            emitted = light.intensity
        elif isinstance(light, DirectionalLight):
            emitted = light.irradiance
        elif isinstance(light, ProjectorLight):
            r, g, b = (float(c) for c in projector_power(light))
            emitted = (r, g, b)
        elif isinstance(light, ImageEnvironment):
            r, g, b = (float(c) for c in light.pixels.mean(axis=(0, 1), dtype="float64"))
            emitted = (r, g, b)
        else:
            emitted = light.radiance
    most = max(*emitted, 1e-300)
    return emitted[0] / most, emitted[1] / most, emitted[2] / most
