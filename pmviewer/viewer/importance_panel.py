"""What importance and deposition make of the photons: figures, a histogram of the stored photons' weights, the lights
that matter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import imgui, implot
from numpy.typing import NDArray

from pmviewer.engine.frame import Frame, Statistics
from pmviewer.viewer import theme
from pmviewer.viewer.format import data_size, grouped
from pmviewer.viewer.light_list import light_rows
from pmviewer.viewer.overlays import LIGHT_PALETTE
from pmviewer.viewer.state import ViewerState
from pmviewer.viewer.statistics_panel import Rows, table

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.photons.deposition import Deposited

FIRST_WEIGHT = -10
"""Exponent of the histogram's first bin, as `pmviewer.photons.deposition.FIRST_WEIGHT`."""
MAP_COLOURS = {"caustic": LIGHT_PALETTE[0], "global": LIGHT_PALETTE[1]}
PERCENTILES = ("1 %", "50 %", "99 %", "largest")
TOP_LIGHTS = 8


def deposition_rows(books: Deposited) -> Rows:
    """The figures of one map."""
    rows = [
        ("Arrived", grouped(books.arrived)),
        ("Stored", f"{grouped(books.stored)}  {_share(books.stored, books.arrived)}"),
    ]
    rejected = books.rejected - books.redistributed
    if books.redistributed:
        text = f"{grouped(books.redistributed)}  {_share(books.redistributed, books.arrived)}"
        rows.append(("Power redistributed", text))
    if rejected:
        rows.append(("Rejected", f"{grouped(rejected)}  {_share(rejected, books.arrived)}"))
    rows.append(("Memory saved", data_size(books.saved_bytes)))
    return rows


def discarded_text(books: Deposited) -> str | None:
    """How much too dark a biased rule makes the map, None where no power is lost."""
    if not books.discarded_power > 0:
        return None
    return f"Biased: {books.discarded_power / books.arrived_power:.2%} of the power is discarded"


def importance_rows(s: Statistics) -> Rows:
    """Of the importons."""
    if not s.importons:
        return []
    return [
        ("Importons traced", grouped(s.importons)),
        ("Stored at", f"{grouped(s.stored_in_pass['importons'])} places"),
    ]


def histogram_of(books: Deposited) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Middles of the bins, as logarithms (base 2) of weights, and the photons in them, from the first to the last bin
    that has any."""
    counts = np.array(books.histogram, np.float64)
    used = np.flatnonzero(counts)
    if not len(used):
        return np.empty(0), np.empty(0)
    some = np.arange(used[0], used[-1] + 1)
    return FIRST_WEIGHT + some + 0.5, counts[some]


def _share(part: int, whole: int) -> str:
    return f"{part / whole:4.0%}" if whole else "–"


class ImportancePanel:
    def __init__(self, state: ViewerState) -> None:
        self._state = state

    def gui(self) -> None:
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
        if not imgui.begin_table("##columns", 3, flags):
            return
        for name, weight in (("figures", 1.15), ("weights", 1.0), ("lights", 0.9)):
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
        table("", [("Trajectories traced, all passes", grouped(s.emitted)), *importance_rows(s)])
        if not s.deposited:
            imgui.text_disabled("Every photon is stored (importance.deposition).")
        for name, books in s.deposited.items():
            if books.arrived == 0:
                continue
            table(f"{name.capitalize()} map, latest pass", deposition_rows(books))
            lost = discarded_text(books)
            if lost is not None:
                imgui.push_text_wrap_pos(0)
                imgui.text_colored(imgui.ImVec4(*theme.WARNING), lost)
                imgui.pop_text_wrap_pos()

    def _weights(self, s: Statistics) -> None:
        """Histogram and percentiles, of both maps in their colours."""
        shown = {name: books for name, books in s.deposited.items() if books.stored}
        if not shown:
            imgui.text_disabled("Weights of the stored photons: all alike.")
            return
        imgui.text_colored(imgui.ImVec4(*theme.DIM), "Weights of the stored photons")
        imgui.set_item_tooltip("Power relative to that with which photons leave the lights")
        self._plot({name: histogram_of(books) for name, books in shown.items()})
        if imgui.begin_table("##percentiles", 1 + len(PERCENTILES)):
            imgui.table_next_row()
            for text in ("", *PERCENTILES):
                imgui.table_next_column()
                imgui.text_colored(imgui.ImVec4(*theme.DIM), text)
            for name, books in shown.items():
                imgui.table_next_row()
                imgui.table_next_column()
                imgui.text_colored(imgui.ImVec4(*MAP_COLOURS[name], 1.0), name)
                for weight in books.percentiles:
                    imgui.table_next_column()
                    imgui.text_unformatted(f"{weight:.3g}")
            imgui.end_table()

    @staticmethod
    def _plot(bars: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]) -> None:
        low = min(middles[0] for middles, _ in bars.values()) - 1.0
        high = max(middles[-1] for middles, _ in bars.values()) + 1.0
        tallest = max(counts.max() for _, counts in bars.values())
        implot.push_style_var(implot.StyleVar_.plot_padding, (4, 4))
        implot.push_style_var(implot.StyleVar_.label_padding, (4, 2))
        implot.push_style_color(implot.Col_.frame_bg, theme.grey(0, 0))
        implot.push_style_color(implot.Col_.plot_bg, theme.grey(0.12))
        implot.push_style_color(implot.Col_.axis_grid, theme.grey(1, 0.12))
        flags = implot.Flags_.no_inputs | implot.Flags_.no_menus | implot.Flags_.no_mouse_text | implot.Flags_.no_legend
        size = imgui.get_content_region_avail().x, max(7.5 * imgui.get_text_line_height(), 60.0)
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


def weight_text(exponent: float) -> str:
    """2^exponent, a whole number or a fraction."""
    return f"{2**exponent:g}" if exponent >= 0 else f"1/{2**-exponent:g}"


def count_text(count: float) -> str:
    """A power of ten."""
    return f"{count:g}" if count < 1e4 else f"1e{round(np.log10(count))}"


def offsets(count: int) -> list[float]:
    """Of the bars of `count` maps within a bin one wide."""
    return [(i - (count - 1) / 2) * 0.8 / count for i in range(count)]
