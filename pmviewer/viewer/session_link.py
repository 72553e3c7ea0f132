"""The window's handle on a session that is still being imported.

Importing the engine takes longer than opening the window, so the window starts with this: it keeps what the user asks
for and hands everything to the real session once that exists.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

from pmviewer.engine.frame import Frame, Message, Status
from pmviewer.engine.inspector.report import Pinned
from pmviewer.errors import PmviewerError
from pmviewer.scene.description import Scene
from pmviewer.settings.access import Settings
from pmviewer.viewer.background import ENGINE, Background


class SessionLike(Protocol):
    """What the window uses of `pmviewer.engine.session.Session`."""

    on_update: Callable[[], None] | None

    @property
    def settings(self) -> Settings:
        """Those that are asked for; frames on their way may have others."""

    @property
    def frame(self) -> Frame | None:
        """The newest one, None before the first."""

    @property
    def is_newest(self) -> bool:
        """Whether the newest frame is of the newest scene and settings, as far as these decide what is rendered, and
        holds what the display asks for. Its own settings may tell another display, or another end."""

    @property
    def status(self) -> Status:
        """What goes on now."""

    @property
    def scene(self) -> Scene | None:
        """The open one, None before the first is loaded."""

    @property
    def scene_path(self) -> str:
        """What the open scene was opened by: a file or a bundled scene's name, "" for none."""

    @property
    def traits(self) -> Any:
        """`SceneTraits` of the open scene, None before it is loaded."""

    @property
    def geometry(self) -> Any:
        """The open scene's surfaces for display, None before it is loaded."""

    @property
    def opened_scene(self) -> Any:
        """The `OpenScene` with all that was derived from it, for renderers beside the session's."""

    @property
    def threads(self) -> int | None:
        """How many the kernels run on, None while the engine is being imported."""

    @property
    def paused(self) -> bool:
        """Whether the user has paused."""

    @property
    def loading(self) -> str:
        """What the loader is doing, "" when nothing is being loaded."""

    def cancel_loading(self) -> None:
        """Give up the scene that is being loaded; the old one stays."""

    @property
    def ahead(self) -> str:
        """What is being compiled ahead, "" when nothing is."""

    def stop_compiling_ahead(self) -> None:
        """Compile nothing ahead until something is changed."""

    def open(
        self,
        source: Any,
        settings: Settings | None = None,
        parameters: Mapping[str, str] | None = None,
        film: Path | None = None,
    ) -> None:
        """Open a scene in the background, with other settings if given; `parameters` replace the file's defaults, and
        `film` is a checkpoint to go on with. A failure becomes a message."""

    @property
    def workers(self) -> Any:
        """Who renders the passes (`pmviewer.engine.pass_maker.PassMaker`), None while the engine is being imported."""

    def autosave(self, path: Path | None) -> None:
        """Keep the film in that file now and then, nowhere with None."""

    def set(self, settings: Settings) -> Any:
        """Use these settings from now on."""

    def pause(self) -> None:
        """Stop after the current pass."""

    def stop(self) -> None:
        """Pause at once, without the pass that is running. Going on begins anew."""

    def resume(self) -> None:
        """Go on after a pause."""

    def restart(self) -> None:
        """Forget the film and begin with pass 0."""

    def inspect(self, pixel: tuple[int, int] | None) -> None:
        """Frames shall hold the gather rays of this pixel (x, y) of the image, of none with None."""

    def pin(self, pinned: Pinned | None) -> None:
        """Frames shall tell what made this pixel, of none with None."""

    def take_messages(self) -> list[Message]:
        """Messages since the last call."""

    def close(self) -> None:
        """Stop the worker and its threads; returns when they are gone."""


