"""The program's side: a window in another process, to change it, read it and put pictures into it."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client, Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from pmviewer import errors
from pmviewer.errors import PmviewerError, SettingError, WindowError
from pmviewer.library.attaching.wire import Message, Place, places, receive, send
from pmviewer.library.names import changed_by
from pmviewer.settings.access import Settings

if TYPE_CHECKING:  # the renderer, which programs that only attach don't need
    from pmviewer.library.frame import RenderedFrame

NOBODY = "No window listens: open one with `pmviewer SCENE --listen`, or allow it in its menu File."
_LOOK_EVERY = 0.2
STARTING = 60.0
"""Seconds for a window to open."""


class Attached:
    """A window that is open in another process, by `pmviewer.attach` or `Rendering.window`. What is set is a step that
    its user can undo. One thread at a time may use it; let it go by `close`, or use it in a `with` statement. Each call
    raises WindowError once the window is closed, or listens no more."""

    def __init__(self, connection: Connection, process: subprocess.Popen[bytes] | None = None) -> None:
        self._connection = connection
        self._process = process
        hello, _ = self._ask({"do": "hello", "pid": os.getpid()})
        self.version, self.pid = str(hello["version"]), int(hello["pid"])

    def __repr__(self) -> str:
        return f"<the window of process {self.pid}>"

    @property
    def settings(self) -> Settings:
        """Those of the window now, whoever has set them."""
        answer, _ = self._ask({"do": "settings"})
        return changed_by(Settings(), answer["values"])

    @property
    def scene(self) -> str | None:
        """Name of the scene that is open in it, None while there is none yet."""
        answer, _ = self._ask({"do": "settings"})
        return answer["scene"]

    def set(self, values: Mapping[str, Any] | None = None, /, **more: Any) -> None:
        """Change settings as `Rendering.set` does. Returns when the window has taken them. Raises SettingError, and
        changes nothing then."""
        self._ask({"do": "set", "values": {**(values or {}), **more}})

    def wait(self, passes: int | None = None, seconds: float | None = None) -> bool:
        """Until the window shows the settings as they are, with so many passes or finished. False after so many
        seconds. Raises PmviewerError where nothing can be rendered."""
        end = None if seconds is None else time.monotonic() + seconds
        while True:
            answer, _ = self._ask({"do": "wait", "passes": passes})
            if answer["shown"]:
                return True
            if answer["failed"]:
                raise PmviewerError(f"The window renders nothing: {answer['failed']}")
            if end is not None and time.monotonic() >= end:
                return False

    def picture(self, layer: str = "beauty") -> NDArray[np.float32] | None:
        """A layer of the picture that is shown, (h, w, c) float32 in W/(m² sr), None before the first."""
        return self._ask({"do": "picture", "layer": layer})[1]

    def show(self, picture: RenderedFrame | NDArray[Any], name: str = "from Python") -> int:
        """Put a rendered frame, with its settings and figures, or an image (h, w, 3) of radiance into the window's
        strip of snapshots, in the place of an earlier one of that name; returns its number there, by which it is
        compared: `w.set({"compare.mode": "wipe", "compare.b": str(number)})`. Raises SettingError for what is no
        picture."""
        with tempfile.TemporaryDirectory(prefix="pmviewer-") as folder:
            path = Path(folder) / "picture.exr"
            if hasattr(picture, "save"):
                picture.save(path)
            else:
                from pmviewer.output.exr import BEAUTY, write_exr

                image = np.asarray(picture, np.float32)
                if image.ndim != 3 or image.shape[2] != 3 or min(image.shape) < 1:
                    raise SettingError(f"A picture is an array (h, w, 3), not {image.shape}.")
                write_exr(path, {BEAUTY: image}, {})
            answer, _ = self._ask({"do": "snapshot", "path": str(path), "name": name})
        return int(answer["number"])

    def say(self, text: str) -> None:
        """A line for the window's log."""
        self._ask({"do": "say", "text": text})

    def quit(self) -> None:
        """Close the window, as its user would."""
        self._ask({"do": "close"})
        self.close()
        if self._process is not None:
            self._process.wait()

    def close(self) -> None:
        """Let the window go; it stays open."""
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ask(self, message: Message) -> tuple[Message, NDArray[np.float32] | None]:
        try:
            send(self._connection, message)
            answer, array = receive(self._connection)
        except TypeError as error:
            raise SettingError(str(error)) from error
        except (EOFError, OSError) as error:
            raise WindowError("The window is closed, or listens no more.") from error
        if "error" in answer:
            raise _error(str(answer.get("kind")), str(answer["error"]))
        return answer, array


def _error(kind: str, text: str) -> PmviewerError:
    """Of the kind that it was in the window."""
    known = getattr(errors, kind, PmviewerError)
    is_one = isinstance(known, type) and issubclass(known, PmviewerError)
    return known(text) if is_one else PmviewerError(text)


def attach(pid: int | None = None) -> Attached:
    """To the window of that process, or to the one that has begun to listen last. Raises WindowError."""
    for path, place in places():
        if pid is not None and place.pid != pid:
            continue
        connection = _connected(path, place)
        if connection is not None:
            return Attached(connection)
    raise WindowError(NOBODY if pid is None else f"The window of process {pid} does not listen. {NOBODY}")


def opened(arguments: Sequence[str]) -> Attached:
    """A window in a process of its own, by these arguments of the command line, attached. Raises WindowError."""
    command = [sys.executable, "-m", "pmviewer", "view", *arguments, "--listen"]
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=said)
        end = time.monotonic() + STARTING
        while time.monotonic() < end and process.poll() is None:
            for path, place in places():
                connection = _connected(path, place) if place.pid == process.pid else None
                if connection is not None:
                    return Attached(connection, process)
            time.sleep(_LOOK_EVERY)
        if process.poll() is None:
            process.terminate()
            raise WindowError(f"The window did not open within {STARTING:.0f} s.")
        said.seek(0)
        lines = said.read().decode(errors="replace").strip().splitlines()
        raise WindowError(f"The window did not open: {lines[0] if lines else 'it ended at once'}")


def _connected(path: Path, place: Place) -> Connection | None:
    """To that window; None where there is none any more, whose file is removed."""
    try:
        return Client(place.address, authkey=bytes.fromhex(place.key))
    except (FileNotFoundError, ConnectionRefusedError):
        path.unlink(missing_ok=True)
    except (OSError, EOFError, ValueError, AuthenticationError):
        pass
    return None
