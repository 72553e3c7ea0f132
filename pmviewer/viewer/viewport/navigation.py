"""Mouse and keys over the picture: camera moves, and magnifying the picture's pixels."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from imgui_bundle import imgui

from pmviewer.render.camera import CameraPose
from pmviewer.viewer.shortcuts import K
from pmviewer.viewer.viewport import controls
from pmviewer.viewer.viewport.target import Fit

if TYPE_CHECKING:
    from pmviewer.viewer.viewport.viewport import Viewport

MOST_ZOOM = 64.0
DRAG_THRESHOLD = 4.0
"""Points from where a button was pressed, from which on the mouse drags."""
FLY_SPEED = 0.7
"""Of the distance to what is ahead, a second."""
_BUTTONS = (imgui.MouseButton_.left, imgui.MouseButton_.right, imgui.MouseButton_.middle)
_FLY_AXES = {K.d: (1, 0, 0), K.a: (-1, 0, 0), K.e: (0, 1, 0), K.q: (0, -1, 0), K.w: (0, 0, 1), K.s: (0, 0, -1)}


class Navigation:
    """What the user does to a viewport's camera and to how the picture lies in the panel."""

    def __init__(self, viewport: Viewport) -> None:
        self._viewport = viewport
        self._state = viewport.state
        self._flew_with_right = False
        self._pivot: controls.Vector | None = None
        """The surface point that was under the mouse when a drag began."""
        self.stopped_at = -1e9
        """When a surface last stopped the camera, by `time.monotonic`."""

    def handle(self, pose: CameraPose, hovered: bool, active: bool) -> None:
        """Once per window frame: move the camera from that pose on."""
        io = imgui.get_io()
        before = pose
        geometry = self._state.session.geometry
        radius = float(geometry.radius) if geometry is not None else 1.0
        wheel = hovered and io.mouse_wheel and not io.key_ctrl
        if geometry is not None and (wheel or (active and _pressed())):
            self._grasp(pose)
        if geometry is not None and (wheel or active or self._state.flying):
            pose = before = self._held(pose, geometry)
        height = max(self._viewport.rectangle()[3], 1.0)
        moved = _dragged() if active else (0.0, 0.0)
        dx, dy = moved[0] / height, moved[1] / height
        right = active and imgui.is_mouse_down(imgui.MouseButton_.right)
        if hovered and io.mouse_wheel and io.key_ctrl:
            self._magnify(io.mouse_wheel)
        elif wheel:
            pose = controls.zoom(pose, io.mouse_wheel, radius)
        if active and io.key_ctrl:
            self._shift(*moved)
        elif active and (dx or dy):
            pose = self._drag(pose, dx, dy, right, radius)
        if not right:
            self._flew_with_right = False
        if (self._state.flying or right) and not io.want_text_input and not io.key_ctrl:
            pose = self._fly(pose, right)
        if pose != before:
            self._move(before, pose)

    def _move(self, before: CameraPose, pose: CameraPose) -> None:
        """Keep out of walls unless asked not to, or looking through them with the free camera."""
        settings = self._state.settings
        if not (settings.display.through_surfaces or settings.free_camera.on or pose.orthographic):
            pose, stopped = self._viewport.surroundings.kept_out(before, pose)
            if stopped:
                self.stopped_at = time.monotonic()
        self._state.move_camera(pose)

    def _grasp(self, pose: CameraPose) -> None:
        """Take hold of the surface under the mouse."""
        place = self._viewport.place_under_mouse(pose)
        self._pivot = self._viewport.surroundings.under(pose, place) if place is not None else None

    def _held(self, pose: CameraPose, geometry: Any) -> CameraPose:
        """The pose with its target at the depth of the surface that is held: orbits turn around that, pans and zooms go
        by its depth. Without one, the target serves, which in a scene's file may lie anywhere along the view."""
        if self._pivot is not None:
            return controls.aimed(pose, self._pivot)
        if self._target_is_automatic():
            return controls.with_pivot(pose, geometry.center, float(geometry.radius))
        return pose

    def _target_is_automatic(self) -> bool:
        """Whether the target is the scene file's, which may lie anywhere. An automatic free camera's is well placed."""
        settings = self._state.settings
        return settings.camera.target == "auto" and not settings.free_camera.on

    def _drag(self, pose: CameraPose, dx: float, dy: float, right: bool, radius: float) -> CameraPose:
        if imgui.is_mouse_down(imgui.MouseButton_.middle) or (imgui.get_io().key_shift and not self._state.flying):
            return controls.pan(pose, dx, dy)
        if self._state.flying or self._flew_with_right:
            return controls.look(pose, dx, dy)
        if right:
            return controls.zoom(pose, (dx - dy) * 12, radius)
        return controls.orbit(pose, dx, dy, self._pivot)

    def _fly(self, pose: CameraPose, right: bool) -> CameraPose:
        axes = np.sum([axis for key, axis in _FLY_AXES.items() if imgui.is_key_down(key)] or [(0, 0, 0)], axis=0)
        if not np.any(axes):
            return pose
        self._flew_with_right = self._flew_with_right or right
        io = imgui.get_io()
        ahead_of = self._viewport.surroundings.depth_ahead(pose)
        step = FLY_SPEED * ahead_of * min(io.delta_time, 0.1) * (4 if io.key_shift else 1)
        across, up, ahead = (float(a) for a in axes)
        return controls.fly(pose, across, up, ahead, step)

    def _magnify(self, notches: float) -> None:
        """Zoom into the pixels, keeping the point under the mouse where it is."""
        u, v = self._viewport.mouse_in_picture()
        zoom = min(max(self._viewport.fit.zoom * 1.25**notches, 1.0), MOST_ZOOM)
        grown = zoom / self._viewport.fit.zoom
        center = u + (self._viewport.fit.center[0] - u) / grown, v + (self._viewport.fit.center[1] - v) / grown
        self._viewport.fit = Fit() if zoom == 1.0 else Fit(zoom, center)

    def _shift(self, dx: float, dy: float) -> None:
        if self._viewport.fit.zoom > 1:
            _, _, width, height = self._viewport.rectangle()
            u, v = self._viewport.fit.center
            self._viewport.fit = replace(
                self._viewport.fit, center=(min(max(u - dx / width, 0), 1), min(max(v - dy / height, 0), 1))
            )


