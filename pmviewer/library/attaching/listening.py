"""The window's side: programs attach to it, and it does what they ask for as it does what its user asks for."""

from __future__ import annotations

import os
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import AuthenticationError
from multiprocessing.connection import Connection, Listener
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import PmviewerError, SettingError
from pmviewer.library.attaching.wire import Message, Place, receive, send, write_place
from pmviewer.library.live import Live
from pmviewer.settings.access import SETTINGS, flat
from pmviewer.version import __version__

if TYPE_CHECKING:  # brings OpenGL along
    from pmviewer.viewer.app import ViewerApp

SLICE = 1.0
"""Seconds after which a request that waits is answered, so that programs can be interrupted and go."""
Answer = tuple[Message, NDArray[np.float32] | None]


@dataclass
class _Open:
    """While the window listens."""

    listener: Listener
    file: Path


class Listening:
    """Lives as long as the window. `begin` opens it to programs of the same user, `end` closes it to them."""

    def __init__(self, app: ViewerApp) -> None:
        self._app, self._live = app, Live(app)
        self._open: _Open | None = None
        self._connections: list[Connection] = []
        self._does: dict[str, Callable[[Message], Answer]] = {
            "hello": self._hello,
            "settings": self._settings,
            "set": self._set,
            "wait": self._wait,
            "picture": self._picture,
            "say": self._say,
            "snapshot": self._snapshot,
            "close": self._close,
        }

    @property
    def is_on(self) -> bool:
        """Whether programs can attach."""
        return self._open is not None

    def toggle(self) -> None:
        """Begin, or end; the log says which."""
        state = self._app.state
        if self.is_on:
            self.end()
            state.say("info", "No program can attach to this window any more.")
            return
        try:
            self.begin()
        except OSError as error:
            state.say("error", f"Programs can't attach to this window: {error}")

    def begin(self) -> None:
        """Listen. Raises OSError."""
        if self._open is not None:
            return
        key = secrets.token_bytes(32)
        listener = Listener(authkey=key)
        try:
            file = write_place(Place(os.getpid(), str(listener.address), key.hex(), time.time()))
        except OSError:
            listener.close()
            raise
        self._open = _Open(listener, file)
        threading.Thread(target=self._accept, args=(self._open,), name="pmviewer listening", daemon=True).start()
        self._app.state.say("info", "Programs of yours can attach to this window: pmviewer.attach() in Python.")

    def end(self) -> None:
        """Listen no more, and let go who is attached."""
        here, self._open = self._open, None
        if here is None:
            return
        here.file.unlink(missing_ok=True)
        here.listener.close()
        while self._connections:
            self._connections.pop().close()

    def closing(self) -> None:
        """The window goes."""
        self._live.open = False
        self.end()

    # threads of their own ---------------------------------------------------------------------------------------

    def _accept(self, here: _Open) -> None:
        while self._open is here:
            try:
                connection = here.listener.accept()
            except AuthenticationError:
                self._app.state.say("warning", "A program without this window's key tried to attach.")
                continue
            except (OSError, EOFError):
                time.sleep(0.05)  # the listener is closed, or who came has gone at once
                continue
            self._connections.append(connection)
            threading.Thread(target=self._serve, args=(connection,), name="pmviewer attached", daemon=True).start()

    def _serve(self, connection: Connection) -> None:
        try:
            while True:
                message, _ = receive(connection)
                answer = self._answer(message)
                send(connection, *answer)
        except (EOFError, OSError, TypeError):  # TypeError: by the connection that `end` has closed meanwhile
            pass  # it has gone, or was let go
        except PmviewerError as error:
            self._app.state.say("warning", f"An attached program was let go. {error}")
        finally:
            connection.close()
            if connection in self._connections:
                self._connections.remove(connection)

    def _answer(self, message: Message) -> Answer:
        """What was asked for, or why not."""
        does = self._does.get(str(message.get("do")))
        try:
            if does is None:
                raise PmviewerError(f"This window (pmviewer {__version__}) does not know '{message.get('do')}'.")
            return does(message)
        except PmviewerError as error:
            return {"error": str(error), "kind": type(error).__name__}, None
        except Exception as error:
            return {"error": f"The window could not do that: {type(error).__name__}: {error}", "kind": ""}, None

    # requests ---------------------------------------------------------------------------------------------------

    def _hello(self, message: Message) -> Answer:
        self._app.state.say("info", f"A program is attached (process {message.get('pid')}).")
        self._app.wake()
        return {"version": __version__, "pid": os.getpid()}, None

    def _settings(self, message: Message) -> Answer:
        values = flat(self._live.settings)
        changed = {path: value for path, value in values.items() if value != SETTINGS[path].default}
        scene = self._app.state.session.scene
        return {"values": changed, "scene": scene.name if scene is not None else None}, None

    def _set(self, message: Message) -> Answer:
        values = message.get("values")
        if not isinstance(values, dict):
            raise SettingError("Settings are given by name.")
        self._live.set({name: tuple(v) if isinstance(v, list) else v for name, v in values.items()})
        return {}, None

    def _wait(self, message: Message) -> Answer:
        passes = message.get("passes")
        shown = self._live.wait(None if passes is None else int(passes), seconds=SLICE)
        failed = self._app.state.session.status
        return {"shown": shown, "failed": failed.text if failed.state == "failed" else None}, None

    def _picture(self, message: Message) -> Answer:
        return {}, self._live.picture(str(message.get("layer", "beauty")))

    def _say(self, message: Message) -> Answer:
        self._live.say(str(message.get("text", "")))
        self._app.wake()
        return {}, None

    def _snapshot(self, message: Message) -> Answer:
        from pmviewer.output.snapshot import read_snapshot

        name = " ".join(str(message.get("name", "")).split())
        snapshot = read_snapshot(Path(str(message.get("path"))))
        put: list[Any] = []
        self._app.state.call(lambda: put.append(self._app.state.snapshots.put(snapshot.renamed(name or snapshot.name))))
        self._app.wake()
        self._live.until(lambda: bool(put))
        if not put or put[0] is None:
            raise PmviewerError("The window has no room for another snapshot: remove one first.")
        return {"number": put[0].number}, None

    def _close(self, message: Message) -> Answer:
        self._app.state.call(self._app.commands.table["quit"])
        self._app.wake()
        return {}, None


def attachable(make: Callable[..., ViewerApp], listens: bool) -> Callable[..., ViewerApp]:
    """Makes windows as `make` does, to which programs can attach at once or when the user allows it (File menu)."""

    def made(*arguments: Any, **options: Any) -> ViewerApp:
        app = make(*arguments, **options)
        listening = Listening(app)
        app.commands.table["listen"] = listening.toggle
        app.state.is_attachable = lambda: listening.is_on
        before = app.params.callbacks.before_exit

        def before_exit() -> None:
            listening.closing()
            before()

        app.params.callbacks.before_exit = before_exit
        if listens:
            listening.toggle()
        return app

    return made
