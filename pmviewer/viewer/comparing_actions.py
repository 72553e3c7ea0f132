"""What keys, menus and palette can do with snapshots and compared pictures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pmviewer.settings.access import SETTINGS
from pmviewer.viewer.dialogs.dialogs import FileDialogs
from pmviewer.viewer.pair import FLIP, MODES
from pmviewer.viewer.state import ViewerState

PICTURES = ["*.exr", "*.png"]


def comparing_actions(state: ViewerState, dialogs: FileDialogs) -> dict[str, Callable[[], None]]:
    """Actions by name."""
    return {
        "take_snapshot": state.take_snapshot,
        "open_snapshot": lambda: dialogs.open("Open a picture as a snapshot", "Pictures", PICTURES, open_in(state)),
        "next_comparison": lambda: _next(state, "compare.mode", MODES, state.settings.compare.mode),
        "next_difference": lambda: _next_difference(state),
        "flip_pictures": lambda: _flip(state),
        "swap_pictures": lambda: swap(state),
        "link_cameras": lambda: state.change({"compare.linked": not state.settings.compare.linked}),
    }


def open_in(state: ViewerState) -> Callable[[Path], None]:
    """Opens a picture as a snapshot of that window."""
    return lambda path: state.snapshots.open([path])


def swap(state: ViewerState) -> None:
    """A for B."""
    compare = state.settings.compare
    state.change({"compare.a": compare.b, "compare.b": compare.a})


def _next(state: ViewerState, path: str, choices: tuple[str, ...], now: str) -> None:
    state.change({path: choices[(choices.index(now) + 1) % len(choices)]})


def _next_difference(state: ViewerState) -> None:
    """The next kind; the first press shows the differences."""
    if state.settings.compare.mode != "difference":
        state.change({"compare.mode": "difference"})
    else:
        path = "compare.difference"
        _next(state, path, SETTINGS[path].choices, state.settings.compare.difference)


def _flip(state: ViewerState) -> None:
    """The other picture; the first press begins to show one at a time."""
    if state.settings.compare.mode != FLIP:
        state.change({"compare.mode": FLIP})
    state.pair.flip()
