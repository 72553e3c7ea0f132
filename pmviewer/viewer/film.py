"""The film of the window: its keys, where it stands, playing it, and its export beside the session."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pmviewer.engine.frame import Level
from pmviewer.errors import PmviewerError, SettingError
from pmviewer.settings.access import SETTINGS, Settings, flat, get, with_values
from pmviewer.settings.film import LONGEST, FilmKey, FilmWay, in_films
from pmviewer.viewer.background import FILMS, Background, Work
from pmviewer.viewer.history import History, Keys
from pmviewer.viewer.session_link import SessionLike

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.engine.pool import WorkPool

FORMATS = (".webp", ".gif", ".mp4", ".png")
"""The last one: numbered pictures."""
APART = 2.0
"""Seconds from the last key to one that is added where there is one already."""
MOST_KEYS = 100


@dataclass
class Export:
    """What the exported film is like; `passes` for each picture."""

    format: str = ".webp"
    fps: float = 24.0
    passes: int = 16


class FilmEditor:
    """Lives as long as the window, whose thread calls everything. `keys` are sorted by time."""

    def __init__(
        self,
        session: SessionLike,
        history: History,
        change: Callable[[dict[str, Any]], None],
        background: Background,
        say: Callable[[Level, str], None],
    ) -> None:
        self.keys: Keys = ()
        self.at = 0.0
        """Seconds at which the film stands."""
        self.export_as = Export()
        self.progress: tuple[str, float] = ("", 0.0)
        self.on_update: Callable[[], None] | None = None
        self._session = session
        self._history = history
        self._change = change
        self._background = background
        self._say = say
        self._way: tuple[Keys, Any, FilmWay | str] | None = None
        self._played: tuple[Settings, Settings, float] | None = None
        """While it plays: the settings before, those set last, and when that was."""
        self._work: Work | None = None
        history.on_film = self._restore

    # keys -------------------------------------------------------------------------------------------------------

    def add(self) -> None:
        """A key of the settings as they are, where the film stands; where there is one already, behind the last."""
        if self._session.scene is None:
            self._say("warning", "There is nothing to film yet: open a scene first.")
        elif len(self.keys) >= MOST_KEYS:
            self._say("warning", f"A film has {MOST_KEYS} keys at most: remove one first.")
        else:
            at = self.at if self.key_here() is None else min(self.keys[-1].at + APART, LONGEST)
            self.at = at
            self._put((*(k for k in self.keys if k.at != at), FilmKey(at, self._session.settings)), "add a key")

    def replace(self, number: int) -> None:
        """That key gets the settings as they are."""
        new = replace(self.keys[number], settings=self._session.settings)
        self._put((*self.keys[:number], new, *self.keys[number + 1 :]), f"replace key {number + 1}")

    def remove(self, number: int) -> None:
        """Drop that key."""
        self._put((*self.keys[:number], *self.keys[number + 1 :]), f"remove key {number + 1}")

    def move(self, number: int, at: float) -> int:
        """Give that key another time, unless one is there; returns its number then."""
        key = replace(self.keys[number], at=round(min(max(at, 0.0), LONGEST), 3))
        others = (*self.keys[:number], *self.keys[number + 1 :])
        if all(other.at != key.at for other in others):
            self._put((*others, key), "move a key")
            self.at = key.at
        return next(n for n, one in enumerate(self.keys) if one.settings is key.settings)

    def key_here(self) -> int | None:
        """Number of the key where the film stands, None between keys."""
        return next((n for n, key in enumerate(self.keys) if abs(key.at - self.at) < 1e-3), None)

    def take(self, keys: Keys) -> None:
        """Of another scene: these, which are no step to undo."""
        self.stop()
        self.keys, self.at = keys, keys[0].at if keys else 0.0

    def _put(self, keys: Keys, label: str) -> None:
        before, self.keys = self.keys, tuple(sorted(keys, key=lambda key: key.at))
        self._history.film_changed(before, self.keys, label)

    def _restore(self, keys: Keys) -> None:
        self.keys = keys

    # looking at it ----------------------------------------------------------------------------------------------

    @property
    def length(self) -> float:
        """Seconds from the first key to the last."""
        return self.keys[-1].at - self.keys[0].at if self.keys else 0.0

    def way(self) -> FilmWay | str:
        """The way through the keys, or why there is none."""
        opened = self._session.opened_scene
        if opened is None or opened.whole is None or not self.keys:
            return "There is no key yet."
        if self._way is None or self._way[0] is not self.keys or self._way[1] is not opened.whole:
            from pmviewer.engine.series.keys import film_way

            found: FilmWay | str
            try:
                found = film_way(opened.scene, opened.whole, self.keys)
            except PmviewerError as error:
                found = str(error)
            self._way = self.keys, opened.whole, found
        return self._way[2]

    def go(self, at: float) -> None:
        """Show the film at that time: camera, edits and settings become those there."""
        self.stop()
        self.at = min(max(at, 0.0), LONGEST)
        settings = self._settings_at(self.at)
        if settings is not None:
            before = flat(self._session.settings)
            self._change({path: value for path, value in flat(settings).items() if value != before[path]})

    def _settings_at(self, at: float) -> Settings | None:
        way, here = self.way(), self.key_here()
        if isinstance(way, str):
            if here is None:
                return None
            key = self.keys[here].settings  # what can't be gone through can be gone to
            return with_values(self._session.settings, {p: get(key, p) for p in SETTINGS if in_films(p)})
        try:
            return way.at(at, self._session.settings)
        except SettingError as error:
            self._say("error", str(error))
            return None

    @property
    def playing(self) -> bool:
        """Whether it goes by itself."""
        return self._played is not None

    def play(self) -> None:
        """From where it stands, from the first key when that is the end; over and over until `stop`."""
        way = self.way()
        if isinstance(way, str) or self.length <= 0:
            self._say("warning", way if isinstance(way, str) else "A film needs two keys at least.")
            return
        if not self.keys[0].at <= self.at < self.keys[-1].at:
            self.at = self.keys[0].at
        self._played = self._session.settings, self._session.settings, time.monotonic()

    def stop(self) -> None:
        """Stand still; all that playing has changed is one step to undo."""
        played, self._played = self._played, None
        if played is not None and self._session.settings != played[0]:
            self._history.gesture += 1
            self._history.changed(played[0], self._session.settings)

    def poll(self) -> None:
        """Once per window frame."""
        if self._played is None:
            return
        first, last, then = self._played
        if self._session.settings != last or not self.keys or self.length <= 0:
            self.stop()  # somebody else has changed something
            return
        now = time.monotonic()
        start, end = self.keys[0].at, self.keys[-1].at
        self.at = self.at + now - then
        if self.at > end:
            self.at = start + (self.at - start) % (end - start)
        settings = self._settings_at(self.at)
        if settings is None:
            self.stop()
            return
        if settings != last:
            self._session.set(settings)
        self._played = first, settings, now

    # export -----------------------------------------------------------------------------------------------------

    @property
    def exporting(self) -> bool:
        """Whether a film is being rendered now."""
        return self._work is not None and self._work.running

    def count(self) -> int:
        """How many pictures the film has."""
        return max(round(self.length * self.export_as.fps), 1) + 1 if self.keys else 0

    def refusal(self) -> str | None:
        """Why there is nothing to export, None if there is."""
        way = self.way()
        if isinstance(way, str):
            return way
        return "A film needs two keys at least." if len(self.keys) < 2 else None

    def export(self, path: Path) -> None:
        """Render the film beside the session and write it."""
        way, why = self.way(), self.refusal()
        if self.exporting or why is not None or isinstance(way, str):
            if why is not None:
                self._say("warning", f"No film: {why}")
            return
        from pmviewer.engine.pool import WorkPool

        how, opened = replace(self.export_as), self._session.opened_scene
        fixed = {"render.passes": how.passes, "compare.mode": "off", "free_camera.on": False, "region.on": False}
        try:
            pictures = way.pictures(how.fps, with_values(self._session.settings, fixed))
        except SettingError as error:
            self._say("error", str(error))
            return
        pool = WorkPool(self._session.threads, behind_window=True)
        self.progress = "starting", 0.0
        self._work = self._background.start(
            FILMS, "rendering the film", lambda: self._run(path, how, opened, pictures, pool), stop=pool.cancel.set
        )

    def cancel(self) -> None:
        """Give the film up: nothing is written but numbered pictures that are there already."""
        if self._work is not None:
            self._work.cancel()

    def _run(self, path: Path, how: Export, opened: Any, pictures: list[Settings], pool: WorkPool) -> str:
        from pmviewer.engine.pool import lower_priority
        from pmviewer.engine.series.keys import with_one_radius
        from pmviewer.engine.series.render import series
        from pmviewer.output.film import Film, numbered
        from pmviewer.output.frame_export import shown_pixels, write_frame_png
        from pmviewer.output.tone import to_uint8

        lower_priority()
        film = None
        try:
            film = Film(path, how.fps) if path.suffix.lower() != ".png" else None
            pictures = with_one_radius(opened, pictures)
            for number, frame in enumerate(series(opened, pictures, pool, self._tell), 1):
                if film is None:
                    write_frame_png(numbered(path, number, len(pictures)), frame)
                else:
                    display = frame.settings.display
                    film.add(to_uint8(shown_pixels(frame, display.view, display)))
            if film is not None:
                film.close()
        except MemoryError:
            raise PmviewerError("Not enough memory for the film: lower N or the image size.") from None
        except BaseException:
            if film is not None:
                film.drop()
            raise
        finally:
            pool.close()
        where = path if film is not None else numbered(path, 1, len(pictures))
        return f"wrote {where.absolute()}: {len(pictures)} pictures, {(len(pictures) - 1) / how.fps:.3g} s"

    def _tell(self, text: str, share: float) -> None:
        self.progress = text, share
        if self._work is not None:
            self._work.share = share
        if self.on_update:
            self.on_update()
