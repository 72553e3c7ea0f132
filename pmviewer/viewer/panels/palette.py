"""The command palette: every command and every setting by name, without a hand on the mouse."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from imgui_bundle import icons_fontawesome_6 as fa
from imgui_bundle import imgui

from pmviewer.settings.access import SETTINGS, SettingInfo, get
from pmviewer.settings.presets import PRESETS
from pmviewer.viewer import theme
from pmviewer.viewer.panels.widgets import SettingWidgets, tooltip_text
from pmviewer.viewer.shortcuts import BINDINGS
from pmviewer.viewer.state import ViewerState

TITLE = "Commands and settings"
LISTED = 14
_WIDTH = 36.0
"""In multiples of the font size."""
_UNBOUND = {
    "open_snapshot": "Open an EXR or PNG file as a snapshot",
    "export_still": "Export at another size, with the legend",
    "borrow_cluster": "Borrow a cluster, or give it back",
    "begin_tour": "The tour: five steps through the window",
    "open_photons": "Photons of a PLY file over the picture",
    "export_film": "Export the film",
    "export_exr_half": "Export the layers as EXR, 16-bit half",
    "export_png_overlays": "Export the picture with overlays as PNG",
}
"""Commands that no key runs."""


@dataclass(frozen=True)
class Entry:
    """A command (`action`), a preset (its number) or a setting, with what it is found by."""

    text: str
    keys: str = ""
    action: str = ""
    preset: int = -1
    setting: SettingInfo | None = None

    @property
    def words(self) -> str:
        """In lower case."""
        if self.setting is None:
            return self.text.lower()
        return f"{self.text} {self.setting.path} {self.setting.description}".lower()


def entries() -> list[Entry]:
    """Commands, presets, settings."""
    commands = [Entry(b.text, b.keys, action=b.action) for b in BINDINGS if b.action]
    unbound = [Entry(text, action=action) for action, text in _UNBOUND.items()]
    presets = [Entry(f"Preset: {preset.name}", preset=number) for number, preset in enumerate(PRESETS)]
    settings = [Entry(f"{info.group}: {info.title}", setting=info) for info in SETTINGS.values()]
    seen: set[str] = set()
    first = [e for e in commands if not (e.action in seen or seen.add(e.action))]  # type: ignore[func-returns-value]
    return [*first, *unbound, *presets, *settings]


def found(wanted: str, among: list[Entry]) -> list[Entry]:
    """Those that have every word, the ones that have it in their name first, where it begins first."""
    words = wanted.lower().split()
    fits = [entry for entry in among if all(word in entry.words for word in words)]

    def rank(entry: Entry) -> tuple[int, int]:
        name = f"{entry.text} {entry.setting.path if entry.setting else ''}".lower()
        outside = sum(word not in name for word in words)
        return outside, min((name.find(word) for word in words if word in name), default=0)

    return sorted(fits, key=rank)


class Palette:
    """Opened by its key; Enter runs the chosen command, or goes into the chosen setting's field."""

    def __init__(self, state: ViewerState) -> None:
        self.is_open = False
        self._state = state
        self._widgets = SettingWidgets(state.refused_view, state.choices)
        self._entries = entries()
        self._wanted = ""
        self._chosen = 0
        self._fresh = False

    def open(self) -> None:
        """Show it, empty."""
        self.is_open, self._wanted, self._chosen, self._fresh = True, "", 0, True

    def gui(self, actions: Mapping[str, Callable[[], None]]) -> None:
        """Draw it over everything while it is open."""
        if not self.is_open:
            return
        area, em = imgui.get_main_viewport(), imgui.get_font_size()
        width = min(_WIDTH * em, 0.9 * area.size.x)
        imgui.set_next_window_pos((area.get_center().x, area.pos.y + 4 * em), imgui.Cond_.always, (0.5, 0.0))
        imgui.set_next_window_size((width, 0))
        flags = imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_collapse
        shown, still_open = imgui.begin(TITLE, True, flags | imgui.WindowFlags_.no_move)
        self.is_open = bool(still_open) and not imgui.is_key_pressed(imgui.Key.escape)
        if shown:
            self._contents(actions)
        imgui.end()

    def _contents(self, actions: Mapping[str, Callable[[], None]]) -> None:
        if self._fresh:
            imgui.set_window_focus()
            imgui.set_keyboard_focus_here()
            self._fresh = False
        imgui.set_next_item_width(-1)
        hint = f"{fa.ICON_FA_MAGNIFYING_GLASS}  a command or a setting"
        flags = imgui.InputTextFlags_.enter_returns_true
        before = self._wanted
        entered, self._wanted = imgui.input_text_with_hint("##wanted", hint, self._wanted, flags)
        listed = found(self._wanted, self._entries)[:LISTED]
        if self._wanted != before:
            self._chosen = 0
        self._chosen = min(max(self._chosen + self._steps(), 0), max(len(listed) - 1, 0))
        if imgui.begin_table("##found", 2):
            imgui.table_setup_column("what", imgui.TableColumnFlags_.width_stretch, 0.6)
            imgui.table_setup_column("value", imgui.TableColumnFlags_.width_stretch, 0.4)
            for number, entry in enumerate(listed):
                self._row(entry, number == self._chosen, entered, actions)
            imgui.end_table()
        if not listed:
            imgui.text_disabled("There is no such command or setting.")

    @staticmethod
    def _steps() -> int:
        down, up = imgui.is_key_pressed(imgui.Key.down_arrow), imgui.is_key_pressed(imgui.Key.up_arrow)
        return int(down) - int(up)

    def _row(self, entry: Entry, chosen: bool, entered: bool, actions: Mapping[str, Callable[[], None]]) -> None:
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.align_text_to_frame_padding()
        clicked = imgui.selectable(f"{theme.drawable(entry.text)}##{entry.words}", chosen)[0]
        imgui.table_next_column()
        if entry.setting is not None:
            self._setting(entry.setting, (chosen and entered) or clicked)
            return
        imgui.text_disabled(entry.keys)
        if clicked or (chosen and entered):
            self.is_open = False
            self._state.history.gesture += 1
            if entry.preset >= 0:
                self._state.change(PRESETS[entry.preset].assignments())
            else:
                actions[entry.action]()

    def _setting(self, info: SettingInfo, entered: bool) -> None:
        """Its field; Enter flips a switch, goes on to the next choice, or begins to type a number."""
        value = get(self._state.settings, info.path)
        resolved = self._state.resolved(info.path) if value == "auto" else value
        reason = self._state.inactive_reason(info.path, self._state.settings, self._state.session.traits)
        imgui.push_style_var(imgui.StyleVar_.alpha, theme.GREYED if reason else 1.0)
        new = self._widgets.edit(info, value, resolved)
        imgui.pop_style_var()
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip) and not imgui.is_item_active():
            more = [(f"No effect now: {reason}", theme.WARNING)] if reason else []
            tooltip_text([(info.path, theme.ACCENT), (info.description, theme.TEXT), *more])
        if entered:
            self._state.history.gesture += 1
            self._fresh = True
            choices = self._state.choices(info)
            if info.scale == "switch":
                new = not value
            elif choices:
                new = choices[(choices.index(value) + 1) % len(choices)] if value in choices else choices[0]
            elif resolved is not None and not isinstance(resolved, tuple | str):
                self._widgets.start_typing(info, resolved)
                self._fresh = False
        if new is not None:
            self._state.change({info.path: new})
