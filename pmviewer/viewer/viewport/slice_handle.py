"""The plane of a slice through media in the picture: its outline in the box that it cuts, a handle that moves it along
its axis, and letters that choose the axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.render.camera import CameraPose
from pmviewer.scene.description import Scene
from pmviewer.settings.schema.display import SLICE_VIEWS
from pmviewer.viewer import theme
from pmviewer.viewer.format import si
from pmviewer.viewer.panels.widgets import tooltip_text
from pmviewer.viewer.viewport.screen_lines import Screen

if TYPE_CHECKING:
    from pmviewer.viewer.viewport.viewport import Viewport

Places = NDArray[np.float64]
AXES = "xyz"
SHORTEST = 3.0
"""Font sizes: where the axis is seen shorter, along the view nearly, the handle is moved up and down instead."""
SWEEP = 12.0
"""Font sizes of such a drag from one end to the other."""
DIGITS = 4
"""Of the place: one in ten thousand of the box is less than a point of the screen."""
_CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
_HANDLES = np.array([(0.5, 0.5), *_CORNERS, (0.5, 0), (1, 0.5), (0.5, 1), (0, 0.5)], float)
"""Where on the plane the handle may be, the first choice first."""
_BETTER = 1.5
"""How much longer the way of another place has to be on the screen."""


class SliceHandle:
    """Of one viewport. `holds_mouse`: the mouse is over the handle or a letter, or drags."""

    def __init__(self, viewport: Viewport) -> None:
        self._viewport = viewport
        self._box: tuple[Scene, tuple[Places, Places]] | None = None
        self._grip: tuple[float, float] | None = None
        """Of a drag: the place where it began, and what the mouse then told."""
        self._spot = _HANDLES[0]
        self.holds_mouse = False
        self.at = (0.0, 0.0)
        """Where the handle is on the screen."""

    def is_shown(self) -> bool:
        """While the picture is a slice, and nothing is compared with it."""
        viewport, state = self._viewport, self._viewport.state
        shown = state.settings.display.view in SLICE_VIEWS and state.shown_display.view in SLICE_VIEWS
        return shown and not (viewport.alone or state.flying or state.shown_pair() is not None)

    def gui(self, pose: CameraPose | None) -> None:
        """Draw it over the picture of that camera, and follow the mouse. Once per window frame, before the picture's
        button, which would take the mouse."""
        self.holds_mouse = False
        bounds = self._bounds() if pose is not None and self.is_shown() else None
        if pose is None or bounds is None:
            self._grip = None
            return
        display = self._viewport.state.settings.display
        axis = AXES.index(display.slice_axis)
        screen = Screen(pose, self._viewport.origin, self._viewport.rectangle())
        painter = imgui.get_window_draw_list()
        (x, y), (width, height) = self._viewport.origin, self._viewport.size
        painter.push_clip_rect((x, y), (x + width, y + height), True)
        _outline(screen, bounds, axis, display.slice)
        self._handle(screen, bounds, axis)
        painter.pop_clip_rect()

    def _bounds(self) -> tuple[Places, Places] | None:
        """The box around the scene's media."""
        scene = self._viewport.state.session.scene
        if scene is None:
            return None
        if self._box is None or self._box[0] is not scene:
            from pmviewer.scene.arrays.media import media_bounds  # numba, which the window doesn't wait for

            self._box = scene, media_bounds(scene)
        return self._box[1]

    def _handle(self, screen: Screen, bounds: tuple[Places, Places], axis: int) -> None:
        display, em = self._viewport.state.settings.display, imgui.get_font_size()
        if self._grip is None:
            self._spot = self._best_spot(screen, bounds, axis)
        ends = _points(bounds, axis, np.array([0.0, 1.0]), self._spot)
        seen = screen.segment(*ends)
        point = screen.place(_points(bounds, axis, np.array([display.slice]), self._spot)[0])
        along_view = seen is None or point is None or _length(seen) < SHORTEST * em
        if point is None or not self._is_inside(point):
            (x, y), (width, height) = self._viewport.origin, self._viewport.size
            point, along_view = (x + width / 2, y + height / 2), True
        self.at = point
        half = 0.7 * em
        imgui.set_cursor_screen_pos((point[0] - half, point[1] - half))
        imgui.invisible_button("##slice", (2 * half, 2 * half))
        hovered, active = imgui.is_item_hovered(), imgui.is_item_active()
        if active:
            self._drag(screen, ends, along_view)
        else:
            self._grip = None
        self.holds_mouse = hovered or active
        if hovered or active:
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ns if along_view else imgui.MouseCursor_.hand)
        if hovered and not active:
            tooltip_text([("Drag: moves the slice along its axis", theme.TEXT)])
        direction = (0.0, -1.0) if along_view or seen is None else _direction(seen)
        _draw_handle(point, direction, hovered or active)
        low, high = bounds[0][axis], bounds[1][axis]
        place = low + display.slice * (high - low)
        self._letters(point, f"{AXES[axis]} = {si(place, 'm')}")

    def _drag(self, screen: Screen, ends: Places, along_view: bool) -> None:
        """Follow the mouse: along the axis by what is nearest to the ray under the mouse, else up and down."""
        display, mouse = self._viewport.state.settings.display, imgui.get_mouse_pos()
        told = -mouse.y / (SWEEP * imgui.get_font_size()) if along_view else screen.nearest(mouse.x, mouse.y, *ends)
        if told is None:
            return
        if self._grip is None:
            self._grip = display.slice, told
        place = min(max(self._grip[0] + told - self._grip[1], 0.0), 1.0)
        self._viewport.state.change({"display.slice": round(place, DIGITS)})

    def _best_spot(self, screen: Screen, bounds: tuple[Places, Places], axis: int) -> Places:
        """Where on the plane the handle can be seen to move: in its middle, unless the way is much longer elsewhere."""
        place = self._viewport.state.settings.display.slice
        best, longest = _HANDLES[0], 0.0
        for spot in _HANDLES:
            point = screen.place(_points(bounds, axis, np.array([place]), spot)[0])
            seen = screen.segment(*_points(bounds, axis, np.array([0.0, 1.0]), spot))
            if point is None or seen is None or not self._is_inside(point):
                continue
            if _length(seen) > (_BETTER * longest if longest else 0.0):
                best, longest = spot, _length(seen)
        return best

    def _is_inside(self, point: tuple[float, float]) -> bool:
        """Whether handle and letters have room there."""
        (x, y), (width, height), em = self._viewport.origin, self._viewport.size, imgui.get_font_size()
        return x + em < point[0] < x + width - 8 * em and y + 2 * em < point[1] < y + height - 4 * em

    def _letters(self, point: tuple[float, float], told: str) -> None:
        """Where the slice is, and a letter for each axis, beside the handle."""
        painter, em = imgui.get_window_draw_list(), imgui.get_font_size()
        chosen_axis = self._viewport.state.settings.display.slice_axis
        line = imgui.get_text_line_height()
        x, y = point[0] + 1.2 * em, point[1] + 0.3 * em
        side, pad = 1.5 * line, 0.3 * em
        width = max(3 * side, imgui.calc_text_size(told).x)
        ground = imgui.get_color_u32(theme.grey(*theme.OVER_PICTURE))
        painter.add_rect_filled((x - pad, y - pad), (x + width + pad, y + line + side + 2 * pad), ground, 3)
        painter.add_text((x, y), imgui.get_color_u32(imgui.ImVec4(*theme.DARK.text)), told)
        y += line + pad
        for number, letter in enumerate(AXES):
            left = x + number * side
            imgui.set_cursor_screen_pos((left, y))
            pressed = imgui.invisible_button(f"##slice.{letter}", (side, side))
            hovered, chosen = imgui.is_item_hovered(), letter == chosen_axis
            self.holds_mouse = self.holds_mouse or hovered or imgui.is_item_active()
            if hovered:
                tooltip_text([(f"The slice lies across {letter}", theme.TEXT)])
                painter.add_rect((left, y), (left + side, y + side), imgui.get_color_u32(theme.grey(0.6, 1.0)), 3)
            colour = theme.DARK.accent if chosen else theme.DARK.text
            size = imgui.calc_text_size(letter)
            place = left + (side - size.x) / 2, y + (side - size.y) / 2
            painter.add_text(place, imgui.get_color_u32(imgui.ImVec4(*colour)), letter)
            if chosen:
                under, code = y + side - 2, imgui.get_color_u32(imgui.ImVec4(*colour))
                painter.add_line((left + 3, under), (left + side - 3, under), code, 2)
            if pressed and not chosen:
                self._viewport.state.change({"display.slice_axis": letter})


