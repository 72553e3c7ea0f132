"""Shared memory, through which the passes of workers on this machine come back, where the system has it (Linux).

Through a socket the sums of a pass are turned, compressed, sent, and turned back, which takes a sixth as long as
rendering them. Here they are written once and added from there. The memory has no name in any folder, so that nothing
is left behind however the processes end; a worker opens it through its owner's descriptor.

Only who gave a segment away takes it back: a worker that is thought lost may still write to its own.
"""

from __future__ import annotations

import mmap
import os
import sys
import uuid
from collections import OrderedDict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.film import Film, Increment

MOST_BYTES = 1 << 29
"""Of all segments together; passes without a segment travel."""
KEPT_OPEN = 16
"""Segments that a worker keeps open."""


@dataclass(frozen=True)
class Handle:
    """A segment of memory of another process: its id, the descriptor there, the name that shows that it is the one."""

    process: int
    descriptor: int
    name: str
    bytes: int


@dataclass(frozen=True)
class Written:
    """What a worker has written there: sums (pixels, columns) float64."""

    pixels: int
    columns: int


class Segment:
    """Memory for one increment, on the side that owns it."""

    def __init__(self, size: int) -> None:
        """size: in bytes. Raises OSError where there is no such memory."""
        name = f"pmviewer-{uuid.uuid4().hex}"
        self._descriptor = os.memfd_create(name)
        try:
            os.ftruncate(self._descriptor, size)
            self._memory = mmap.mmap(self._descriptor, size)
        except BaseException:
            os.close(self._descriptor)
            raise
        self.handle = Handle(os.getpid(), self._descriptor, name, size)

    def increment(self, written: Written) -> Increment:
        """What is there; it is that of the next one once the segment has been given away again."""
        return _increment(self._memory, written)

    def close(self) -> None:
        """The memory goes when the other side has closed it, too."""
        os.close(self._descriptor)
        self._memory.close()


class Segments:
    """Segments for the increments of one film, no more than MOST_BYTES hold."""

    def __init__(self, film: Film) -> None:
        pixels, columns = film.sums.shape
        self._size = pixels * columns * 8
        self._most = MOST_BYTES // self._size if sys.platform == "linux" else 0
        self._free: list[Segment] = []
        self._given = 0

    def take(self) -> Segment | None:
        """A segment that nobody else has, None where there are no more."""
        if self._given >= self._most:
            return None
        try:
            segment = self._free.pop() if self._free else Segment(self._size)
        except (OSError, ValueError):  # no memory of the kind
            self._most = self._given
            return None
        self._given += 1
        return segment

    def give_back(self, segment: Segment | None) -> None:
        """Whoever had it has said what is in it, and that has been used."""
        if segment is not None:
            self._given -= 1
            self._free.append(segment)

    def lose(self, segment: Segment | None) -> None:
        """Whoever had it may still write there: nobody gets it again."""
        if segment is not None:
            self._given -= 1
            segment.close()

    def close(self) -> None:
        """Those that are free go."""
        while self._free:
            self._free.pop().close()


class Writer:
    """The worker's side. Segments of the present run stay open, the latest few."""

    def __init__(self) -> None:
        self._run = ""
        self._open: OrderedDict[str, mmap.mmap] = OrderedDict()

    def write(self, run: str, handle: Handle, increment: Increment) -> Written | None:
        """Write an increment of a whole film there, in the course of `run`; None where that can't be done."""
        if run != self._run:
            self._run = run
            self._open.clear()
        pixels, columns = increment.sums.shape
        written = Written(pixels, columns)
        try:
            memory = self._opened(handle)
        except OSError:
            return None
        if memory is None or pixels * columns * 8 > len(memory):
            return None
        _increment(memory, written).sums[:] = increment.sums
        return written

    def _opened(self, handle: Handle) -> mmap.mmap | None:
        """Raises OSError when it can't be opened. None when it is something else by now: its owner has closed it."""
        memory = self._open.get(handle.name)
        if memory is None:
            descriptor = os.open(f"/proc/{handle.process}/fd/{handle.descriptor}", os.O_RDWR)
            try:
                if handle.name not in os.readlink(f"/proc/self/fd/{descriptor}"):
                    return None
                memory = mmap.mmap(descriptor, handle.bytes)
            finally:
                os.close(descriptor)
            while len(self._open) >= KEPT_OPEN:
                self._open.popitem(last=False)
            self._open[handle.name] = memory
        self._open.move_to_end(handle.name)
        return memory


def _increment(memory: mmap.mmap, written: Written) -> Increment:
    sums: NDArray[np.float64] = np.frombuffer(memory, np.float64, written.pixels * written.columns)
    return Increment(sums.reshape(written.pixels, written.columns))
