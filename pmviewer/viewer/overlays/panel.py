"""The panel of the overlays: a switch and a count for each, and of those that are shown the settings and the legend."""

from __future__ import annotations

from imgui_bundle import imgui

from pmviewer.settings.access import SETTINGS
from pmviewer.viewer import theme
from pmviewer.viewer.format import grouped
from pmviewer.viewer.overlays.legend import wrapped
from pmviewer.viewer.overlays.overlay import Overlay
from pmviewer.viewer.overlays.registry import SWITCHED
from pmviewer.viewer.panels.settings_panel import SettingsPanel
from pmviewer.viewer.panels.widgets import tooltip_text
from pmviewer.viewer.shortcuts import keys_of
from pmviewer.viewer.viewport.viewport import Viewport


class OverlayPanel:
    """Rows are those of the settings panel; it lends its widgets."""

    def __init__(self, viewport: Viewport, rows: SettingsPanel) -> None:
        self._viewport = viewport
        self._state = viewport.state
        self._rows = rows

    def gui(self) -> None:
        """Draw the panel; called once a frame inside its window."""
        for overlay in SWITCHED:
            self._overlay(overlay)
            imgui.spacing()

    def _overlay(self, overlay: type[Overlay]) -> None:
        shown = overlay.is_shown(self._state.settings)
        reason = self._rows.reason(f"overlays.{overlay.name}.show")
        self._switch(overlay, shown, reason)
        self._count(overlay)
        if not shown:
            return
        imgui.indent(imgui.get_font_size() * 0.5)
        if self._rows.begin_rows(f"overlays.{overlay.name}", name_em=5.5):
            for row in overlay.rows():
                self._rows.row(row)
            imgui.end_table()
        picture = self._viewport.picture
        if reason:
            wrapped(reason)
        elif picture is not None and self._state.frame is not None:
            picture.layers.by_name[overlay.name].legend(self._viewport.source())
        imgui.unindent(imgui.get_font_size() * 0.5)

    def _switch(self, overlay: type[Overlay], shown: bool, reason: str | None) -> None:
        info = SETTINGS[f"overlays.{overlay.name}.show"]
        imgui.push_style_var(imgui.StyleVar_.alpha, theme.GREYED if reason else 1.0)
        changed, show = imgui.checkbox(f"{info.group}##{info.path}", shown)
        imgui.pop_style_var()
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            keys = keys_of(f"toggle_{overlay.name}")
            lines = [(info.path, theme.ACCENT), (f"{info.description} Key {keys}.", theme.TEXT)]
            if reason:
                lines.append((f"No effect now: {reason}", theme.WARNING))
            tooltip_text(lines)
        if changed:
            self._state.change({info.path: show})

    def _count(self, overlay: type[Overlay]) -> None:
        """How many there are, at the right edge of the row."""
        picture = self._viewport.picture
        count = None if picture is None else picture.layers.by_name[overlay.name].count(self._viewport.source())
        if count is None:
            return
        text = grouped(count) if count else "none"
        imgui.same_line()
        room = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
        if room < 0:
            imgui.new_line()
            return
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + room)
        imgui.text_disabled(text)
        imgui.set_item_tooltip(overlay.things)
