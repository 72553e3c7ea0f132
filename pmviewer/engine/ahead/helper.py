"""A helping process as its parent sees it."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmviewer.kernels.compile.sources import PACKAGE

if TYPE_CHECKING:  # takes time
    from pmviewer.engine.ahead.requests import Request


@dataclass(frozen=True)
class Progress:
    """The part being compiled, of so many; `text` names it."""

    part: int
    of: int
    text: str


class Helper:
    """A process that works on one request and is ended with `stop`, or when this process ends. `finished` tells whether
    all was done."""

    def __init__(self) -> None:
        """It begins to import what it needs."""
        self.progress: Progress | None = None
        self.finished = False
        paths = [str(PACKAGE.parent), os.environ.get("PYTHONPATH", "")]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "pmviewer.engine.ahead.child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        )
        self._thread: threading.Thread | None = None

    def ask(self, request: Request, on_change: Callable[[], None] = lambda: None) -> None:
        """Give it its work, once. `on_change` is called on a thread of its own."""
        arguments = request, on_change
        self._thread = threading.Thread(target=self._talk, args=arguments, name="pmviewer ahead", daemon=True)
        self._thread.start()

    def wait(self) -> None:
        """Until it has done what it was asked for."""
        if self._thread is not None:
            self._thread.join()

    def stop(self) -> None:
        """End it now; what it was compiling is lost."""
        self._process.kill()
        self._process.wait()
        self.wait()
        self._close()

    def _talk(self, request: Request, on_change: Callable[[], None]) -> None:
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        with contextlib.suppress(OSError):  # it died, and is not missed
            pickle.dump(request, process.stdin)
            process.stdin.flush()
        for line in process.stdout:
            said = json.loads(line)
            self.finished = self.finished or "done" in said
            self.progress = Progress(said["part"], said["of"], said["text"]) if "part" in said else None
            on_change()
        self._close()
        self.progress = None
        on_change()

    def _close(self) -> None:
        with contextlib.suppress(OSError), self._process:  # closes its pipes, whatever was not read any more
            pass
