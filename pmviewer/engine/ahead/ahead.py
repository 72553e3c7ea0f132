"""What a session compiles ahead of time, in one helping process at a time, behind everything else.

While a scene is being opened for the first time it is the eye pass (`beside`). When the picture has been up for a while
and nothing was asked for, it is what a click would need, once for each state of the settings.
"""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pmviewer.engine import prepare as prepare_module
from pmviewer.engine.ahead.beside import compile_beside
from pmviewer.engine.ahead.helper import Helper
from pmviewer.engine.ahead.requests import Clicks
from pmviewer.engine.opened import OpenScene
from pmviewer.kernels.compile.jit import CACHE_FOLDER
from pmviewer.kernels.compile.sources import stamp
from pmviewer.progress import available_threads
from pmviewer.scene.analysis import SceneTraits
from pmviewer.scene.miniature import miniature
from pmviewer.settings.access import SETTINGS, Settings, get

QUIET = 10.0
"""Seconds without a change after which it begins."""


class Ahead:
    """`text` says what is being compiled, "" when nothing is. `on_change` is called from any thread."""

    def __init__(
        self,
        threads: int | None,
        on_change: Callable[[], None],
        early: Helper | None = None,
        *,
        clicks: bool = True,
    ) -> None:
        """early: a process that waits to be asked (`early`), ended here if it is not needed; clicks: whether there will
        be any."""
        self._threads = threads or available_threads()
        self._on_change = on_change
        self._lock = threading.Lock()
        self._early = early
        self._helper: Helper | None = None
        self._timer: threading.Timer | None = None
        self._waiting: tuple[int, str] | None = None
        self._clicks = clicks
        self._closed = False

    @property
    def text(self) -> str:
        """ "nearest (3 of 20)"; while a first picture is prepared the session's own state tells."""
        helper = self._helper
        progress = helper.progress if helper is not None else None
        if progress is None:
            return ""
        return f"{progress.text or 'this method'} ({progress.part} of {progress.of})"

    def opening(self, of_record: np.dtype, traits: SceneTraits, settings: Settings) -> None:
        """A scene with such a record is being opened."""
        with self._lock:
            if not self._closed:
                self._end()
                early, self._early = self._early, None
                self._helper = compile_beside(early, of_record, traits, settings, self._threads)

    def shown(self, opened: OpenScene, settings: Settings) -> None:
        """The picture of these settings is up: what a click would need comes next, once it is quiet."""
        state = opened.uid, _words(settings)
        with self._lock:
            wanted = self._clicks and settings.display.compile_ahead
            if self._closed or state == self._waiting or not wanted:
                return
            self._forget()
            self._waiting = state
            self._timer = threading.Timer(QUIET, self._begin, (state, opened, settings))
            self._timer.daemon = True
            self._timer.start()

    def stop(self) -> None:
        """Compile nothing ahead for the state that is shown."""
        with self._lock:
            self._forget()
            self._end()

    def close(self) -> None:
        """End all work."""
        self._closed = True
        self.stop()
        if self._early is not None:
            self._early.stop()

    def _begin(self, state: tuple[int, str], opened: OpenScene, settings: Settings) -> None:
        """On the timer's thread."""
        of_record = opened.flat.record.dtype
        done = finished_mark(of_record, settings)
        if done.exists():
            return
        before = self._helper
        if before is not None:
            before.wait()
        request = Clicks(miniature(opened.scene), of_record, settings)
        with self._lock:
            if self._closed or state != self._waiting:
                return
            helper = self._helper = Helper()
            helper.ask(request, self._on_change)
        helper.wait()
        if helper.finished:
            mark(done)

    def _forget(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = None

    def _end(self) -> None:
        if self._helper is not None:
            self._helper.stop()
        self._helper = None


def finished_mark(of_record: np.dtype, settings: Settings) -> Path:
    """The file that tells that all clicks from these settings of such a scene are compiled. It lies with the compiled
    code of these sources and is removed like that (`pmviewer.kernels.compile.cache_folder`)."""
    told = hashlib.sha256(f"{of_record}{_words(settings)}".encode()).hexdigest()[:16]
    return CACHE_FOLDER / f"ahead-{stamp(Path(prepare_module.__file__).resolve())}" / told


def mark(path: Path) -> None:
    """Make the mark; without it the work is looked through again."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    except OSError:
        return


def _words(settings: Settings) -> str:
    """The settings that choose between things. Numbers rarely decide what is compiled, and change all the time."""
    chosen = [info.path for info in SETTINGS.values() if info.choices or info.kind is bool]
    return " ".join(f"{path}={get(settings, path)}" for path in chosen)
