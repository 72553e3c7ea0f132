"""Every click on the default scene with a stopwatch: `python -m pmviewer.bench.measures.start_clicks`.

Prints a line of JSON for each: what is clicked, seconds until its first picture, and how many of them went into
compiling.
"""

from __future__ import annotations

import json
import sys
import time

from numba.core import event

from pmviewer.engine.ahead.clicks import clicks
from pmviewer.engine.opened import open_scene
from pmviewer.engine.session import Session
from pmviewer.settings.access import Settings, with_values

SCENE = "cornell_caustic"
PATIENCE = 600.0


class Compiling(event.Listener):
    """Adds up the seconds in which this process compiles."""

    def __init__(self) -> None:
        self.seconds, self._depth, self._since = 0.0, 0, 0.0

    def on_start(self, event: event.Event) -> None:
        """Numba begins to compile a function, perhaps one that another one being compiled calls."""
        if self._depth == 0:
            self._since = time.perf_counter()
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        """Only the outermost function's time is counted, which includes those that it calls."""
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._since


def main() -> int:
    """Returns 1 when a picture does not come."""
    compiling = Compiling()
    event.register("numba:compile", compiling)
    opened = open_scene(SCENE)
    session = Session()
    session.open(SCENE)
    session.wait(1, PATIENCE)
    for click in clicks(opened, Settings()):
        before, compiled = time.perf_counter(), compiling.seconds
        session.set(with_values(click.settings, {"render.passes": 1}))
        session.restart()  # what only changes the display needs no new pass
        if not session.wait(1, PATIENCE):
            print(f"{click.text}: {session.status.text}", file=sys.stderr)
            return 1
        seconds = time.perf_counter() - before
        print(json.dumps({"click": click.text, "seconds": seconds, "compiling": compiling.seconds - compiled}))
    session.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
