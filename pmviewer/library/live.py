"""A window that is open, as a script sees it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.library.names import changed_by
from pmviewer.settings.access import Settings, flat

if TYPE_CHECKING:  # brings OpenGL along
    from pmviewer.viewer.app import ViewerApp

_LOOK_EVERY = 0.02
_PATIENCE = 5.0
"""Seconds that a closed window waits for its script."""


class Live:
    """Handed to the script of `Rendering.show`, which runs beside the window on a thread of its own."""

    def __init__(self, app: ViewerApp) -> None:
        self._app = app
        self.open = True
        """False once the window was closed: the script should come to its end."""

    @property
    def settings(self) -> Settings:
        """Those of the window now, whoever has set them."""
        return self._app.state.settings

    def set(self, values: Mapping[str, Any] | None = None, /, **more: Any) -> None:
        """Change settings as `Rendering.set` does; in the window it is a step that can be undone. Returns when the
        window has taken them. Raises SettingError."""
        before = self.settings
        after = changed_by(before, {**(values or {}), **more})
        old = flat(before)
        changed = {path: value for path, value in flat(after).items() if value != old[path]}
        if not changed:
            return
        taken: list[bool] = []

        def take() -> None:
            self._app.state.history.gesture += 1
            self._app.state.change(changed)
            taken.append(True)

        self._app.state.call(take)
        self._app.wake()
        self.until(lambda: bool(taken))

    def wait(self, passes: int | None = None, seconds: float | None = None) -> bool:
        """Until the window shows the settings as they are, with so many passes or finished. False if it was closed
        before, or after so many seconds."""

        def shown() -> bool:
            session, frame = self._app.state.session, self._app.state.frame
            if frame is None or frame.coarse or not session.is_newest:
                return False
            enough = passes is not None and frame.statistics.passes >= passes
            return enough or session.status.state == "finished"

        return self.until(shown, seconds)

    def picture(self, layer: str = "beauty") -> NDArray[np.float32] | None:
        """A layer of the picture that is shown, (h, w, c) float32 in W/(m² sr), None before the first."""
        frame = self._app.state.frame
        return None if frame is None else frame.image(layer).copy()

    def say(self, text: str) -> None:
        """A line for the window's log."""
        self._app.state.say("info", text)

    def until(self, holds: Callable[[], bool], seconds: float | None = None) -> bool:
        """Until that holds. False if the window was closed before, or after so many seconds."""
        end = None if seconds is None else time.monotonic() + seconds
        while self.open:
            if holds():
                return True
            if end is not None and time.monotonic() > end:
                return False
            time.sleep(_LOOK_EVERY)
        return False


class Scripted:
    """A window with a script beside it, or without one."""

    def __init__(self, script: Callable[[Live], None] | None) -> None:
        self._script = script
        self._live: Live | None = None
        self._thread: threading.Thread | None = None
        self._error: BaseException | None = None

    def begin(self, app: ViewerApp) -> ViewerApp:
        """The window that is about to open; the script begins when it has a scene."""
        self._live = Live(app)
        if self._script is not None:
            self._thread = threading.Thread(target=self._run, name="pmviewer script", daemon=True)
            self._thread.start()
        return app

    def _run(self) -> None:
        assert self._live is not None
        assert self._script is not None
        try:
            if self._live.until(lambda: self._live is not None and self._live._app.state.session.scene is not None):
                self._script(self._live)
        except BaseException as error:
            self._error = error
            self._live._app.state.say("error", f"The script: {type(error).__name__}: {error}")

    def end(self) -> Settings:
        """The window is closed: its last settings. Raises the script's error."""
        assert self._live is not None
        self._live.open = False
        if self._thread is not None:
            self._thread.join(_PATIENCE)
        if self._error is not None:
            raise self._error
        return self._live.settings
