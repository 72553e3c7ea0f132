"""Switches and legends of the photon maps drawn over the picture."""

from __future__ import annotations

from imgui_bundle import imgui

from pmviewer.settings import SETTINGS, PointOverlay
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped, si
from pmviewer.viewer.overlays import BOUNCE_PALETTE, LIGHT_PALETTE, RGB, CloudSummary
from pmviewer.viewer.settings_panel import SettingsPanel
from pmviewer.viewer.shortcuts import keys_of
from pmviewer.viewer.viewport import Viewport
from pmviewer.viewer.widgets import tooltip_text

_MAPS = {"caustic": "toggle_caustic", "global": "toggle_global", "radiance": "toggle_radiance"}
_UNIT = {"radiance": "W/m²"}


class OverlayPanel:
    """Rows are those of the settings panel; it lends its widgets."""

    def __init__(self, viewport: Viewport, rows: SettingsPanel) -> None:
        self._viewport = viewport
        self._state = viewport.state
        self._rows = rows

    def gui(self) -> None:
        for name in _MAPS:
            self._map(name)
            imgui.spacing()

    def _map(self, name: str) -> None:
        path = f"overlays.{name}"
        style = self._style(name)
        info = SETTINGS[f"{path}.show"]
        changed, show = imgui.checkbox(f"{info.group}##{path}.show", style.show)
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            key = keys_of(_MAPS[name])
            tooltip_text([(info.path, theme.ACCENT), (f"{info.description} Key {key}.", theme.TEXT)])
        if changed:
            self._state.change({info.path: show})
        frame = self._state.frame
        if frame is not None:
            count = frame.statistics.stored_in_pass.get(name, 0)
            text = grouped(count) if count else "none"
            imgui.same_line()
            room = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
            if room >= 0:
                imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + room)
                imgui.text_disabled(text)
                imgui.set_item_tooltip("Photons stored in the latest pass")
            else:
                imgui.new_line()
        if not style.show:
            return
        imgui.indent(imgui.get_font_size() * 0.5)
        if self._rows.begin_rows(path, name_em=5.5):
            for setting in ("size", "colour", "depth", "limit"):
                self._rows.row(SETTINGS[f"{path}.{setting}"])
            imgui.end_table()
        picture = self._viewport.picture
        if picture is not None and frame is not None:
            self._legend(style, picture.clouds[name].summary(style.limit), _UNIT.get(name, "W"))
        imgui.unindent(imgui.get_font_size() * 0.5)

    def _style(self, name: str) -> PointOverlay:
        return self._state.settings.overlays.by_map()[name]

    def _legend(self, style: PointOverlay, cloud: CloudSummary, unit: str) -> None:
        if cloud.total == 0:
            imgui.text_disabled("This map is empty.")
            return
        if style.colour == "power":
            imgui.push_text_wrap_pos(0)
            low, high = si(cloud.power_low, unit), si(cloud.power_high, unit)
            amount = f"all near {high}" if low == high else f"brightness from {low} to {high}, logarithmic"
            imgui.text_disabled(f"Hue of the power; {amount}")
            imgui.pop_text_wrap_pos()
        elif style.colour == "bounce":
            last = len(BOUNCE_PALETTE) - 1
            labels = [*(str(i) for i in range(last)), f"{last}+"]
            _swatches(
                "Scatterings before; 0 is straight from the light", list(zip(labels, BOUNCE_PALETTE, strict=True))
            )
        else:
            shown = [(f"light {i + 1}", LIGHT_PALETTE[i % len(LIGHT_PALETTE)]) for i in cloud.lights]
            _swatches("", shown[:12])
            if len(shown) > 12:
                imgui.text_disabled(f"and {len(shown) - 12} more; colours repeat after {len(LIGHT_PALETTE)}")
        if cloud.drawn < cloud.total:
            imgui.text_disabled(f"{grouped(cloud.drawn)} of {grouped(cloud.total)} drawn")


def _swatches(title: str, entries: list[tuple[str, RGB]]) -> None:
    """Coloured squares with labels, as many in a line as fit."""
    if title:
        imgui.push_text_wrap_pos(0)
        imgui.text_disabled(title)
        imgui.pop_text_wrap_pos()
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
