"""The emitters `sunsky` of Mitsuba 3 and `sky`, `sun`, `sunsky` of 0.6 as lights."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.daylight.image import sky_image
from pmviewer.scene.daylight.models import SUN_HALF_APERTURE, sky_model
from pmviewer.scene.daylight.position import Moment, sun_angles
from pmviewer.scene.description import DirectionalLight, ImageEnvironment, Light
from pmviewer.scene.formats.mitsuba.interface import bounded

if TYPE_CHECKING:
    from pmviewer.scene.formats.mitsuba.document import Properties

Float = NDArray[np.float64]
TYPES = frozenset(("sky", "sun", "sunsky", "timed_sunsky"))
_IMAGE_OF_Z_UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Takes Mitsuba 3's frame (z up, x north) to the image's (y up)."""
_PREETHAM = (
    "is shown with the model of Preetham et al., whose sky has up to twice the light of Hosek and Wilkie's, which "
    "Mitsuba uses: install the extra 'mitsuba' for its tables"
)


def read_daylight(p: Properties, name: str, turn: Float) -> list[Light]:
    """The lights of an emitter of `TYPES`, whose `to_world` turns by `turn` (3, 3). Version 0.x has y up."""
    old = p.type in ("sky", "sun") or p.document.root.attributes.get("version", "3").strip().startswith("0")
    p.known("resolution", "complex_sun")
    if old:
        what = f"{p.element} of version 0.x has y up, as Mitsuba 0.6 has it; Mitsuba 3 takes z for up there."
        p.document.warn(what, p.element)
    if p.type == "timed_sunsky":
        _freeze(p)
    scale = max(p.number("scale", 1.0), 0.0)
    sky_scale = max(p.number("sky_scale", scale), 0.0) if p.type != "sun" else 0.0
    sun_scale = max(p.number("sun_scale", scale), 0.0) if p.type != "sky" else 0.0
    turbidity = bounded(p, "turbidity", p.number("turbidity", 3.0), 1.0, 10.0)
    albedo = p.bounded_colour("albedo", 0.2 if old else 0.3, 1)
    stretch = bounded(p, "stretch", p.number("stretch", 1.0), 1.0, 2.0)
    extend = p.boolean("extend", False)
    size = p.number("sun_radius_scale", 1.0)
    half = math.radians(bounded(p, "sun_aperture", p.number("sun_aperture", 0.5358), 0.0, 89.0)) / 2 * max(size, 0.0)
    to_image = np.eye(3) if old else _IMAGE_OF_Z_UP
    sun = to_image @ _sun(p, turn, old)
    zenith = math.acos(min(max(float(sun[1]), -1.0), 1.0))
    if zenith >= math.pi / 2:
        what = f"{p.element}: the sun is below the horizon, no light comes from it or its sky."
        p.document.warn(what, p.element)
        return []
    model, exact = sky_model(turbidity, albedo, zenith)
    if not exact:
        p.document.warn(f"{p.element} {_PREETHAM}.", p.element)
    if stretch > 1:  # the sun is drawn down with the sky
        sun = _drawn_down(sun, stretch)
    to_world = turn @ to_image.T
    lights: list[Light] = []
    if sun_scale > 0 and not half > 0:
        direction = -to_world @ sun
        r, g, b = (float(c) for c in sun_scale * model.sun())
        lights.append(DirectionalLight(f"{name} (sun)", (direction[0], direction[1], direction[2]), (r, g, b)))
        sun_scale = 0.0
    if sky_scale > 0 or sun_scale > 0:
        half = half or SUN_HALF_APERTURE
        pixels = sky_image(model, sun, sky_scale, sun_scale, half, stretch, extend)
        lights.append(ImageEnvironment(name, pixels, to_world))
    return lights


def _freeze(p: Properties) -> None:
    """The sun stands still at its usual time."""
    p.document.warn(f"{p.element} is shown at one moment, 15 h of its first day or of 10 July 2010.", p.element)
    p.known("end_year", "end_month", "end_day", "window_start_time", "window_end_time")


def _drawn_down(sun: Float, stretch: float) -> Float:
    zenith = math.acos(min(max(float(sun[1]), -1.0), 1.0)) * stretch
    flat = math.hypot(sun[0], sun[2]) or 1.0
    return np.array([sun[0] / flat * math.sin(zenith), math.cos(zenith), sun[2] / flat * math.sin(zenith)])


def _sun(p: Properties, turn: Float, old: bool) -> Float:
    """Unit vector towards the sun in the emitter's own frame."""
    moment = Moment(
        p.integer("start_year" if p.type == "timed_sunsky" else "year", 2010),
        p.integer("start_month" if p.type == "timed_sunsky" else "month", 7),
        p.integer("start_day" if p.type == "timed_sunsky" else "day", 10),
        p.number("hour", 15.0) + (p.number("minute", 0.0) + p.number("second", 0.0) / 60) / 60,
        p.number("latitude", 35.6894),
        p.number("longitude", 139.6917),
        p.number("timezone", 9.0),
    )
    if "sun_direction" in p:
        given = np.array(p.point("sun_direction", (0.0, 0.0, 1.0)))
        length = float(np.linalg.norm(given))
        if length > 0:
            return np.asarray(turn.T @ given) / length
        p.document.warn(f"'sun_direction' of {p.element} has no length: the sun of its date is used.", p.element)
    zenith, azimuth = sun_angles(moment)
    flat = math.sin(zenith)
    if old:
        return np.array([math.sin(azimuth) * flat, math.cos(zenith), -math.cos(azimuth) * flat])
    return np.array([-math.cos(azimuth) * flat, -math.sin(azimuth) * flat, math.cos(zenith)])
