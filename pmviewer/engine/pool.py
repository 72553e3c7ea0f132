"""Threads for kernels: serial `nogil` functions on small tiles, in a pool that can give way to the window."""

from __future__ import annotations

import contextlib
import itertools
import os
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from queue import SimpleQueue
from typing import Any, NoReturn

from pmviewer.progress import Cancelled as Cancelled
from pmviewer.progress import Task as Task
from pmviewer.progress import available_threads as available_threads

BEHIND_WINDOW = 10
"""Niceness of threads that work beside a window."""

FEW_TASKS = 8
"""With fewer, a share says nothing."""
REPORT_SECONDS = 0.03
"""From one report of progress to the next."""


def lower_priority() -> None:
    """Let the window's thread go first (measured: steady 60 frames a second beside full load). Where the system has
    no priority per thread, or the thread has a lower one already, nothing changes."""
    with contextlib.suppress(OSError, AttributeError):
        thread = threading.get_native_id()
        os.setpriority(os.PRIO_PROCESS, thread, max(BEHIND_WINDOW, os.getpriority(os.PRIO_PROCESS, thread)))


class _Batch:
    """Tasks that threads share: `numbers` gives each out once, `through` are those that ended. `ended` is free once no
    thread is at work on them any more."""

    def __init__(self, tasks: Sequence[Task]) -> None:
        self.tasks = tasks
        self.numbers = itertools.count()
        self.results: list[Any] = [None] * len(tasks)
        self.through: list[int] = []
        self.errors: dict[int, BaseException] = {}
        self.stopped = False
        self.working = 0
        self.ended = threading.Lock()


_Queue = SimpleQueue[tuple[Callable[[_Batch], None], _Batch] | None]


def _serve(queue: _Queue, behind_window: bool) -> None:
    """A thread's life. It knows nothing of its pool while it waits, so that a pool that nobody closed can go."""
    if behind_window:
        lower_priority()
    while (job := queue.get()) is not None:
        work, batch = job
        work(batch)
        del job, work, batch


def _dismiss(queue: _Queue, threads: list[threading.Thread]) -> None:
    """Let the threads end once they have done what they were given."""
    for _ in threads:
        queue.put(None)


def _raise_of(batch: _Batch) -> NoReturn:
    """Raise what the first of the tasks that failed has raised. It knows the frames that it went through; if these knew
    it, too, they and all pictures and maps in them would stay until Python looks for such circles."""
    error = batch.errors[min(batch.errors)]
    batch.errors.clear()
    try:
        raise error
    finally:
        del error


class WorkPool:
    """Runs tasks on `threads` threads. `cpu_seconds` adds up the time that threads spent in tasks.

    `on_progress` hears which stage runs, and which share of its current tasks is through (None: they are few).
    `behind_window` lowers the threads' priority; without a window nobody waits, and they keep the process's own.
    Where neither is asked for and one thread is enough, it is the caller's own: to wake another takes longer than small
    tasks do.
    """

    def __init__(self, threads: int | None = None, *, behind_window: bool = False) -> None:
        self.threads = threads or available_threads()
        self.cancel = threading.Event()
        self.cpu_seconds = 0.0
        self.stage = ""
        self.on_progress: Callable[[str, float | None], None] | None = None
        self._lock = threading.Lock()
        self._behind_window = behind_window
        self._queue: _Queue = SimpleQueue()
        self._serving: list[threading.Thread] = []
        self._dismiss = weakref.finalize(self, _dismiss, self._queue, self._serving)

    def run(self, tasks: Sequence[Task]) -> list[Any]:
        """Results in the order of the tasks.

        Raises Cancelled as soon as the running tasks are through when `cancel` is set, and whatever a task raises.
        """
        batch = _Batch(tasks)
        if min(self.threads, len(tasks)) < 2 and self.on_progress is None and not self._behind_window:
            batch.working = 1
            batch.ended.acquire()
            self._work(batch)
        else:
            self._share(batch)
        if batch.errors:
            _raise_of(batch)
        if len(batch.through) < len(tasks):  # closed meanwhile
            raise Cancelled
        return batch.results

    def _share(self, batch: _Batch) -> None:
        """Have threads do it, and wait for them."""
        count = batch.working = min(self.threads, len(batch.tasks))
        if not count:
            return
        batch.ended.acquire()
        with self._lock:
            if not self._dismiss.alive:  # closed meanwhile
                return
            while len(self._serving) < count:
                name = f"pmviewer_{len(self._serving)}"
                arguments = self._queue, self._behind_window
                self._serving.append(threading.Thread(target=_serve, args=arguments, name=name, daemon=True))
                self._serving[-1].start()
            for _ in range(count):
                self._queue.put((self._work, batch))
        ended = False
        try:
            while not (ended := batch.ended.acquire(timeout=REPORT_SECONDS if self.on_progress is not None else -1)):
                self._report(batch)
            self._report(batch)
        finally:
            batch.stopped = True
            if not ended:
                batch.ended.acquire()

    def _work(self, batch: _Batch) -> None:
        """On one thread: the next task that nobody has begun, until there is none. Threads fetch their tasks
        themselves, as a future for each costs the caller some 50 µs, in which nothing else may be left to do."""
        start = time.thread_time()
        try:
            for number in batch.numbers:
                if number >= len(batch.tasks) or batch.stopped:
                    return
                try:
                    if self.cancel.is_set():
                        raise Cancelled
                    batch.results[number] = batch.tasks[number]()
                except BaseException as error:  # for the thread that waits
                    batch.stopped, batch.errors[number] = True, error
                batch.through.append(number)
        finally:
            spent = time.thread_time() - start
            with self._lock:
                self.cpu_seconds += spent
                batch.working -= 1
                if batch.working == 0:
                    batch.ended.release()

    def _report(self, batch: _Batch) -> None:
        if self.on_progress is not None and batch.tasks:
            count = len(batch.tasks)
            self.on_progress(self.stage, len(batch.through) / count if count >= FEW_TASKS else None)

    def close(self) -> None:
        """Let what runs come to its end, begin nothing more, and wait for the threads."""
        self.cancel.set()
        with self._lock:
            self._dismiss()
        for thread in self._serving:
            thread.join()
