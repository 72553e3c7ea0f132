"""A file that one process at a time may use, told by a lock beside it, which the system lets go of however the process
ends."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from pmviewer.errors import OutputError

fcntl: Any
msvcrt: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None
    import msvcrt

LOCK = ".lock"
"""Behind the file's name: the lock's."""
_BYTE = 1 << 30
"""Where Windows locks: what is before can be read by others."""


class InUse(OutputError):
    """Another process holds the lock; the text names it."""


class Lock:
    """The lock of a file, or folder, from now on until `release` or the end of the process. Where a file system has no
    locks, everybody gets one."""

    def __init__(self, path: Path, what: str) -> None:
        """what: the file, for the sentence of InUse ("out.checkpoint"). Raises InUse, and OutputError where there can
        be no file beside it."""
        self._path = path.with_name(path.name + LOCK)
        while True:
            try:
                file = self._path.open("a+b", buffering=0)  # on a full disk nothing is left to be written
            except OSError as error:
                raise OutputError(f"{what}: no file can be made beside it ({error.strerror}).") from None
            try:
                _take(file)
            except (BlockingIOError, PermissionError):
                holder = _text(self._path)
                file.close()
                raise InUse(f"{what} is in use{holder}: wait for its end, or name another file.") from None
            except OSError:  # no locks on this file system
                pass
            if _is_at(file, self._path):
                break
            file.close()  # its owner has removed it meanwhile
        with suppress(OSError):
            file.truncate(0)
            file.write(f"process {os.getpid()} on {socket.gethostname()}".encode())
        self._file: IO[bytes] | None = file

    def release(self) -> None:
        """Let go, and remove the lock's file. May be called twice."""
        file, self._file = self._file, None
        if file is None:
            return
        if fcntl is None:
            file.close()  # or it can't be removed
        with suppress(OSError):
            self._path.unlink()
        file.close()


def _take(file: IO[bytes]) -> None:
    if fcntl is not None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    else:
        file.seek(_BYTE)
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)


def _is_at(file: IO[bytes], path: Path) -> bool:
    """Whether the open file is the one of that name."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def _text(path: Path) -> str:
    try:
        named = path.read_bytes()[:200].decode("utf-8", "replace").strip()
    except OSError:
        return ""
    return f" by {named}" if named else " by another process"
