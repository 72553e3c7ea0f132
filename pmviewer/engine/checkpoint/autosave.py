"""The film of a session, kept on disk between passes and gone on with after a crash."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable
from pathlib import Path

from pmviewer.engine.checkpoint.checkpoint import Job, read_checkpoint, write_checkpoint
from pmviewer.engine.frame import Level
from pmviewer.engine.renderer import Renderer
from pmviewer.errors import OutputError, SceneError

WORTH = 10.0
"""Seconds of rendering that are worth a file."""
SHARE = 20.0
"""Times as long as writing took, nothing is written again: of large pictures, or on slow disks."""


class KeptFilm:
    """Writes the film to `path`, which nobody else does, now and then, None for nowhere; on the thread that renders:
    the film stands still meanwhile, and the window does not wait for it. `go_on_with` is a checkpoint that the next
    renderer goes on with. `say` gets lines for the log."""

    def __init__(self, say: Callable[[Level, str], None]) -> None:
        self.path: Path | None = None
        self.go_on_with: Path | None = None
        self._say = say
        self._of: weakref.ref[Renderer] | None = None
        self._rendered = self._took = 0.0
        self._at = time.monotonic()
        self._failed = False

    def renderer(self, make: Callable[[], Renderer]) -> Renderer:
        """A new one, by `make`; one that goes on with a film, if it fits: else that it begins anew is said."""
        renderer, film, self.go_on_with = make(), self.go_on_with, None
        if film is None:
            return renderer
        try:
            found = read_checkpoint(film)
            if said := found.check(renderer):
                self._say("warning", f"The last bits of the picture may differ from those without the crash: {said}")
            found.resume(renderer)
        except SceneError as error:
            self._say("warning", f"The film begins anew. {error}")
            return make()
        self._say("info", f"going on after pass {renderer.passes}")
        self._of, self._rendered = weakref.ref(renderer), renderer.tally.seconds
        return renderer

    def after_pass(self, renderer: Renderer, interval: float, done: bool) -> None:
        """Write the film if there is enough of it since the last time, and that was an `interval` of seconds ago, or
        the film is `done`; 0 seconds for never."""
        if self._of is None or self._of() is not renderer:
            self._of, self._rendered = weakref.ref(renderer), 0.0
        start = time.monotonic()
        passed, new = start - self._at, renderer.tally.seconds - self._rendered
        early = passed < max(interval, SHARE * self._took) and not done
        if self.path is None or interval <= 0 or new < WORTH or early:
            return
        try:
            write_checkpoint(self.path, renderer, Job(renderer.scene.source), locked=True)
            self._failed = False
        except OutputError as error:
            if not self._failed:
                self._say("warning", f"Autosave: {error}")
            self._failed = True
        self._at = time.monotonic()
        self._took, self._rendered = self._at - start, renderer.tally.seconds
