"""What importance and deposition make of the photons: figures, a histogram of the stored photons' weights, the lights
that matter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from imgui_bundle import imgui, implot
from numpy.typing import NDArray

from pmviewer.engine.frame import Frame, Statistics
from pmviewer.photons.deposition.deposited import FIRST_WEIGHT, Deposited
from pmviewer.viewer import theme
from pmviewer.viewer.format import data_size, grouped
from pmviewer.viewer.gl.palette import LIGHT_PALETTE
from pmviewer.viewer.panels.light_list import light_rows
from pmviewer.viewer.panels.statistics_panel import BESIDE, table
from pmviewer.viewer.state import ViewerState

MAP_COLOURS = {"caustic": LIGHT_PALETTE[0], "global": LIGHT_PALETTE[1]}
PERCENTILES = ("1 %", "50 %", "99 %", "all")
TOP_LIGHTS = 8


def deposition_rows(deposited: Mapping[str, Deposited]) -> list[tuple[str, list[str]]]:
    """The figures of the maps, a column each: what became of the photons of the latest pass. Rows that would be all
    nothing are left out, but for the first two."""
    every = list(deposited.values())

    def counts(values: list[int]) -> list[str]:
        return [f"{grouped(n)}  {_share(n, b.arrived)}" for n, b in zip(values, every, strict=True)]

    rows = [("Arrived", [grouped(b.arrived) for b in every]), ("Stored", counts([b.stored for b in every]))]
    redistributed, rejected = [b.redistributed for b in every], [b.rejected - b.redistributed for b in every]
    if any(redistributed):
        rows.append(("Redistributed", counts(redistributed)))
    if any(rejected):
        rows.append(("Rejected", counts(rejected)))
    rows.append(("Memory saved", [data_size(b.saved_bytes) for b in every]))
    return rows


def bias_row(deposited: Mapping[str, Deposited]) -> list[str] | None:
    """Share of the power that a biased rule discards in each map, None where no power is lost."""
    every = list(deposited.values())
    if not any(b.discarded_power > 0 for b in every):
        return None
    return [f"{b.discarded_power / b.arrived_power:.2%}" if b.arrived_power > 0 else "–" for b in every]


def traced_text(s: Statistics) -> str:
    """What was traced: photons of all passes, importons for the latest."""
    text = f"{grouped(s.emitted)} trajectories traced in all passes"
    if s.importons:
        text += f"; {grouped(s.importons)} importons, stored at {grouped(s.stored_in_pass['importons'])} places"
    return text


def histogram_of(deposited: Deposited) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Middles of the bins, as logarithms (base 2) of weights, and the photons in them, from the first to the last bin
    that has any."""
    counts = np.array(deposited.histogram, np.float64)
    used = np.flatnonzero(counts)
    if not len(used):
        return np.empty(0), np.empty(0)
    some = np.arange(used[0], used[-1] + 1)
    return FIRST_WEIGHT + some.astype(np.float64), counts[some]


def _share(part: int, whole: int) -> str:
    return f"{part / whole:4.0%}" if whole else "–"