class SessionLink(SessionLike):
    """A session that exists once `make` has returned; `make` runs on a thread of its own."""

    def __init__(self, make: Callable[[], SessionLike], settings: Settings | None = None) -> None:
        self.on_update: Callable[[], None] | None = None
        self._make = make
        self._session: SessionLike | None = None
        self._settings = settings or Settings()
        self._source: tuple[str | Path | Scene, Settings | None, Mapping[str, str] | None, Path | None] | None = None
        self._film: Path | None = None
        self._paused = False
        self._closed = False
        self._status = Status("preparing", "starting the engine")
        self._lock = threading.Lock()

    def connect(self, background: Background) -> None:
        """Start making the session."""
        background.start(ENGINE, "starting the engine", self._connect)

    def _connect(self) -> str:
        try:
            session = self._make()
        except Exception as error:  # whatever it is, the window has to show it
            with self._lock:
                self._status = Status("failed", "the engine did not start")
            self._notify()
            raise PmviewerError(f"The engine did not start: {error}") from error
        with self._lock:
            session.on_update = self._notify
            self._session = session
            if self._closed:
                session.close()
                return ""
            session.set(self._settings)
            session.autosave(self._film)
            if self._paused:
                session.pause()
            if self._source is not None:
                session.open(*self._source)
        self._notify()
        return ""

    def _notify(self) -> None:
        if self.on_update:
            self.on_update()

    # requests ---------------------------------------------------------------------------------------------------

    def open(
        self,
        source: str | Path | Scene,
        settings: Settings | None = None,
        parameters: Mapping[str, str] | None = None,
        film: Path | None = None,
    ) -> None:
        with self._lock:
            if self._session is not None:
                self._session.open(source, settings, parameters, film)
                return
            self._source = (source, settings, parameters, film)

    def autosave(self, path: Path | None) -> None:
        with self._lock:
            self._film = path
            if self._session is not None:
                self._session.autosave(path)

    def cancel_loading(self) -> None:
        with self._lock:
            if self._session is not None:
                self._session.cancel_loading()

    def stop_compiling_ahead(self) -> None:
        """What is not there yet compiles nothing."""
        if self._session is not None:
            self._session.stop_compiling_ahead()

    def set(self, settings: Settings) -> None:
        with self._lock:
            self._settings = settings
            if self._session is not None:
                self._session.set(settings)
            elif self._source is not None and self._source[1] is not None:
                self._source = (self._source[0], settings, *self._source[2:])

    def pause(self) -> None:
        with self._lock:
            self._paused = True
            if self._session is not None:
                self._session.pause()

    def stop(self) -> None:
        self.pause()
        with self._lock:
            if self._session is not None:
                self._session.stop()

    def resume(self) -> None:
        with self._lock:
            self._paused = False
            if self._session is not None:
                self._session.resume()

    def restart(self) -> None:
        with self._lock:
            if self._session is not None:
                self._session.restart()

    def inspect(self, pixel: tuple[int, int] | None) -> None:
        with self._lock:
            if self._session is not None:
                self._session.inspect(pixel)

    def pin(self, pinned: Pinned | None) -> None:
        with self._lock:
            if self._session is not None:
                self._session.pin(pinned)

    def close(self) -> None:
        with self._lock:
            self._closed = True
            session = self._session
        if session is not None:
            session.close()

    # state ------------------------------------------------------------------------------------------------------

    @property
    def settings(self) -> Settings:
        if self._session is not None:
            return self._session.settings
        if self._source is not None and self._source[1] is not None:
            return self._source[1]
        return self._settings

    @property
    def frame(self) -> Frame | None:
        return self._session.frame if self._session else None

    @property
    def is_newest(self) -> bool:
        return self._session is not None and self._session.is_newest

    @property
    def status(self) -> Status:
        return self._session.status if self._session else self._status

    @property
    def loading(self) -> str:
        return self._session.loading if self._session else ""

    @property
    def ahead(self) -> str:
        return self._session.ahead if self._session else ""

    @property
    def scene(self) -> Scene | None:
        return self._session.scene if self._session else None

    @property
    def scene_path(self) -> str:
        return self._session.scene_path if self._session else ""

    @property
    def traits(self) -> Any:
        return self._session.traits if self._session else None

    @property
    def geometry(self) -> Any:
        return self._session.geometry if self._session else None

    @property
    def threads(self) -> int | None:
        return self._session.threads if self._session else None

    @property
    def workers(self) -> Any:
        return self._session.workers if self._session else None

    @property
    def opened_scene(self) -> Any:
        return self._session.opened_scene if self._session else None

    @property
    def paused(self) -> bool:
        return self._session.paused if self._session else self._paused

    def take_messages(self) -> list[Message]:
        return self._session.take_messages() if self._session else []
