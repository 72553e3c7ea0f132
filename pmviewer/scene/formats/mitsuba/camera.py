"""Sensor elements as cameras: what is no camera of ours becomes the nearest one, with a sentence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.clean import check_camera
from pmviewer.scene.description import Camera, NamedCamera, Vec3
from pmviewer.scene.formats.mitsuba.document import Document, Properties
from pmviewer.scene.formats.mitsuba.film import DEFAULT_SIZE, Film, read_film
from pmviewer.scene.formats.mitsuba.medium import Media
from pmviewer.scene.formats.mitsuba.transform import Matrix, mirrors
from pmviewer.scene.formats.mitsuba.values import parse_float, parse_numbers
from pmviewer.scene.formats.mitsuba.xml import Element

Axis = Literal["x", "y", "diagonal", "smaller", "larger"]
Box = tuple[NDArray[np.float64], NDArray[np.float64]]
_FILM_DIAGONAL_MM = math.hypot(36, 24)
_LEAST_FOV, _LARGEST_FOV = 1e-3, 179.0
_UNPOINTED = frozenset(("irradiancemeter", "fluencemeter", "distant", "mdistant"))
_INSTEAD = {
    "perspective_rdist": "it is shown without its distortion",
    "spherical": "a perspective camera 120° wide in its direction replaces it",
    "radiancemeter": "a perspective camera in its direction replaces it",
}
_LENSES = {"thinlens": "perspective", "telecentric": "orthographic"}
"""Cameras with a lens, and what they would be without."""
_FAR_CLIP = 1e4
"""Mitsuba's own, which is also where its lenses are focused by default."""
_A = {"perspective": "a perspective", "orthographic": "an orthographic"}
_SPHERICAL_FOV = 120.0
_PROBE_SIDE = 512


class _Unusable(Exception):
    """A sensor that no camera can stand in for."""


def read_cameras(
    sensors: Sequence[Element], document: Document, box: Box, media: Media
) -> tuple[list[NamedCamera], tuple[int, int]]:
    """Every usable <sensor> in the order of the file, and the size of the picture if there is none. `box` has the
    corners of the scene, `media` its media; `batch` stands for the sensors in it."""
    found: list[NamedCamera] = []
    size = DEFAULT_SIZE
    for element in _flat(sensors, document):
        p = Properties(element, document)
        film = read_film(p)
        try:
            found.append(_camera(p, film, (box[0] + box[1]) / 2, media.around(p)))
        except _Unusable as reason:
            document.warn(f"{reason}: it is left out.", element)
            size = (film.width, film.height) if size == DEFAULT_SIZE else size
    if not found:
        document.diagnostics.warn("The scene has no camera that can be used: one framed on it is.")
    if len(found) > 1:
        more = f"{len(found) - 1} other camera{'s' if len(found) > 2 else ''} of the scene can be chosen"
        document.diagnostics.warn(f"'{found[0].name}' gives the view, {more}.")
    return found, size


def _flat(sensors: Sequence[Element], document: Document) -> list[Element]:
    flat: list[Element] = []
    for element in sensors:
        if element.attributes.get("type") == "batch":
            document.warn(f"{element}: the sensors in it are shown one at a time.", element)
            flat += Properties(element, document).objects("sensor")
        else:
            flat.append(element)
    return flat