def _points(bounds: tuple[Places, Places], axis: int, places: Places, spot: Places) -> Places:
    """(n, 3): at those places (n,) of the slice from 0 to 1, at a spot (2,) of its plane from 0 to 1."""
    low, high = bounds
    shares = np.empty((len(places), 3))
    shares[:, axis] = places
    shares[:, [a for a in range(3) if a != axis]] = spot
    return low + shares * (high - low)


def _outline(screen: Screen, bounds: tuple[Places, Places], axis: int, place: float) -> None:
    """The plane's, and weaker the edges of the box along the axis."""
    painter = imgui.get_window_draw_list()
    strong = imgui.get_color_u32(imgui.ImVec4(*theme.DARK.accent[:3], 0.9))
    weak = imgui.get_color_u32(imgui.ImVec4(*theme.DARK.accent[:3], 0.35))
    corners = np.array([_points(bounds, axis, np.array([0.0, place, 1.0]), corner) for corner in _CORNERS])
    lines = [(corners[k, 0], corners[k, 2], weak, 1.0) for k in range(4)]
    for end in (0, 2):
        lines += [(corners[k, end], corners[(k + 1) % 4, end], weak, 1.0) for k in range(4)]
    lines += [(corners[k, 1], corners[(k + 1) % 4, 1], strong, 2.0) for k in range(4)]
    for a, b, code, thickness in lines:
        seen = screen.segment(a, b)
        if seen is not None:
            painter.add_line(*seen, code, thickness)


