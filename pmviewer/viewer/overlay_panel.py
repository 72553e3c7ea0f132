"""Switches and legends of the photon maps drawn over the picture."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import imgui

from pmviewer.settings import SETTINGS, get
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped, si
from pmviewer.viewer.overlays import (
    BOUNCE_PALETTE,
    LIGHT_PALETTE,
    LIT_COLOUR,
    RGB,
    SHADOW_COLOUR,
    CloudSummary,
)
from pmviewer.viewer.picture import CLOUDS
from pmviewer.viewer.settings_panel import SettingsPanel
from pmviewer.viewer.shortcuts import keys_of
from pmviewer.viewer.viewport import Viewport
from pmviewer.viewer.widgets import tooltip_text


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
        frame = self._state.frame
        if frame is None or name not in CLOUDS:
            return
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
        cloud = picture.clouds[name].summary(style.limit)
        _colour_legend(style.colour, cloud, overlay.unit)
        if cloud.drawn < cloud.total:
            imgui.text_disabled(f"{grouped(cloud.drawn)} of {grouped(cloud.total)} drawn")

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
    elif colour == "importance":
        low, high = si(cloud.power_low, unit), si(cloud.power_high, unit)
        _wrapped(f"Brightness by importance, from {low} to {high}, logarithmic")
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