class ImportancePanel:
    """The tab "Importance"; where nothing is stored by importance, the sentence that says why."""

    def __init__(self, state: ViewerState) -> None:
        self._state = state

    def gui(self) -> None:
        """Draw the tab; called once a frame while it is in front."""
        frame = self._state.frame
        if frame is None:
            imgui.text_disabled("Nothing rendered yet.")
            return
        s = frame.statistics
        if not s.deposited and not s.importons:
            reason = self._state.inactive_reason("importance.N", self._state.settings, self._state.session.traits)
            imgui.text_disabled(theme.drawable(reason or "Importance is off."))
            return
        flags = imgui.TableFlags_.borders_inner_v
        parts = (("figures", 1.2), ("weights", 1.0), ("lights", 0.85))
        roomy = imgui.get_content_region_avail().x > BESIDE * imgui.get_font_size()
        if not imgui.begin_table("##columns", len(parts) if roomy else 1, flags):
            return
        for name, weight in parts if roomy else ():
            imgui.table_setup_column(name, imgui.TableColumnFlags_.width_stretch, weight)
        imgui.table_next_column()
        self._figures(s)
        imgui.table_next_column()
        self._weights(s)
        imgui.table_next_column()
        self._lights(frame)
        imgui.end_table()

    @staticmethod
    def _figures(s: Statistics) -> None:
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted(traced_text(s))
        if not s.deposited:
            imgui.text_disabled("Every photon is stored (importance.deposition).")
        imgui.pop_text_wrap_pos()
        used = {name: deposited for name, deposited in s.deposited.items() if deposited.arrived}
        if not used or not imgui.begin_table("##figures", 1 + len(used)):
            return
        _cells("Latest pass", list(used), theme.DIM)
        for name, values in deposition_rows(used):
            _cells(name, values, theme.TEXT)
        lost = bias_row(used)
        if lost is not None:
            _cells("Power lost (bias)", lost, theme.WARNING)
            imgui.set_item_tooltip("Discarded below the cut-off: the picture is too dark by what this would have lit")
        imgui.end_table()

    def _weights(self, s: Statistics) -> None:
        """Histogram and percentiles, of both maps in their colours."""
        shown = {name: deposited for name, deposited in s.deposited.items() if deposited.stored}
        if not shown:
            imgui.text_disabled("Weights of the stored photons: all alike.")
            return
        imgui.text_colored(imgui.ImVec4(*theme.DIM), "Weights of the stored photons")
        imgui.set_item_tooltip("Power relative to that with which photons leave the lights")
        if imgui.begin_table("##percentiles", 1 + len(PERCENTILES)):
            _cells("at most", PERCENTILES, theme.DIM)
            for name, deposited in shown.items():
                _cells(name, [f"{weight:.3g}" for weight in deposited.percentiles], (*MAP_COLOURS[name], 1.0))
            imgui.end_table()
        self._plot({name: histogram_of(deposited) for name, deposited in shown.items()})

    @staticmethod
    def _plot(bars: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]) -> None:
        low = min(middles[0] for middles, _ in bars.values()) - 1.0
        high = max(middles[-1] for middles, _ in bars.values()) + 1.0
        tallest = max(counts.max() for _, counts in bars.values())
        implot.push_style_var(implot.StyleVar_.plot_padding, (4, 4))
        implot.push_style_var(implot.StyleVar_.label_padding, (4, 2))
        implot.push_style_color(implot.Col_.frame_bg, theme.grey(0, 0))
        implot.push_style_color(implot.Col_.plot_bg, theme.ground("plot"))
        implot.push_style_color(implot.Col_.axis_grid, theme.grey(theme.look.lighter, 0.12))
        flags = implot.Flags_.no_inputs | implot.Flags_.no_menus | implot.Flags_.no_mouse_text | implot.Flags_.no_legend
        line = imgui.get_text_line_height()
        size = imgui.get_content_region_avail().x, max(imgui.get_content_region_avail().y - 0.5 * line, 6 * line)
        if implot.begin_plot("##weights", size, flags):
            axis = implot.AxisFlags_.no_menus | implot.AxisFlags_.no_highlight
            implot.setup_axis(implot.ImAxis_.x1, "weight", axis)
            implot.setup_axis(implot.ImAxis_.y1, "photons", axis)
            implot.setup_axis_scale(implot.ImAxis_.y1, implot.Scale_.log10)
            implot.setup_axis_limits(implot.ImAxis_.x1, low, high, implot.Cond_.always)
            implot.setup_axis_limits(implot.ImAxis_.y1, 0.7, 2.0 * tallest, implot.Cond_.always)
            step = max(1, round((high - low) / 6))
            ticks = [float(e) for e in range(int(np.ceil(low)), int(high) + 1) if e % step == 0]
            implot.setup_axis_ticks(implot.ImAxis_.x1, ticks, [weight_text(e) for e in ticks])
            decades = [10.0**e for e in range(int(np.log10(tallest)) + 1)]
            implot.setup_axis_ticks(
                implot.ImAxis_.y1, decades, [f"{v:g}" if v < 1e4 else f"1e{np.log10(v):.0f}" for v in decades]
            )
            for (name, (middles, counts)), offset in zip(bars.items(), offsets(len(bars)), strict=True):
                some = counts > 0
                spec = implot.Spec(fill_color=imgui.ImVec4(*MAP_COLOURS[name], 0.9))
                implot.plot_bars(name, middles[some] + offset, counts[some], 0.8 / len(bars), spec)
            implot.end_plot()
        implot.pop_style_color(3)
        implot.pop_style_var(2)

    def _lights(self, frame: Frame) -> None:
        lights = frame.known_lights
        if lights is None:
            imgui.text_colored(imgui.ImVec4(*theme.DIM), "Lights that matter")
            imgui.push_text_wrap_pos(0)
            imgui.text_disabled("Shown with the overlay 'light importance' (L).")
            imgui.pop_text_wrap_pos()
            return
        table("Share of the picture's light", light_rows(lights, TOP_LIGHTS))


def _cells(name: str, values: Sequence[str], colour: theme.Colour) -> None:
    """A row of a table: a name and values at the right of their columns."""
    imgui.table_next_row()
    imgui.table_next_column()
    imgui.text_colored(imgui.ImVec4(*colour), theme.drawable(name))
    for value in values:
        imgui.table_next_column()
        room = imgui.get_content_region_avail().x - imgui.calc_text_size(value).x
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0))
        imgui.text_colored(imgui.ImVec4(*colour), value)


def weight_text(exponent: float) -> str:
    """2^exponent, a whole number or a fraction."""
    return f"{2**exponent:g}" if exponent >= 0 else f"1/{2**-exponent:g}"


def count_text(count: float) -> str:
    """A power of ten."""
    return f"{count:g}" if count < 1e4 else f"1e{round(np.log10(count))}"


def offsets(count: int) -> list[float]:
    """Of the bars of `count` maps within a bin one wide."""
    return [(i - (count - 1) / 2) * 0.8 / count for i in range(count)]
