"""What a process that tries scenes keeps from scene to scene."""

from __future__ import annotations

import atexit
import os
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from pmviewer.bench.agree.mitsuba_client import Mitsuba
from pmviewer.engine.pool import WorkPool

_own: dict[str, Any] = {}
"""What a worker process keeps: its folder, its Mitsuba, its pool of one thread."""


def tools() -> tuple[Path, Mitsuba, WorkPool]:
    """This process's own folder, Mitsuba and pool, made with the first call and closed with the process."""
    if not _own:
        folder = tempfile.TemporaryDirectory(prefix="pmviewer-agree-")
        _own.update(folder=folder, mitsuba=Mitsuba(Path(folder.name)), pool=WorkPool(1))
        atexit.register(_close)
    return Path(_own["folder"].name), _own["mitsuba"], _own["pool"]


def _close() -> None:
    _own["mitsuba"].close()
    _own["pool"].close()
    _own["folder"].cleanup()


def end_with(parent: int) -> None:
    """End this process soon after the one with that number, even if that was killed and could not say goodbye."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
