"""What lies over the picture: the value under the mouse, the depth legend, what is being waited for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import imgui

from pmviewer.output.diagnostic_views import DENOISED, DIAGNOSTICS, ERROR
from pmviewer.viewer import theme
from pmviewer.viewer.format import si
from pmviewer.viewer.gl.planes import preview_of
from pmviewer.viewer.viewport.caption import LEGEND_EMS, caption, is_narrow
from pmviewer.viewer.viewport.legend import draw_false_legend, draw_legend, draw_marks
from pmviewer.viewer.viewport.pair_hud import draw_pair
from pmviewer.viewer.viewport.values import value_under_mouse

if TYPE_CHECKING:
    from pmviewer.viewer.viewport.viewport import Viewport

_TITLES = {
    "error": f"error: {ERROR.text}, no unit",
    DENOISED: "denoised by Open Image Denoise: a guess, no estimate",
} | {view: f"{view}: {info.text}; grey: {info.none}" for view, info in DIAGNOSTICS.items()}


def draw_hud(viewport: Viewport, hovered: bool) -> None:
    """Small captions in the panel's corners."""
    state = viewport.state
    view = state.shown_display.view
    width, height = viewport.size
    line = imgui.get_text_line_height()
    margin = 0.6 * line
    pair = state.shown_pair()
    if viewport.shown_camera() is None and pair is None:
        status = state.session.status
        caption(viewport, status.text or "Drop a scene here or press Ctrl+O", (width / 2, height / 2), anchor=0.5)
        return
    if pair is not None:
        draw_pair(viewport, pair)
        if state.settings.free_camera.on:
            _free_camera_label(viewport)
        if hovered and (text := value_under_mouse(viewport)):
            caption(viewport, text, (margin, height - line - 1.2 * margin))
        return
    below = 0.0
    problem = state.pair.problem(state.settings, state.frame)
    if problem:
        caption(viewport, f"comparing: {problem}", (width / 2, 0.3 * height), anchor=0.5, colour=theme.DARK.warning)
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
        below = caption(viewport, _title(viewport, view), (margin, margin))
    elif state.frame is not None and (preview := preview_of(state.frame, state.settings.display)) is not None:
        caption(viewport, f"preview, no estimate: {preview.caption}", (margin, margin))
    if state.settings.free_camera.on and viewport.captions:
        _free_camera_label(viewport)
    elif viewport.captions:
        _clip_label(viewport)
    if view == "depth" and state.frame is not None and viewport.picture is not None:
        _depth_legend(viewport, *viewport.picture.planes.depth_range)
    draw_false_legend(viewport, below if is_narrow(viewport) else 0.0)
    draw_marks(viewport)
    if viewport.picture is not None:
        source = viewport.source()
        for overlay in viewport.picture.layers.shown(state.settings):
            overlay.annotate(viewport, source)
    hint = viewport.region.draw()
    if hint:
        caption(viewport, hint, (width / 2, height - line - 2 * margin), anchor=0.5, colour=theme.DARK.accent)
    advice = "" if viewport.alone else viewport.advice()
    if advice:
        caption(viewport, advice, (width / 2, 0.5 * height), anchor=0.5, colour=theme.DARK.warning)
    if state.flying:
        text = "flying: W A S D, Q down, E up, drag to look, Shift faster, F or Esc to leave"
        caption(viewport, text, (width / 2, height - line - 2 * margin), anchor=0.5, colour=theme.DARK.accent)
    elif hovered:
        text = value_under_mouse(viewport)
        if text:
            caption(viewport, text, (margin, height - line - 1.2 * margin))


def _title(viewport: Viewport, view: str) -> str:
    """What is shown, with the map where there are two."""
    frame = viewport.state.frame
    of = frame.inspection.wanted.map if view in DIAGNOSTICS and frame is not None else ""
    return f"{of} map, {_TITLES[view]}" if of else _TITLES.get(view, view)


def _clip_label(viewport: Viewport) -> None:
    """What the picture leaves out, above the line of the value under the mouse."""
    camera = viewport.state.settings.camera
    if camera.clip == "off":
        return
    across = "the view" if camera.clip == "view" else camera.clip
    line = imgui.get_text_line_height()
    text = f"clipped across {across}: what is on the camera's side of the plane is left out"
    caption(viewport, text, (0.6 * line, viewport.size[1] - 3.4 * line), colour=theme.DARK.free)


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


def _depth_legend(viewport: Viewport, near: float, far: float) -> None:
    """From bright (near) to dark (far)."""
    labels = [(0.0, si(near, "m")), (0.5, si((near + far) / 2, "m")), (1.0, si(far, "m"))]
    draw_legend(viewport, labels, np.array([[1.0, 1.0, 1.0], [0.1, 0.1, 0.1]]))
