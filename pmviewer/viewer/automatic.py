"""Automatic mode in the window: the trial runs beside the session, and what it picks is one change to undo.

The user's own window begins a trial by itself, once a scene that is opened shows its first passes, so that no picture
waits for it. It leaves alone what anybody has chosen: session files, kept films, any setting that a trial would set.

What a trial picked is for its scene and its method: another scene, and another method by hand, have the user's own
settings again.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pmviewer.engine.frame import Level
from pmviewer.errors import PmviewerError
from pmviewer.progress import check
from pmviewer.settings.access import Settings, get, with_values
from pmviewer.settings.presets import given
from pmviewer.viewer.background import CHOOSING, Background, Work
from pmviewer.viewer.session_link import SessionLike

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.engine.auto.choose import Choice


SEEN = 2
"""Passes that a scene shows before a trial begins by itself."""
COMPILED = 30.0
"""Seconds for which such a trial waits for kernels that are being compiled ahead; a later one would throw a long film
away."""


class AutomaticRun:
    """At most one trial at a time, with a pool of its own. Methods are for the window's thread."""

    def __init__(
        self,
        session: SessionLike,
        background: Background,
        say: Callable[[Level, str], None],
        change: Callable[[dict[str, Any]], None],
    ) -> None:
        self._session, self._background, self._say, self._change = session, background, say, change
        self._work: Work | None = None
        self._arrived: tuple[Any, Any, Choice] | None = None
        self._picked: dict[str, tuple[Any, Any]] = {}
        """What trials have set, by full name: the user's own value and the one that was picked."""
        self.at_start = False
        """Whether scenes that are opened get a trial by themselves, where `display.automatic` is on."""
        self._expected = False

    @property
    def running(self) -> bool:
        """Whether a trial is under way."""
        return self._work is not None and self._work.running

    def opening(self, *, chosen: bool) -> None:
        """A scene is being opened; `chosen`: with settings that somebody has kept for it."""
        self._expected = self.at_start and not chosen

    def undone(self, settings: Settings) -> dict[str, Any]:
        """By full name, the user's own values of what trials have picked and nobody has changed since."""
        return {
            path: own for path, (own, picked) in self._picked.items() if own != picked and get(settings, path) == picked
        }

    def start(self) -> None:
        """Begin a trial of the open scene, or cancel the one that runs."""
        if self.running:
            assert self._work is not None
            self._work.cancel()
            return
        opened = self._session.opened_scene
        if opened is None:
            self._say("warning", "Open a scene first: automatic mode tries ways of rendering it.")
            return
        self._expected = False
        self._start(opened, asked=True)

    def _start(self, opened: Any, *, asked: bool) -> None:
        settings = self._session.settings
        from pmviewer.engine.pool import WorkPool

        pool = WorkPool(self._session.threads, behind_window=True)
        render, apart = settings.render, self._session.workers.where is not None

        def choose_beside() -> str:
            from pmviewer.engine.auto.choose import Goal, choose
            from pmviewer.engine.pool import lower_priority

            lower_priority()
            goal = Goal(render.time_limit * pool.threads, render.error, apart)
            try:
                if not asked and not _compiled(opened, settings):
                    return "automatic mode has not tried ways of rendering: they are still being compiled (Shift+R)"
                before = None if asked else settings
                self._arrived = (
                    opened,
                    before,
                    choose(opened, settings, goal, pool, lambda text, share: None),
                )
            except MemoryError:
                raise PmviewerError("Not enough memory to try ways of rendering: lower the image size.") from None
            finally:
                pool.close()
            return ""

        title = "trying ways of rendering"
        self._work = self._background.start(CHOOSING, title, choose_beside, stop=pool.cancel.set)

    def poll(self) -> None:
        """Once per window frame: take over what was picked, unless another scene is open by now, or somebody has chosen
        since a trial began by itself."""
        self._begin_by_itself()
        if self._arrived is None:
            return
        (opened, before, choice), self._arrived = self._arrived, None
        now = self._session.settings
        if self._session.opened_scene is not opened:
            return
        if before is not None and any(get(now, path) != get(before, path) for path in choice.values):
            return
        for number, sentence in enumerate(choice.sentences):
            self._say("info", f"automatic: {sentence}" if number == 0 else f"  {sentence}")
        own = with_values(now, self.undone(now))
        self._picked = {path: (get(own, path), value) for path, value in choice.values.items()}
        self._change(dict(choice.values))

    def _begin_by_itself(self) -> None:
        """Frames and states of the scene before may still arrive after it is opened, and a scene that is opened again
        has their name: only the newest scene's count."""
        if not self._expected or self.running or not self._session.is_newest:
            return
        opened, frame, settings = self._session.opened_scene, self._session.frame, self._session.settings
        if opened is None or frame is None or frame.coarse or frame.statistics.passes < SEEN:
            return
        state = self._session.status.state
        if state in ("finished", "failed") or not settings.display.automatic or given(settings):
            self._expected = False
        elif state == "rendering":
            self._expected = False
            self._start(opened, asked=False)


def _compiled(opened: Any, settings: Settings) -> bool:
    """Wait a while for what a trial needs. Raises Cancelled."""
    from pmviewer.engine.auto.ready import is_ready

    until = time.monotonic() + COMPILED
    while not is_ready(opened, settings):
        if time.monotonic() > until:
            return False
        check()
        time.sleep(1.0)
    return True
