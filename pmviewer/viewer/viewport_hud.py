"""What lies over the picture: the value under the mouse, the depth legend, what is being waited for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from imgui_bundle import imgui

from pmviewer.viewer import theme
from pmviewer.viewer.format import si

if TYPE_CHECKING:
    from pmviewer.viewer.viewport import Viewport

_UNITS = {"albedo": "", "normal": "", "depth": "m"}


def draw_hud(viewport: Viewport, hovered: bool) -> None:
    """Small captions in the panel's corners."""
    state = viewport.state
    view = state.settings.display.view
    width, height = viewport.size
    line = imgui.get_text_line_height()
    margin = 0.6 * line
    if viewport.shown_camera() is None:
        status = state.session.status
        _caption(viewport, status.text or "Drop a scene here or press Ctrl+O", (width / 2, height / 2), anchor=0.5)
        return
    if state.frame is None or view == "geometry":
        text = (
            "geometry"
            if view == "geometry"
            else f"geometry, while the first picture is made: {state.session.status.text}"
        )
        _caption(viewport, text, (margin, margin))
    elif view != "beauty":
        _caption(viewport, view, (margin, margin))
    if view == "depth" and state.frame is not None and viewport.picture is not None:
        _depth_legend(viewport, *viewport.picture.depth_range)
    if state.flying:
        text = "flying: W A S D, Q down, E up, drag to look, Shift faster, F or Esc to leave"
        _caption(viewport, text, (width / 2, height - line - 2 * margin), anchor=0.5, colour=theme.ACCENT)
    elif hovered:
        text = _value_under_mouse(viewport)
        if text:
            _caption(viewport, text, (margin, height - line - 1.2 * margin))


def _value_under_mouse(viewport: Viewport) -> str:
    pixel, frame = viewport.pixel_under_mouse(), viewport.state.frame
    if pixel is None or frame is None:
        return ""
    rows, columns = frame.planes.shape[:2]
    x, y = pixel[0] * columns // frame.camera.width, pixel[1] * rows // frame.camera.height
    view = viewport.state.settings.display.view
    if view == "geometry":
        return f"{pixel[0]}, {pixel[1]}"
    from pmviewer.render.planes import view_of

    values = view_of(frame.planes[y : y + 1, x : x + 1], view)[0, 0]
    unit = _UNITS.get(view, "W/(m² sr)")
    return f"{pixel[0]}, {pixel[1]}    " + "  ".join(f"{v:.4g}" for v in values) + f"  {unit}"


def _depth_legend(viewport: Viewport, near: float, far: float) -> None:
    """A bar from bright (near) to dark (far) at the right edge."""
    draw = imgui.get_window_draw_list()
    line = imgui.get_text_line_height()
    x1 = viewport.origin[0] + viewport.size[0] - 0.8 * line
    x0, y0 = x1 - 0.8 * line, viewport.origin[1] + 1.2 * line
    y1 = y0 + 8 * line
    pad = 0.5 * line
    labels = [(y0, si(near, "m")), ((y0 + y1) / 2, si((near + far) / 2, "m")), (y1, si(far, "m"))]
    widest = max(imgui.calc_text_size(text).x for _, text in labels)
    box = imgui.get_color_u32(theme.grey(0.1, 0.75))
    draw.add_rect_filled((x0 - widest - 0.4 * line - pad, y0 - pad), (x1 + pad, y1 + pad), box, 4)
    bright, dark = imgui.get_color_u32(theme.grey(1.0)), imgui.get_color_u32(theme.grey(0.1))
    draw.add_rect_filled_multi_color((x0, y0), (x1, y1), bright, bright, dark, dark)
    for y, text in labels:
        size = imgui.calc_text_size(text)
        top = min(max(y - size.y / 2, y0), y1 - size.y)
        draw.add_text((x0 - size.x - 0.4 * line, top), imgui.get_color_u32(theme.grey(0.9)), text)


def _caption(
    viewport: Viewport,
    text: str,
    position: tuple[float, float],
    *,
    anchor: float = 0.0,
    colour: theme.Colour = theme.TEXT,
) -> None:
    """Text on a translucent ground; `anchor` 0.5 centres it on the position."""
    text = theme.drawable(text)
    size = imgui.calc_text_size(text)
    x, y = viewport.origin[0] + position[0] - anchor * size.x, viewport.origin[1] + position[1]
    draw = imgui.get_window_draw_list()
    pad = 0.35 * size.y
    ground = imgui.get_color_u32(theme.grey(0.08, 0.7))
    draw.add_rect_filled((x - pad, y - 0.5 * pad), (x + size.x + pad, y + size.y + 0.5 * pad), ground, 3)
    draw.add_text((x, y), imgui.get_color_u32(imgui.ImVec4(*colour)), text)