def _draw_handle(point: tuple[float, float], direction: tuple[float, float], held: bool) -> None:
    """A disc with an arrow to either side."""
    painter, em = imgui.get_window_draw_list(), imgui.get_font_size()
    colour = imgui.get_color_u32(imgui.ImVec4(*(theme.DARK.text if held else theme.DARK.accent)))
    dark = imgui.get_color_u32(theme.grey(*theme.OVER_PICTURE))
    (x, y), (dx, dy) = point, direction
    for grown, code in ((2.0, dark), (0.0, colour)):
        painter.add_circle_filled((x, y), 0.35 * em + grown, code)
        for sign in (-1.0, 1.0):
            tip = (x + sign * dx * (1.1 * em + grown), y + sign * dy * (1.1 * em + grown))
            foot = (x + sign * dx * (0.55 * em - grown / 2), y + sign * dy * (0.55 * em - grown / 2))
            wide = 0.32 * em + grown
            painter.add_triangle_filled(
                tip, (foot[0] - dy * wide, foot[1] + dx * wide), (foot[0] + dy * wide, foot[1] - dx * wide), code
            )


def _length(seen: tuple[tuple[float, float], tuple[float, float]]) -> float:
    (ax, ay), (bx, by) = seen
    return float(np.hypot(bx - ax, by - ay))


def _direction(seen: tuple[tuple[float, float], tuple[float, float]]) -> tuple[float, float]:
    (ax, ay), (bx, by) = seen
    length = max(_length(seen), 1e-6)
    return (bx - ax) / length, (by - ay) / length
