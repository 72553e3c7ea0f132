"""Where compiled code is kept, and when it is removed: never while a process uses it.

Each version of Python and numba has a folder of its own. A process that uses one holds a shared lock on a file in it
for as long as it lives (the system lets go of it however the process ends), and nobody removes what he can't lock for
himself alone. Where the system has no such locks, nothing is removed.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from pathlib import Path
from typing import IO, Any

fcntl: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

KEPT_CACHES = 3
"""Of different versions of Python and numba."""

KEPT_DAYS = 14
"""Compiled code that nobody has asked for in so many days is removed."""

LOCK = ".in-use"

_held: list[IO[bytes]] = []
"""Open as long as this process lives."""


def claim(root: Path, name: str) -> Path:
    """The folder `name` in `root`, in use by this process from now on. What nobody uses is removed when it is old or
    there is too much of it. Raises OSError where no folder can be made."""
    folder = root / name
    lock, alone = _locked(folder)
    if alone:
        _remove_unused(folder)
    if lock is not None:
        _share(lock)
        _held.append(lock)
    os.utime(folder)
    others = [p for p in root.iterdir() if p.is_dir() and p != folder]
    for stale in sorted(others, key=lambda p: p.stat().st_mtime, reverse=True)[KEPT_CACHES - 1 :]:
        _remove(stale)
    return folder


def _locked(folder: Path) -> tuple[IO[bytes] | None, bool]:
    """The lock of a folder, which is made if it isn't there, and whether nobody else has it."""
    while True:
        folder.mkdir(parents=True, exist_ok=True)
        if fcntl is None:
            return None, False
        try:
            lock = (folder / LOCK).open("ab")
        except FileNotFoundError:
            continue  # removed between both
        except OSError:
            return None, False
        try:
            alone = _alone(lock)
            if not alone:
                _share(lock)
            if _still_there(lock, folder / LOCK):
                return lock, alone
        except OSError:  # no locks on this file system
            lock.close()
            return None, False
        lock.close()


def _alone(lock: IO[bytes]) -> bool:
    """Take the lock for this process alone, if nobody has it."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _share(lock: IO[bytes]) -> None:
    fcntl.flock(lock, fcntl.LOCK_SH)


def _still_there(lock: IO[bytes], path: Path) -> bool:
    """Whether the locked file is the one of that name: another process may have removed the folder meanwhile."""
    try:
        return os.path.samestat(os.fstat(lock.fileno()), path.stat())
    except FileNotFoundError:
        return False


def _remove_unused(folder: Path) -> None:
    oldest = time.time() - KEPT_DAYS * 86400
    with os.scandir(folder) as entries:  # thousands of them, at each start
        unused = [entry.path for entry in entries if entry.is_dir() and entry.stat().st_mtime < oldest]
    for path in unused:
        shutil.rmtree(path, ignore_errors=True)


def _remove(folder: Path) -> None:
    """Remove a folder that no process uses."""
    if fcntl is None:
        return
    with contextlib.suppress(OSError), (folder / LOCK).open("ab") as lock:
        if _alone(lock):
            shutil.rmtree(folder, ignore_errors=True)
