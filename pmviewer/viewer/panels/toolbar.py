"""The row under the menu: run, method, view, exposure, tone curve, export."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from imgui_bundle import icons_fontawesome_6 as fa
from imgui_bundle import imgui

from pmviewer.settings.access import SETTINGS, get
from pmviewer.viewer import theme
from pmviewer.viewer.panels.widgets import SettingWidgets, icon_button, tooltip_text
from pmviewer.viewer.shortcuts import keys_of
from pmviewer.viewer.state import ViewerState
from pmviewer.viewer.viewport.viewport import is_data_view

Actions = Mapping[str, Callable[[], None]]
WIDE, MORE = 78.0, 11.0
"""Width of the window in em from which the light's rig has room, and how much a choice of cameras takes."""


class Toolbar:
    def __init__(self, state: ViewerState, actions: Actions) -> None:
        self._state = state
        self._actions = actions
        self._widgets = SettingWidgets(state.refused_view, state.choices)

    def gui(self) -> None:
        paused = self._state.session.paused
        icon = fa.ICON_FA_PLAY if paused else fa.ICON_FA_PAUSE
        self._button(icon, "toggle_pause", "Resume" if paused else "Pause", on=paused)
        self._button(fa.ICON_FA_ARROW_ROTATE_RIGHT, "restart", "Restart")
        self._gap()
        self._setting("render.method", "method", 7)
        self._setting("display.view", "view", 9)
        data = is_data_view(self._state.shown_display)
        room = imgui.get_window_width() / imgui.get_font_size()
        several = len(self._state.choices(SETTINGS["camera.name"])) > 2
        if several and room > WIDE + MORE:  # else the panel has it
            self._setting("camera.name", "camera", 6)
        if room > WIDE:
            self._setting("light.rig", "light", 5.5)
        self._setting("display.exposure", "exposure", 6, faded=data)
        self._setting("display.tone", "tone", 6, faded=data)
        self._gap()
        self._button(fa.ICON_FA_EXPAND, "frame_all", "Frame the whole scene")
        self._button(fa.ICON_FA_PAPER_PLANE, "toggle_fly", "Fly through the scene", on=self._state.flying)
        free = self._state.settings.free_camera.on
        text = "Free camera: see the render camera's importance from elsewhere"
        self._button(fa.ICON_FA_VIDEO, "toggle_free", text, on=free)
        text = "Compare with and without importance"
        self._button(fa.ICON_FA_SCALE_BALANCED, "compare_importance", text, on=self._state.gain.running)
        self._gap()
        self._button(fa.ICON_FA_FOLDER_OPEN, "open", "Open a scene or session")
        self._button(fa.ICON_FA_IMAGE, "export_png", "Export the picture as PNG")
        self._button(fa.ICON_FA_LAYER_GROUP, "export_exr", "Export the layers as EXR")
        self._button(fa.ICON_FA_FLOPPY_DISK, "save_session", "Save the session")
        self._gap()
        self._button(fa.ICON_FA_KEYBOARD, "toggle_help", "Keys and mouse", on=self._state.help_open)

    def _button(self, icon: str, action: str, text: str, *, on: bool = False) -> None:
        if icon_button(icon, action, f"{text}  ({keys_of(action)})", on=on):
            self._actions[action]()
        imgui.same_line(0, 2)

    @staticmethod
    def _gap() -> None:
        imgui.same_line(0, imgui.get_font_size() * 0.4)
        imgui.text_disabled("|")
        imgui.same_line(0, imgui.get_font_size() * 0.4)

    def _setting(self, path: str, label: str, width_em: float, *, faded: bool = False) -> None:
        info, value = SETTINGS[path], get(self._state.settings, path)
        imgui.push_style_var(imgui.StyleVar_.alpha, 0.5 if faded else 1.0)
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
        imgui.same_line(0, imgui.get_font_size() * 0.6)
