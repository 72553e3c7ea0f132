"""Session and film on disk while the window is open, and what a window that crashed has left there.

Each window has a folder of its own with a lock, which the system lets go of however the process ends: what lies in a
folder that nobody holds was left by a crash. The window writes the session (`session.toml`, snapshots), the engine the
film (`film.checkpoint`). A window that is closed removes its folder.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pmviewer.errors import OutputError, PmviewerError
from pmviewer.output.checkpoint_header import Header, read_header
from pmviewer.output.locked import Lock
from pmviewer.settings.film import FilmKey
from pmviewer.viewer.background import READING, Background, Lane
from pmviewer.viewer.session_link import SessionLike
from pmviewer.viewer.snapshots import Snapshots

if TYPE_CHECKING:  # brings OpenEXR along, which the window doesn't wait for
    from pmviewer.output.snapshot import Snapshot

SESSION, FILM = "session.toml", "film.checkpoint"
AUTOSAVING = Lane("autosave")
KEPT, KEPT_DAYS = 3, 30
"""Folders that crashes have left, and for how long; others are removed."""


@dataclass(frozen=True, eq=False)
class Left:
    """What a crash has left in a folder, whose lock is held: the scene's name, when it was written (seconds of the
    epoch), and what its film tells, None where there is none."""

    folder: Path
    lock: Lock
    scene: str
    when: float
    film: Header | None


class Autosave:
    """Of one window; `root` holds the folders of all of them, None keeps nothing. `left` is the newest that a crash has
    left, until somebody decides about it."""

    def __init__(self, root: Path | None, session: SessionLike, background: Background) -> None:
        self._root, self._session, self._background = root, session, background
        self._folder: Path | None = None
        self._lock: Lock | None = None
        self._at = time.monotonic()
        self._kept: tuple[Any, ...] | None = None
        self._written: dict[Path, Snapshot] = {}
        self.left: Left | None = None

    def begin(self) -> None:
        """Take a folder, and look for what was left. A folder that can't be made keeps nothing."""
        if self._root is None:
            return
        with contextlib.suppress(OSError, OutputError):
            self._root.mkdir(parents=True, exist_ok=True)
            self._look(self._root)
            folder = self._root / f"{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}"
            folder.mkdir()
            self._take(folder, Lock(folder / "window", "the autosave"))

    def _take(self, folder: Path, lock: Lock) -> None:
        self._folder, self._lock = folder, lock
        self._session.autosave(folder / FILM)

    def _look(self, root: Path) -> None:
        """Find what was left: the newest is offered, the oldest and what holds nothing is removed."""
        folders = sorted((path for path in root.iterdir() if path.is_dir()), key=_time_of, reverse=True)
        found = 0
        for folder in folders:
            try:
                lock = Lock(folder / "window", "the autosave")
            except OutputError:
                continue  # another window's
            good = (folder / SESSION).is_file() and time.time() - _time_of(folder) < KEPT_DAYS * 86400
            found += good
            if not good or found > KEPT:
                _remove(folder, lock)
            elif self.left is None:
                self.left = _left(folder, lock)
            else:
                lock.release()

    def poll(self, parameters: dict[str, str], snapshots: Snapshots, film: tuple[FilmKey, ...], passes: int) -> None:
        """Once per window frame: write the session, if it has changed and it is time."""
        settings, scene = self._session.settings, self._session.scene_path
        interval, folder = settings.display.autosave, self._folder
        if folder is None or interval <= 0 or self._session.scene is None or time.monotonic() - self._at < interval:
            return
        if self._background.running(READING) or self._background.running(AUTOSAVING):
            return  # snapshots that are still being read would be missing
        now = settings, scene, dict(parameters), snapshots.version, film
        self._at = time.monotonic()
        if now == self._kept:
            return
        self._kept, pictures = now, tuple(snapshots.all)

        def work() -> str:
            from pmviewer.engine.pool import lower_priority
            from pmviewer.output.session_file import write_session

            lower_priority()  # nobody waits for it, and the window shall go on
            write_session(folder / SESSION, settings, scene, passes, parameters, pictures, film, self._written)
            return ""

        self._background.start(AUTOSAVING, "autosave", work)

    def restore(self) -> tuple[Path, Path | None]:
        """The session file that was left, and its film; from now on they are this window's."""
        left, self.left = self.left, None
        assert left is not None
        self._remove_own()
        self._take(left.folder, left.lock)
        self._at = time.monotonic()
        return left.folder / SESSION, left.folder / FILM if left.film is not None else None

    def discard(self) -> None:
        """Remove what was left."""
        left, self.left = self.left, None
        if left is not None:
            _remove(left.folder, left.lock)

    def leave(self) -> None:
        """Decide nothing: the next window offers it again."""
        left, self.left = self.left, None
        if left is not None:
            left.lock.release()

    def end(self) -> None:
        """The window was closed properly: nothing is kept of it."""
        self.leave()
        if self._folder is not None:
            self._session.autosave(None)
        self._remove_own()

    def _remove_own(self) -> None:
        if self._folder is not None and self._lock is not None:
            _remove(self._folder, self._lock)
        self._folder = self._lock = None


def _left(folder: Path, lock: Lock) -> Left:
    """What is there; a film that can't be read is none."""
    film: Header | None = None
    with contextlib.suppress(PmviewerError):
        film = read_header(folder / FILM)
    scene = film.scene_name if film is not None else _scene_of(folder / SESSION)
    return Left(folder, lock, scene, _time_of(folder), film)


def _scene_of(session: Path) -> str:
    from pmviewer.output.session_file import read_session

    try:
        return Path(read_session(session).scene).stem
    except PmviewerError:
        return "a scene"


def _time_of(folder: Path) -> float:
    """When something was written there last."""
    times = [0.0]
    for path in (folder, folder / SESSION, folder / FILM):
        with contextlib.suppress(OSError):
            times.append(path.stat().st_mtime)
    return max(times)


def _remove(folder: Path, lock: Lock) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    lock.release()
