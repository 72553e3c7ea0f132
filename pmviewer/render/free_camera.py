"""The free camera: where it looks from, and the frustum of the render camera that it sees.

The render camera decides what is stored and how it is looked up; the free camera only decides what the film shows. It
is a pinhole, whatever lens the render camera has.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.render.clip import clipped
from pmviewer.scene.description import Scene, Vec3
from pmviewer.settings.access import FreeCamera, Settings

FOV = 45.0
AZIMUTH, ELEVATION = math.radians(40), math.radians(50)
"""Of an automatic eye point: aside of the line behind the render camera, and above it."""
UPRIGHT = math.cos(math.radians(40))
"""The coordinate axis that the render camera's up is as near to as this is taken for the scene's vertical."""
NEAR_END = 0.12
"""Share of the frustum's length at which its near end is drawn."""

Float = NDArray[np.float64]


def resolve_view(scene: Scene, settings: Settings, center: NDArray[np.floating], radius: float) -> CameraPose:
    """The camera whose picture is shown: the free one while it is on, else the render camera. `center` (3,) and
    `radius` bound the scene."""
    render = resolve_camera(scene, settings.camera)
    if settings.free_camera.on:
        return free_pose(render, settings.free_camera, center, radius)
    return clipped(render, settings.camera, center, radius)


def free_pose(render: CameraPose, free: FreeCamera, center: NDArray[np.floating], radius: float) -> CameraPose:
    """The free camera of that render camera, with as many pixels.

    Raises SettingError where the render camera's eye and target coincide.
    """
    middle, reach = enclosing(np.asarray(center, float), radius, np.asarray(render.origin, float))
    fov = FOV if free.fov == "auto" else float(free.fov)
    target = _vec3(middle) if free.target == "auto" else free.target
    if free.origin == "auto":
        half = math.atan(math.tan(math.radians(fov) / 2) * min(1.0, render.height / render.width))
        origin = _vec3(np.asarray(target) + _behind(render) * reach / math.sin(half))
    else:
        origin = free.origin
    if origin == target and free.target == "auto":  # where a given eye point is the automatic target
        target = _vec3(np.asarray(target) - np.asarray(_behind(render)) * radius)
    up = _vec3(_level(render)[1]) if free.up == "auto" else free.up
    width, height, hides = render.width, render.height, render.hides_lights
    pose = CameraPose(origin, target, up, fov, width, height, filter=render.filter, hides_lights=hides)
    return with_cut(pose, render, free, radius)


def as_perspective(pose: CameraPose) -> CameraPose:
    """A perspective camera without a shift for what the pose sees: its own, or one as far before an orthographic
    camera's target as spans its width there."""
    if not pose.orthographic:
        return replace(pose, shift=(0.0, 0.0), aperture=0.0)
    distance = pose.view_width / (2 * math.tan(math.radians(FOV) / 2))
    origin = np.asarray(pose.target, float) - pose.axes()[2] * distance
    return replace(pose, origin=_vec3(origin), fov=FOV, projection="perspective", shift=(0.0, 0.0), aperture=0.0)


def plan_pose(render: CameraPose, center: NDArray[np.floating], radius: float) -> CameraPose:
    """Straight from above, so far that scene and render camera fit, with what is ahead of the latter on top."""
    middle, reach = enclosing(np.asarray(center, float), radius, np.asarray(render.origin, float))
    level, up = _level(render)
    half = math.atan(math.tan(math.radians(FOV) / 2) * min(1.0, render.height / render.width))
    eye = middle + up * reach / math.sin(half)
    return CameraPose(_vec3(eye), _vec3(middle), _vec3(level), FOV, render.width, render.height)


def with_cut(pose: CameraPose, render: CameraPose, free: FreeCamera, radius: float) -> CameraPose:
    """The free camera without what lies above the cut, if it is above itself."""
    _, up = _level(render)
    above = float(np.subtract(pose.origin, render.origin) @ up) - free.cut_height * radius
    if not free.cut or above <= 0:
        return pose
    return replace(pose, near=above, near_normal=_vec3(-up))


def enclosing(center: Float, radius: float, point: Float) -> tuple[Float, float]:
    """Centre and radius of the smallest sphere around a sphere and a point."""
    away = point - center
    distance = float(np.linalg.norm(away))
    if distance <= radius:
        return center, radius
    grown = (radius + distance) / 2
    return center + away * (1 - grown / distance), grown


def _behind(render: CameraPose) -> Float:
    """Unit vector from what an automatic free camera looks at to its eye."""
    level, up = _level(render)
    aside = np.cross(level, up)
    back = -level * math.cos(AZIMUTH) + aside * math.sin(AZIMUTH)
    return back * math.cos(ELEVATION) + up * math.sin(ELEVATION)


def _level(render: CameraPose) -> tuple[Float, Float]:
    """Unit vectors ahead of the render camera on the level, and up."""
    _, top, forward = render.axes()
    up = np.asarray(render.up, float)
    length = float(np.linalg.norm(up))
    up = up / length if length > 0 and math.isfinite(length) else top
    axis = int(np.argmax(np.abs(up)))
    if abs(up[axis]) >= UPRIGHT:  # files often tilt up with the view
        up = np.eye(3)[axis] * np.sign(up[axis])
    level = forward - up * float(forward @ up)
    if np.linalg.norm(level) < 1e-3:  # looks straight up or down: its image's top says where ahead is
        level = top - up * float(top @ up)
    if np.linalg.norm(level) < 1e-3:
        level = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    return level / np.linalg.norm(level), up


def frustum_lines(camera: CameraPose, length: float) -> Float:
    """Line ends (2n, 3) of a camera's frustum with its image plane at `length` along the view: four edges from the eye,
    the near end, the image's border, and a triangle on its upper edge that says where up is. An orthographic camera's
    is a box whose edges start at the plane through its eye."""
    eye, corner, right, down = camera.ray_frame()
    across, along = right * camera.width, down * camera.height
    image = np.array([corner, corner + across, corner + across + along, corner + along])
    middle = corner + across / 2
    mark = np.array([middle - across * 0.15, middle - along * 0.2, middle + across * 0.15])
    if camera.orthographic:
        ahead = camera.axes()[2] * length
        starts, near, far, roof = eye + image, eye + image + ahead * NEAR_END, eye + image + ahead, eye + mark + ahead
    else:
        starts = np.broadcast_to(eye, (4, 3))
        far, near, roof = eye + image * length, eye + image * (length * NEAR_END), eye + length * mark
    edges = list(zip(starts, far, strict=True))
    edges += [(ring[i], ring[(i + 1) % 4]) for ring in (near, far) for i in range(4)]
    edges += [(roof[0], roof[1]), (roof[1], roof[2])]
    return np.array(edges).reshape(-1, 3)


def _vec3(v: NDArray[np.floating]) -> Vec3:
    return float(v[0]), float(v[1]), float(v[2])
