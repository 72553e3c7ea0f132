"""Emitter elements without a surface: point, spot, directional, environments, sun and sky."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pmviewer.errors import SceneError
from pmviewer.scene.defaults.sky_sum import sum_of_skies
from pmviewer.scene.description import (
    RGB,
    ConstantEnvironment,
    DirectionalLight,
    Environment,
    ImageEnvironment,
    Light,
    PointLight,
    SpotLight,
    Vec3,
)
from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.formats.mitsuba.interface import bounded
from pmviewer.scene.formats.mitsuba.projector import read_projector
from pmviewer.scene.formats.mitsuba.sky import TYPES as DAYLIGHT
from pmviewer.scene.formats.mitsuba.sky import read_daylight
from pmviewer.scene.formats.mitsuba.slide import thrown
from pmviewer.scene.formats.mitsuba.transform import Matrix, nearest_rotation
from pmviewer.scene.formats.sky_image import read_sky

CUTOFF = 20.0
"""Mitsuba's default in degrees; the beam width's is three quarters of the cut-off."""
BEAM = 0.75
_LEAST_CUTOFF = 0.01
_LEFT_OUT = "Pictures that can't be used are left out, what they would light stays dark: {names}."


def add_lights(p: Properties, lights: list[Light]) -> None:
    """Add what an <emitter> outside a shape describes to the lights read before. Several environments are added up;
    what can't be shown is left out with a warning. Raises SceneError."""
    element, document = p.element, p.document
    name = element.attributes.get("id") or f"{p.type} (line {element.line})"
    p.known("sampling_weight")
    if p.type == "area":
        document.ignore(element, "outside a shape has no surface to shine from and was ignored")
        return
    if p.type not in _READERS:
        document.ignore(element)
        return
    found = _READERS[p.type](p, name)
    p.warn_unused("texture", "medium")
    for light in found:
        if not isinstance(light, Environment):
            lights.append(light)
            continue
        before = next((i for i, old in enumerate(lights) if isinstance(old, Environment)), None)
        if before is None:
            lights.append(light)
            continue
        old = lights[before]
        assert isinstance(old, Environment)
        lights[before] = sum_of_skies(old, light)
        document.warn("The scene has several environments: their light is added up.", element)


def _instead_of_matrix(p: Properties, name: str) -> bool:
    """Whether the property stands there and counts, and 'to_world' does not."""
    if name in p and "to_world" in p:
        p.document.warn(f"{p.element} has both '{name}' and 'to_world': '{name}' is used.", p.element)
        p.known("to_world")
    return name in p


def _point(p: Properties, name: str) -> list[Light]:
    instead = _instead_of_matrix(p, "position")
    x, y, z = p.point("position", (0.0, 0.0, 0.0)) if instead else p.transform()[:3, 3].tolist()
    return [PointLight(name, (x, y, z), p.bounded_colour("intensity", 1.0, None))]


def _unit(v: np.ndarray, p: Properties) -> Vec3 | None:
    """The direction, None with a warning where there is none."""
    length = float(np.linalg.norm(v))
    if not 0 < length < np.inf:
        p.document.warn(f"{p.element} has no direction to shine in: it is left out.", p.element)
        return None
    x, y, z = (float(c) for c in v / length)
    return (x, y, z)


def _spot(p: Properties, name: str) -> list[Light]:
    m = p.transform()
    cutoff = bounded(p, "cutoff_angle", p.number("cutoff_angle", CUTOFF), _LEAST_CUTOFF, 180.0)
    beam = bounded(p, "beam_width", p.number("beam_width", BEAM * cutoff), 0.0, cutoff)
    intensity = p.bounded_colour("intensity", 1.0, None)
    if "texture" in p or p.objects("texture"):
        found = [t for t in [p.texture("texture")] if t is not None] + p.unnamed_textures()
        if found and (lights := thrown(p, name, found[0], intensity, cutoff, beam)) is not None:
            return lights
        p.document.warn(f"{p.element}: its texture is left out, it shines in the texture's mean colour.", p.element)
        if found:
            intensity = _times(intensity, found[0].mean)
    x, y, z = (float(c) for c in m[:3, 3])
    axis = _unit(m[:3, 2], p)
    return [] if axis is None else [SpotLight(name, (x, y, z), axis, intensity, cutoff, beam)]


def _times(a: RGB, b: RGB) -> RGB:
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


def _directional(p: Properties, name: str) -> list[Light]:
    if _instead_of_matrix(p, "direction"):
        direction = _unit(np.array(p.point("direction", (0.0, 0.0, 1.0))), p)
    else:
        direction = _unit(p.transform()[:3, 2], p)
    irradiance = p.bounded_colour("irradiance", 1.0, None)
    return [] if direction is None else [DirectionalLight(name, direction, irradiance)]


def _collimated(p: Properties, name: str) -> list[Light]:
    """A beam without width has no place in a picture's pixels: a spot of the least width with its power."""
    p.document.warn(f"{p.element} is shown as a spot of {_LEAST_CUTOFF}° with its power.", p.element)
    # "intensity" is what forks of version 0.5 call it.
    m, power = p.transform(), p.bounded_colour("power" if "power" in p else "intensity", 1.0, None)
    direction = _unit(m[:3, 2], p)
    solid = 4 * math.pi * math.sin(math.radians(_LEAST_CUTOFF) / 2) ** 2
    x, y, z = (float(c) for c in m[:3, 3])
    intensity = _times(power, (1 / solid,) * 3)
    return [] if direction is None else [SpotLight(name, (x, y, z), direction, intensity, _LEAST_CUTOFF, _LEAST_CUTOFF)]


def _constant(p: Properties, name: str) -> list[Light]:
    return [ConstantEnvironment(name, p.bounded_colour("radiance", 1.0, None))]


def _image(p: Properties, name: str) -> list[Light]:
    scale = bounded(p, "scale", p.number("scale", 1.0), 0.0, 1e30)
    p.known("mis_compensation", "cache")
    turn = _turned(p)
    file = p.string("filename", "")
    try:
        if not file:
            raise SceneError("it names no file")
        path = p.document.file(file, p.element)
        sky, unusable = read_sky(path)
    except SceneError as error:
        reason = "does not exist" if "does not exist" in error.what else error.what.rstrip(".")
        shown = file.replace("\\", "/")[-80:] or str(p.element)
        p.document.diagnostics.warn_of(f"{shown} ({reason[:160]})", _LEFT_OUT, p.element.line)
        return []
    if unusable:
        what = f"{path.name} has {unusable} numbers that are negative or not finite: they count as 0."
        p.document.warn(what, p.element)
    with np.errstate(over="ignore"):
        pixels = sky * np.float32(scale)
    if not np.isfinite(pixels).all():
        raise p.document.error(f"'scale' of {p.element} makes radiances too large.", p.values["scale"])
    return [ImageEnvironment(name, pixels, turn)]


def _daylight(p: Properties, name: str) -> list[Light]:
    return read_daylight(p, name, _turned(p))


def _turned(p: Properties) -> Matrix:
    """How `to_world` turns an environment, which has no size and no place."""
    m = p.transform()[:3, :3]
    turn, even = nearest_rotation(m)
    if not even:
        what = f"'to_world' of {p.element} squeezes or shears: only its rotation is used."
        p.document.warn(what, p.values["to_world"])
    return turn


_READERS: dict[str, Callable[[Properties, str], list[Light]]] = {
    "point": _point,
    "spot": _spot,
    "directional": _directional,
    "projector": read_projector,
    "collimated": _collimated,
    "constant": _constant,
    "envmap": _image,
    **dict.fromkeys(DAYLIGHT, _daylight),
}
