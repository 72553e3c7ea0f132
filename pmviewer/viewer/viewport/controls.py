"""Moving the camera: pure functions from one pose to the next, in units of what is on the screen.

Mouse distances come as fractions of the picture's height, so the feel doesn't depend on its size; speeds follow the
distance to what is under the mouse or near, so neither does it depend on the scene's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.camera import CameraPose
from pmviewer.scene.description import Vec3

Vector = NDArray[np.float64]

ORBIT_SPEED = math.pi
"""Radians a drag over the picture's whole height turns."""
LOOK_SPEED = math.pi / 2
"""The same for turning about the eye."""
POLE = math.radians(2)
"""The orbit stops this short of looking along the up vector."""


def _vec3(v: Vector) -> Vec3:
    return float(v[0]), float(v[1]), float(v[2])


def _unit(v: Vector) -> Vector:
    return v / max(float(np.linalg.norm(v)), 1e-300)


def _rotate(v: Vector, axis: Vector, angle: float) -> Vector:
    """Rodrigues' rotation about a unit axis."""
    c, s = math.cos(angle), math.sin(angle)
    return v * c + np.cross(axis, v) * s + axis * float(axis @ v) * (1 - c)


def _upright(pose: CameraPose) -> Vector:
    """The unit up vector; the image's own when the pose's is along the view."""
    up = _unit(np.asarray(pose.up, float))
    _, top, forward = pose.axes()
    return top if abs(float(up @ forward)) > math.cos(POLE / 2) else up


def with_pivot(pose: CameraPose, center: Vector, radius: float) -> CameraPose:
    """A camera straight from a file may have its target anywhere along the view ray (a matrix has none): put it at the
    depth of the scene's centre, where a drag expects to hold the scene."""
    _, _, forward = pose.axes()
    origin = np.asarray(pose.origin, float)
    depth = float((center - origin) @ forward)
    if depth < 0.05 * radius:
        depth = max(0.5 * radius, float(np.linalg.norm(np.subtract(pose.target, pose.origin))))
    return replace(pose, target=_vec3(origin + forward * depth))


def aimed(pose: CameraPose, point: Vector) -> CameraPose:
    """The same view with the target at the point's depth, so that panning and zooming follow what lies there. A point
    that isn't ahead changes nothing."""
    forward = pose.axes()[2]
    origin = np.asarray(pose.origin, float)
    depth = float((point - origin) @ forward)
    return replace(pose, target=_vec3(origin + forward * depth)) if depth > 0 else pose


def _turning(pose: CameraPose, offset: Vector, sideways: float, away_from_up: float) -> Callable[[Vector], Vector]:
    """The rotation that turns `offset` clockwise about the up axis, then away from it but never past the poles. Angles
    in radians."""
    up = _upright(pose)
    around = sideways if pose.mirrored else -sideways
    turned = _rotate(offset, up, around)
    axis = _unit(np.cross(up, turned))
    polar = math.acos(float(np.clip(_unit(turned) @ up, -1, 1)))
    tilt = min(max(polar + away_from_up, POLE), math.pi - POLE) - polar
    return lambda v: _rotate(_rotate(v, up, around), axis, tilt)


def orbit(pose: CameraPose, dx: float, dy: float, pivot: Vector | None = None) -> CameraPose:
    """Turn eye and view around a point, the target by default, as if dragging the scene."""
    origin, target = np.asarray(pose.origin, float), np.asarray(pose.target, float)
    held = target if pivot is None else pivot
    turn = _turning(pose, origin - target, dx * ORBIT_SPEED, -dy * ORBIT_SPEED)
    origin, target = held + turn(origin - held), held + turn(target - held)
    return replace(pose, origin=_vec3(origin), target=_vec3(target), up=_vec3(_upright(pose)))


def look(pose: CameraPose, dx: float, dy: float) -> CameraPose:
    """Turn the view about the eye."""
    origin = np.asarray(pose.origin, float)
    offset = np.asarray(pose.target, float) - origin
    turn = _turning(pose, offset, dx * LOOK_SPEED, dy * LOOK_SPEED)
    return replace(pose, target=_vec3(origin + turn(offset)), up=_vec3(_upright(pose)))


def _height_at_target(pose: CameraPose) -> float:
    """What the picture's height spans at the target's distance."""
    distance = 1.0 if pose.orthographic else float(np.linalg.norm(np.subtract(pose.target, pose.origin)))
    return 2 * distance * pose.half_width() * pose.height / pose.width


def shifted(pose: CameraPose, way: Vector) -> CameraPose:
    """Eye and target moved by the vector (3,)."""
    return replace(pose, origin=_vec3(pose.origin + way), target=_vec3(pose.target + way))


def pan(pose: CameraPose, dx: float, dy: float) -> CameraPose:
    """Move eye and target so that the target's plane follows the mouse."""
    right, top, _ = pose.axes()
    return shifted(pose, (-right * dx + top * dy) * _height_at_target(pose))


def zoom(pose: CameraPose, steps: float, radius: float) -> CameraPose:
    """Move the eye towards the target; one step (a notch of the wheel) is a tenth of the way. Close to the target the
    eye goes on at a steady pace and pushes the target ahead, so that zooming never gets stuck. An orthographic picture
    spans a tenth less instead."""
    if pose.orthographic:
        return replace(pose, view_width=min(max(pose.view_width * 0.9**steps, 1e-6 * radius), 1e3 * radius))
    origin, target = np.asarray(pose.origin, float), np.asarray(pose.target, float)
    forward = _unit(target - origin)
    distance = float(np.linalg.norm(target - origin))
    advance = distance * (1 - 0.9**steps)
    if steps > 0:
        advance = max(advance, 0.005 * radius * steps)
    moved = origin + forward * advance
    left = max(distance - advance, 0.02 * radius)
    return replace(pose, origin=_vec3(moved), target=_vec3(moved + forward * left))


def fly(pose: CameraPose, right: float, up: float, forward: float, step: float) -> CameraPose:
    """Move eye and target along the camera's axes; each argument is −1, 0 or 1, `step` a distance."""
    x, y, z = pose.axes()
    return shifted(pose, (x * right + y * up + z * forward) * step)


def frame_all(pose: CameraPose, center: Vector, radius: float) -> CameraPose:
    """Back off along the view direction until the bounding sphere fits; an orthographic picture gets as wide."""
    right, top, forward = pose.axes()
    half_x = pose.half_width()
    if pose.orthographic:
        distance, half_x = 2 * radius, 1.02 * radius * max(1.0, pose.width / pose.height)
        pose = replace(pose, view_width=2 * half_x)
    else:
        half = math.atan(min(half_x, half_x * pose.height / pose.width))
        distance = radius / max(math.sin(half), 1e-3) * 1.02
    half_y = half_x * pose.height / pose.width
    aside = right * (2 * half_x * pose.shift[0]) - top * (2 * half_y * pose.shift[1])
    eye = np.asarray(center, float) - forward * distance - aside * (1.0 if pose.orthographic else distance)
    return replace(pose, origin=_vec3(eye), target=_vec3(eye + forward * distance))


def camera_values(pose: CameraPose, group: str = "camera") -> dict[str, Vec3 | float]:
    """The place, view and, of an orthographic camera, width of the pose as settings of that group, "camera" or
    "free_camera"."""
    values: dict[str, Vec3 | float] = {
        f"{group}.origin": pose.origin,
        f"{group}.target": pose.target,
        f"{group}.up": pose.up,
    }
    if pose.orthographic and group == "camera":
        values["camera.view_width"] = pose.view_width
    return values
