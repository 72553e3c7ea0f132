"""Slow work of the window (writing files) on a thread of its own, so that the interface never waits."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from pmviewer.engine.frame import Level
from pmviewer.errors import PmviewerError


@dataclass
class Job:
    title: str
    started: float = field(default_factory=time.monotonic)

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.started


class Jobs:
    """Runs one job after the other. `say` gets each job's result or error as a line for the log."""

    def __init__(self, say: Callable[[Level, str], None]) -> None:
        self._say = say
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="pmviewer export")
        self._lock = threading.Lock()
        self._running: list[Job] = []
        self.on_done: Callable[[], None] | None = None

    @property
    def running(self) -> list[Job]:
        with self._lock:
            return list(self._running)

    def start(self, title: str, work: Callable[[], str]) -> None:
        """Run `work`; the text it returns, unless empty, goes to the log, and so does the one sentence of its error."""
        job = Job(title)
        with self._lock:
            self._running.append(job)
        self._executor.submit(self._run, job, work)

    def _run(self, job: Job, work: Callable[[], str]) -> None:
        try:
            text = work()
            if text:
                self._say("info", text)
        except (PmviewerError, OSError) as error:
            self._say("error", str(error))
        except MemoryError:
            self._say("error", f"{job.title}: not enough memory.")
        except Exception as error:
            self._say("error", f"{job.title}: unexpected {type(error).__name__}: {error}")
        finally:
            with self._lock:
                self._running.remove(job)
            if self.on_done:
                self.on_done()

    def finish(self) -> None:
        """Wait until everything is written."""
        self._executor.shutdown(wait=True)
