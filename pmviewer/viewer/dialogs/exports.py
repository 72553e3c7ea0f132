"""Files that leave the window: PNG, EXR, session, screenshots. Pixels are read at once, files are written behind."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.viewer.background import FILES
from pmviewer.viewer.comparison import COMPARED_VIEWS
from pmviewer.viewer.overlays.layers import any_shown
from pmviewer.viewer.pair import WIPE
from pmviewer.viewer.state import ViewerState
from pmviewer.viewer.viewport.viewport import Viewport


def default_path(state: ViewerState, suffix: str, view: str = "") -> Path:
    """`<scene>-<view>-<passes><suffix>` in the current folder."""
    scene, frame = state.session.scene, state.frame
    name = re.sub(r"[^\w.-]+", "_", scene.name if scene is not None else "") or "picture"
    passes = str(frame.statistics.passes) if frame is not None else ""
    return Path.cwd() / ("-".join(part for part in (name, view, passes) if part) + suffix)


def fresh_path(path: Path) -> Path:
    """The path, or with a number behind its name when a file is there: screenshots never overwrite."""
    number, candidate = 2, path
    while candidate.exists():
        candidate = path.with_stem(f"{path.stem}_{number}")
        number += 1
    return candidate


class Exports:
    """Writers of what is shown. Pixels are read in the window's thread; where a file went, or why it did not, the log
    says."""

    def __init__(self, state: ViewerState, viewport: Viewport) -> None:
        self._state = state
        self._viewport = viewport

    def png(self, path: Path, *, overlays: bool) -> None:
        """The picture at its own resolution as it is shown, with or without the points over it."""
        settings, frame = self._state.settings, self._state.frame
        points = overlays and (any_shown(settings) or self._state.inspector.pinned is not None)
        display = self._state.shown_display
        pair, gain = self._state.shown_pair(), self._state.gain.gain
        if pair is not None and gain is not None and self._state.gain.shown and pair.mode == WIPE:

            def sheet() -> str:
                from pmviewer.output.frame_export import gain_sheet
                from pmviewer.output.png import write_png

                write_png(path, gain_sheet(gain, pair.display))
                return f"wrote {path.absolute()}"

            self._state.background.start(FILES, "writing PNG", sheet)
            return
        if frame is not None and pair is None and not points and display.view not in ("geometry", *COMPARED_VIEWS):
            # The same code as `pmviewer render` uses, so that both write the same picture.

            def work() -> str:
                from pmviewer.output.frame_export import write_frame_png

                write_frame_png(path, frame, display=display)
                return f"wrote {path.absolute()}"

            self._state.background.start(FILES, "writing PNG", work)
            return
        pixels = self._viewport.capture(overlays=overlays)
        if pixels is None:
            self._state.say("error", "There is no picture to export yet: open a scene first.")
            return
        self.pixels(path, pixels)

    def pixels(self, path: Path, pixels: NDArray[np.uint8]) -> None:
        """(height, width, 3) uint8 as PNG."""

        def work() -> str:
            from pmviewer.output.png import write_png

            write_png(path, pixels)
            return f"wrote {path.absolute()}"

        self._state.background.start(FILES, "writing PNG", work)

    def exr(self, path: Path, *, half: bool = False) -> None:
        """Every layer of the newest frame."""
        frame = self._state.frame
        if frame is None:
            self._state.say("error", "There is no picture to export yet: wait for the first pass.")
            return

        now = self._state.settings  # what is drawn over the picture may have changed since the pass
        update = {"display": now.display, "overlays": now.overlays}
        shown = replace(frame, settings=frame.settings.model_copy(update=update))

        def work() -> str:
            from pmviewer.output.frame_export import write_frame_exr

            write_frame_exr(path, shown, half)
            return f"wrote {path.absolute()}"

        self._state.background.start(FILES, "writing EXR", work)

    def session(self, path: Path) -> None:
        """Settings and scene, so that the file reopens to the same picture, and the snapshots beside it."""
        state = self._state
        if state.session.scene is None:
            state.say("error", "There is no session to save yet: open a scene first.")
            return
        settings, scene = state.settings, state.session.scene_path
        parameters = dict(state.parameters)
        passes = state.frame.statistics.passes if state.frame is not None else 0
        snapshots, film = tuple(state.snapshots.all), state.film.keys

        def work() -> str:
            from pmviewer.output.session_file import write_session

            write_session(path, settings, scene, passes, parameters, snapshots, film)
            return f"wrote {path.absolute()}"

        state.background.start(FILES, "saving the session", work)
