"""What no scene may contain: unusable triangles, shapes and lights are dropped and counted, the rest is an error."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.kernels.meshes.mesh import FLAT, NOT_FINITE, judge, keep_used, keep_whole, number_marked, renumber
from pmviewer.progress import parallel
from pmviewer.scene.description import (
    Camera,
    Cylinder,
    Disk,
    Geometry,
    Light,
    Mesh,
    Parallelogram,
    Shape,
    Sphere,
)
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.emission import emitted_power
from pmviewer.scene.meshes.mesh_bounds import know_bounds

LARGEST_SIDE = 16384
"""Pixels; the camera's settings have the same bound."""
LARGEST_SHIFT = 1000.0
"""Of a camera's picture, in its widths and heights; the camera's settings have the same bound."""
LARGEST_COORDINATE = 1e15
"""Beyond this, squares of distances leave float32."""
_FLATTEST = 1e-9
"""A triangle's height over its longest edge below which it has no normal."""
_ON_SURFACE = 1e-6
_AT_ONCE = 1 << 18
"""Triangles that one thread looks at at a time."""


def check_faces(mesh: Mesh, path: Path | None) -> None:
    """Raises SceneError for an index that has no vertex."""
    if len(mesh.faces) and (mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices)):
        bad = int(np.flatnonzero(((mesh.faces < 0) | (mesh.faces >= len(mesh.vertices))).any(axis=1))[0])
        what = f"Triangle {bad} uses a vertex that does not exist (there are {len(mesh.vertices)})."
        raise SceneError(what, path, hint="The mesh file is damaged: export it again.")


def clean_shapes(shapes: list[Shape], diagnostics: Diagnostics) -> tuple[Shape, ...]:
    """The usable shapes. What is left out is counted in `diagnostics.dropped`."""
    kept = []
    for shape in shapes:
        if isinstance(shape.geometry, Mesh) and shape.geometry.colours is not None:
            _judge_colours(shape.name, shape.geometry.colours, diagnostics)
        geometry = _clean(shape.geometry, diagnostics.dropped)
        if geometry is None:
            reason = "zero-area light" if shape.radiance is not None else f"empty {_kind(shape.geometry)}"
            diagnostics.dropped[reason] += 1
            continue
        radiance = shape.radiance
        if radiance is not None and not max(radiance) > 0:
            diagnostics.dropped["light of no power"] += 1
            radiance = None
        emission = None if radiance is None else shape.emission
        kept.append(replace(shape, geometry=geometry, radiance=radiance, emission=emission))
    return tuple(kept)


def _judge_colours(name: str, colours: NDArray[np.float64], diagnostics: Diagnostics) -> None:
    """Warn of colours at vertices that are no share of light. `clean_mesh` cuts them."""
    if not np.isfinite(colours).all():
        diagnostics.warn(f"Colours at vertices of '{name}' are not numbers: they count as black.", kind="vertex NaN")
    elif colours.size and (colours.max() > 1.0 + 1e-6 or colours.min() < 0.0):
        sentence = f"Colours at vertices of '{name}' beyond 0 to 1 were cut: they would create energy."
        diagnostics.warn(sentence, kind="vertex colours")


def _kind(geometry: Geometry) -> str:
    return type(geometry).__name__.lower()


def clean_lights(lights: list[Light], diagnostics: Diagnostics) -> tuple[Light, ...]:
    """Lights that emit something."""
    kept = []
    for light in lights:
        if emitted_power(light, 1.0).max() > 0:
            kept.append(light)
        else:
            diagnostics.dropped["light of no power"] += 1
    return tuple(kept)


def _clean(geometry: Geometry, dropped: Counter[str]) -> Geometry | None:
    if isinstance(geometry, Mesh):
        return clean_mesh(geometry, dropped)
    if isinstance(geometry, Parallelogram):
        numbers = (*geometry.corner, *geometry.edge_u, *geometry.edge_v)
        corner, u, v = (np.array(x, np.float32) for x in (geometry.corner, geometry.edge_u, geometry.edge_v))
        corners = np.array([[corner, corner + u, corner + v]], np.float64)
        return geometry if _usable(numbers) and not _flat(corners)[0] else None
    if isinstance(geometry, Sphere):
        return geometry if _usable((*geometry.center, geometry.radius)) and _visible(geometry.radius) else None
    if isinstance(geometry, Disk):
        visible = _visible(geometry.radius) and any(geometry.normal)
        return geometry if _usable((*geometry.center, geometry.radius)) and visible else None
    assert isinstance(geometry, Cylinder)
    length = math.dist(geometry.p0, geometry.p1)
    visible = _visible(geometry.radius) and _visible(length)
    return geometry if _usable((*geometry.p0, *geometry.p1, geometry.radius)) and visible else None


