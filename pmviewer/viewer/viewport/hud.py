"""What lies over the picture: the value under the mouse, the depth legend, what is being waited for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.engine.frame import Frame
from pmviewer.output.diagnostic_views import CLASS_COLOURS, DENOISED, DIAGNOSTICS
from pmviewer.output.falsecolour import COLOURS, ERROR_SCALE, Scale
from pmviewer.viewer import theme
from pmviewer.viewer.format import duration, si
from pmviewer.viewer.viewport.caption import LEGEND_EMS, caption

if TYPE_CHECKING:
    from pmviewer.output.compare import Reference
    from pmviewer.viewer.viewport.viewport import Viewport

_TITLES = {
    "error": "error: (I–R)²/(R²+0.01) of each pixel, no unit",
    DENOISED: "denoised by Open Image Denoise: a guess, no estimate",
} | {view: f"{view}: {info.text}; grey: {info.none}" for view, info in DIAGNOSTICS.items()}
_UNITS = {"albedo": "", "normal": "", "depth": "m"} | {view: info.unit for view, info in DIAGNOSTICS.items()}


def draw_hud(viewport: Viewport, hovered: bool) -> None:
    """Small captions in the panel's corners."""
    state = viewport.state
    view = state.shown_display.view
    width, height = viewport.size
    line = imgui.get_text_line_height()
    margin = 0.6 * line
    if viewport.shown_camera() is None:
        status = state.session.status
        caption(viewport, status.text or "Drop a scene here or press Ctrl+O", (width / 2, height / 2), anchor=0.5)
        return
    if state.gain.frames() is not None:
        _compared_pictures(viewport)
        if state.settings.free_camera.on:
            _free_camera_label(viewport)
        if hovered and (text := _value_under_mouse(viewport)):
            caption(viewport, text, (margin, height - line - 1.2 * margin))
        return
    if state.frame is None or view == "geometry":
        text = (
            "geometry"
            if view == "geometry"
            else f"geometry, while the first picture is made: {state.session.status.text}"
        )
        if viewport.captions:
            caption(viewport, text, (margin, margin))
    elif view != state.settings.display.view and not state.flipped:
        refusal = state.refused_view(state.settings.display.view) or "to come with the next pass"
        caption(viewport, f"{state.settings.display.view}: {refusal}", (margin, margin), colour=theme.DARK.warning)
    elif view != "beauty" and viewport.captions:
        caption(viewport, _title(viewport, view), (margin, margin))
    if state.settings.free_camera.on and viewport.captions:
        _free_camera_label(viewport)
    if view == "depth" and state.frame is not None and viewport.picture is not None:
        _depth_legend(viewport, *viewport.picture.planes.depth_range)
    if view == "error":
        _error_legend(viewport)
    if view in DIAGNOSTICS and DIAGNOSTICS[view].classes:
        _class_legend(viewport, DIAGNOSTICS[view].classes)
    elif view in DIAGNOSTICS and not DIAGNOSTICS[view].cells and viewport.picture is not None:
        _scale_legend(viewport, viewport.picture.planes.scale, DIAGNOSTICS[view].colours)
    if viewport.picture is not None:
        source = viewport.source()
        for overlay in viewport.picture.layers.shown(state.settings):
            overlay.annotate(viewport, source)
    advice = "" if viewport.alone else viewport.advice()
    if advice:
        caption(viewport, advice, (width / 2, 0.5 * height), anchor=0.5, colour=theme.DARK.warning)
    if state.flying:
        text = "flying: W A S D, Q down, E up, drag to look, Shift faster, F or Esc to leave"
        caption(viewport, text, (width / 2, height - line - 2 * margin), anchor=0.5, colour=theme.DARK.accent)
    elif hovered:
        text = _value_under_mouse(viewport)
        if text:
            caption(viewport, text, (margin, height - line - 1.2 * margin))


def _title(viewport: Viewport, view: str) -> str:
    """What is shown, with the map where there are two."""
    frame = viewport.state.frame
    of = frame.inspection.wanted.map if view in DIAGNOSTICS and frame is not None else ""
    return f"{of} map, {_TITLES[view]}" if of else _TITLES.get(view, view)


