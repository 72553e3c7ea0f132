"""The menu "Edit": undo and redo with the names of the steps, presets, what is changed."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import imgui

from pmviewer.settings.access import get
from pmviewer.settings.presets import PRESETS
from pmviewer.viewer import theme
from pmviewer.viewer.panels.widgets import tooltip_text
from pmviewer.viewer.state import ViewerState

AUTOMATIC = (
    "A trial of a few passes on a small picture finds the method, N and radius that suit the scene, for the time limit "
    "or the error limit of the stop rules, or for ten seconds. It says why in the log."
)
LISTED = 20
"""Steps that the history shows, either way."""


class EditMenu:
    """`item` draws an entry by its text and the name of an action, see `pmviewer.viewer.panels.menus`."""

    def __init__(self, state: ViewerState, item: Callable[..., None]) -> None:
        self._state = state
        self._item = item

    def gui(self) -> None:
        """The menu's entries."""
        history = self._state.history
        undo = f"Undo: {history.done[-1].name}" if history.done else "Undo"
        redo = f"Redo: {history.undone[-1].name}" if history.undone else "Redo"
        self._item(f"{theme.drawable(undo)}###undo", "undo", enabled=bool(history.done))
        self._item(f"{theme.drawable(redo)}###redo", "redo", enabled=bool(history.undone))
        if imgui.begin_menu("History", bool(history.done or history.undone)):
            self._steps()
            imgui.end_menu()
        imgui.separator()
        if imgui.begin_menu("Presets"):
            self._presets()
            imgui.end_menu()
        self._item("Changed settings", "list_changed", self._state.only_changed)
        self._item("Find a command or setting …", "open_palette")

    def _presets(self) -> None:
        """Ways of rendering; the one in force is ticked. Camera, display, seed and stop rules stay."""
        settings = self._state.settings
        self._item("Automatic", "choose_automatically", self._state.automatic.running)
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            tooltip_text([(AUTOMATIC, theme.TEXT)])
        imgui.separator()
        for preset in PRESETS:
            assignments = preset.assignments()
            in_force = all(get(settings, path) == value for path, value in assignments.items())
            if imgui.menu_item(preset.name, "", in_force)[0]:
                self._state.change(assignments)
            if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
                tooltip_text([(preset.text, theme.TEXT)])

    def _steps(self) -> None:
        """Steps to come above, those done below, the newest first: a click goes there."""
        history = self._state.history
        for number, step in reversed(list(enumerate(reversed(history.undone[-LISTED:])))):
            if imgui.menu_item(f"{theme.drawable(step.name)}###redo{number}", "", False)[0]:
                for _ in range(number + 1):
                    self._state.redo()
        imgui.separator_text("now")
        for number, step in enumerate(reversed(history.done[-LISTED:])):
            if imgui.menu_item(f"{theme.drawable(step.name)}###undo{number}", "", False)[0]:
                for _ in range(number + 1):
                    self._state.undo()
