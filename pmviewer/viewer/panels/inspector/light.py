"""The pixel's value by terms as bars, and since it was pinned."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui, implot

from pmviewer.engine.inspector.report import History, PixelReport, luminance
from pmviewer.render.planes import TERMS, VOLUME_TERMS
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped
from pmviewer.viewer.overlays.legend import wrapped
from pmviewer.viewer.panels.inspector.plots import begin_plot, end_plot, spread

TERM_COLOURS: tuple[theme.Colour, ...] = (
    (0.93, 0.83, 0.36, 1.0),
    (0.90, 0.57, 0.23, 1.0),
    (0.45, 0.68, 0.88, 1.0),
    (0.85, 0.45, 0.62, 1.0),
    (0.42, 0.72, 0.52, 1.0),
    (0.62, 0.55, 0.86, 1.0),
    (0.70, 0.70, 0.70, 1.0),
)
"""Of the terms in their order, distinct with colour-blind eyes too."""


def shares(report: PixelReport) -> list[tuple[str, float, float]]:
    """Name, luminance, and share of the whole of each term."""
    values = luminance(report.terms)
    total = float(values.sum())
    names = (*TERMS, *VOLUME_TERMS)[: len(values)]
    return [(name, float(v), float(v) / total if total > 0 else 0.0) for name, v in zip(names, values, strict=True)]


_ROOMY = 11.0
"""Room in font sizes for bars beside figures of four digits."""


def draw_terms(report: PixelReport) -> None:
    """A bar for each term, as long as its share, and the sum below."""
    roomy = imgui.get_content_region_avail().x > _ROOMY * imgui.get_font_size()
    digits, padding = 4 if roomy else 3, imgui.get_style().cell_padding
    imgui.push_style_var(imgui.StyleVar_.cell_padding, (padding.x if roomy else 1.0, padding.y))
    if imgui.begin_table("##terms", 3):
        imgui.table_setup_column("name", imgui.TableColumnFlags_.width_fixed)
        imgui.table_setup_column("bar", imgui.TableColumnFlags_.width_stretch)
        imgui.table_setup_column("value", imgui.TableColumnFlags_.width_fixed)
        for (name, value, share), colour in zip(shares(report), TERM_COLOURS):
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_unformatted(name)
            imgui.table_next_column()
            _bar(share, colour)
            imgui.table_next_column()
            _right(f"{value:.{digits}g}")
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text_unformatted("sum")
        imgui.table_next_column()
        rgb = report.terms.sum(axis=0)
        imgui.table_next_column()
        _right(f"{float(luminance(rgb)):.{digits}g}")
        imgui.end_table()
    imgui.pop_style_var()
    if report.terms.size:
        rgb = report.terms.sum(axis=0)
        wrapped("RGB  " + "  ".join(f"{v:.4g}" for v in rgb))
        imgui.set_item_tooltip("Red, green, blue in W/(m² sr); the figures above are luminances")


def _bar(share: float, colour: theme.Colour) -> None:
    width, height = imgui.get_content_region_avail().x, imgui.get_text_line_height()
    x, y = imgui.get_cursor_screen_pos()
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled((x, y + 2), (x + width, y + height - 2), imgui.get_color_u32(theme.ground("plot")))
    if share > 0:
        right = x + max(share * width, 1.0)
        draw.add_rect_filled((x, y + 2), (right, y + height - 2), imgui.get_color_u32(imgui.ImVec4(*colour)))
    imgui.dummy((width, height))
    imgui.set_item_tooltip(f"{share:.1%} of the pixel")


def _right(text: str) -> None:
    room = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0))
    imgui.text_unformatted(text)


def draw_history(history: History) -> None:
    """The mean against passes with a band of one standard error."""
    if len(history.passes) < 2:
        wrapped("The curve begins with the second pass that is watched.")
        return
    mean, error = luminance(history.mean), history.error
    text = f"{mean[-1]:.4g}"
    if np.isfinite(error[-1]):
        text += f" ± {error[-1]:.2g}"
    imgui.text_wrapped(f"{text} after {grouped(int(history.passes[-1]))} passes")
    imgui.set_item_tooltip(
        "Luminance in W/(m² sr) and its standard error by the spread of single passes since the pixel was pinned. "
        "Passes complement each other: the true error tends to be smaller."
    )
    band = np.nan_to_num(error)
    low, high = spread(np.concatenate([mean - band, mean + band]))
    passes = history.passes.astype(np.float64)
    if begin_plot("##history", 7, ("passes", passes[0], passes[-1]), ("L", low, high)):
        step = max(1, -(-len(passes) // 6))
        marked = passes[::step]
        implot.setup_axis_ticks(implot.ImAxis_.x1, list(marked), [f"{int(p)}" for p in marked])
        colour = imgui.ImVec4(*theme.ACCENT)
        known = np.isfinite(error)
        if known.any():
            spec = implot.Spec(fill_color=colour, fill_alpha=0.4)
            xs, below, above = passes[known], (mean - error)[known], (mean + error)[known]
            implot.plot_shaded("##error", xs, below, above, spec)
        implot.plot_line("##mean", passes, np.ascontiguousarray(mean), implot.Spec(line_color=colour, line_weight=2.0))
        end_plot()
