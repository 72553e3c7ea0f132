"""The tab "Snapshots"."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from imgui_bundle import icons_fontawesome_6 as fa
from imgui_bundle import imgui

from pmviewer.settings.access import SETTINGS
from pmviewer.settings.schema.compare import LAST, LIVE, REFERENCE
from pmviewer.viewer import theme
from pmviewer.viewer.panels.snapshots.strip import Strip
from pmviewer.viewer.panels.snapshots.table import Row, figure_rows, setting_rows
from pmviewer.viewer.panels.widgets import begin_combo, icon_button, tooltip_text
from pmviewer.viewer.shortcuts import keys_of
from pmviewer.viewer.sides import Side
from pmviewer.viewer.state import ViewerState
from pmviewer.viewer.viewport.viewport import Viewport

_NARROW = 46.0
"""Width of the panel in font sizes below which the table stands under the strip."""


class SnapshotsPanel:
    """Strip on the left, table on the right; in a narrow window below each other."""

    def __init__(self, state: ViewerState, viewport: Viewport, actions: Mapping[str, Callable[[], None]]) -> None:
        self._state = state
        self._viewport = viewport
        self._actions = actions
        self.strip = Strip(state, viewport)
        self._rows: tuple[object, list[Row], list[Row]] | None = None

    def gui(self) -> None:
        """Draw the tab; called once a frame while it is in front."""
        em, room = imgui.get_font_size(), imgui.get_content_region_avail()
        self._buttons()
        self._choices()
        left = imgui.get_content_region_avail()
        if room.x < _NARROW * em:
            self.strip.gui(max(6.5 * em, 0.5 * left.y))
            self._table()
            return
        if imgui.begin_child("##left", (0.5 * room.x, 0)):
            self.strip.gui(0)
        imgui.end_child()
        imgui.same_line()
        if imgui.begin_child("##right", (0, 0)):
            self._table()
        imgui.end_child()

    def _buttons(self) -> None:
        for icon, action, text in (
            (fa.ICON_FA_CAMERA, "take_snapshot", "Keep the picture as a snapshot"),
            (fa.ICON_FA_FOLDER_OPEN, "open_snapshot", "Open an EXR or PNG file as a snapshot"),
            (fa.ICON_FA_RIGHT_LEFT, "swap_pictures", "Swap A and B"),
        ):
            keys = keys_of(action)
            if icon_button(icon, f"snapshots.{action}", f"{text}  ({keys})" if keys else text):
                self._actions[action]()
            imgui.same_line(0, 2)
        linked = self._state.settings.compare.linked
        text = f"Link cameras: snapshots that are compared follow the live one  ({keys_of('link_cameras')})"
        if icon_button(fa.ICON_FA_LINK, "snapshots.link_cameras", text, on=linked):
            self._actions["link_cameras"]()
        imgui.same_line(0, 2)

    def _choices(self) -> None:
        """How A and B are compared, and which they are; in lines that fit."""
        em, compare = imgui.get_font_size(), self._state.settings.compare
        widgets = [("mode", "", 7.5), ("a", "A", 9.0), ("b", "B", 9.0)]
        if compare.mode == "difference":
            widgets.append(("difference", "", 6.5))
        for name, label, wide in widgets:
            info = SETTINGS[f"compare.{name}"]
            if imgui.get_content_region_avail().x < (wide + 1.5) * em:
                imgui.new_line()
            imgui.begin_group()
            if label:
                imgui.align_text_to_frame_padding()
                imgui.text_colored(imgui.ImVec4(*theme.DIM), label)
                imgui.same_line(0, 0.4 * em)
            imgui.set_next_item_width(wide * em)
            if name in ("a", "b"):
                self._picture_choice(info.path, getattr(compare, name))
            else:
                self._choice(info.path, getattr(compare, name))
            imgui.end_group()
            if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip) and not imgui.is_any_item_active():
                tooltip_text([(info.path, theme.ACCENT), (info.description, theme.TEXT)])
            imgui.same_line(0, 0.7 * em)
        imgui.new_line()

    def _choice(self, path: str, value: str) -> None:
        state = self._state
        if not begin_combo(f"##snapshots.{path}", value):
            return
        for choice in SETTINGS[path].choices:
            why = state.inactive_reason(f"{path}={choice}", state.settings, state.session.traits)
            flags = imgui.SelectableFlags_.none if why is None else imgui.SelectableFlags_.disabled
            if imgui.selectable(choice, choice == value, flags)[0]:
                state.change({path: choice})
            if why is not None and imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
                tooltip_text([(why, theme.TEXT)])
        imgui.end_combo()

    def _picture_choice(self, path: str, value: str) -> None:
        state = self._state
        names = {LIVE: "live picture", REFERENCE: "reference", LAST: "last snapshot"}
        names |= {str(one.number): one.name for one in state.snapshots.all}
        if not begin_combo(f"##snapshots.{path}", theme.drawable(names.get(value, f"{value}: gone"))):
            return
        for name, text in names.items():
            if imgui.selectable(f"{theme.drawable(text)}##{name}", name == value)[0]:
                state.change({path: name})
        imgui.end_combo()

    # the table --------------------------------------------------------------------------------------------------

    def _table(self) -> None:
        state = self._state
        found = state.pair.sides(state.settings, state.frame)
        if isinstance(found, str):
            _wrapped(found, theme.DIM if state.settings.compare.mode == "off" else theme.WARNING)
            return
        figures, settings = self._worked_out(*found)
        flags = imgui.TableFlags_.borders_inner_h | imgui.TableFlags_.sizing_stretch_same
        imgui.push_style_var(imgui.StyleVar_.cell_padding, (imgui.get_style().cell_padding.x, 1))
        if imgui.begin_table("##figures", 4, flags):
            for label, share in (
                ("of", 1.4),
                ("A", 1.0),
                ("B", 1.0),
                ("ratio", 0.7),
            ):  # long names leave room for figures
                imgui.table_setup_column(label, imgui.TableColumnFlags_.width_stretch, share)
            names = [theme.drawable(side.name) for side in found]
            _row(("", f"A  {names[0]}", f"B  {names[1]}", "A / B"), theme.DIM)
            for row in figures:
                _row((row.name, row.a, row.b, row.ratio), theme.TEXT)
            for row in settings:
                _row((row.name, row.a, row.b, row.ratio), theme.ACCENT)
            imgui.end_table()
        imgui.pop_style_var()
        if any(side.settings is None for side in found):
            _wrapped("The settings of one of them aren't known: no file of this program.", theme.DIM)
        elif not settings:
            _wrapped("No setting differs that makes another picture.", theme.DIM)

    def _worked_out(self, a: Side, b: Side) -> tuple[list[Row], list[Row]]:
        """The table's rows, made once for the same pictures and errors."""
        errors = self._state.measured.error(a), self._state.measured.error(b)
        key = (a.key, a.name, b.key, b.name, errors)
        if self._rows is None or self._rows[0] != key:
            self._rows = key, figure_rows(a, b, errors), setting_rows(a, b)
        return self._rows[1], self._rows[2]


def _row(cells: tuple[str, ...], colour: theme.Colour) -> None:
    imgui.table_next_row()
    for number, text in enumerate(cells):
        imgui.table_next_column()
        drawn = theme.drawable(text)
        imgui.text_colored(imgui.ImVec4(*(theme.DIM if number == 0 else colour)), drawn)
        if imgui.is_item_hovered() and imgui.calc_text_size(drawn).x > imgui.get_column_width():
            imgui.set_tooltip(drawn)


def _wrapped(text: str, colour: theme.Colour) -> None:
    imgui.push_text_wrap_pos(0)
    imgui.text_colored(imgui.ImVec4(*colour), theme.drawable(text))
    imgui.pop_text_wrap_pos()
