"""The dialog after a crash: go on with what was kept, or not."""

from __future__ import annotations

import time
from collections.abc import Callable

from imgui_bundle import imgui

from pmviewer.viewer import theme
from pmviewer.viewer.autosave import Autosave, Left
from pmviewer.viewer.dialogs.modal import begin_modal
from pmviewer.viewer.format import duration, grouped

TITLE = "pmviewer was not closed properly"


class RestoreDialog:
    """A modal window as long as something is left (`Autosave.left`); `restore` opens it."""

    def __init__(self, autosave: Autosave, restore: Callable[[], None]) -> None:
        self._autosave, self._restore = autosave, restore
        self._asked = False

    @property
    def is_open(self) -> bool:
        """Whether it waits for an answer."""
        return self._autosave.left is not None

    def gui(self) -> None:
        """Draw it while it is open."""
        left = self._autosave.left
        if left is None:
            return
        self._asked = begin_modal(TITLE, not self._asked)
        if self._asked:
            self._contents(left)
            imgui.end_popup()

    def _contents(self, left: Left) -> None:
        imgui.push_text_wrap_pos(26 * imgui.get_font_size())
        imgui.text_unformatted(theme.drawable(f"Its session was kept: {told(left)}"))
        imgui.text_colored(imgui.ImVec4(*theme.DIM), theme.drawable(_what_restoring_does(left)))
        imgui.pop_text_wrap_pos()
        imgui.spacing()
        if imgui.button("Restore##autosave"):
            imgui.close_current_popup()
            self._restore()
        imgui.set_item_default_focus()
        imgui.same_line()
        if imgui.button("Discard##autosave"):
            imgui.close_current_popup()
            self._autosave.discard()
        imgui.same_line()
        if imgui.button("Not now##autosave") or imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
            self._autosave.leave()


def told(left: Left) -> str:
    """Scene, passes, and when."""
    film = left.film
    passes = "" if film is None else f", {_passes(film.passes)} in {duration(film.seconds)}"
    return f"{left.scene}{passes}, {_when(left.when)}."


def _passes(count: int) -> str:
    return "one pass" if count == 1 else f"{grouped(count)} passes"


def _when(then: float) -> str:
    there, now = time.localtime(then), time.localtime()
    day = "" if there[:3] == now[:3] else time.strftime("%Y-%m-%d ", there)
    return time.strftime(f"{day}%H:%M", there)


def _what_restoring_does(left: Left) -> str:
    if left.film is None:
        return "Restore opens its scene with settings and snapshots, and renders anew."
    return "Restore opens its scene with settings and snapshots, and goes on after the last pass that was kept."