def _camera(p: Properties, film: Film, center: NDArray[np.float64], medium: int) -> NamedCamera:
    element, document = p.element, p.document
    if p.type in _UNPOINTED:
        raise _Unusable(f"{element} looks nowhere in particular")
    if p.type in _INSTEAD:
        document.warn(f"{element}: {_INSTEAD[p.type]}.", element)
    elif p.type not in ("perspective", "orthographic", *_LENSES):
        p.type = "orthographic" if "orthographic" in p.type.lower() else "perspective"
        document.warn(f"{element} is approximated by {_A[p.type]} camera.", element)
    p.known("kc", "shutter_open", "shutter_close", "srf")
    if p.type == "radiancemeter" and (film.width, film.height) == (1, 1):
        film = Film(_PROBE_SIDE, _PROBE_SIDE, (_PROBE_SIDE, _PROBE_SIDE))
    origin, target, up, m = _placed(p, center)
    camera = Camera(origin, target, up, fov=40.0, mirrored=mirrors(m))
    camera = _orthographic(p, camera, film, m) if p.type in ("orthographic", "telecentric") else _lens(p, camera, film)
    near, far = _clip(p)
    aperture, focus = _thin_lens(p, far)
    p.warn_unused("film", "medium")
    camera = replace(camera, near=near, far=far, aperture=aperture, focus=focus, filter=film.filter, medium=medium)
    try:
        check_camera(camera, document.diagnostics.path, element.line)
    except SceneError as error:
        raise _Unusable(f"{element} can't be used: {error.what.rstrip('.')}") from None
    name = element.attributes.get("id") or f"{p.type} (line {element.line})"
    return NamedCamera(name, camera, film.width, film.height)


def _placed(p: Properties, center: NDArray[np.float64]) -> tuple[Vec3, Vec3, Vec3, Matrix]:
    """Origin, target and up, and the matrix they come from. `center` of the scene tells how far away
    the orbit point is, where nothing else does."""
    element, document = p.element, p.document
    looked = _lookat(p)
    try:
        m = p.transform()
    except SceneError as error:
        raise _Unusable(f"The to_world matrix of {element} can't be used ({error.what.rstrip('.')})") from None
    lengths = np.linalg.norm(m[:3, :3], axis=0)
    singular = _Unusable(f"The to_world matrix of {element} is singular")
    if not np.isfinite(lengths).all() or lengths.min() <= 1e-12 * lengths.max():
        raise singular
    axes = m[:3, :3] / lengths
    if float(np.linalg.norm(np.cross(axes[:, 0], axes[:, 2]))) < 1e-6:
        raise singular
    flat = p.type in ("orthographic", "telecentric")
    uneven = abs(lengths[0] / lengths[1] - 1) if flat else np.abs(lengths - 1).max()
    if uneven > 1e-3 or np.abs(axes.T @ axes - np.eye(3)).max() > 1e-3:
        what = "Uneven scale and shear" if flat else "Scale and shear"
        document.warn(f"{what} in the to_world matrix of {element} are ignored.", element)
    origin = _vec3(m[:3, 3])
    alone = p.values.get("to_world")
    if looked is not None and alone is not None and len(alone.children) == 1:
        return origin, looked[1], _vec3(m[:3, 1]), m
    distance = float((center - m[:3, 3]) @ axes[:, 2])
    target = _vec3(m[:3, 3] + axes[:, 2] * (distance if distance > 1e-6 else 1.0))
    return origin, target, _vec3(m[:3, 1]), m


def _vec3(v: NDArray[np.float64]) -> Vec3:
    return (float(v[0]), float(v[1]), float(v[2]))


def _lookat(p: Properties) -> tuple[Vec3, Vec3] | None:
    """The two points of the only <lookat> in the transformation."""
    transform = p.values.get("to_world")
    if transform is None:
        return None
    looks = [c for c in transform.children if c.tag.lower() == "lookat"]
    try:
        (only,) = looks
        origin, target = (parse_numbers(only.attributes[name], (3,)) for name in ("origin", "target"))
    except (KeyError, ValueError):
        return None
    return (origin[0], origin[1], origin[2]), (target[0], target[1], target[2])


def _clip(p: Properties) -> tuple[float, float]:
    near, far = p.number("near_clip", 0.0), p.number("far_clip", math.inf)
    if 0 <= near < far:
        return near, far
    p.document.warn(f"'near_clip' and 'far_clip' of {p.element} leave nothing to see: nothing is clipped.", p.element)
    return 0.0, math.inf


