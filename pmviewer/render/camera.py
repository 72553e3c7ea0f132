"""The camera: from scene and settings to rays, and to the matrices by which OpenGL draws the same view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SettingError
from pmviewer.scene.description import Camera, NamedCamera, PixelFilter, Scene, Vec3
from pmviewer.settings.access import CameraSettings
from pmviewer.settings.schema import Render

Matrix = NDArray[np.float64]


def _fov_x(camera: Camera, width: int, height: int) -> float:
    """Horizontal field of view in degrees of a camera whose `fov_axis` may be another."""
    half = math.tan(math.radians(camera.fov) / 2)
    aspect = width / height
    axis = camera.fov_axis
    if axis == "smaller":
        axis = "x" if width <= height else "y"
    elif axis == "larger":
        axis = "x" if width >= height else "y"
    if axis == "y":
        half *= aspect
    elif axis == "diagonal":
        half *= aspect / math.hypot(aspect, 1)
    return math.degrees(2 * math.atan(half))


@dataclass(frozen=True)
class CameraPose:
    """A camera with nothing left open. `fov` is horizontal, in degrees; `width` and `height` in pixels.

    An orthographic one sees what is before the plane through `origin`, `view_width` scene units wide. `shift` is that
    of `pmviewer.scene.description.Camera`.
    """

    origin: Vec3
    target: Vec3
    up: Vec3
    fov: float
    width: int
    height: int
    near: float = 0.0
    far: float = math.inf
    mirrored: bool = False
    near_normal: Vec3 | None = None
    """Unit normal of the near plane, at the distance `near` along it from the eye; None: along the view."""
    projection: Literal["perspective", "orthographic"] = "perspective"
    view_width: float = 1.0
    shift: tuple[float, float] = (0.0, 0.0)
    aperture: float = 0.0
    """Radius of the thin lens in the eye's plane, 0 for a pinhole."""
    focus: float | None = None
    """Distance along the view of the plane that the lens shows sharp. None: that of the surface in the middle of the
    picture, which `pmviewer.engine.focus` finds."""
    filter: PixelFilter | None = None
    """Reconstruction filter of the file's film, None where it names none."""
    hides_lights: bool = False
    """Whether the file says that the camera does not see lights and the sky (`pmviewer.render.hidden_lights`)."""
    medium: int | None = None
    """Number of the medium around the eye, −1 for none, as `pmviewer.engine.immersion` finds it; None in scenes without
    media."""
    pixel_side: float = 1.0
    """Side of the square in the middle of each pixel that is seen, in pixels: with less than 1 a small picture is made
    of pixels of a larger one, those between them left out (`pmviewer.engine.auto.trial`)."""

    @property
    def orthographic(self) -> bool:
        """Rays are parallel and start on a plane."""
        return self.projection == "orthographic"

    @property
    def shift_x(self) -> float:
        """In widths of the picture."""
        return self.shift[0]

    @property
    def shift_y(self) -> float:
        """In heights of the picture."""
        return self.shift[1]

    def half_width(self) -> float:
        """Half of what the picture's width spans: at distance 1, or at any of an orthographic camera."""
        return self.view_width / 2 if self.orthographic else math.tan(math.radians(self.fov) / 2)

    def axes(self) -> tuple[Matrix, Matrix, Matrix]:
        """Unit vectors to the right of the image, to its top, and into the view; read-only.

        Raises SettingError when eye and target coincide. An `up` along the view direction is replaced.
        """
        return self._axes

    @cached_property  # every pass asks, of the same camera
    def _axes(self) -> tuple[Matrix, Matrix, Matrix]:
        forward = np.subtract(self.target, self.origin, dtype=np.float64)
        length = float(np.linalg.norm(forward))
        if not math.isfinite(length) or length == 0:
            raise SettingError("The camera's origin and target coincide: move one of them.")
        forward /= length
        up = np.asarray(self.up, float)
        right = np.cross(forward, up)
        if np.linalg.norm(right) < 1e-9 * max(1e-300, float(np.linalg.norm(up))) or not np.all(np.isfinite(right)):
            right = np.cross(forward, np.eye(3)[np.argmin(np.abs(forward))])
        right /= np.linalg.norm(right)
        top = np.cross(right, forward)
        right = -right if self.mirrored else right
        for axis in (right, top, forward):
            axis.flags.writeable = False
        return right, top, forward

    def ray_frame(self) -> NDArray[np.float64]:
        """(4, 3): the eye, the image's top left corner from there, and the change per pixel right and down.

        Corner and changes are directions, or places on the plane through the eye of an orthographic camera, whose rays
        all have the direction of the view. Read-only.
        """
        return self._ray_frame

    @cached_property
    def _ray_frame(self) -> NDArray[np.float64]:
        right, top, forward = self.axes()
        half = self.half_width()
        step = 2 * half / self.width
        corner = (0.0 if self.orthographic else 1.0) * forward - right * half + top * (step * self.height / 2)
        across, along = right * step, -top * step
        corner += across * (self.shift[0] * self.width) + along * (self.shift[1] * self.height)
        frame = np.array([self.origin, corner, across, along], dtype=np.float64)
        frame.flags.writeable = False
        return frame

    def rays(self, x: NDArray[np.number], y: NDArray[np.number]) -> tuple[Matrix, Matrix]:
        """Origins and unit directions (n, 3) of the rays through places (n,) of the image, in pixels."""
        eye, corner, right, down = self.ray_frame()
        # A row for each coordinate: numpy takes several times as long for rows of three.
        places = corner[:, None] + np.asarray(x, float) * right[:, None] + np.asarray(y, float) * down[:, None]
        if self.orthographic:
            return (eye[:, None] + places).T.copy(), np.tile(self.axes()[2], (places.shape[1], 1))
        return np.tile(eye, (places.shape[1], 1)), (places / np.sqrt((places**2).sum(axis=0))).T.copy()

    def seen_from(self, origin: NDArray[np.floating], direction: NDArray[np.floating]) -> NDArray[np.float64]:
        """From which distance on rays of the camera from `origin` (…, 3) in the unit `direction` (…, 3) see: (…), the
        near plane; infinity if they never pass it."""
        if self.near <= 0:
            return np.zeros(np.shape(direction)[:-1])
        normal = self.axes()[2] if self.near_normal is None else np.asarray(self.near_normal, float)
        towards = np.asarray(direction @ normal, float)
        before = np.maximum(self.near - np.subtract(origin, self.origin) @ normal, 0.0)
        passes = np.where(towards > 0, before / np.where(towards > 0, towards, 1.0), math.inf)
        return np.where(before > 0, passes, 0.0)

    def start(self) -> NDArray[np.float64]:
        """Where (3,) the view along the axis begins: the eye, or the near plane before it."""
        forward, origin = self.axes()[2], np.asarray(self.origin, float)
        near = float(self.seen_from(origin, forward))
        return origin + near * forward if near < math.inf else origin

    def sees_like(self, other: CameraPose) -> bool:
        """Whether every pixel looks at the same point as the other's, through the same lens. A target farther away
        changes nothing."""
        if (self.width, self.height, self.projection) != (other.width, other.height, other.projection):
            return False
        if (self.near, self.near_normal) != (other.near, other.near_normal):
            return False
        if self.aperture != other.aperture or (self.aperture > 0 and self.focus != other.focus):
            return False
        mine, theirs = self.ray_frame(), other.ray_frame()
        length = float(np.linalg.norm(np.subtract(other.target, other.origin)))
        near = np.abs(mine - theirs)
        if self.orthographic:
            turned = np.abs(self.axes()[2] - other.axes()[2]).max()
            return bool(near.max() <= 1e-6 * max(other.view_width, 1e-300) and turned <= 1e-6)
        return bool(near[0].max() <= 1e-6 * length and near[1:].max() <= 1e-6)

    def pixel_angle(self) -> float:
        """Width of a pixel in the image's centre divided by its distance; 0 for an orthographic camera."""
        return 0.0 if self.orthographic else 2 * self.half_width() / self.width

    def pixel_size(self) -> float:
        """Width of a pixel at distance 0: an orthographic camera's at any distance."""
        return self.view_width / self.width if self.orthographic else 0.0

    def confusion(self, depth: NDArray[np.floating]) -> Matrix:
        """Radius of the circle of confusion, in pixels, of points at those distances (n,) along the view, all above 0:
        R·f·|1/depth − 1/focus|, R being the lens's radius and f the distance at which a pixel is one unit wide (of an
        orthographic camera R·|depth/focus − 1| in pixels). 0 for a pinhole."""
        depth = np.asarray(depth, float)
        if self.aperture == 0:
            return np.zeros_like(depth)
        assert self.focus is not None
        if self.orthographic:
            return self.aperture * np.abs(depth / self.focus - 1) / self.pixel_size()
        return self.aperture * np.abs(1 / depth - 1 / self.focus) / self.pixel_angle()

    def view_matrix(self) -> Matrix:
        """World to eye space (OpenGL: the camera looks along −z), row-major (4, 4)."""
        right, top, forward = self.axes()
        rotation = np.eye(4)
        rotation[0, :3], rotation[1, :3], rotation[2, :3] = right, top, -forward
        translation = np.eye(4)
        translation[:3, 3] = -np.asarray(self.origin, float)
        return rotation @ translation

    def projection_matrix(self, near: float, far: float) -> Matrix:
        """Eye to clip space (OpenGL), row-major (4, 4)."""
        half_x = self.half_width()
        half_y = half_x * self.height / self.width
        projection = np.zeros((4, 4))
        projection[0, 0], projection[1, 1] = 1 / half_x, 1 / half_y
        if self.orthographic:
            projection[0, 3], projection[1, 3] = -2 * self.shift[0], 2 * self.shift[1]
            projection[2, 2], projection[2, 3] = -2 / (far - near), -(far + near) / (far - near)
            projection[3, 3] = 1
            return projection
        projection[0, 2], projection[1, 2] = 2 * self.shift[0], -2 * self.shift[1]
        projection[2, 2], projection[2, 3] = -(far + near) / (far - near), -2 * far * near / (far - near)
        projection[3, 2] = -1
        return projection

    def cut_projection(self, near: float, far: float) -> Matrix:
        """`projection_matrix` with the camera's own near plane, whichever way it faces, for what is nearer.

        The third row is replaced by the plane's, scaled so that nothing before `far` falls out (Lengyel 2005).
        """
        if self.near <= 0:
            return self.projection_matrix(near, far)
        if self.near_normal is None:
            return self.projection_matrix(min(max(near, self.near), 0.99 * far), far)
        projection = self.projection_matrix(near, far)
        plane = np.append(self.view_matrix()[:3, :3] @ np.asarray(self.near_normal, float), -self.near)
        corner = np.linalg.solve(projection, [math.copysign(1, plane[0]), math.copysign(1, plane[1]), 1, 1])
        reach = float(plane @ corner)
        if reach > 0:  # else all that the camera can see is cut away, and the plane below is kept for depth
            projection[2] = 2 / reach * plane - projection[3]
        else:
            projection[2] = -2 * projection[3] + plane / max(float(np.abs(plane).max()), 1e-300)
        return projection

    def project(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """World points (n, 3) to (n, 3): pixel x, pixel y (from the top left corner) and distance along the view."""
        right, top, forward = self.axes()
        offset = np.asarray(points, float) - np.asarray(self.origin, float)
        depth = offset @ forward
        scale = self.width / (2 * self.half_width())
        away = np.ones_like(depth) if self.orthographic else depth
        x = self.width * (0.5 - self.shift[0]) + scale * (offset @ right) / away
        y = self.height * (0.5 - self.shift[1]) - scale * (offset @ top) / away
        return np.stack([x, y, depth], axis=1)


def size_only(settings: CameraSettings) -> CameraSettings:
    """The same picture size with the scene's own camera."""
    return CameraSettings(name=settings.name, width=settings.width, height=settings.height)


def camera_of(scene: Scene, name: str) -> NamedCamera:
    """The scene's camera with that name or number (from 1), for "auto" its own. Raises SettingError."""
    own = NamedCamera("auto", scene.camera, scene.width, scene.height)
    if name == "auto":
        return own
    for camera in scene.cameras:
        if camera.name == name:
            return camera
    if name.isdecimal() and 1 <= int(name) <= len(scene.cameras):
        return scene.cameras[int(name) - 1]
    if not scene.cameras:
        raise SettingError(f"camera.name = {name}: the scene's file has no camera. Use auto.")
    known = ", ".join(camera.name for camera in scene.cameras[:20])
    raise SettingError(f"camera.name = {name}: the scene has {len(scene.cameras)} cameras: {known}.")


def resolve_camera(scene: Scene, settings: CameraSettings) -> CameraPose:
    """The chosen camera of the scene with the settings' overrides. Raises SettingError for one that is not there."""
    chosen = camera_of(scene, settings.name)
    width = chosen.width if settings.width == "auto" else int(settings.width)
    height = chosen.height if settings.height == "auto" else int(settings.height)
    camera = chosen.camera
    origin = camera.origin if settings.origin == "auto" else settings.origin
    target = camera.target if settings.target == "auto" else settings.target
    shift_x, shift_y = (
        given if asked == "auto" else float(asked)
        for given, asked in zip(camera.shift, (settings.shift_x, settings.shift_y), strict=True)
    )
    return CameraPose(
        origin=origin,
        target=target,
        up=camera.up if settings.up == "auto" else settings.up,
        fov=_fov_x(camera, width, height) if settings.fov == "auto" else float(settings.fov),
        width=width,
        height=height,
        near=camera.near,
        far=camera.far,
        mirrored=camera.mirrored,
        projection=camera.projection if settings.projection == "auto" else settings.projection,
        view_width=_view_width(camera, settings, width, height),
        shift=(shift_x, shift_y),
        aperture=camera.aperture if settings.aperture == "auto" else float(settings.aperture),
        focus=camera.focus if settings.focus == "auto" else float(settings.focus),
        filter=camera.filter,
        hides_lights=camera.hides_lights,
    )


def _view_width(camera: Camera, settings: CameraSettings, width: int, height: int) -> float:
    """Of an orthographic picture; for a perspective camera what it sees at its target."""
    if settings.view_width != "auto":
        return float(settings.view_width)
    if camera.projection == "orthographic":
        return camera.width
    half = math.tan(math.radians(_fov_x(camera, width, height)) / 2)
    return 2 * half * max(math.dist(camera.origin, camera.target), 1e-15)


def are_hidden(own: bool, render: Render) -> bool:
    """Whether lights are hidden from a camera of which the file says `own`, with these settings."""
    return own if render.lights == "auto" else render.lights == "hidden"


def hidden_from(camera: CameraPose, render: Render) -> bool:
    """Whether a pass by that camera hides lights: not in scenes with media."""
    return camera.medium is None and are_hidden(camera.hides_lights, render)
