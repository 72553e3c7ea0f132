"""The settings, made from the schema: N, q and the radius on top, the rest by group."""

from __future__ import annotations

from itertools import groupby
from typing import Any, NamedTuple

from imgui_bundle import icons_fontawesome_6 as fa
from imgui_bundle import imgui

from pmviewer.settings.access import SETTINGS, SettingInfo, Settings, flat
from pmviewer.viewer import theme
from pmviewer.viewer.format import si
from pmviewer.viewer.panels.widgets import (
    SettingWidgets,
    icon_button,
    range_text,
    reset_button,
    tooltip_text,
)
from pmviewer.viewer.shortcuts import keys_of
from pmviewer.viewer.state import ViewerState
from pmviewer.viewer.value_text import value_text

_ASK = "Reset every setting"
PINNED = ("photons.N", "photons.q", "estimate.radius")
_ELSEWHERE = ("overlays.",)
STACKED = 14.0
"""Width in font sizes below which a name stands above its value."""
_OPEN = ("Light pass", "Density estimate", "Method")


class _Facts(NamedTuple):
    """Every setting's value and why it has no effect, and those that differ from their defaults, in their order."""

    values: dict[str, Any]
    reasons: dict[str, str | None]
    changed: dict[str, None]


class SettingsPanel:
    """Rows for every setting of the schema but those that have a place of their own: overlays, toolbar, comparison."""

    def __init__(self, state: ViewerState) -> None:
        self.state = state
        self.widgets = SettingWidgets(state.refused_view, state.choices)
        self.find = ""
        """Only settings that contain this are listed."""
        self.pinned: tuple[float, float, float, float] | None = None
        """Where on the screen the rows above the groups are: left, top, right, bottom."""
        self._known: tuple[Settings, Any, _Facts] | None = None
        listed = [i for i in SETTINGS.values() if i.path not in PINNED and not i.path.startswith(_ELSEWHERE)]
        self._groups = [(heading, list(infos)) for heading, infos in groupby(listed, key=lambda info: info.group)]

    def gui(self) -> None:
        """Draw the panel; called once a frame inside its window."""
        # The groups below scroll: leave the same room beside these rows as the scroll bar takes there.
        if self.begin_rows("pinned", room=imgui.get_style().scrollbar_size):
            for path in PINNED:
                self.row(SETTINGS[path])
            imgui.end_table()
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            self.pinned = low.x, low.y, high.x, high.y
        imgui.spacing()
        self._filter_row()
        flags = imgui.WindowFlags_.always_vertical_scrollbar
        if imgui.begin_child("##groups", (0, 0), imgui.ChildFlags_.none, flags):
            if self.state.only_changed:
                self._changed()
            else:
                for heading, infos in self._groups:
                    self._group(heading, infos)
        imgui.end_child()

    def _filter_row(self) -> None:
        everything = [path for path in self._facts().changed if not path.startswith(_ELSEWHERE)]
        size = imgui.get_frame_height() * 1.15 + imgui.get_style().item_spacing.x
        imgui.set_next_item_width(-2 * size)
        _, self.find = imgui.input_text_with_hint(
            "##filter", f"{fa.ICON_FA_MAGNIFYING_GLASS}  find a setting", self.find
        )
        imgui.same_line()
        only = self.state.only_changed
        tip = "List all settings" if only else f"List the changed settings alone ({keys_of('list_changed')})"
        if icon_button(fa.ICON_FA_FILTER, "only.changed", tip, on=only):
            self.state.only_changed = not only
        imgui.same_line()
        tip = "Reset every setting to its default" if everything else "Every setting has its default"
        if icon_button(fa.ICON_FA_ARROW_ROTATE_LEFT, "reset.all", tip, enabled=bool(everything)):
            imgui.open_popup(_ASK)
        self._ask_reset(everything)

    def _ask_reset(self, paths: list[str]) -> None:
        """Whether everything is meant, since there is no way back."""
        if not imgui.begin_popup(_ASK):
            return
        names = ", ".join(paths[:6]) + (f" and {len(paths) - 6} more" if len(paths) > 6 else "")
        imgui.push_text_wrap_pos(imgui.get_font_size() * 22)
        imgui.text_unformatted(f"Reset {len(paths)} settings to their defaults?")
        imgui.text_colored(imgui.ImVec4(*theme.DIM), names)
        imgui.pop_text_wrap_pos()
        if imgui.button("Reset all"):
            self.state.change({path: SETTINGS[path].default for path in paths})
            imgui.close_current_popup()
        imgui.same_line()
        if imgui.button("Cancel"):
            imgui.close_current_popup()
        imgui.end_popup()

    def _group(self, heading: str, infos: list[SettingInfo]) -> None:
        wanted = self.find.strip().lower()
        if wanted:
            infos = [i for i in infos if wanted in f"{i.path} {i.title} {i.description} {heading}".lower()]
            if not infos:
                return
            imgui.set_next_item_open(True)
            identity = f"{heading}, found"  # groups are as they were once the search is over
        else:
            identity = heading
            imgui.set_next_item_open(heading in _OPEN, imgui.Cond_.once)
        changed = sum(i.path in self._facts().changed for i in infos)
        note = f"   {changed} changed" if changed else ""
        if imgui.collapsing_header(f"{heading}{note}###{identity}") and self.begin_rows(heading):
            section = ""
            for info in infos:
                if info.section != section:
                    section = info.section
                    self._section(section)
                self.row(info)
            imgui.end_table()

    def _changed(self) -> None:
        """What differs from the defaults, group by group, each with its reset."""
        wanted = self.find.strip().lower()
        changed = [SETTINGS[path] for path in self._facts().changed if wanted in path.lower()]
        if not changed:
            imgui.text_disabled("Every setting has its default.")
        for heading, infos in groupby(changed, key=lambda info: info.group):
            imgui.text_colored(imgui.ImVec4(*theme.ACCENT), theme.drawable(heading))
            if self.begin_rows(f"changed {heading}"):
                for info in infos:
                    self.row(info)
                imgui.end_table()

    @staticmethod
    def _section(heading: str) -> None:
        """A line over the settings that belong together within a group, which reaches over all columns."""
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.spacing()
        drawn = imgui.get_window_draw_list()
        low, high = drawn.get_clip_rect_min(), drawn.get_clip_rect_max()
        right = imgui.get_window_pos().x + imgui.get_window_width()
        imgui.push_clip_rect(low, imgui.ImVec2(right, high.y), False)
        imgui.text_colored(imgui.ImVec4(*theme.ACCENT), theme.drawable(heading))
        imgui.pop_clip_rect()

    def reason(self, path: str) -> str | None:
        """Why the setting has no effect now, or None."""
        return self._facts().reasons[path]

    def _value(self, path: str) -> Any:
        return self._facts().values[path]

    def _facts(self) -> _Facts:
        """Of the settings as they are, worked out once for each change."""
        settings, traits = self.state.settings, self.state.session.traits
        if self._known is None or self._known[0] is not settings or self._known[1] is not traits:
            reasons = {path: self.state.inactive_reason(path, settings, traits) for path in SETTINGS}
            values = flat(settings)
            changed = {path: None for path, info in SETTINGS.items() if values[path] != info.default}
            self._known = settings, traits, _Facts(values, reasons, changed)
        return self._known[2]

    @staticmethod
    def begin_rows(name: str, name_em: float = 8.8, room: float = 0) -> bool:
        """Open the table that `row` fills; end it with `imgui.end_table()` when True. In a narrow panel names have a
        line of their own, above their values."""
        width, em = imgui.get_content_region_avail().x - room, imgui.get_font_size()
        stacked = width < STACKED * em
        if not imgui.begin_table(f"##{name}", 2 if stacked else 3, imgui.TableFlags_.none, (width, 0)):
            return False
        if not stacked:
            imgui.table_setup_column("name", imgui.TableColumnFlags_.width_fixed, min(name_em * em, 0.42 * width))
        imgui.table_setup_column("value", imgui.TableColumnFlags_.width_stretch)
        imgui.table_setup_column("reset", imgui.TableColumnFlags_.width_fixed, 1.75 * em)
        return True

    def row(self, info: SettingInfo) -> None:
        """Label, widget and reset of one setting, inside the table of `begin_rows`."""
        state, value = self.state, self._value(info.path)
        reason = self.reason(info.path)
        resolved = state.resolved(info.path) if value == "auto" else value
        imgui.table_next_row()
        imgui.table_next_column()
        if reason:
            imgui.push_style_var(imgui.StyleVar_.alpha, theme.GREYED)
        imgui.align_text_to_frame_padding()
        differs = value != info.default
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.TEXT) if differs else theme.grey(theme.look.name))
        imgui.text_unformatted(theme.drawable(info.title))
        imgui.pop_style_color()
        described = self._is_hovered()
        self._context_menu("label", info, value, resolved)
        if imgui.table_get_column_count() > 2:
            imgui.table_next_column()
        elif info.scale == "switch":
            imgui.same_line()
        new = self.widgets.edit(info, value, resolved)
        described = described or (self._is_hovered() and not imgui.is_item_active())
        self._context_menu("value", info, value, resolved)
        imgui.table_next_column()
        if info.auto:
            new = self._auto_button(info, value, resolved, new)
        elif reset_button(info, value):
            new = info.default
        if reason:
            imgui.pop_style_var()
        if described:
            self._tooltip(info, value, reason)
        if new is not None:
            state.change({info.path: new})

    @staticmethod
    def _is_hovered() -> bool:
        return imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip)

    def _auto_button(self, info: SettingInfo, value: Any, resolved: Any, new: Any) -> Any:
        automatic = value == "auto"
        if automatic:
            tip = "Automatic. Click to fix the present value." if resolved is not None else "Automatic"
        else:
            tip = "Back to automatic"
        if icon_button(fa.ICON_FA_WAND_MAGIC_SPARKLES, f"auto.{info.path}", tip, on=automatic):
            return resolved if automatic else "auto"
        return new

    def _context_menu(self, part: str, info: SettingInfo, value: Any, resolved: Any) -> None:
        if not imgui.begin_popup_context_item(f"menu.{part}.{info.path}"):
            return
        imgui.text_disabled(info.path)
        imgui.separator()
        if imgui.menu_item(f"Reset to {value_text(info, info.default)}", "", False, value != info.default)[0]:
            self.state.change({info.path: info.default})
        typed = info.scale not in ("switch", "choice", "name", "vector") and resolved is not None
        if typed and imgui.menu_item_simple("Type a value"):
            self.widgets.start_typing(info, resolved)
        if imgui.menu_item_simple("Copy as command-line option"):
            text = " ".join(f"{v:g}" for v in value) if isinstance(value, tuple) else str(value)
            quote = '"' if " " in text else ""
            imgui.set_clipboard_text(f"--set {quote}{info.path}={text}{quote}")
        imgui.end_popup()

    def _tooltip(self, info: SettingInfo, value: Any, reason: str | None) -> None:
        lines = [(info.path, theme.ACCENT), (info.description, theme.TEXT)]
        if reason:
            lines.append((f"No effect now: {reason}", theme.WARNING))
        resolved = self.state.resolved(info.path) if value == "auto" else value
        geometry = self.state.session.geometry
        if info.unit == "× scene" and geometry is not None and isinstance(resolved, int | float):
            lines.append((f"In this scene {si(float(resolved) * float(geometry.radius), 'm')}.", theme.TEXT))
        allowed = range_text(info)
        default = f"Default {value_text(info, info.default)}"
        lines.append((f"{allowed}. {default}." if allowed else f"{default}.", theme.DIM))
        tooltip_text(lines)
