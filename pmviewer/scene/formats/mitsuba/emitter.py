"""Emitter elements without a surface: point, spot, directional, constant and image environments."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pmviewer.errors import SceneError
from pmviewer.scene.description import (
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
from pmviewer.scene.formats.mitsuba.transform import Matrix, similar_columns
from pmviewer.scene.sky_image import read_sky

CUTOFF = 20.0
"""Mitsuba's default in degrees; the beam width's is three quarters of the cut-off."""
BEAM = 0.75


def read_light(p: Properties, others: Sequence[Light]) -> Light | None:
    """The light that an <emitter> outside a shape describes, None for one that is left out with a warning.

    `others` are the lights read before. Raises SceneError.
    """
    element, document = p.element, p.document
    name = element.attributes.get("id") or f"{p.type} (line {element.line})"
    p.known("sampling_weight")
    if p.type == "area":
        document.ignore(element, "outside a shape has no surface to shine from and was ignored")
        return None
    if p.type in ("constant", "envmap") and any(isinstance(light, Environment) for light in others):
        document.ignore(element, "beside another environment was ignored")
        return None
    readers = {
        "point": _point,
        "spot": _spot,
        "directional": _directional,
        "constant": _constant,
        "envmap": _image,
    }
    if p.type not in readers:
        document.ignore(element)
        return None
    light = readers[p.type](p, name)
    p.warn_unused()
    return light


def _one_of(p: Properties, name: str) -> bool:
    """Whether the property stands there instead of 'to_world'."""
    if name in p and "to_world" in p:
        raise p.document.error(f"{p.element} has both '{name}' and 'to_world'.", p.element, "Keep one of them.")
    return name in p


def _point(p: Properties, name: str) -> Light:
    x, y, z = p.point("position", (0.0, 0.0, 0.0)) if _one_of(p, "position") else p.transform()[:3, 3].tolist()
    return PointLight(name, (x, y, z), p.bounded_colour("intensity", 1.0, None))


def _unit(v: np.ndarray, p: Properties, what: str) -> Vec3:
    length = float(np.linalg.norm(v))
    if not 0 < length < np.inf:
        raise p.document.error(f"{what} of {p.element} has no length.", p.element, "Give it a direction.")
    x, y, z = (float(c) for c in v / length)
    return (x, y, z)


def _spot(p: Properties, name: str) -> Light:
    m = p.transform()
    cutoff = p.number("cutoff_angle", CUTOFF)
    beam = p.number("beam_width", BEAM * cutoff)
    if not 0 < cutoff <= 180:
        what = f"'cutoff_angle' of {p.element} must be above 0 and at most 180 degrees, found {cutoff:g}."
        raise p.document.error(what, p.values.get("cutoff_angle", p.element))
    if not 0 <= beam <= cutoff:
        what = f"'beam_width' of {p.element} must lie between 0 and 'cutoff_angle' ({cutoff:g}), found {beam:g}."
        raise p.document.error(what, p.values.get("beam_width", p.element))
    x, y, z = (float(c) for c in m[:3, 3])
    axis = _unit(m[:3, 2], p, "'to_world'")
    return SpotLight(name, (x, y, z), axis, p.bounded_colour("intensity", 1.0, None), cutoff, beam)


def _directional(p: Properties, name: str) -> Light:
    if _one_of(p, "direction"):
        direction = _unit(np.array(p.point("direction", (0.0, 0.0, 1.0))), p, "'direction'")
    else:
        direction = _unit(p.transform()[:3, 2], p, "'to_world'")
    return DirectionalLight(name, direction, p.bounded_colour("irradiance", 1.0, None))


def _constant(p: Properties, name: str) -> Light:
    return ConstantEnvironment(name, p.bounded_colour("radiance", 1.0, None))


def _image(p: Properties, name: str) -> Light:
    file = p.string("filename", "")
    if not file:
        raise p.document.error(f"{p.element} needs a 'filename'.", p.element)
    path = p.document.file(file, p.element)
    scale = p.number("scale", 1.0)
    if scale < 0:
        what = f"'scale' of {p.element} must not be negative, found {scale:g}."
        raise p.document.error(what, p.values["scale"])
    p.known("mis_compensation")
    turn = rotation_of(p.transform())
    if turn is None:
        what = f"'to_world' of {p.element} must be a rotation, it squeezes or shears."
        raise p.document.error(what, p.values["to_world"], "Leave scaling out of it.")
    try:
        sky, unusable = read_sky(path)
    except SceneError as error:
        what = f"The picture {path.name} named by {p.element}: {error.what}"
        raise p.document.error(what, p.element, error.hint) from None
    if unusable:
        what = f"{path.name} has {unusable} numbers that are negative or not finite: they count as 0."
        p.document.warn(what, p.element)
    with np.errstate(over="ignore"):
        pixels = sky * np.float32(scale)
    if not np.isfinite(pixels).all():
        raise p.document.error(f"'scale' of {p.element} makes radiances too large.", p.values["scale"])
    return ImageEnvironment(name, pixels, turn)


def rotation_of(m: Matrix) -> Matrix | None:
    """The rotation, or mirroring, of a transformation that keeps angles; None for any other."""
    size = similar_columns(m)
    if size is None or not size > 0:
        return None
    u, _, v = np.linalg.svd(m[:3, :3] / size)
    return np.asarray(u @ v)
