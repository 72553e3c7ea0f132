"""The error against the reference: its figures, and its curve against time beside those of earlier settings."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

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
from pmviewer.viewer.snapshots import curve_of
from pmviewer.viewer.state import ViewerState

if TYPE_CHECKING:  # brings OpenEXR along, which the window doesn't wait for
    from pmviewer.output.snapshot import CurvePoint

CURRENT, EARLIER, KEPT = "current", "earlier", "snapshot"
AXES = {"seconds": "rendering time (s)", "CPU": "CPU time (s)", "passes": "passes"}
"""What curves are plotted against."""
LEGEND = 0.4
"""Of a plot's width, what the names of its curves take at most beside it."""
NARROW, LOW = 26.0, 8.0
"""Ems of a plot below which it has no legend beside it, or no titles of axes: its curves would have no room left."""
_SNAPSHOTS: tuple[theme.Colour, ...] = (
    (0.35, 0.71, 0.91, 1.0),
    (0.10, 0.70, 0.50, 1.0),
    (0.84, 0.55, 0.72, 1.0),
    (0.94, 0.89, 0.36, 1.0),
)
"""After Okabe and Ito; they repeat."""
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
    """The tab "Error". `axis`: what the curves are plotted against."""

    def __init__(self, state: ViewerState, actions: Mapping[str, Callable[[], None]]) -> None:
        self._state = state
        self._actions = actions
        self.axis = "seconds"

    def gui(self) -> None:
        """Draw the tab; called once a frame while it is in front."""
        comparison = self._state.comparison
        runs = [*comparison.earlier, *([comparison.current] if comparison.current else [])]
        curves = [_curve_of(run, run is comparison.current) for run in runs if run.points]
        if comparison.reference is not None:
            truth = str(comparison.reference.path)
            kept = self._state.snapshots.all
            known = [one for one in kept if one.curve and one.truth == truth]
            curves += [Curve(f"{one.name}##snapshot{one.number}", one.curve, KEPT) for one in known]
        if imgui.begin_child("##figures", (17 * imgui.get_font_size(), 0)):
            self._source()
            if curves:
                self._axis_choice()
            self._figures()
        imgui.end_child()
        imgui.same_line()
        if curves:
            self._plot(curves)
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
        for number, text in enumerate(AXES):
            if number:
                imgui.same_line()
            if imgui.radio_button(text, self.axis == text):
                self.axis = text
        imgui.begin_disabled(not comparison.earlier)
        if imgui.button("Clear"):
            comparison.clear_earlier()
        imgui.end_disabled()
        imgui.set_item_tooltip("Forget the curves of earlier settings")

    def _plot(self, curves: list[Curve]) -> None:
        drawn = [(curve, *curve.values(self.axis)) for curve in curves]
        x_limits = log_limits([float(x) for _, xs, _ in drawn for x in xs])
        y_limits = log_limits([float(y) for _, _, ys in drawn for y in ys])
        implot.push_style_var(implot.StyleVar_.plot_padding, (4, 4))
        implot.push_style_var(implot.StyleVar_.label_padding, (4, 2))
        implot.push_style_color(implot.Col_.frame_bg, theme.grey(0, 0))
        implot.push_style_color(implot.Col_.plot_bg, theme.ground("plot"))
        implot.push_style_color(implot.Col_.axis_grid, theme.grey(theme.look.lighter, 0.12))
        flags = implot.Flags_.no_inputs | implot.Flags_.no_menus | implot.Flags_.no_mouse_text
        size, em = imgui.get_content_region_avail(), imgui.get_font_size()
        narrow, low = size.x < NARROW * em, size.y < LOW * em
        if narrow and len(drawn) == 1:
            flags |= implot.Flags_.no_legend
        if implot.begin_plot("##curves", size, flags):
            _axis(implot.ImAxis_.x1, "" if low else AXES[self.axis], x_limits)
            _axis(implot.ImAxis_.y1, "" if low else "relMSE", y_limits)
            if narrow:
                implot.setup_legend(implot.Location_.north_east, implot.LegendFlags_.none)
            else:
                implot.setup_legend(implot.Location_.east, implot.LegendFlags_.outside)
            for number, (curve, xs, ys) in enumerate(drawn):
                current = curve.kind == CURRENT
                palette = _SNAPSHOTS if curve.kind == KEPT else _EARLIER
                colour = imgui.ImVec4(*(theme.ACCENT if current else palette[number % len(palette)]))
                spec = implot.Spec(line_color=colour, line_weight=2.0 if current else 1.5)
                spec.marker, spec.marker_size = implot.Marker_.circle, 3.0 if current else 2.0
                spec.marker_fill_color = spec.marker_line_color = colour
                label = theme.drawable(curve.label)
                implot.plot_line(label if narrow else _elided(label, LEGEND * size.x), xs, ys, spec)
            implot.end_plot()
        implot.pop_style_color(3)
        implot.pop_style_var(2)


@dataclass(frozen=True)
class Curve:
    """A line of the plot: of the current run, of an earlier one, or of a snapshot."""

    label: str
    points: Sequence[CurvePoint]
    kind: str

    def values(self, axis: str) -> tuple[np.ndarray, np.ndarray]:
        """What it is plotted against, and relMSE: positive, since both axes are logarithmic."""
        read = {"passes": lambda p: p.passes, "seconds": lambda p: p.seconds, "CPU": lambda p: p.cpu_seconds}[axis]
        points = [p for p in self.points if math.isfinite(p.relmse)]
        if not points:
            return np.ones(1), np.ones(1)
        xs, ys = (np.array(values, np.float64) for values in zip(*((read(p), p.relmse) for p in points)))
        return np.maximum(xs, 1e-6), np.maximum(ys, 1e-12)


def _curve_of(run: Run, current: bool) -> Curve:
    return Curve(f"{run.label}##{run.version}", curve_of(run), CURRENT if current else EARLIER)


def _elided(label: str, room: float) -> str:
    """The label, what it shows before its "##" cut to so many pixels."""
    shown, mark, own = label.partition("##")
    if imgui.calc_text_size(shown).x > room:
        while shown and imgui.calc_text_size(f"{shown}…").x > room:
            shown = shown[:-1]
        shown = f"{shown.rstrip(' ,')}…"
    return f"{shown}{mark}{own}"


def _axis(axis: int, title: str, limits: tuple[float, float]) -> None:
    implot.setup_axis(axis, title, implot.AxisFlags_.no_menus | implot.AxisFlags_.no_highlight)
    implot.setup_axis_scale(axis, implot.Scale_.log10)
    implot.setup_axis_limits(axis, *limits, implot.Cond_.always)
    low, high = limits
    ticks = Scale(low, high, log=True).ticks(5)
    values = [low * (high / low) ** tick.position for tick in ticks]
    implot.setup_axis_ticks(axis, values, [tick.label.replace("e-0", "e-") for tick in ticks])
