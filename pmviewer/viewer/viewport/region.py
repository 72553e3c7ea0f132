"""The region of interest in the viewport: its outline, and drawing it with the mouse."""

from __future__ import annotations

from typing import TYPE_CHECKING

from imgui_bundle import imgui

from pmviewer.viewer import theme
from pmviewer.viewer.viewport.navigation import DRAG_THRESHOLD

if TYPE_CHECKING:
    from pmviewer.viewer.viewport.viewport import Viewport

Rectangle = tuple[float, float, float, float]
HINT = "drag a rectangle: it alone is refined · click: the whole picture · Esc: as it was"


class RegionDrag:
    """`choosing` is on from the key until the button is released."""

    def __init__(self, viewport: Viewport) -> None:
        self._viewport = viewport
        self._from: tuple[float, float] | None = None
        self.choosing = False

    def toggle(self) -> None:
        """Begin to choose a region, or leave it as it is."""
        self.choosing, self._from = not self.choosing, None

    def handle(self, active: bool) -> bool:
        """Once per window frame; True while the mouse draws the region."""
        if not self.choosing:
            return False
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
        viewport, state = self._viewport, self._viewport.state
        if active and imgui.is_mouse_clicked(imgui.MouseButton_.left):
            self._from = _clamped(viewport.mouse_in_picture())
        if self._from is not None and imgui.is_mouse_released(imgui.MouseButton_.left):
            drawn, self.choosing, self._from = self._drawn(), False, None
            if drawn is None:
                state.change({"region.on": False})
            else:
                names = ("left", "top", "right", "bottom")
                shares = {f"region.{name}": round(v, 4) for name, v in zip(names, drawn, strict=True)}
                state.change({"region.on": True, **shares})
        return True

    def _drawn(self) -> Rectangle | None:
        """What is between the press and the mouse, None where that is but a click."""
        if self._from is None:
            return None
        (ax, ay), (bx, by) = self._from, _clamped(self._viewport.mouse_in_picture())
        _, _, width, height = self._viewport.rectangle()
        if max(abs(bx - ax) * width, abs(by - ay) * height) < DRAG_THRESHOLD:
            return None
        return min(ax, bx), min(ay, by), max(ax, bx), max(ay, by)

    def draw(self) -> str:
        """The outline over the picture; returns what is to be said of it."""
        viewport = self._viewport
        region = viewport.state.settings.region
        drawn = self._drawn() if self.choosing else None
        camera = viewport.shown_camera()
        if drawn is not None:
            self._outline(drawn)
        elif region.on and camera is not None:
            x0, y0, x1, y1 = region.pixels(camera.width, camera.height)
            self._outline((x0 / camera.width, y0 / camera.height, x1 / camera.width, y1 / camera.height))
        return HINT if self.choosing else ""

    def _outline(self, shares: Rectangle) -> None:
        left, top, width, height = self._viewport.rectangle()
        x, y = self._viewport.origin[0] + left, self._viewport.origin[1] + top
        corners = (x + shares[0] * width, y + shares[1] * height), (x + shares[2] * width, y + shares[3] * height)
        draw = imgui.get_window_draw_list()
        dark = imgui.get_color_u32(imgui.ImVec4(0, 0, 0, 0.7))
        draw.add_rect(*corners, dark, 0, 3.0)
        draw.add_rect(*corners, imgui.get_color_u32(imgui.ImVec4(*theme.DARK.accent)), 0, 1.0)


def _clamped(place: tuple[float, float]) -> tuple[float, float]:
    return min(max(place[0], 0.0), 1.0), min(max(place[1], 0.0), 1.0)
