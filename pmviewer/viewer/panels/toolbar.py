"""The row under the menu: run, method, view, exposure, tone curve, export."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from imgui_bundle import icons_fontawesome_6 as fa
from imgui_bundle import imgui

from pmviewer.output.diagnostic_views import DIAGNOSTICS
from pmviewer.settings.access import SETTINGS, get
from pmviewer.viewer import theme
from pmviewer.viewer.panels.widgets import SettingWidgets, how_many, icon_button, tooltip_text
from pmviewer.viewer.shortcuts import keys_of
from pmviewer.viewer.state import ViewerState
from pmviewer.viewer.viewport.viewport import is_data_view

Actions = Mapping[str, Callable[[], None]]
WIDE, MORE = 78.0, 11.0
"""Width of the window in em from which the light's rig has room, and how much a choice of cameras takes."""


_CHOICES = 5
"""Items up to the choice of the view."""
_MORE = "More of the toolbar"
_PAUSE = ("Pause", "Resume")
_FREE = "Free camera: see the render camera's importance from elsewhere"
_AUTOMATIC = "Automatic: a short trial chooses the method and its numbers"
_COMPARE = "Compare with and without importance"


@dataclass(frozen=True)
class Item:
    """A piece of the toolbar, `width` points wide with the space behind it; `in_menu` draws it where there was no room,
    None for what is only between others."""

    width: float
    draw: Callable[[], None]
    in_menu: Callable[[], None] | None = None


