"""Switches and legends of the photon maps drawn over the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.output.falsecolour import COLOURS, DIVERGING
from pmviewer.settings.access import SETTINGS, get
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped, si
from pmviewer.viewer.overlays.overlays import (
    AROUND_ONE,
    BOUNCE_PALETTE,
    CHANNELS,
    FATE_PALETTE,
    FATES,
    LIGHT_PALETTE,
    LIT_COLOUR,
    RGB,
    SHADOW_COLOUR,
    CloudSummary,
    fate_counts,
)
from pmviewer.viewer.panels.light_list import light_rows
from pmviewer.viewer.panels.settings_panel import SettingsPanel
from pmviewer.viewer.panels.widgets import tooltip_text
from pmviewer.viewer.shortcuts import keys_of
from pmviewer.viewer.viewport.picture import CLOUDS
from pmviewer.viewer.viewport.viewport import Viewport


@dataclass(frozen=True)
class Overlay:
    """`action` switches it, `unit` is that of what "power" colours it by, `things` what is counted."""

    action: str
    unit: str = "W"
    things: str = "Photons stored in the latest pass"


OVERLAYS = {
    "caustic": Overlay("toggle_caustic"),
    "global": Overlay("toggle_global"),
    "radiance": Overlay("toggle_radiance", "W/m²", "Radiance photons that gather rays have used in the latest pass"),
    "cache": Overlay("toggle_cache", "W/m²", "Records of the irradiance cache in the latest pass"),
    "shadow": Overlay("toggle_shadow", things="Shadow photons, which serve all passes"),
    "importons": Overlay("toggle_importons", "px/m²", "Importons stored for the importance maps of the latest pass"),
    "fates": Overlay("toggle_fates", things="Photons of the latest pass that were judged again"),
    "lights": Overlay("toggle_lights", things="Lights that have a place in the scene"),
    "paths": Overlay("toggle_paths"),
    "gather": Overlay("toggle_gather"),
    "projection": Overlay("toggle_projection"),
}


class OverlayPanel:
    """Rows are those of the settings panel; it lends its widgets."""

    def __init__(self, viewport: Viewport, rows: SettingsPanel) -> None:
        self._viewport = viewport
        self._state = viewport.state
        self._rows = rows

    def gui(self) -> None:
        for name, overlay in OVERLAYS.items():
            self._overlay(name, overlay)
            imgui.spacing()

    def _overlay(self, name: str, overlay: Overlay) -> None:
        path = f"overlays.{name}"
        info = SETTINGS[f"{path}.show"]
        shown = get(self._state.settings, info.path)
        reason = self._rows.reason(info.path)
        imgui.push_style_var(imgui.StyleVar_.alpha, 0.45 if reason else 1.0)
        changed, show = imgui.checkbox(f"{info.group}##{path}.show", shown)
        imgui.pop_style_var()
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            lines = [(info.path, theme.ACCENT), (f"{info.description} Key {keys_of(overlay.action)}.", theme.TEXT)]
            if reason:
                lines.append((f"No effect now: {reason}", theme.WARNING))
            tooltip_text(lines)
        if changed:
            self._state.change({info.path: show})
        self._count(name, overlay)
        if not shown:
            return
        imgui.indent(imgui.get_font_size() * 0.5)
        if self._rows.begin_rows(path, name_em=5.5):
            for row in SETTINGS.values():
                if row.path.startswith(f"{path}.") and row is not info:
                    self._rows.row(row)
            imgui.end_table()
        if reason:
            _wrapped(reason)
        else:
            self._legend(name, overlay)
        imgui.unindent(imgui.get_font_size() * 0.5)

    def _count(self, name: str, overlay: Overlay) -> None:
        """How many there are, at the right edge of the row."""
        frame, picture = self._state.frame, self._viewport.picture
        if name in ("fates", "lights"):
            if picture is None or not get(self._state.settings, f"overlays.{name}.show"):
                return
            count = picture.clouds[name].summary(1).total
        elif frame is None or name not in CLOUDS:
            return
        else:
            count = frame.statistics.stored_in_pass.get(name, 0)
        text = grouped(count) if count else "none"
        imgui.same_line()
        room = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
        if room < 0:
            imgui.new_line()
            return
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + room)
        imgui.text_disabled(text)
        imgui.set_item_tooltip(overlay.things)

    def _legend(self, name: str, overlay: Overlay) -> None:
        picture, overlays = self._viewport.picture, self._state.settings.overlays
        if picture is None or self._state.frame is None:
            return
        if name == "paths":
            _colour_legend(overlays.paths.colour, picture.paths.summary(), "W")
            if picture.paths.summary().total:
                _wrapped("Each line brightens the way the photon flew.")
            return
        if name == "gather":
            self._gather_legend(overlays.gather.colour)
            return
        if name == "projection":
            self._projection_legend()
            return
        style = overlays.by_map()[name]
        cloud = picture.clouds[name].summary(style.limit, style.colour)
        _colour_legend(style.colour, cloud, overlay.unit)
        if name == "fates":
            self._fate_counts(overlays.fates.map)
        if name == "lights":
            self._top_lights()
        if cloud.drawn < cloud.total:
            imgui.text_disabled(f"{grouped(cloud.drawn)} of {grouped(cloud.total)} drawn")

    def _fate_counts(self, map_: str) -> None:
        """How many photons met which fate, in the maps that are drawn."""
        frame = self._state.frame
        if frame is None or frame.inspection.fates is None:
            return
        counts = fate_counts(frame.inspection.fates, map_)
        total = max(sum(counts), 1)
        for name, count, colour in zip(FATES, counts, FATE_PALETTE, strict=True):
            if count:
                _swatches("", [(f"{name}: {grouped(count)}, {count / total:.1%}", colour)])

    def _top_lights(self) -> None:
        frame = self._state.frame
        lights = None if frame is None else frame.known_lights
        if lights is None:
            return
        for text, share in light_rows(lights, 8):
            _wrapped(f"{text}: {share}")

    def _gather_legend(self, colour: str) -> None:
        picture, pixel = self._viewport.picture, self._viewport.inspected
        assert picture is not None
        if pixel is None:
            _wrapped("Hold I over the picture.")
            return
        rays = picture.gathered.summary()
        _wrapped(f"Pixel {pixel[0]}, {pixel[1]}: {grouped(rays.total)} rays that meet something")
        if colour == "source":
            _swatches("Direction by ", [("the BSDF", LIGHT_PALETTE[0]), ("photons", LIGHT_PALETTE[1])])
        elif rays.total:
            low, high = si(rays.power_low, "W/(m² sr)"), si(rays.power_high, "W/(m² sr)")
            _wrapped(f"Hue of what a ray adds to the pixel, from {low} to {high}, logarithmic; grey: nothing")

    def _projection_legend(self) -> None:
        picture = self._viewport.picture
        assert picture is not None
        cells = picture.cells
        shown = cells.lights[:12]
        colours = [LIGHT_PALETTE[number % len(LIGHT_PALETTE)] for number, _, _ in shown]
        labels = [f"{name}, {share:.0%} of its power" for _, name, share in shown]
        _swatches("", list(zip(labels, colours, strict=True)))
        if len(cells.lights) > 12:
            imgui.text_disabled(f"and {len(cells.lights) - 12} more")
        if cells.other_lights:
            _wrapped(f"Lights without cells: {grouped(cells.other_lights)}. Their photons start anywhere.")
        elif not cells.lights:
            _wrapped("No maps: they would spare too little here (photons.projection = on makes them).")


def _wrapped(text: str) -> None:
    imgui.push_text_wrap_pos(0)
    imgui.text_disabled(theme.drawable(text))
    imgui.pop_text_wrap_pos()


def _colour_legend(colour: str, cloud: CloudSummary, unit: str) -> None:
    """What the colours of points or lines tell."""
    if cloud.total == 0:
        imgui.text_disabled("There is nothing to draw.")
    elif colour == "power":
        low, high = si(cloud.power_low, unit), si(cloud.power_high, unit)
        amount = f"all near {high}" if low == high else f"brightness from {low} to {high}, logarithmic"
        _wrapped(f"Hue of the {'power' if unit == 'W' else 'irradiance'}; {amount}")
    elif colour in CHANNELS:
        _wrapped(_QUANTITIES[colour])
        table = DIVERGING if colour in AROUND_ONE else COLOURS
        if colour == "picture":
            ends = f"{cloud.power_low:.2%}", f"{cloud.power_high:.2%}"
        elif colour in AROUND_ONE:
            ends = f"{cloud.power_low:.3g}×", f"{cloud.power_high:.3g}×"
        else:
            ends = si(cloud.power_low, unit), si(cloud.power_high, unit)
        _colour_bar(table, *ends)
    elif colour == "fate":
        pass  # its counts are the legend
    elif colour == "map":
        _swatches("Importance for the ", [("caustic map", LIGHT_PALETTE[0]), ("global map", LIGHT_PALETTE[1])])
    elif colour == "bounce":
        last = len(BOUNCE_PALETTE) - 1
        labels = [*(str(i) for i in range(last)), f"{last}+"]
        _swatches("Scatterings before; 0 is straight from the light", list(zip(labels, BOUNCE_PALETTE, strict=True)))
    elif colour == "lit or shadow":
        _swatches("Where the light ", [("arrives", LIT_COLOUR), ("does not", SHADOW_COLOUR)])
    else:
        shown = [(f"light {i + 1}", LIGHT_PALETTE[i % len(LIGHT_PALETTE)]) for i in cloud.lights]
        _swatches("", shown[:12])
        if len(shown) > 12:
            imgui.text_disabled(f"and {len(shown) - 12} more; colours repeat after {len(LIGHT_PALETTE)}")


_QUANTITIES = {
    "importance": "Importance, as it is used",
    "screen": "Screen importance",
    "footprint": "Footprint importance",
    "average": "Average of screen and footprint importance",
    "picture": "Share of the picture's light that comes from a light",
    "emission": "Photons that leave a light, relative to its power",
}


def _colour_bar(table: NDArray[np.floating], low: str, high: str) -> None:
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


def _swatches(title: str, entries: list[tuple[str, RGB]]) -> None:
    """Coloured squares with labels, as many in a line as fit."""
    if title:
        _wrapped(title)
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
