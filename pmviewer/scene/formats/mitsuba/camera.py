"""Sensor and film elements as camera and image size."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from pmviewer.scene.clean import check_camera, check_size
from pmviewer.scene.description import Camera, Vec3
from pmviewer.scene.formats.mitsuba.document import Document, Properties
from pmviewer.scene.formats.mitsuba.transform import mirrors
from pmviewer.scene.formats.mitsuba.values import parse_float, parse_numbers
from pmviewer.scene.formats.mitsuba.xml import Element

Axis = Literal["x", "y", "diagonal", "smaller", "larger"]
DEFAULT_SIZE = (768, 576)
_FILM_DIAGONAL_MM = math.hypot(36, 24)
_FILM_SILENT = (
    "pixel_format", "component_format", "file_format", "sample_border", "compensate", "banner", "high_quality_edges",
    "gamma", "exposure", "tonemap_method", "attach_log", "rfilter",
)  # fmt: skip


@dataclass(frozen=True)
class View:
    camera: Camera
    width: int
    height: int


def film_size(sensor: Properties) -> tuple[int, int]:
    """Width and height in pixels of a sensor's film."""
    films = sensor.objects("film")
    if not films:
        return DEFAULT_SIZE
    film = Properties(films[0], sensor.document)
    if film.type != "hdrfilm":
        sensor.document.warn(f"{film.element} is read as an hdrfilm.", film.element)
    film.known(*_FILM_SILENT)
    width, height = film.integer("width", DEFAULT_SIZE[0]), film.integer("height", DEFAULT_SIZE[1])
    film.warn_unused()
    check_size(width, height, sensor.document.diagnostics.path, film.element.line)
    return width, height


def view(element: Element, document: Document, center: np.ndarray) -> View:
    """Camera of a perspective <sensor>. `center` of the scene tells how far away its orbit point is."""
    p = Properties(element, document)
    if p.type != "perspective":
        document.warn(f"{element} is approximated by a perspective camera.", element)
        p.known("aperture_radius", "focus_distance")
    width, height = film_size(p)
    m = p.transform()
    origin, left, up, forward = m[:3, 3], m[:3, 0], m[:3, 1], m[:3, 2]
    lengths = np.linalg.norm(m[:3, :3], axis=0)
    if not np.isfinite(lengths).all() or lengths.min() <= 1e-12 * lengths.max():
        at = p.values.get("to_world", element)
        hint = "Use <lookat>, or a matrix of rotation and translation."
        raise document.error(f"The to_world matrix of {element} is singular.", at, hint)
    angles = (m[:3, :3] / lengths).T @ (m[:3, :3] / lengths) - np.eye(3)
    if np.abs(lengths - 1).max() > 1e-3 or np.abs(angles).max() > 1e-3:
        document.warn(f"Scale and shear in the to_world matrix of {element} are ignored.", element)
    if float(np.linalg.norm(np.cross(left / lengths[0], forward / lengths[2]))) < 1e-6:
        at = p.values.get("to_world", element)
        raise document.error(f"The to_world matrix of {element} is singular.", at, "Use <lookat>.")
    direction = forward / lengths[2]
    fov, axis = _fov(p)
    target = _lookat_target(p)
    if target is None:
        distance = float((center - origin) @ direction)
        t = origin + direction * (distance if distance > 1e-6 else 1.0)
        target = (float(t[0]), float(t[1]), float(t[2]))
    camera = Camera(
        origin=(float(origin[0]), float(origin[1]), float(origin[2])),
        target=target,
        up=(float(up[0]), float(up[1]), float(up[2])),
        fov=fov,
        fov_axis=axis,
        near=p.number("near_clip", 0.0),
        far=p.number("far_clip", math.inf),
        mirrored=mirrors(m),
    )
    p.known("shutter_open", "shutter_close")
    p.warn_unused("film")
    check_camera(camera, document.diagnostics.path, element.line)
    return View(camera, width, height)


def _lookat_target(p: Properties) -> Vec3 | None:
    """The point that the file says it looks at, when nothing else moves the camera."""
    transform = p.values.get("to_world")
    if transform is None or [c.tag.lower() for c in transform.children] != ["lookat"]:
        return None
    x, y, z = parse_numbers(transform.children[0].attributes["target"], (3,))
    return (x, y, z)


def _fov(p: Properties) -> tuple[float, Axis]:
    if "fov" in p:
        fov, axis = p.number("fov", 0.0), p.string("fov_axis", "x").lower()
        p.known("focal_length")
        if axis not in get_args(Axis):
            at = p.values["fov_axis"]
            expected = ", ".join(get_args(Axis))
            raise p.document.error(f"'fov_axis' of {p.element}: expected one of {expected}, found '{axis}'.", at)
        return fov, axis  # type: ignore[return-value]
    p.known("fov_axis")
    text = p.string("focal_length", "50mm").removesuffix("mm")
    try:
        millimetres = parse_float(text)
        if millimetres <= 0:
            raise ValueError("expected a length above zero")
    except ValueError as error:
        at = p.values.get("focal_length", p.element)
        raise p.document.error(f"'focal_length' of {p.element}: {error}.", at) from None
    return math.degrees(2 * math.atan(_FILM_DIAGONAL_MM / (2 * millimetres))), "diagonal"
