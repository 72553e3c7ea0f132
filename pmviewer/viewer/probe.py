"""The real window under a stopwatch: `python -m pmviewer.viewer.probe SCENE start|frames SECONDS`.

Prints one JSON object. Times are of the monotonic clock, which all processes of a machine share, so that whoever
started this one can subtract the moment before.

start   closes after the first picture: {"window": t, "coarse": t}: the first swap, the first one with a picture
frames  keeps dragging N for SECONDS while the session computes: {"intervals": [seconds between swaps]}
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

from pmviewer.settings.access import Settings, with_values
from pmviewer.viewer.app import ViewerApp
from pmviewer.viewer.start import start_viewer

DRAG_EVERY = 0.4
SIZE = 512


class Probe:
    """Hooks into the window's swaps."""

    def __init__(self, mode: str, seconds: float) -> None:
        self.mode, self.seconds = mode, seconds
        self.result: dict[str, Any] = {"intervals": []}
        self.app: ViewerApp | None = None
        self._last = self._begin = self._dragged = 0.0
        self._drags = 0

    def make_app(self, session: Any, **arguments: Any) -> ViewerApp:
        """The window with a stopwatch at its buffer swaps; it idles as usual for `start` alone."""
        app = ViewerApp(session, remember=False, **arguments)
        app.params.callbacks.after_swap = self._after_swap
        app.params.fps_idling.enable_idling = self.mode == "start"
        self.app = app
        return app

    def _after_swap(self) -> None:
        assert self.app is not None
        now = time.monotonic()
        self.result.setdefault("window", now)
        if self.app.state.session.status.state == "failed":
            self._exit()
        frame = self.app.state.session.frame
        if frame is None:
            return
        if "coarse" not in self.result:
            self.result["coarse"] = now
            self._begin = self._dragged = self._last = now
            if self.mode == "start":
                self._exit()
            return
        self.result["intervals"].append(now - self._last)
        self._last = now
        if now - self._dragged > DRAG_EVERY:
            self._dragged = now
            self._drags += 1
            N = 100_000 + 10_000 * (self._drags % 8)
            self.app.state.session.set(with_values(self.app.state.session.settings, {"photons.N": N}))
        if now - self._begin > self.seconds:
            self._exit()

    def _exit(self) -> None:
        assert self.app is not None
        self.app.params.app_shall_exit = True


def main(arguments: list[str]) -> int:
    """Run the window on `[scene, mode, seconds]`, print the times; the window's exit status."""
    scene, mode, seconds = arguments[0], arguments[1], float(arguments[2]) if len(arguments) > 2 else 0.0
    probe = Probe(mode, seconds)
    settings = with_values(Settings(), {"camera.width": SIZE, "camera.height": SIZE})
    code = start_viewer(probe.make_app, scene, settings, None, None)
    print(json.dumps(probe.result))
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
