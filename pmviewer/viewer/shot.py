"""Pictures of the window from the command line: open it, wait for the last pass, write what is seen, close it.

What the window draws over the picture, points, lines, captions and legends, is in no other file that the program
writes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import hello_imgui
from numpy.typing import NDArray

from pmviewer.errors import PmviewerError, SceneError, SettingError
from pmviewer.output.png import write_png
from pmviewer.viewer.background import DIFFERENCES

if TYPE_CHECKING:
    from pmviewer.engine.frame import Frame
    from pmviewer.viewer.state import ViewerState
    from pmviewer.viewer.viewport.viewport import Viewport

SETTLING = 4
"""Window frames without a change before the picture is taken: panels take two to find their places."""


@dataclass
class Shot:
    """What to write; `pixel` is the one whose gather rays are shown, `pinned` the one in the inspector, `held`
    names the object with handles, `panel` the panel in front; with `hemisphere` the file shows what a gather at the
    pinned pixel sees instead of the window. `error` is why there is no file, once the window has closed, `stored`
    what the last pass stored."""

    path: Path
    pixel: tuple[int, int] | None = None
    pinned: tuple[int, int] | None = None
    held: str = ""
    panel: str = ""
    hemisphere: bool = False
    error: PmviewerError | None = None
    stored: str = ""
    done: bool = field(default=False, init=False)
    _still: int = field(default=0, init=False)
    _asked: bool = field(default=False, init=False)
    _key: tuple[int, int] = field(default=(-1, -1), init=False)

    def after_drawing(self, state: ViewerState, viewport: Viewport, pixels: Callable[[], NDArray[np.uint8]]) -> None:
        """Once per window frame, when it is drawn; `pixels` gives (h, w, 3) of the window."""
        if self.done:
            return
        hello_imgui.request_refresh()
        try:
            if self._ready(state, viewport):
                write_png(self.path, self._hemisphere(state) if self.hemisphere else pixels())
                self.stored = _stored(state.frame)
                self._end()
        except PmviewerError as error:
            self.error = error
            self._end()

    def _ready(self, state: ViewerState, viewport: Viewport) -> bool:
        status, frame = state.session.status, state.frame
        if status.state == "failed":
            raise SceneError(status.text)
        if frame is not None and not frame.coarse and not self._asked:
            self._asked = True
            self._ask(state, viewport, frame)
        if status.state != "finished" or frame is None:
            return False
        if state.snapshots.arriving or state.background.running(DIFFERENCES):
            return False
        problem = state.pair.problem(state.settings, frame)
        if problem:
            raise SettingError(f"compare.mode = {state.settings.compare.mode}: {problem}")
        view = state.settings.display.view
        refusal = state.refused_view(view)
        if refusal is not None:
            raise SettingError(f"display.view = {view}: {refusal}")
        waiting = self.pixel is not None and frame.inspection.gathered is None
        waiting = waiting or (self.pinned is not None and state.inspector.report is None)
        key = frame.serial, viewport.redraws
        self._still = self._still + 1 if key == self._key and not waiting else 0
        self._key = key
        return self._still >= SETTLING and state.shown_display.view == view

    def _ask(self, state: ViewerState, viewport: Viewport, frame: Frame) -> None:
        """Have the frame hold what is told of pixels."""
        width, height = frame.camera.width, frame.camera.height
        for pixel in (self.pixel, self.pinned):
            if pixel is not None and not (0 <= pixel[0] < width and 0 <= pixel[1] < height):
                raise SettingError(f"The pixel {pixel} is outside of {width}x{height}.")
        if self.pixel is not None:
            viewport.inspected = self.pixel
            state.session.inspect(self.pixel)
        if self.pinned is not None:
            state.inspector.pin(self.pinned)
        if self.held and state.editing.catalogue is not None:
            state.editing.choose(state.editing.catalogue.find("object", self.held))
        if self.panel:
            self._to_the_front()

    def _hemisphere(self, state: ViewerState) -> NDArray[np.uint8]:
        """The discs of the pinned pixel, side by side on white. Raises SettingError where there are none."""
        from pmviewer.viewer.panels.inspector.fisheye import side_by_side

        report = state.inspector.report
        if report is None or report.fisheye is None:
            raise SettingError(
                f"--hemisphere: nothing gathers at the pixel {self.pinned}; it needs gather.estimation=on with the "
                "final gather, and a diffuse surface there."
            )
        return side_by_side(report.fisheye)

    def _to_the_front(self) -> None:
        """Bring the panel there. Raises SettingError where there is none of that name."""
        windows = hello_imgui.get_runner_params().docking_params.dockable_windows
        labels = {window.label.lower(): window for window in windows}
        if self.panel.lower() not in labels:
            panels = ", ".join(window.label for window in windows)
            raise SettingError(f"--panel {self.panel}: there is no such panel, with --window there are {panels}.")
        labels[self.panel.lower()].focus_window_at_next_frame = True

    def _end(self) -> None:
        self.done = True
        hello_imgui.get_runner_params().app_shall_exit = True


def _stored(frame: Frame | None) -> str:
    """Photons of the latest pass, for the one line that the command says."""
    if frame is None:
        return ""
    parts = []
    for name, count in frame.statistics.stored_in_pass.items():
        if name in ("caustic", "global") and count:
            fate = frame.statistics.deposited.get(name)
            of = f" of {fate.arrived:,}" if fate is not None and fate.arrived != count else ""
            parts.append(f"{count:,}{of} {name} photons")
    return f" ({', '.join(parts)} in the last pass)" if parts else ""
