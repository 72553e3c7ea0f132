"""Threads for kernels: serial `nogil` functions on small tiles, in a pool that can give way to the window."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from pmviewer.progress import Cancelled as Cancelled
from pmviewer.progress import Task as Task
from pmviewer.progress import available_threads as available_threads

BEHIND_WINDOW = 10
"""Niceness of threads that work beside a window."""


FEW_TASKS = 8
"""With fewer, a share says nothing."""


def lower_priority() -> None:
    """Let the window's thread go first (measured: steady 60 frames a second beside full load). Where the system has
    no priority per thread, or the thread has a lower one already, nothing changes."""
    with contextlib.suppress(OSError, AttributeError):
        thread = threading.get_native_id()
        os.setpriority(os.PRIO_PROCESS, thread, max(BEHIND_WINDOW, os.getpriority(os.PRIO_PROCESS, thread)))


class WorkPool:
    """Runs tasks on `threads` threads. `cpu_seconds` adds up the time that threads spent in tasks.

    `on_progress` hears which stage runs, and which share of its current tasks is through (None: they are few).
    `behind_window` lowers the threads' priority; without a window nobody waits, and they keep the process's own.
    """

    def __init__(self, threads: int | None = None, *, behind_window: bool = False) -> None:
        self.threads = threads or available_threads()
        self.cancel = threading.Event()
        self.cpu_seconds = 0.0
        self.stage = ""
        self.on_progress: Callable[[str, float | None], None] | None = None
        self._lock = threading.Lock()
        self._executor = ThreadPoolExecutor(
            self.threads, "pmviewer", initializer=lower_priority if behind_window else None
        )

    def run(self, tasks: Sequence[Task]) -> list[Any]:
        """Results in the order of the tasks.

        Raises Cancelled as soon as the running tasks are through when `cancel` is set, and whatever a task raises.
        """
        futures: list[Future[Any]] = [self._executor.submit(self._guarded, task) for task in tasks]
        results = []
        try:
            for count, future in enumerate(futures, start=1):
                results.append(future.result())
                if self.on_progress is not None:
                    self.on_progress(self.stage, count / len(tasks) if len(tasks) >= FEW_TASKS else None)
        finally:
            if len(results) < len(futures):
                for future in futures:
                    future.cancel()
                for future in futures:
                    if not future.cancelled():
                        future.exception()
        return results

    def _guarded(self, task: Task) -> Any:
        if self.cancel.is_set():
            raise Cancelled
        start = time.thread_time()
        try:
            return task()
        finally:
            spent = time.thread_time() - start
            with self._lock:
                self.cpu_seconds += spent

    def close(self) -> None:
        """Drop what has not started and wait for the rest."""
        self.cancel.set()
        self._executor.shutdown(wait=True, cancel_futures=True)