class Clicks:
    """Tells a click of the left button from a drag: the mouse has stayed where it was pressed."""

    def __init__(self) -> None:
        self._pressed: tuple[float, float] | None = None

    def clicked(self, active: bool) -> bool:
        """Once per window frame, after the picture's button: whether it was clicked now. `active`: it is held."""
        mouse, io = imgui.get_mouse_pos(), imgui.get_io()
        if imgui.is_item_activated():
            left = imgui.is_mouse_down(imgui.MouseButton_.left)
            self._pressed = (mouse.x, mouse.y) if left and not (io.key_ctrl or io.key_shift) else None
        at = self._pressed
        if at is not None and math.hypot(mouse.x - at[0], mouse.y - at[1]) >= DRAG_THRESHOLD:
            self._pressed = at = None
        if active or at is None:
            return False
        self._pressed = None
        return True


def _pressed() -> bool:
    """Whether a mouse button has just gone down."""
    return any(imgui.is_mouse_clicked(button) for button in _BUTTONS)


def _dragged() -> tuple[float, float]:
    """How far the mouse was dragged since the last call, in points: nothing until it is some points from where the
    button was pressed, so that a click turns nothing."""
    button = next((b for b in _BUTTONS if imgui.is_mouse_down(b)), None)
    if button is None:
        return 0.0, 0.0
    moved = imgui.get_mouse_drag_delta(button, DRAG_THRESHOLD)
    if moved.x or moved.y:
        imgui.reset_mouse_drag_delta(button)
    return moved.x, moved.y