class Toolbar:
    """Buttons and choices; what the window has no room for is behind a button at the end."""

    def __init__(self, state: ViewerState, actions: Actions) -> None:
        self._state = state
        self._actions = actions
        self._widgets = SettingWidgets(state.refused_view, state.choices)
        self.choices: tuple[float, float, float, float] | None = None
        """Where on the screen method and view are chosen: left, top, right, bottom."""

    def gui(self) -> None:
        """What fits, from the left; the rest behind a button at the end."""
        items, room = self._items(), imgui.get_content_region_avail().x
        fits = how_many([item.width for item in items], room, _button_width())
        corner, wide = imgui.get_cursor_screen_pos(), sum(item.width for item in items[:_CHOICES])
        for item in items[:fits]:
            item.draw()
        self.choices = corner.x, corner.y, corner.x + wide, corner.y + imgui.get_frame_height()
        rest = [item for item in items[fits:] if item.in_menu is not None]
        if rest:
            self._overflow(rest)

    def _overflow(self, items: list[Item]) -> None:
        if icon_button(fa.ICON_FA_ANGLES_RIGHT, "more", "What has no room here"):
            imgui.open_popup(_MORE)
        if imgui.begin_popup(_MORE):
            for item in items:
                if item.in_menu is not None:
                    item.in_menu()
            imgui.end_popup()

    def _items(self) -> list[Item]:
        state = self._state
        paused, data = state.session.paused, is_data_view(state.shown_display)
        room = imgui.get_window_width() / imgui.get_font_size()
        several = len(state.choices(SETTINGS["camera.name"])) > 2
        items = [
            self._button(fa.ICON_FA_PLAY if paused else fa.ICON_FA_PAUSE, "toggle_pause", _PAUSE[paused], on=paused),
            self._button(fa.ICON_FA_ARROW_ROTATE_RIGHT, "restart", "Restart"),
            _gap(),
            self._button(fa.ICON_FA_GAUGE_HIGH, "choose_automatically", _AUTOMATIC, on=state.automatic.running),
            self._setting("render.method", "method", 7),
            self._setting("display.view", "view", 9),
        ]
        if several and room > WIDE + MORE:  # else the panel has it
            items.append(self._setting("camera.name", "camera", 6))
        if room > WIDE:
            items.append(self._setting("light.rig", "light", 5.5))
        free, compares = state.settings.free_camera.on, state.gain.running
        return [
            *items,
            self._setting("display.exposure", "exposure", 6, faded=data),
            self._shading_or_tone(data),
            _gap(),
            self._button(fa.ICON_FA_EXPAND, "frame_all", "Frame the whole scene"),
            self._button(fa.ICON_FA_PAPER_PLANE, "toggle_fly", "Fly through the scene", on=state.flying),
            self._button(fa.ICON_FA_VIDEO, "toggle_free", _FREE, on=free),
            self._button(fa.ICON_FA_SCALE_BALANCED, "compare_importance", _COMPARE, on=compares),
            _gap(),
            self._button(fa.ICON_FA_FOLDER_OPEN, "open", "Open a scene or session"),
            self._button(fa.ICON_FA_IMAGE, "export_png", "Export the picture as PNG"),
            self._button(fa.ICON_FA_LAYER_GROUP, "export_exr", "Export the layers as EXR"),
            self._button(fa.ICON_FA_FLOPPY_DISK, "save_session", "Save the session"),
            _gap(),
            self._button(fa.ICON_FA_KEYBOARD, "toggle_help", "Keys and mouse", on=state.help_open),
        ]

    def _shading_or_tone(self, data: bool) -> Item:
        """What matters to the view: false colours have shading under them, other views a tone curve."""
        shown = self._state.shown_display.view
        if shown == "error" or shown in DIAGNOSTICS:
            return self._setting("display.shading", "shading", 6)
        return self._setting("display.tone", "tone", 6, faded=data)

    def _button(self, icon: str, action: str, text: str, *, on: bool = False) -> Item:
        def draw() -> None:
            if icon_button(icon, action, f"{text}  ({keys_of(action)})", on=on):
                self._actions[action]()
            imgui.same_line(0, 2)

        def in_menu() -> None:
            if imgui.menu_item(f"{icon}  {text}", keys_of(action), on)[0]:
                self._actions[action]()

        return Item(_button_width() + 2, draw, in_menu)

    def _setting(self, path: str, label: str, width_em: float, *, faded: bool = False) -> Item:
        em, spacing = imgui.get_font_size(), imgui.get_style().item_spacing.x
        width = imgui.calc_text_size(label).x + spacing + (width_em + 0.6) * em
        if SETTINGS[path].auto:
            width += _button_width() + 2

        def draw() -> None:
            self._edit(path, label, width_em, faded)
            imgui.same_line(0, 0.6 * em)

        return Item(width, draw, lambda: self._edit(path, label, width_em, faded))

    def _edit(self, path: str, label: str, width_em: float, faded: bool) -> None:
        info, value = SETTINGS[path], get(self._state.settings, path)
        if path == "display.view":
            value = self._state.named_view
        imgui.push_style_var(imgui.StyleVar_.alpha, theme.GREYED if faded else 1.0)
        imgui.begin_group()
        imgui.align_text_to_frame_padding()
        imgui.text_colored(imgui.ImVec4(*theme.DIM), label)
        imgui.same_line()
        resolved = self._state.resolved(path) if value == "auto" else value
        new = self._widgets.edit(info, value, resolved, width=width_em * imgui.get_font_size())
        if info.auto:
            imgui.same_line(0, 2)
            tip = "Automatic. Click to fix the present value." if value == "auto" else "Back to automatic"
            if icon_button(fa.ICON_FA_WAND_MAGIC_SPARKLES, f"auto.{path}", tip, on=value == "auto"):
                new = resolved if value == "auto" else "auto"
        imgui.end_group()
        imgui.pop_style_var()
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip) and not imgui.is_any_item_active():
            lines = [(info.path, theme.ACCENT), (info.description, theme.TEXT)]
            if faded:
                lines.append(("This view shows data as it is.", theme.WARNING))
            tooltip_text(lines)
        if new is not None:
            self._state.change({path: new})


def _gap() -> Item:
    """A line between groups of buttons."""
    space = imgui.get_font_size() * 0.4

    def draw() -> None:
        imgui.same_line(0, space)
        imgui.text_disabled("|")
        imgui.same_line(0, space)

    return Item(2 * space + imgui.calc_text_size("|").x, draw)


def _button_width() -> float:
    return 1.15 * imgui.get_frame_height()
