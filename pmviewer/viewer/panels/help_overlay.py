"""The overview of keys and mouse buttons, made from the table of bindings."""

from __future__ import annotations

from imgui_bundle import imgui

from pmviewer.viewer import theme
from pmviewer.viewer.shortcuts import BINDINGS, Binding
from pmviewer.viewer.state import ViewerState

_LEFT = ("File", "Edit", "Render", "Film", "Free camera", "Window", "Settings")
_KEYS, _TEXT = 12.0, 18.0
_WIDTH = _KEYS + _TEXT + 1.5
"""Widths in multiples of the font size."""


def draw_help(state: ViewerState) -> None:
    """A window in the middle of the screen, in two columns."""
    if not state.help_open:
        return
    center = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(center, imgui.Cond_.always, (0.5, 0.5))
    flags = imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.no_collapse
    shown, still_open = imgui.begin("Keys and mouse", True, flags)
    state.help_open = bool(still_open)
    if shown:
        groups: dict[str, list[Binding]] = {}
        for binding in BINDINGS:
            groups.setdefault(binding.group, []).append(binding)
        if imgui.begin_table("##help", 2, imgui.TableFlags_.sizing_fixed_fit):
            for side in (0, 1):
                imgui.table_setup_column(
                    f"side{side}", imgui.TableColumnFlags_.width_fixed, _WIDTH * imgui.get_font_size()
                )
            for side in (0, 1):
                imgui.table_next_column()
                for name, bindings in groups.items():
                    if (name in _LEFT) == (side == 0):
                        _group(name, bindings)
            imgui.end_table()
    imgui.end()


def _group(name: str, bindings: list[Binding]) -> None:
    em = imgui.get_font_size()
    imgui.text_colored(imgui.ImVec4(*theme.ACCENT), name)
    if not imgui.begin_table(f"##{name}", 2, imgui.TableFlags_.sizing_fixed_fit):
        return
    imgui.table_setup_column("keys", imgui.TableColumnFlags_.width_fixed, _KEYS * em)
    imgui.table_setup_column("what", imgui.TableColumnFlags_.width_fixed, _TEXT * em)
    for binding in bindings:
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text_unformatted(theme.drawable(binding.keys))
        imgui.table_next_column()
        imgui.push_text_wrap_pos(0)
        imgui.text_colored(imgui.ImVec4(*theme.DIM), theme.drawable(binding.text))
        imgui.pop_text_wrap_pos()
    imgui.end_table()
    imgui.spacing()
