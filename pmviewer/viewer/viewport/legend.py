"""The legend of false colours: colours, values, the histogram of what is shown, and the settings that decide them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import icons_fontawesome_6 as fa
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.output.false_look import Histogram
from pmviewer.output.falsecolour import Scale
from pmviewer.settings.access import SETTINGS, get
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped
from pmviewer.viewer.gl.planes import Shown
from pmviewer.viewer.panels.widgets import icon_button, tooltip_text
from pmviewer.viewer.viewport.caption import caption, is_narrow

if TYPE_CHECKING:
    from pmviewer.viewer.viewport.viewport import Viewport

_POPUP = "How numbers become colours"
_ROWS = ("colours", "two_sided", "classes", "range", "percentile", "low", "high", "spacing", "shading", "marks")
_HISTOGRAM = 3.2
"""Width of the histogram, in lines."""
_LINES = 8.0


def draw_false_legend(viewport: Viewport, top: float = 0.0) -> None:
    """Of the view or difference in false colours that is shown; below `top`, where a caption ends that goes across.
    `Viewport.legend_end` is where it ends, for the button to its settings."""
    shown = viewport.picture.planes.shown if viewport.picture is not None else None
    if shown is None:
        return
    if shown.info.classes:
        viewport.legend_end = _class_legend(viewport, shown.info.classes, shown.look.class_colours, top)
    elif not shown.info.cells:
        viewport.legend_end = _scale_legend(viewport, shown, top)


def draw_marks(viewport: Viewport) -> None:
    """How many pixels are marked, while they are."""
    picture, state = viewport.picture, viewport.state
    if picture is None or not state.settings.display.marks:
        return
    shown = picture.planes.shown
    marks = shown.marks if shown is not None and shown.info.in_colours else picture.planes.marks
    if marks is None:
        return
    line = imgui.get_text_line_height()
    text = marks.text()
    if shown is not None:
        h, total = shown.histogram, max(marks.total, 1)
        text = f"{h.broken:,} not finite, {h.below:,} below the colours ({h.below / total:.2%}), {h.above:,} above them"
        text += f" ({h.above / total:.2%})"
    caption(viewport, text, (0.6 * line, 2.2 * line), colour=theme.DARK.accent)


def tick_text(value: float) -> str:
    """Of a legend's tick, which is a round number: thousands and millions with a prefix, as there is little room."""
    for factor, prefix in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if abs(value) >= 10 * factor:
            return f"{value / factor:.6g}{prefix}"
    return f"{value:.0e}".replace("e-0", "e-") if 0 < abs(value) < 1e-3 else f"{value:.6g}"


def _scale_legend(viewport: Viewport, shown: Shown, top: float) -> float:
    """Large values are on top; the unit stands at the highest tick alone."""
    labels = [(1.0 - tick.position, tick_text(tick.value)) for tick in shown.scale.ticks()]
    if labels:
        labels[-1] = (labels[-1][0], f"{labels[-1][1]} {shown.scale.unit}".rstrip())
    return draw_legend(viewport, labels, shown.table[::-8], None if is_narrow(viewport) else shown.histogram, top)


def _class_legend(
    viewport: Viewport, names: Sequence[str], colours: Sequence[tuple[float, float, float]], top: float
) -> float:
    """A patch of colour for each class, the last one on top."""
    bands = [colour for colour in colours[len(names) - 1 :: -1] for _ in range(16)]  # sharp edges
    labels = [((i + 0.5) / len(names), name) for i, name in enumerate(reversed(names))]
    return draw_legend(viewport, labels, np.array(bands), None, top)


def draw_legend(
    viewport: Viewport,
    labels: list[tuple[float, str]],
    colours: NDArray[np.floating],
    histogram: Histogram | None = None,
    below: float = 0.0,
) -> float:
    """A bar at the right edge with colours (n, 3) from top to bottom, labels at positions from 0 (top) to 1, and a
    histogram, lowest values at the bottom, so far below the viewport's top. Returns the bottom on the screen."""
    draw = imgui.get_window_draw_list()
    line = imgui.get_text_line_height()
    x1 = viewport.origin[0] + viewport.size[0] - 0.8 * line
    x0, y0 = x1 - 0.8 * line, viewport.origin[1] + max(1.2 * line, below + 0.7 * line)
    lowest_end = viewport.origin[1] + viewport.size[1] - 0.9 * line
    y1 = min(y0 + _LINES * line, max(lowest_end, y0 + 2 * line))
    pad = 0.7 * line
    left = x0 - (_HISTOGRAM * line if histogram is not None else 0.0)
    widest = max((imgui.calc_text_size(text).x for _, text in labels), default=0.0)
    box = imgui.get_color_u32(theme.grey(*theme.OVER_PICTURE))
    draw.add_rect_filled((left - widest - 0.4 * line - pad, y0 - pad), (x1 + pad, y1 + pad), box, 4)
    codes = [imgui.get_color_u32(imgui.ImVec4(float(r), float(g), float(b), 1.0)) for r, g, b in colours]
    edges = np.linspace(y0, y1, len(codes))
    for top, bottom, above, below in zip(edges[:-1], edges[1:], codes[:-1], codes[1:], strict=True):
        draw.add_rect_filled_multi_color((x0, float(top)), (x1, float(bottom)), above, above, below, below)
    if histogram is not None:
        _draw_histogram(histogram, (left, y0, x0 - 0.15 * line, y1))
    lowest = -np.inf  # labels that would run into the one above are left out
    for position, text in sorted(labels):
        size = imgui.calc_text_size(text)
        top = y0 + position * (y1 - y0) - size.y / 2
        if top < lowest:
            continue
        lowest = top + 0.9 * size.y
        draw.add_text((left - size.x - 0.4 * line, top), imgui.get_color_u32(theme.grey(0.9)), text)
    return float(y1 + pad)


