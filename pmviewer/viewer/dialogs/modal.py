"""Modal windows in the middle of the window, as large as what is in them."""

from __future__ import annotations

from abc import ABC, abstractmethod

from imgui_bundle import imgui


def begin_modal(title: str, opens: bool) -> bool:
    """Begin the modal window of that title, which `opens` with this frame or is open already. Whether it is shown: then
    the caller draws what is in it, and calls `imgui.end_popup`."""
    if opens:
        imgui.open_popup(title)
    imgui.set_next_window_pos(imgui.get_main_viewport().get_center(), imgui.Cond_.appearing, (0.5, 0.5))
    shown, _ = imgui.begin_popup_modal(title, None, imgui.WindowFlags_.always_auto_resize)
    return bool(shown)


class Modal(ABC):
    """A modal window; `open` shows it. Subclasses say in `_contents` what is in it, and call `_close`."""

    title: str

    def __init__(self) -> None:
        self._asked = False
        self.is_open = False

    def open(self) -> None:
        """With the next window frame."""
        self._asked = self.is_open = True

    def gui(self) -> None:
        """Draw it while it is open."""
        if not self.is_open:
            return
        opens, self._asked = self._asked, False
        if not begin_modal(self.title, opens):
            self.is_open = False
            return
        self._contents()
        imgui.end_popup()

    @abstractmethod
    def _contents(self) -> None:
        """Draw what is in it."""

    def _close(self) -> None:
        self.is_open = False
        imgui.close_current_popup()