def _usable(numbers: tuple[float, ...]) -> bool:
    return all(math.isfinite(x) and abs(x) <= LARGEST_COORDINATE for x in numbers)


def _visible(length: float) -> bool:
    return length > 1e-15


def clean_mesh(mesh: Mesh, dropped: Counter[str]) -> Mesh | None:
    """The mesh without triangles that have unusable vertices or no area; None when nothing is left.

    Triangles are judged as float32 sees them, since that is how they are traced. Broken vertex normals are replaced by
    those of the neighbouring faces; colours are cut to 0 … 1.
    """
    vertices, faces = np.ascontiguousarray(mesh.vertices, np.float64), np.ascontiguousarray(mesh.faces, np.int32)
    verdict, place = np.empty(len(faces), np.uint8), np.full(len(vertices), -1, np.int32)
    low, high = np.empty(3), np.empty(3)
    pieces = [(piece.start, piece.stop) for piece in _pieces(faces)]
    judged = partial(judge, vertices, faces)
    bad = parallel([partial(judged, i, j, LARGEST_COORDINATE, _FLATTEST, verdict, place) for i, j in pieces])
    for reason, number in (
        ("triangle with a NaN, infinite or huge vertex", NOT_FINITE),
        ("degenerate triangle", FLAT),
    ):
        if sum(bad) and (count := int((verdict == number).sum())):
            dropped[reason] += count
    if sum(bad) == len(faces):
        return None
    numbered = partial(number_marked, vertices, place, low, high)
    if sum(bad):
        ends = np.cumsum([j - i - wrong for (i, j), wrong in zip(pieces, bad)], dtype=np.int64).tolist()
        whole = np.empty((ends[-1], 3), np.int32)
        places = zip(pieces, [0, *ends], ends)
        kept = [partial(keep_whole, faces, verdict, i, j, whole[to:end]) for (i, j), to, end in places]
        n_used, *_ = parallel([numbered, *kept])
        faces = whole
    else:
        n_used = numbered()
    if n_used == len(vertices):
        cleaned = _with_all(mesh, vertices, faces)
    else:
        cleaned = _without_unused(mesh, vertices, faces, place, n_used, faces if sum(bad) else np.empty_like(faces))
    know_bounds(cleaned, low, high)
    return cleaned


