"""Pieces of the overlays' legends in the panel: text, bars of colours, patches of colour."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.output.false_look import Look
from pmviewer.scene.dispersion import LONGEST, SHORTEST
from pmviewer.scene.spectrum import shown_colours
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped, si
from pmviewer.viewer.gl.palette import (
    BOUNCE_PALETTE,
    DIRECTION_PALETTE,
    LIGHT_PALETTE,
    LIT_COLOUR,
    RGB,
    SHADOW_COLOUR,
    By,
    Colouring,
    light_colour,
)
from pmviewer.viewer.gl.program import DEFAULT_LOOK
from pmviewer.viewer.gl.records import CloudSummary

MOST_SWATCHES = 12


def wrapped(text: str) -> None:
    """A sentence, in as many lines as it takes."""
    imgui.push_text_wrap_pos(0)
    imgui.text_disabled(theme.drawable(text))
    imgui.pop_text_wrap_pos()


def nothing_to_draw() -> None:
    """The sentence that stands for a legend when an overlay has no data."""
    imgui.text_disabled("There is nothing to draw.")


def drawn_of(cloud: CloudSummary) -> None:
    """How many are drawn, where it isn't all."""
    if cloud.drawn < cloud.total:
        imgui.text_disabled(f"{grouped(cloud.drawn)} of {grouped(cloud.total)} drawn")


def colour_legend(colouring: Colouring, cloud: CloudSummary, unit: str, look: Look = DEFAULT_LOOK) -> None:
    """What the colours of points or lines tell; `unit` is that of their power."""
    if colouring.by == By.POWER:
        low, high = si(cloud.power_low, unit), si(cloud.power_high, unit)
        amount = f"all near {high}" if low == high else f"brightness from {low} to {high}, logarithmic"
        wrapped(f"Hue of the {'power' if unit == 'W' else 'irradiance'}; {amount}")
    elif colouring.by == By.QUANTITY:
        wrapped(colouring.text)
        colour_bar(
            colouring.table(look), *(_end_text(colouring, end, unit) for end in (cloud.power_low, cloud.power_high))
        )
    elif colouring.by == By.BOUNCES:
        last = len(BOUNCE_PALETTE) - 1
        labels = [*(str(i) for i in range(last)), f"{last}+"]
        swatches("Scatterings before; 0 is straight from the light", list(zip(labels, BOUNCE_PALETTE, strict=True)))
    elif colouring.by == By.LIT:
        swatches("Where the light ", [("arrives", LIT_COLOUR), ("does not", SHADOW_COLOUR)])
    elif colouring.by == By.WAVELENGTH:
        wrapped("Wavelength; grey: all of them still, as no glass has split the light")
        colour_bar(np.repeat(shown_colours(), 15, axis=0), f"{SHORTEST:.0f} nm", f"{LONGEST:.0f} nm")
    elif colouring.by == By.DIRECTION:
        swatches("Where a photon came from, along the axes of the scene", list(DIRECTION_PALETTE))
    elif colouring.by == By.LIGHT:
        swatches("", [(f"light {i + 1}", light_colour(i)) for i in cloud.lights[:MOST_SWATCHES]])
        if len(cloud.lights) > MOST_SWATCHES:
            more = len(cloud.lights) - MOST_SWATCHES
            imgui.text_disabled(f"and {more} more; colours repeat after {len(LIGHT_PALETTE)}")


def _end_text(colouring: Colouring, value: float, unit: str) -> str:
    if colouring.scale == "share":
        return f"{value:.2%}"
    return f"{value:.3g}×" if colouring.scale == "around one" else si(value, unit)


def colour_bar(table: NDArray[np.floating], low: str, high: str) -> None:
    """Colours (n, 3) of a logarithmic scale from left to right, with what its ends mean."""
    draw, start = imgui.get_window_draw_list(), imgui.get_cursor_screen_pos()
    line = imgui.get_text_line_height()
    width = min(imgui.get_content_region_avail().x, 16 * line)
    codes = [imgui.get_color_u32(imgui.ImVec4(float(r), float(g), float(b), 1.0)) for r, g, b in table[::15]]
    edges = [start.x + width * i / (len(codes) - 1) for i in range(len(codes))]
    for x0, x1, left, right in zip(edges[:-1], edges[1:], codes[:-1], codes[1:], strict=True):
        draw.add_rect_filled_multi_color((x0, start.y), (x1, start.y + 0.6 * line), left, right, right, left)
    imgui.dummy((width, 0.6 * line))
    imgui.text_disabled(theme.drawable(low))
    size = imgui.calc_text_size(theme.drawable(high)).x
    imgui.same_line()
    imgui.set_cursor_screen_pos((start.x + max(width - size, 0), imgui.get_cursor_screen_pos().y))
    imgui.text_disabled(theme.drawable(high))


def swatches(title: str, entries: list[tuple[str, RGB]]) -> None:
    """Coloured squares with labels, as many in a line as fit."""
    if title:
        wrapped(title)
    size = imgui.get_font_size() * 0.8
    right = imgui.get_cursor_screen_pos().x + imgui.get_content_region_avail().x
    flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_drag_drop | imgui.ColorEditFlags_.no_picker
    for number, (label, colour) in enumerate(entries):
        width = size + imgui.calc_text_size(label).x + 3 * imgui.get_style().item_inner_spacing.x
        if number and imgui.get_item_rect_max().x + width < right:
            imgui.same_line()
        imgui.color_button(f"##{title}{label}", imgui.ImVec4(*colour, 1.0), flags, (size, size))
        imgui.same_line(0, imgui.get_style().item_inner_spacing.x)
        imgui.text_disabled(label)
