"""Work beside the window: on guarded threads, whose errors become one sentence in the log, and which end with the
window.

Whatever the window does that may take longer than a frame goes through `Background.start`: files that are written,
references that are read and measured, the comparison with and without importance, starting the engine.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from pmviewer.engine.frame import Level
from pmviewer.errors import PmviewerError
from pmviewer.progress import Cancelled, watched

PATIENCE = 0.5
"""Seconds for which a closing window waits for work that nobody needs any more."""


@dataclass(frozen=True)
class Lane:
    """Work of one lane is done one piece after the other.

    kept: what the user has asked for is finished even when the window closes (files that are written); other work is
    cancelled then
    shown: the status bar tells of it
    """

    name: str
    kept: bool = False
    shown: bool = False


FILES = Lane("files", kept=True, shown=True)
FILMS = Lane("films", shown=True)
READING = Lane("reading", shown=True)
MEASURING = Lane("measuring")
COMPARING = Lane("comparing")
DIFFERENCES = Lane("differences")
COUNTING = Lane("counting")
LINKING = Lane("linking")
CHOOSING = Lane("choosing", shown=True)
ENGINE = Lane("engine")


def _nothing() -> str:
    return ""


@dataclass(eq=False)
class Work:
    """One piece of work. `stop` is called when it is cancelled; work that calls `pmviewer.progress.check` needs none.
    Everything may be asked from any thread. Work that is done has let go of what it was done with."""

    title: str
    lane: Lane
    do: Callable[[], str]
    stop: Callable[[], None] | None = None
    started: float = field(default_factory=time.monotonic)
    cancelled: bool = field(default=False, init=False)
    share: float | None = field(default=None, init=False)
    """How far it is, where it tells."""
    done: threading.Event = field(default_factory=threading.Event, init=False)

    @property
    def running(self) -> bool:
        """Whether it is under way, or waits for its turn."""
        return not self.done.is_set()

    @property
    def seconds(self) -> float:
        """Since it was started."""
        return time.monotonic() - self.started

    def cancel(self) -> None:
        """Ask it to end; work that waits for its turn is never begun."""
        self.cancelled, stop = True, self.stop
        if stop is not None and self.running:
            stop()


class Background:
    """Lives as long as the window. `say` gets each result or error as a line for the log, `on_done` hears when
    something has ended."""

    def __init__(self, say: Callable[[Level, str], None]) -> None:
        self.on_done: Callable[[], None] | None = None
        self._say = say
        self._lock = threading.Lock()
        self._lanes: dict[Lane, deque[Work]] = {}
        """What each lane has to do, the piece under way first."""
        self._closed = False

    def start(self, lane: Lane, title: str, do: Callable[[], str], *, stop: Callable[[], None] | None = None) -> Work:
        """Have `do` done on the lane's thread. The text it returns, unless empty, goes to the log, and so does the one
        sentence of its error. In a window that is closing nothing begins any more but what is kept."""
        return self.take(Work(title, lane, do, stop))

    def take(self, work: Work) -> Work:
        """The same for work that is made already."""
        lane = work.lane
        with self._lock:
            if self._closed and not lane.kept:
                work.cancelled = True
                work.done.set()
                return work
            queue = self._lanes.setdefault(lane, deque())
            queue.append(work)
            if len(queue) == 1:
                thread = threading.Thread(target=self._serve, args=(queue,), name=f"pmviewer {lane.name}", daemon=True)
                thread.start()
        return work

    def running(self, lane: Lane | None = None) -> list[Work]:
        """What is under way or waits, of one lane or of all."""
        with self._lock:
            queues = list(self._lanes.values()) if lane is None else [self._lanes.get(lane, deque())]
            return [work for queue in queues for work in queue]

    def _serve(self, queue: deque[Work]) -> None:
        """Do what is in the queue, then end."""
        while True:
            with self._lock:
                work = queue[0]
            if not work.cancelled:
                self._guard(work)
            with self._lock:
                queue.popleft()
                work.do, work.stop = _nothing, None
                work.done.set()
                last = not queue
            if self.on_done:
                self.on_done()
            if last:
                return

    def _guard(self, work: Work) -> None:
        try:
            with watched(unwanted=lambda: work.cancelled):
                text = work.do()
            if text:
                self._say("info", text)
        except Cancelled:
            self._say("info", f"{work.title}: cancelled.")
        except (PmviewerError, OSError) as error:
            self._say("error", str(error))
        except MemoryError:
            self._say("error", f"{work.title}: not enough memory.")
        except Exception as error:
            self._say("error", f"{work.title}: unexpected {type(error).__name__}: {error}")

    def finish(self, patience: float = PATIENCE) -> bool:
        """The window closes: wait until everything that is kept is done, cancel the rest and wait for that `patience`
        seconds. True when nothing is under way any more."""
        with self._lock:
            self._closed = True
        self.on_done = None
        works = self.running()
        for work in works:
            if not work.lane.kept:
                work.cancel()
        for work in works:
            if work.lane.kept:
                work.done.wait()
        end = time.monotonic() + patience
        return all(work.done.wait(max(end - time.monotonic(), 0.0)) for work in works)