def _with_all(mesh: Mesh, vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> Mesh:
    """The mesh with these faces, which use all of its vertices."""
    normals = None if mesh.normals is None else _mended(Mesh(vertices, faces, mesh.normals))
    return Mesh(vertices, faces, normals, _finite(mesh.uv), _colours(mesh.colours))


def _without_unused(
    mesh: Mesh,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    place: NDArray[np.int32],
    n_used: int,
    renumbered: NDArray[np.int32],
) -> Mesh:
    """The mesh with these faces and the `n_used` vertices that they use. `place` (V,) has the new number of each
    vertex, −1 for others; the faces get theirs in `renumbered`, which may be the faces themselves."""
    normals, uv, colours = mesh.normals, mesh.uv, mesh.colours
    if normals is not None or uv is not None or colours is not None:
        used = np.flatnonzero(place >= 0)
        if normals is not None:
            whole = np.where(np.isfinite(vertices), vertices, 0.0)
            normals = _mended(Mesh(whole, faces, normals))[used]
        uv = None if uv is None else _finite(uv[used])
        colours = None if colours is None else _colours(colours[used])
    kept = np.empty((n_used, 3))
    parallel(
        [
            partial(keep_used, vertices, place, kept),
            *(partial(renumber, faces[p], place, renumbered[p]) for p in _pieces(faces)),
        ]
    )
    return Mesh(kept, renumbered, normals, uv, colours)


def _pieces(faces: NDArray[np.int32]) -> list[slice]:
    """What one thread looks at at a time."""
    return [slice(i, min(i + _AT_ONCE, len(faces))) for i in range(0, len(faces), _AT_ONCE)]


def _finite(uv: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    return uv if uv is None or np.isfinite(uv).all() else np.nan_to_num(uv, posinf=0.0, neginf=0.0)


def _colours(colours: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """Finite colours between 0 and 1: they multiply what a surface reflects."""
    if colours is None or (
        np.isfinite(colours).all() and 0 <= colours.min(initial=0.0) <= colours.max(initial=0.0) <= 1
    ):
        return colours
    return np.clip(np.nan_to_num(colours, posinf=0.0, neginf=0.0), 0.0, 1.0)


def _flat(corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of the triangles (n, 3, 3) have no area."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    longest = np.maximum.reduce([(e * e).sum(axis=1) for e in (a, b, b - a)])
    area = np.linalg.norm(np.cross(a, b), axis=1)
    return np.logical_not((area > _FLATTEST * longest) & (longest > 0))


def _mended(mesh: Mesh) -> NDArray[np.float64]:
    """Unit vertex normals; those that are NaN or zero are computed anew."""
    from pmviewer.scene.arrays.primitives import unit, with_smooth_normals

    assert mesh.normals is not None
    finite = np.isfinite(mesh.normals)
    normals = unit(mesh.normals if finite.all() else np.where(finite, mesh.normals, 0.0))
    broken = np.logical_not(finite.all(axis=1) & np.any(normals, axis=1))
    if broken.any():
        smooth = with_smooth_normals(Mesh(mesh.vertices, mesh.faces)).normals
        assert smooth is not None
        normals = np.where(broken[:, None], smooth, normals)
    return normals


def check_camera(camera: Camera, path: Path | None, line: int | None = None) -> None:
    """Raises SceneError for a camera that can't look at anything."""
    numbers = (*camera.origin, *camera.target, *camera.up)
    if not _usable(numbers) or camera.origin == camera.target:
        hint = "Check its to_world transformation."
        raise SceneError("The camera's position or direction is not usable (NaN, infinite or zero).", path, line, hint)
    if not all(math.isfinite(s) and abs(s) <= LARGEST_SHIFT for s in camera.shift):
        what = f"The camera's picture is shifted by {camera.shift[0]:g} widths and {camera.shift[1]:g} heights."
        raise SceneError(what, path, line, f"Correct its offset: at most {LARGEST_SHIFT:g}.")
    if not (math.isfinite(camera.aperture) and camera.aperture >= 0):
        raise SceneError(f"The lens can't have the radius {camera.aperture:g}.", path, line, "Correct its aperture.")
    if camera.focus is not None and not camera.focus > 0:
        raise SceneError(f"The lens can't be focused at the distance {camera.focus:g}.", path, line, "Correct it.")
    if camera.projection == "orthographic":
        if not (math.isfinite(camera.width) and 1e-15 < camera.width <= LARGEST_COORDINATE):
            what = f"The orthographic camera's picture is {camera.width:g} units wide: that can't be shown."
            raise SceneError(what, path, line, "Check the scale of its to_world transformation.")
        return
    if not 0 < camera.fov < 180:
        what = f"The camera's field of view must lie between 0 and 180 degrees, found {camera.fov:g}."
        raise SceneError(what, path, line)


def check_size(width: int, height: int, path: Path | None, line: int | None = None) -> None:
    """Raises SceneError for an image without pixels or with absurdly many."""
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        what = f"The image must be 1 to {LARGEST_SIDE} pixels wide and high, found {width} × {height}."
        raise SceneError(what, path, line, "Correct the film's width and height.")


def on_a_surface(origin: tuple[float, float, float], shapes: tuple[Shape, ...], scale: float) -> str | None:
    """Name of a shape that the point lies on, within a millionth of the scene's size."""
    near = _ON_SURFACE * scale
    eye = np.array(origin)
    for shape in shapes:
        g = shape.geometry
        if isinstance(g, Sphere) and abs(math.dist(g.center, origin) - g.radius) <= near:
            return shape.name
        if isinstance(g, Parallelogram):
            if _far(eye, g, near):
                continue
            corner, u, v = np.array(g.corner), np.array(g.edge_u), np.array(g.edge_v)
            if _touches(
                np.array([[corner, corner + u, corner + u + v], [corner, corner + u + v, corner + v]]), eye, near
            ):
                return shape.name
        if isinstance(g, Mesh) and not _far(eye, g, near) and _touches(g.vertices[g.faces], eye, near):
            return shape.name
    return None


def _far(eye: NDArray[np.float64], g: Mesh | Parallelogram, near: float) -> bool:
    """Is the point further than `near` from the box around the geometry?"""
    if isinstance(g, Mesh):
        low, high = g.vertices.min(axis=0).tolist(), g.vertices.max(axis=0).tolist()
    else:
        low = [c + min(u, 0.0) + min(v, 0.0) for c, u, v in zip(g.corner, g.edge_u, g.edge_v)]
        high = [c + max(u, 0.0) + max(v, 0.0) for c, u, v in zip(g.corner, g.edge_u, g.edge_v)]
    return any(not a - near <= x <= b + near for a, x, b in zip(low, eye.tolist(), high))


def _touches(corners: NDArray[np.float64], eye: NDArray[np.float64], near: float) -> bool:
    """Is the point within `near` of one of the triangles (in their plane and between their edges)?"""
    a, b, c = corners[:, 0] - eye, corners[:, 1] - eye, corners[:, 2] - eye
    with np.errstate(invalid="ignore"):  # a sliver may have no normal: the comparisons are then false
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        inside = np.abs((normal * a).sum(axis=1)) <= near
        for p, q in ((a, b), (b, c), (c, a)):
            inward = np.cross(normal, q - p)
            inward /= np.linalg.norm(inward, axis=1, keepdims=True)
            inside &= (inward * -p).sum(axis=1) >= -near
    return bool(inside.any())
