"""Automatic mode in the window: the trial runs beside the session, and what it picks is one change to undo."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pmviewer.engine.frame import Level
from pmviewer.errors import PmviewerError
from pmviewer.viewer.background import CHOOSING, Background, Work
from pmviewer.viewer.session_link import SessionLike

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.engine.auto.choose import Choice


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
        self._arrived: tuple[Any, Choice] | None = None

    @property
    def running(self) -> bool:
        """Whether a trial is under way."""
        return self._work is not None and self._work.running

    def start(self) -> None:
        """Begin a trial of the open scene, or cancel the one that runs."""
        if self.running:
            assert self._work is not None
            self._work.cancel()
            return
        opened, settings = self._session.opened_scene, self._session.settings
        if opened is None:
            self._say("warning", "Open a scene first: automatic mode tries ways of rendering it.")
            return
        from pmviewer.engine.pool import WorkPool

        pool = WorkPool(self._session.threads, behind_window=True)
        seconds, error = settings.render.time_limit * pool.threads, settings.render.error

        def choose_beside() -> str:
            from pmviewer.engine.auto.choose import Goal, choose
            from pmviewer.engine.pool import lower_priority

            lower_priority()
            try:
                self._arrived = opened, choose(opened, settings, Goal(seconds, error), pool, lambda text, share: None)
            except MemoryError:
                raise PmviewerError("Not enough memory to try ways of rendering: lower the image size.") from None
            finally:
                pool.close()
            return ""

        title = "trying ways of rendering"
        self._work = self._background.start(CHOOSING, title, choose_beside, stop=pool.cancel.set)

    def poll(self) -> None:
        """Once per window frame: take over what was picked, unless another scene is open by now."""
        if self._arrived is None:
            return
        (opened, choice), self._arrived = self._arrived, None
        if self._session.opened_scene is not opened:
            return
        for number, sentence in enumerate(choice.sentences):
            self._say("info", f"automatic: {sentence}" if number == 0 else f"  {sentence}")
        self._change(dict(choice.values))