def _draw_histogram(histogram: Histogram, place: tuple[float, float, float, float]) -> None:
    """Bars from the right, the longest as wide as there is room."""
    x0, y0, x1, y1 = place
    most = int(histogram.counts.max(initial=0))
    if most == 0:
        return
    draw, bins = imgui.get_window_draw_list(), len(histogram.counts)
    code = imgui.get_color_u32(theme.grey(0.72))
    edges = np.linspace(y1, y0, bins + 1)
    for count, low, high in zip(histogram.counts, edges[:-1], edges[1:], strict=True):
        if count:
            width = max((x1 - x0) * float(count) / most, 1.0)
            draw.add_rect_filled((x1 - width, float(high)), (x1, float(low)), code)


def draw_settings_button(viewport: Viewport) -> None:
    """Under the legend that was drawn last, at the right edge. To be called before the picture's button: of things that
    overlap, the first takes the mouse."""
    shown = viewport.picture.planes.shown if viewport.picture is not None else None
    bottom = viewport.legend_end
    if shown is None or bottom is None or viewport.alone:
        return
    line, back = imgui.get_text_line_height(), imgui.get_cursor_screen_pos()
    side = 1.15 * imgui.get_frame_height()
    x = viewport.origin[0] + viewport.size[0] - 0.1 * line - side
    imgui.get_window_draw_list().add_rect_filled(
        (x, bottom + 2), (x + side, bottom + 2 + imgui.get_frame_height()),
        imgui.get_color_u32(theme.grey(*theme.OVER_PICTURE)), 3,
    )  # fmt: skip
    imgui.set_cursor_screen_pos((x, bottom + 2))
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.DARK.text))
    if icon_button(fa.ICON_FA_SLIDERS, "false.colours", "Colours, range and marks"):
        imgui.open_popup(_POPUP)
    imgui.pop_style_color()
    if imgui.begin_popup(_POPUP):
        _settings(viewport, shown)
        imgui.end_popup()
    imgui.set_cursor_screen_pos(back)
    imgui.dummy((0, 0))


def _settings(viewport: Viewport, shown: Shown) -> None:
    """The settings that have an effect on what is shown, and how many pixels have which value."""
    state, em = viewport.state, imgui.get_font_size()
    if shown.info.in_colours:
        _counts(shown.histogram, shown.scale)
    for name in _ROWS:
        info = SETTINGS[f"display.{name}"]
        if state.inactive_reason(info.path, state.settings, state.session.traits) is not None:
            continue
        value = get(state.settings, info.path)
        imgui.align_text_to_frame_padding()
        imgui.text_colored(imgui.ImVec4(*theme.DIM), theme.drawable(info.title))
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            tooltip_text([(info.path, theme.ACCENT), (info.description, theme.TEXT)])
        imgui.same_line(11 * em)
        new = viewport.widgets.edit(info, value, value, width=11 * em)
        if new is not None:
            state.change(_with_range(info.path, new, shown.scale))


def _with_range(path: str, value: object, scale: Scale) -> dict[str, object]:
    """The change; whoever sets the range by hand begins with the one that is shown."""
    if path == "display.range" and value == "by hand":
        return {path: value, "display.low": float(f"{scale.lower:.4g}"), "display.high": float(f"{scale.upper:.4g}")}
    return {path: value}


def _counts(histogram: Histogram, scale: Scale) -> None:
    total = max(histogram.total, 1)
    parts = f"{histogram.below / total:.1%} below, {histogram.above / total:.1%} above"
    imgui.text_unformatted(f"{grouped(histogram.total)} pixels, {parts}")
    imgui.text_disabled(theme.drawable(f"{scale.lower:.4g} to {scale.upper:.4g} {scale.unit}".rstrip()))
    if histogram.broken:
        imgui.text_colored(imgui.ImVec4(*theme.WARNING), f"{grouped(histogram.broken)} not finite")
