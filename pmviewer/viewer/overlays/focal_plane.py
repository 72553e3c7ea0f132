"""The plane that the render camera's lens shows sharp, as translucent cells: what lies behind it is tinted.

The window draws surfaces as a pinhole in the lens's middle sees them, whatever the lens does to the picture.
"""

from __future__ import annotations

import moderngl
import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.render.camera import CameraPose
from pmviewer.settings.access import FocusOverlay, Settings
from pmviewer.viewer import theme
from pmviewer.viewer.format import short
from pmviewer.viewer.gl.cells import draw_cells
from pmviewer.viewer.gl.program import Drawing, Shaders
from pmviewer.viewer.overlays.legend import wrapped
from pmviewer.viewer.overlays.overlay import Needs, Overlay, Source, Switch

CELLS = 12
"""Across the picture."""
COLOUR = theme.ACCENT[:3]
_CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)])


def plane_vertices(camera: CameraPose) -> NDArray[np.float32]:
    """(n, 8): position, place in the cell and colour of two triangles a cell of the part of the plane in focus that the
    camera sees. The camera has a lens, and is focused."""
    assert camera.focus is not None
    eye, corner, right, down = camera.ray_frame()
    rows = max(1, round(CELLS * camera.height / camera.width))
    x, y = (g.reshape(-1, 1) for g in np.meshgrid(np.arange(CELLS), np.arange(rows)))
    u = (x + _CORNERS[:, 0]) * camera.width / CELLS
    v = (y + _CORNERS[:, 1]) * camera.height / rows
    places = corner + u[..., None] * right + v[..., None] * down
    ahead = camera.axes()[2] * camera.focus
    data = np.empty((len(x), 6, 8), np.float32)
    data[..., :3] = eye + (places + ahead if camera.orthographic else places * camera.focus)
    data[..., 3:5] = _CORNERS
    data[..., 5:] = COLOUR
    return data.reshape(-1, 8)


class FocalPlane(Overlay):
    """Of the render camera; Ctrl+click focuses on what is clicked at."""

    name = "focal"
    switch = Switch(imgui.Key.l, "Shift+L", "Focal plane of the lens on or off", shift=True)
    rank = -2

    def __init__(self, shaders: Shaders) -> None:
        super().__init__(shaders)
        self._buffer: moderngl.Buffer | None = None
        self._array: moderngl.VertexArray | None = None

    def needs(self, source: Source) -> Needs | None:
        camera = source.render_camera()
        return None if camera is None or camera.aperture == 0 or camera.focus is None else (camera,)

    def take(self, camera: CameraPose) -> None:
        """The plane of that camera."""
        self.release()
        self._buffer = self.shaders.context.buffer(plane_vertices(camera))
        content = [(self._buffer, "3f4 2f4 3f4", "position", "corner", "tint")]
        self._array = self.shaders.array("cells", content)

    def release(self) -> None:
        if self._array is not None and self._buffer is not None:
            self.shaders.drop(self._array)
            self._buffer.release()
        self._array = self._buffer = None

    def draw_over(self, drawing: Drawing, settings: Settings) -> None:
        if self._array is None:
            return
        style: FocusOverlay = self.style(settings)
        draw_cells(self.shaders, self._array, drawing, style.opacity, style.depth)

    def legend(self, source: Source) -> None:
        camera = source.render_camera()
        if camera is not None and camera.aperture > 0 and camera.focus is not None:
            wrapped(f"In focus at the distance {short(camera.focus)}. Ctrl+click in the picture focuses there.")
