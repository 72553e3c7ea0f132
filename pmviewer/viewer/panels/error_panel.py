"""The error against the reference: its figures, and its curve against time beside those of earlier settings."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from imgui_bundle import icons_fontawesome_6 as fa
from imgui_bundle import imgui, implot

from pmviewer.output.falsecolour import Scale
from pmviewer.viewer import theme
from pmviewer.viewer.comparison import Point, Run
from pmviewer.viewer.format import grouped
from pmviewer.viewer.panels.statistics_panel import Rows, table
from pmviewer.viewer.panels.widgets import icon_button
from pmviewer.viewer.shortcuts import keys_of
from pmviewer.viewer.state import ViewerState

_EARLIER: tuple[theme.Colour, ...] = (
    (0.62, 0.62, 0.62, 0.8),
    (0.48, 0.60, 0.70, 0.8),
    (0.58, 0.67, 0.50, 0.8),
    (0.68, 0.52, 0.62, 0.8),
)
"""Muted, so that the present run stands out; they repeat."""


def error_rows(point: Point) -> Rows:
    """The figures of one frame."""
    m = point.metrics
    return [
        (f"relMSE, pass {grouped(point.passes)}", f"{m.relmse_all:.3e}"),
        ("Without the worst 0.1 %", f"{m.relmse_drop:.3e}"),
        ("Error of 8×8 blocks", "–" if math.isnan(m.block_error) else f"{m.block_error:.3e}"),
        ("Mean ratio", f"{m.mean_ratio:.4f}"),
    ]


def log_limits(values: Sequence[float]) -> tuple[float, float]:
    """Limits of a logarithmic axis that leave room for markers around the values, and span at least a factor of 4."""
    low, high = min(values), max(values)
    widen = max((high / low) ** 0.07, 2.0 * math.sqrt(low / high))
    return low / widen, high * widen


class ErrorPanel:
    """The tab "Error". `by_passes`: the curves are plotted against passes, not time."""

    def __init__(self, state: ViewerState, actions: Mapping[str, Callable[[], None]]) -> None:
        self._state = state
        self._actions = actions
        self.by_passes = False

    def gui(self) -> None:
        """Draw the tab; called once a frame while it is in front."""
        comparison = self._state.comparison
        runs = [*comparison.earlier, *([comparison.current] if comparison.current else [])]
        runs = [run for run in runs if run.points]
        if imgui.begin_child("##figures", (17 * imgui.get_font_size(), 0)):
            self._source()
            if runs:
                self._axis_choice()
            self._figures()
        imgui.end_child()
        imgui.same_line()
        if runs:
            self._plot(runs)
        else:
            imgui.text_disabled("The curve of the error begins with the first pass that can be compared.")

    def _source(self) -> None:
        """Where the reference comes from, and a button to load another one."""
        reference = self._state.comparison.reference
        if icon_button(fa.ICON_FA_FOLDER_OPEN, "load_reference", f"Load a reference  ({keys_of('load_reference')})"):
            self._actions["load_reference"]()
        imgui.same_line()
        imgui.align_text_to_frame_padding()
        if reference is None:
            imgui.text_disabled("no reference")
            return
        imgui.text_unformatted(theme.drawable(f"{reference.path.parent.name}/{reference.path.name}"))
        imgui.set_item_tooltip(f"{reference.path}\n{reference.size[0]}×{reference.size[1]} pixels")

    def _figures(self) -> None:
        comparison, frame = self._state.comparison, self._state.frame
        reference = comparison.reference
        problem = comparison.problem(frame)
        if problem is not None:
            imgui.push_text_wrap_pos(0)
            colour = theme.WARNING if reference is not None and frame is not None else theme.DIM
            imgui.text_colored(imgui.ImVec4(*colour), theme.drawable(problem))
            imgui.pop_text_wrap_pos()
        camera = self._state.live_camera()
        if reference is not None and camera is not None and (camera.width, camera.height) != reference.size:
            width, height = reference.size
            if imgui.button(f"Render {width}×{height}"):
                self._state.change({"camera.width": width, "camera.height": height})
        point = comparison.latest(frame)
        if problem is None and point is not None:
            table("", error_rows(point))

    def _axis_choice(self) -> None:
        """What the curves run over, and a button that forgets those of other settings."""
        comparison = self._state.comparison
        for text, by_passes in (("seconds", False), ("passes", True)):
            if imgui.radio_button(text, self.by_passes == by_passes):
                self.by_passes = by_passes
            imgui.same_line()
        imgui.begin_disabled(not comparison.earlier)
        if imgui.button("Clear"):
            comparison.clear_earlier()
        imgui.end_disabled()
        imgui.set_item_tooltip("Forget the curves of earlier settings")

    def _plot(self, runs: list[Run]) -> None:
        comparison = self._state.comparison
        curves = [(run, *self._curve(run)) for run in runs]
        x_limits = log_limits([float(x) for _, xs, _ in curves for x in xs])
        y_limits = log_limits([float(y) for _, _, ys in curves for y in ys])
        implot.push_style_var(implot.StyleVar_.plot_padding, (4, 4))
        implot.push_style_var(implot.StyleVar_.label_padding, (4, 2))
        implot.push_style_color(implot.Col_.frame_bg, theme.grey(0, 0))
        implot.push_style_color(implot.Col_.plot_bg, theme.ground("plot"))
        implot.push_style_color(implot.Col_.axis_grid, theme.grey(theme.look.lighter, 0.12))
        flags = implot.Flags_.no_inputs | implot.Flags_.no_menus | implot.Flags_.no_mouse_text
        if implot.begin_plot("##curves", imgui.get_content_region_avail(), flags):
            _axis(implot.ImAxis_.x1, "passes" if self.by_passes else "rendering time (s)", x_limits)
            _axis(implot.ImAxis_.y1, "relMSE", y_limits)
            implot.setup_legend(implot.Location_.east, implot.LegendFlags_.outside)
            for number, (run, xs, ys) in enumerate(curves):
                current = run is comparison.current
                colour = imgui.ImVec4(*(theme.ACCENT if current else _EARLIER[number % len(_EARLIER)]))
                spec = implot.Spec(line_color=colour, line_weight=2.0 if current else 1.5)
                spec.marker, spec.marker_size = implot.Marker_.circle, 3.0 if current else 2.0
                spec.marker_fill_color = spec.marker_line_color = colour
                implot.plot_line(f"{theme.drawable(run.label)}##{run.version}", xs, ys, spec)
            implot.end_plot()
        implot.pop_style_color(3)
        implot.pop_style_var(2)

    def _curve(self, run: Run) -> tuple[np.ndarray, np.ndarray]:
        """Passes or seconds, and relMSE: positive, since both axes are logarithmic."""
        points = list(run.points)
        xs = np.array([p.passes if self.by_passes else p.seconds for p in points], np.float64)
        ys = np.array([p.metrics.relmse_all for p in points], np.float64)
        good = np.isfinite(ys)
        if not good.any():
            return np.ones(1), np.ones(1)
        return np.maximum(xs[good], 1e-6), np.maximum(ys[good], 1e-12)


def _axis(axis: int, title: str, limits: tuple[float, float]) -> None:
    implot.setup_axis(axis, title, implot.AxisFlags_.no_menus | implot.AxisFlags_.no_highlight)
    implot.setup_axis_scale(axis, implot.Scale_.log10)
    implot.setup_axis_limits(axis, *limits, implot.Cond_.always)
    low, high = limits
    ticks = Scale(low, high, log=True).ticks(5)
    values = [low * (high / low) ** tick.position for tick in ticks]
    implot.setup_axis_ticks(axis, values, [tick.label.replace("e-0", "e-") for tick in ticks])