def _compared_pictures(viewport: Viewport) -> None:
    """The line between the pictures with and without importance, and what each of them is."""
    state, x = viewport.state, viewport.split_x()
    gain, pair = state.gain.gain, state.shown_pair()
    if gain is None or pair is None or x is None:
        return
    line = imgui.get_text_line_height()
    draw, (ox, oy), height = imgui.get_window_draw_list(), viewport.origin, viewport.size[1]
    for colour, wide in ((theme.grey(0.0, 0.6), 5.0), (theme.grey(1.0), 2.0)):
        draw.add_line((ox + x, oy), (ox + x, oy + height), imgui.get_color_u32(colour), wide)
    draw.add_circle_filled((ox + x, oy + height / 2), 0.5 * line, imgui.get_color_u32(theme.grey(1.0)))
    gap = 0.8 * line
    view = "" if pair[1].view == "beauty" else f" · {pair[1].view}"
    for title, side, anchor, at in (
        (f"with importance{view}", gain.with_, 1.0, x - gap),
        (f"without{view}", gain.without, 0.0, x + gap),
    ):
        caption(viewport, title, (at, 0.6 * line), anchor=anchor, colour=theme.DARK.accent)
        stored, error, spent = si(side.stored), f"{side.error.relmse_all:.2e}", duration(side.cpu_seconds)
        facts = (
            f"{stored} photons stored",
            f"relMSE {error}",
            f"{spent} CPU",
            *((gain.heading,) if side is gain.without else ()),
        )
        for number, fact in enumerate(facts):  # one below the other: narrow windows have no room for a line of them
            caption(viewport, fact, (at, (2.2 + 1.4 * number) * line), anchor=anchor)


def _free_camera_label(viewport: Viewport) -> None:
    """Whose importance is shown, above the line of the value under the mouse."""
    state = viewport.state
    text = "free camera · importance of the render camera"
    if state.inactive_reason("importance.N", state.settings, state.session.traits) is not None:
        text = "free camera · importance is off: the render camera sets the look-up radius alone"
    pose, geometry = state.live_camera(), state.session.geometry
    if pose is not None and geometry is not None and pose.near_normal is not None:
        height = state.settings.free_camera.cut_height * float(geometry.radius)
        text += f" · cut open {si(abs(height), 'm')} {'above' if height >= 0 else 'below'} its eye"
    line = imgui.get_text_line_height()
    x = 0.6 * line
    wrap = max(viewport.size[0] - x - LEGEND_EMS * imgui.get_font_size(), 1.0)  # as the caption does
    lines = imgui.calc_text_size(text, wrap_width=wrap).y
    caption(viewport, text, (x, viewport.size[1] - lines - 2.4 * line), colour=theme.DARK.free)


def _value_under_mouse(viewport: Viewport) -> str:
    pixel = viewport.pixel_under_mouse()
    frame = viewport.frame_at(pixel) if pixel is not None else None
    if pixel is None or frame is None:
        return ""
    rows, columns = frame.planes.shape[:2]
    x, y = pixel[0] * columns // frame.camera.width, pixel[1] * rows // frame.camera.height
    pair = viewport.state.shown_pair()
    view = pair[1].view if pair is not None else viewport.state.shown_display.view
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
        if DIAGNOSTICS[view].classes:
            return f"{pixel[0]}, {pixel[1]}    {DIAGNOSTICS[view].classes[int(values[0])]}"
        if DIAGNOSTICS[view].cells:
            return f"{pixel[0]}, {pixel[1]}    cell {int(values[0])}{', beyond the cut-off' if values[0] % 1 else ''}"
    elif view == DENOISED:
        values = frame.image(view)[y, x]
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


def _scale_legend(viewport: Viewport, scale: Scale, colours: NDArray[np.floating]) -> None:
    """Large values are on top; the unit stands at the highest tick alone."""
    labels = [(1.0 - tick.position, tick_text(tick.value)) for tick in scale.ticks()]
    labels[-1] = (labels[-1][0], f"{labels[-1][1]} {scale.unit}")
    _legend(viewport, labels, colours[::-8])


def tick_text(value: float) -> str:
    """Of a legend's tick, which is a round number: thousands and millions with a prefix, as there is little room."""
    for factor, prefix in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if abs(value) >= 10 * factor:
            return f"{value / factor:.6g}{prefix}"
    return f"{value:.6g}"


def _class_legend(viewport: Viewport, names: Sequence[str]) -> None:
    """A patch of colour for each class, the last one on top."""
    bands = [colour for colour in CLASS_COLOURS[len(names) - 1 :: -1] for _ in range(16)]  # sharp edges
    labels = [((i + 0.5) / len(names), name) for i, name in enumerate(reversed(names))]
    _legend(viewport, labels, np.array(bands))


def _legend(viewport: Viewport, labels: list[tuple[float, str]], colours: NDArray[np.floating]) -> None:
    """A bar at the right edge with colours (n, 3) from top to bottom, and labels at positions from 0 (top) to 1."""
    draw = imgui.get_window_draw_list()
    line = imgui.get_text_line_height()
    x1 = viewport.origin[0] + viewport.size[0] - 0.8 * line
    x0, y0 = x1 - 0.8 * line, viewport.origin[1] + 1.2 * line
    y1 = y0 + 8 * line
    pad = 0.7 * line
    widest = max(imgui.calc_text_size(text).x for _, text in labels)
    box = imgui.get_color_u32(theme.grey(*theme.OVER_PICTURE))
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