def _thin_lens(p: Properties, far: float) -> tuple[float, float | None]:
    """Radius of the lens and distance in focus. Sensors of other types may name both, and have no lens."""
    if p.type not in _LENSES:
        p.known("aperture_radius", "focus_distance")
        return 0.0, None
    if "aperture_radius" not in p:
        p.document.warn(f"{p.element} has no 'aperture_radius': everything is sharp.", p.element)
    aperture, focus = p.number("aperture_radius", 0.0), p.number("focus_distance", min(far, _FAR_CLIP))
    if not aperture >= 0:
        what = f"'aperture_radius' of {p.element} can't be {aperture:g}: everything is sharp."
        p.document.warn(what, p.values["aperture_radius"])
        aperture = 0.0
    if not focus > 0:
        what = f"'focus_distance' of {p.element} can't be {focus:g}: the middle of the picture is sharp."
        p.document.warn(what, p.values["focus_distance"])
        return aperture, None
    return aperture, focus


def _orthographic(p: Properties, camera: Camera, film: Film, m: Matrix) -> Camera:
    """Mitsuba's picture is 2 units wide before `to_world` scales it."""
    scale = float(np.linalg.norm(m[:3, 0]))
    p.known("fov", "fov_axis", "focal_length")
    width = 2 * scale * film.width / film.full[0]
    return replace(camera, projection="orthographic", width=width, shift=film.shift((0.0, 0.0)))


def _lens(p: Properties, camera: Camera, film: Film) -> Camera:
    fov, axis = field_of_view(p)
    if p.type == "spherical":
        fov, axis = _SPHERICAL_FOV, "larger"
    offset = p.number("principal_point_offset_x", 0.0), p.number("principal_point_offset_y", 0.0)
    if film.cropped:
        half = math.tan(math.radians(fov) / 2) * share_of_width(axis, *film.full)
        fov, axis = math.degrees(2 * math.atan(half * film.width / film.full[0])), "x"
    return replace(camera, fov=fov, fov_axis=axis, shift=film.shift(offset))


def share_of_width(axis: Axis, width: int, height: int) -> float:
    """The film's width over its size along an axis."""
    along = {
        "x": width,
        "y": height,
        "diagonal": math.hypot(width, height),
        "smaller": min(width, height),
        "larger": max(width, height),
    }
    return width / along[axis]


def field_of_view(p: Properties) -> tuple[float, Axis]:
    """Field of view in degrees and its axis."""
    if "fov" in p:
        fov, axis = p.number("fov", 0.0), p.string("fov_axis", "x").lower()
        p.known("focal_length")
        if axis not in get_args(Axis):
            at = p.values["fov_axis"]
            p.document.warn(f"'fov_axis' of {p.element}: '{axis[:40]}' is not known, x replaces it.", at)
            axis = "x"
        cut = min(max(fov, _LEAST_FOV), _LARGEST_FOV)
        if cut != fov:
            what = f"The field of view of {p.element} can't be {fov:g} degrees: it was taken as {cut:g}."
            p.document.warn(what, p.values["fov"])
        return cut, axis  # type: ignore[return-value]
    p.known("fov_axis")
    millimetres = 50.0
    try:
        if p.tag_of("focal_length") in ("float", "integer"):
            millimetres = p.number("focal_length", 50.0)
        else:
            millimetres = parse_float(p.string("focal_length", "50mm").removesuffix("mm"))
        if millimetres <= 0:
            raise ValueError("expected a length above zero")
    except ValueError as error:
        at = p.values.get("focal_length", p.element)
        p.document.warn(f"'focal_length' of {p.element}: {error}; 50 mm replace it.", at)
        millimetres = 50.0
    fov = math.degrees(2 * math.atan(_FILM_DIAGONAL_MM / (2 * millimetres)))
    return min(max(fov, _LEAST_FOV), _LARGEST_FOV), "diagonal"
