"""What is near the camera: the surface under the mouse, how far things are ahead, walls in its way, and whether it is
where there is anything to see."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.frame import Frame
from pmviewer.render.camera import CameraPose
from pmviewer.render.planes import PLANES
from pmviewer.viewer.background import Background, Lane
from pmviewer.viewer.viewport import controls
from pmviewer.viewer.viewport.surface_rays import SurfaceRays, Vector

GAP = 0.005
"""The eye's least distance from walls, relative to the scene's radius."""
AT_ONCE = 50_000
"""Triangles that a window frame can wait for."""
BOXING = Lane("boxing")
OUTSIDE = (
    "The camera is outside the room that the scene's own camera is in: Backspace returns to it, and "
    "camera.clip looks in through its walls."
)
NOTHING = "The camera sees no surface: Home shows the whole scene, Backspace is the scene's own camera."
UNLIT = "Nothing that the camera sees is lit: it may be behind a wall or inside an object. Backspace returns."
STOPPED = "A surface is in the camera's way (View > Move through surfaces)."
_SIDES = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], float)
_TURN = np.array([[0.8, -0.48, 0.36], [0.6, 0.64, -0.48], [0.0, 0.6, 0.8]])
_AROUND = _SIDES / np.linalg.norm(_SIDES, axis=1, keepdims=True) @ _TURN
"""Directions to all sides, (26, 3), turned so that none runs along the axes, as walls do."""
_LOOKED_AT = (0.2, 0.5, 0.8)


class Surroundings:
    """Of the open scene. Everything is for the window's thread."""

    def __init__(self) -> None:
        self._geometry: Any = None
        self._rays: SurfaceRays | None = None
        self._radius = 1.0
        self._closed: tuple[tuple[float, ...], bool] | None = None
        self._unlit: tuple[int, str] = (-1, "")

    def take(self, geometry: Any, background: Background) -> None:
        """Of a `DrawGeometry`, or None. Of one with many triangles nothing is known for some moments."""
        if geometry is self._geometry:
            return
        if geometry is not None and self._geometry is not None and geometry.vertices is self._geometry.vertices:
            self._geometry = geometry  # in other colours
            return
        self._geometry, self._closed, self._unlit, self._rays = geometry, None, (-1, ""), None
        self._radius = float(geometry.radius) if geometry is not None else 1.0
        if geometry is None:
            return

        def work() -> str:
            rays = SurfaceRays(geometry)
            if self._geometry is not None and self._geometry.vertices is geometry.vertices:
                self._rays = rays
            return ""

        if len(geometry.vertices) <= 3 * AT_ONCE:
            work()
        else:
            background.start(BOXING, "boxing the surfaces", work)

    def under(self, pose: CameraPose, pixel: tuple[float, float]) -> Vector | None:
        """The surface point (3,) that the camera sees at that place of the image, in pixels; None without one."""
        origin, direction = _ray(pose, pixel)
        near, rays = float(pose.seen_from(origin, direction)), self._rays
        hit = rays.nearest(origin, direction, near) if rays is not None else None
        return origin + direction * hit[0] if hit is not None else None

    def object_under(self, pose: CameraPose, pixel: tuple[float, float]) -> int:
        """The number of the object there, shapes before instances; −1 where there is none."""
        origin, direction = _ray(pose, pixel)
        near, rays, geometry = float(pose.seen_from(origin, direction)), self._rays, self._geometry
        hit = rays.nearest_triangle(origin, direction, near) if rays is not None else None
        return geometry.object_at(3 * hit[2]) if hit is not None else -1

    def depth_ahead(self, pose: CameraPose) -> float:
        """A typical distance of what the camera sees: the middle one of nine places; the scene's radius where it sees
        nothing. At least a fiftieth of that, so that nobody gets stuck."""
        if self._rays is None:
            return self._radius
        places = [(x * pose.width, y * pose.height) for y in _LOOKED_AT for x in _LOOKED_AT]
        seen = [point for point in (self.under(pose, place) for place in places) if point is not None]
        if not seen:
            return self._radius
        middle = float(np.median(np.linalg.norm(np.array(seen) - pose.origin, axis=1)))
        return min(max(middle, 0.02 * self._radius), self._radius)

    def kept_out(self, before: CameraPose, after: CameraPose) -> tuple[CameraPose, bool]:
        """The second pose, its eye moved there from the first one's without passing a surface: stopped by it, or led
        along it. And whether one was met."""
        if self._rays is None or before.origin == after.origin:
            return after, False
        eye, wanted = np.asarray(before.origin, float), np.asarray(after.origin, float)
        stopped = False
        for _ in range(2):  # along one wall into the next: there it stays
            eye, normal = self._towards(eye, wanted)
            if normal is None:
                break
            stopped = True
            left = wanted - eye
            wanted = eye + left - normal * float(left @ normal)
        if not stopped:
            return after, False
        return controls.shifted(after, eye - np.asarray(after.origin, float)), True

    def _towards(self, eye: Vector, wanted: Vector) -> tuple[Vector, Vector | None]:
        """How far the eye gets on a straight way, and the normal of what stops it."""
        way = wanted - eye
        length = float(np.linalg.norm(way))
        if length < 1e-9 * self._radius:
            return eye, None
        assert self._rays is not None
        direction, gap = way / length, GAP * self._radius
        hit = self._rays.nearest(eye, direction)
        if hit is None:
            return wanted, None
        distance, normal = hit
        reach = distance - gap / max(-float(normal @ direction), 0.05)  # so far from the surface, not along the way
        if reach >= length:
            return wanted, None
        return eye + direction * max(reach, 0.0), normal

    # what to say ------------------------------------------------------------------------------------------------

    def advice(self, pose: CameraPose, own: CameraPose, frame: Frame | None) -> str:
        """One sentence where the camera shows nothing of use: it is outside the closed room of the scene's own camera,
        or the frame shows no surface, or no light. Else an empty one."""
        meant = pose.orthographic or pose.near_normal is not None  # who clips looks in from outside
        if self._rays is not None and pose.origin != own.origin and not meant:
            if self._is_closed_in(own) and not self._encloses(np.asarray(pose.origin, float)):
                return OUTSIDE
        return self._of_frame(frame) if frame is not None and not frame.coarse else ""

    def _is_closed_in(self, own: CameraPose) -> bool:
        if self._closed is None or self._closed[0] != own.origin:
            self._closed = own.origin, self._encloses(np.asarray(own.origin, float))
        return self._closed[1]

    def _encloses(self, point: Vector) -> bool:
        """Whether there are surfaces on all sides."""
        assert self._rays is not None
        return all(self._rays.nearest(point, direction) is not None for direction in _AROUND)

    def _of_frame(self, frame: Frame) -> str:
        if self._unlit[0] != frame.serial:
            depth: NDArray[np.float32] = frame.planes[..., PLANES["depth"]]
            text = ""
            if not np.any(frame.image("beauty")):
                text = UNLIT if np.any((depth > 0) & np.isfinite(depth)) else NOTHING
            self._unlit = frame.serial, text
        return self._unlit[1]


def _ray(pose: CameraPose, pixel: tuple[float, float]) -> tuple[Vector, Vector]:
    """Origin and direction (3,) of the camera's ray through that place of the image."""
    origins, directions = pose.rays(np.array([pixel[0]]), np.array([pixel[1]]))
    return origins[0], directions[0]
