"""What lies over the picture: the value under the mouse, the depth legend, what is being waited for."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.engine.frame import Frame
from pmviewer.output.diagnostic_views import DIAGNOSTICS
from pmviewer.output.falsecolour import COLOURS, ERROR_SCALE, Scale
from pmviewer.viewer import theme
from pmviewer.viewer.format import si

if TYPE_CHECKING:
    from pmviewer.output.compare import Reference
    from pmviewer.viewer.viewport import Viewport

_TITLES = {"error": "error: (I–R)²/(R²+0.01) of each pixel, no unit"} | {
    view: f"{view}: {how.text}; grey: {how.none}" for view, how in DIAGNOSTICS.items()
}
_UNITS = {"albedo": "", "normal": "", "depth": "m"} | {view: how.unit for view, how in DIAGNOSTICS.items()}

LEGEND_EMS = 9.0
"""Width that captions leave to legends, in font sizes."""


def draw_hud(viewport: Viewport, hovered: bool) -> None:
    """Small captions in the panel's corners."""
    state = viewport.state
    view = state.shown_display.view
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
    elif view != state.settings.display.view and not state.flipped:
        refusal = state.refused_view(state.settings.display.view) or "is being made"
        _caption(viewport, f"{state.settings.display.view}: {refusal}", (margin, margin), colour=theme.WARNING)
    elif view != "beauty" and viewport.captions:
        _caption(viewport, _TITLES.get(view, view), (margin, margin))
    if view == "depth" and state.frame is not None and viewport.picture is not None:
        _depth_legend(viewport, *viewport.picture.depth_range)
    if view == "error":
        _error_legend(viewport)
    if view in DIAGNOSTICS and not DIAGNOSTICS[view].cells and viewport.picture is not None:
        _scale_legend(viewport, viewport.picture.scale)
    if state.settings.overlays.gather.show and viewport.inspected is None and state.frame is not None:
        text = "hold I over the picture: gather rays of the pixel under the mouse"
        _caption(viewport, text, (width / 2, height - line - 2 * margin), anchor=0.5, colour=theme.ACCENT)
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
    view = viewport.state.shown_display.view
    if view == "geometry":
        return f"{pixel[0]}, {pixel[1]}"
    reference = viewport.state.comparison.reference
    if view in ("reference", "error") and reference is not None:
        return f"{pixel[0]}, {pixel[1]}    {_compared(frame, reference, view, *pixel)}"
    from pmviewer.render.planes import view_of

    if view in DIAGNOSTICS:
        values = frame.image(view)[y, x]
        if values[0] < 0:
            return f"{pixel[0]}, {pixel[1]}    {DIAGNOSTICS[view].none}"
        if DIAGNOSTICS[view].cells:
            return f"{pixel[0]}, {pixel[1]}    cell {int(values[0])}{', beyond the cut-off' if values[0] % 1 else ''}"
    else:
        values = view_of(frame.planes[y : y + 1, x : x + 1], view)[0, 0]
    unit = _UNITS.get(view, "W/(m² sr)")
    return f"{pixel[0]}, {pixel[1]}    " + "  ".join(f"{v:.4g}" for v in values) + f"  {unit}"


def _compared(frame: Frame, reference: Reference, view: str, x: int, y: int) -> str:
    from pmviewer.output.compare import pixel_error

    if view == "error":
        return f"error {pixel_error(frame.image(), reference, x, y):.3g}"
    return "  ".join(f"{v:.4g}" for v in reference.image[y, x]) + "  W/(m² sr)"


def _depth_legend(viewport: Viewport, near: float, far: float) -> None:
    """From bright (near) to dark (far)."""
    labels = [(0.0, si(near, "m")), (0.5, si((near + far) / 2, "m")), (1.0, si(far, "m"))]
    _legend(viewport, labels, np.array([[1.0, 1.0, 1.0], [0.1, 0.1, 0.1]]))


def _error_legend(viewport: Viewport) -> None:
    """Large errors are on top."""
    lowest, highest = (round(math.log10(bound)) for bound in (ERROR_SCALE.lower, ERROR_SCALE.upper))
    powers = range(highest, lowest - 1, -1)
    labels = [((highest - p) / (highest - lowest), f"1e{p}" if p < -2 else f"{10.0**p:g}") for p in powers]
    _legend(viewport, labels, COLOURS[::-8])


def _scale_legend(viewport: Viewport, scale: Scale) -> None:
    """Large values are on top; the unit stands at the highest tick alone."""
    labels = [(1.0 - tick.position, tick.label.removesuffix(f" {scale.unit}")) for tick in scale.ticks()]
    labels[-1] = (labels[-1][0], f"{labels[-1][1]} {scale.unit}")
    _legend(viewport, labels, COLOURS[::-8])


def _legend(viewport: Viewport, labels: list[tuple[float, str]], colours: NDArray[np.floating]) -> None:
    """A bar at the right edge with colours (n, 3) from top to bottom, and labels at positions from 0 (top) to 1."""
    draw = imgui.get_window_draw_list()
    line = imgui.get_text_line_height()
    x1 = viewport.origin[0] + viewport.size[0] - 0.8 * line
    x0, y0 = x1 - 0.8 * line, viewport.origin[1] + 1.2 * line
    y1 = y0 + 8 * line
    pad = 0.7 * line
    widest = max(imgui.calc_text_size(text).x for _, text in labels)
    box = imgui.get_color_u32(theme.grey(0.1, 0.75))
    draw.add_rect_filled((x0 - widest - 0.4 * line - pad, y0 - pad), (x1 + pad, y1 + pad), box, 4)
    codes = [imgui.get_color_u32(imgui.ImVec4(float(r), float(g), float(b), 1.0)) for r, g, b in colours]
    edges = np.linspace(y0, y1, len(codes))
    for top, bottom, above, below in zip(edges[:-1], edges[1:], codes[:-1], codes[1:], strict=True):
        draw.add_rect_filled_multi_color((x0, float(top)), (x1, float(bottom)), above, above, below, below)
    lowest = -np.inf  # labels that would run into the one above are left out
    for position, text in sorted(labels):
        size = imgui.calc_text_size(text)
        top = y0 + position * (y1 - y0) - size.y / 2
        if top < lowest:
            continue
        lowest = top + 0.9 * size.y
        draw.add_text((x0 - size.x - 0.4 * line, top), imgui.get_color_u32(theme.grey(0.9)), text)


def _caption(
    viewport: Viewport,
    text: str,
    position: tuple[float, float],
    *,
    anchor: float = 0.0,
    colour: theme.Colour = theme.TEXT,
) -> None:
    """Text on a translucent ground, in lines that leave room for a legend; `anchor` 0.5 centres it on the position."""
    text = theme.drawable(text)
    room = viewport.size[0] - position[0] - LEGEND_EMS * imgui.get_font_size()
    wrap = room if anchor == 0.0 and room > 0 else 0.0
    size = imgui.calc_text_size(text, wrap_width=wrap or -1.0)
    x, y = viewport.origin[0] + position[0] - anchor * size.x, viewport.origin[1] + position[1]
    draw = imgui.get_window_draw_list()
    pad = 0.35 * imgui.get_text_line_height()
    ground = imgui.get_color_u32(theme.grey(0.08, 0.7))
    draw.add_rect_filled((x - pad, y - 0.5 * pad), (x + size.x + pad, y + size.y + 0.5 * pad), ground, 3)
    code = imgui.get_color_u32(imgui.ImVec4(*colour))
    draw.add_text(imgui.get_font(), imgui.get_font_size(), (x, y), code, text, wrap_width=wrap)
