"""The log: messages coloured by level, newest at the end, copied by click or all at once; and toasts for errors."""

from __future__ import annotations

import time

from imgui_bundle import icons_fontawesome_6 as fa
from imgui_bundle import imgui

from pmviewer.engine.frame import Message
from pmviewer.viewer import theme
from pmviewer.viewer.state import ViewerState

_ICONS = {
    "info": fa.ICON_FA_CIRCLE_INFO,
    "warning": fa.ICON_FA_TRIANGLE_EXCLAMATION,
    "error": fa.ICON_FA_CIRCLE_XMARK,
}


def line_of(message: Message) -> str:
    """One line of plain text, for the clipboard."""
    return f"{time.strftime('%H:%M:%S', time.localtime(message.when))} {message.level}: {message.text}"


class LogPanel:
    """The tab "Log". It follows the end unless the user has scrolled up."""

    def __init__(self, state: ViewerState) -> None:
        self._state = state
        self._seen = 0

    def gui(self) -> None:
        """Draw the tab; called once a frame while it is in front."""
        log = self._state.log
        imgui.begin_disabled(not log)
        if imgui.small_button(f"{fa.ICON_FA_COPY}  Copy all"):
            imgui.set_clipboard_text("\n".join(line_of(m) for m in log))
        imgui.same_line()
        if imgui.small_button("Clear"):
            log.clear()
        imgui.end_disabled()
        if imgui.begin_child("##lines", (0, 0)):
            at_end = imgui.get_scroll_y() >= imgui.get_scroll_max_y() - 2
            imgui.push_text_wrap_pos(0)
            for number, message in enumerate(log):
                self._line(number, message)
            imgui.pop_text_wrap_pos()
            if len(log) != self._seen and at_end:
                imgui.set_scroll_here_y(1.0)
            self._seen = len(log)
        imgui.end_child()

    @staticmethod
    def _line(number: int, message: Message) -> None:
        imgui.text_disabled(time.strftime("%H:%M:%S", time.localtime(message.when)))
        imgui.same_line()
        colour = imgui.ImVec4(*theme.LEVELS[message.level])
        imgui.push_style_color(imgui.Col_.text, colour)
        imgui.text_unformatted(_ICONS[message.level])
        imgui.same_line()
        imgui.text_unformatted(theme.drawable(message.text))
        imgui.pop_style_color()
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            imgui.set_tooltip("Click to copy")
        if imgui.is_item_clicked():
            imgui.set_clipboard_text(line_of(message))


def draw_toasts(state: ViewerState, left: float, top: float, width: float) -> None:
    """The newest errors over the picture, each with a button that dismisses it."""
    em = imgui.get_font_size()
    wide = min(width - 2 * em, 36 * em)
    y = top + 0.8 * em
    for number, toast in enumerate(list(state.toasts)):
        imgui.set_next_window_pos((left + (width - wide) / 2, y))
        imgui.set_next_window_size((wide, 0))
        imgui.push_style_color(imgui.Col_.window_bg, theme.ground("menu_bar_bg", 0.96))
        imgui.push_style_color(imgui.Col_.border, imgui.ImVec4(*theme.LEVELS[toast.message.level]))
        flags = (
            imgui.WindowFlags_.no_decoration
            | imgui.WindowFlags_.no_docking
            | imgui.WindowFlags_.no_saved_settings
            | imgui.WindowFlags_.no_focus_on_appearing
            | imgui.WindowFlags_.no_move
        )
        imgui.begin(f"##toast{number}", None, flags)
        imgui.text_colored(imgui.ImVec4(*theme.LEVELS[toast.message.level]), _ICONS[toast.message.level])
        imgui.same_line()
        imgui.push_text_wrap_pos(wide - 2.6 * em)
        imgui.text_unformatted(theme.drawable(toast.message.text))
        imgui.pop_text_wrap_pos()
        imgui.same_line(wide - 2.2 * em)
        if imgui.small_button(f"{fa.ICON_FA_XMARK}##dismiss"):
            state.toasts.remove(toast)
        imgui.set_item_tooltip("Dismiss")
        y += imgui.get_window_height() + 0.4 * em
        imgui.end()
        imgui.pop_style_color(2)
