"""No two processes compile the same function: the second waits for the first and loads what it has saved.

A function is a byte of a file that nobody reads, locked by whoever compiles it; the system lets go of it however the
process ends. Functions that a process holds call one another, so that none can wait in a circle; where the system finds
one all the same, or has no such locks, both compile.
"""

from __future__ import annotations

from pathlib import Path
from typing import IO, Any

fcntl: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None


class Turns:
    """Locks by number (below 2⁶⁰) in a file of `folder`. The file stays open: closing it would let go of all."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / ".compiling"
        self._file: IO[bytes] | None = None
        self._usable = fcntl is not None

    def take(self, number: int) -> bool:
        """Wait until nobody else holds it, and hold it. False without locks: then nobody is waited for."""
        if not self._usable:
            return False
        try:
            if self._file is None:
                self._file = self._path.open("ab")
            fcntl.lockf(self._file, fcntl.LOCK_EX, 1, number)
        except OSError:  # no locks on this file system, or a circle
            return False
        return True

    def give(self, number: int) -> None:
        """Let others have it."""
        if self._file is not None:
            fcntl.lockf(self._file, fcntl.LOCK_UN, 1, number)
