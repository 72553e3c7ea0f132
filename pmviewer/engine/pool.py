"""Threads for kernels: serial `nogil` functions on small tiles, in a pool that can give way to the window."""

from __future__ import annotations

import contextlib
import itertools
import os
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any, Generic, NoReturn, TypeVar

from pmviewer.progress import Cancelled as Cancelled
from pmviewer.progress import Task as Task
from pmviewer.progress import available_threads as available_threads

T = TypeVar("T")
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


@dataclass
class _Account:
    """Whose tasks these are: the `stage` that runs, and the CPU seconds that threads have spent in them. `first`
    tasks go before all others; of one that is `dropped`, no task begins."""

    first: bool = False
    stage: str = ""
    cpu_seconds: float = 0.0
    dropped: bool = False


class _Batch:
    """Tasks that threads share: `numbers` gives each out once, `through` are those that ended. So many threads are
    `working` on them; once none is any more, they are `over`, and `ended` is free."""

    def __init__(self, tasks: Sequence[Task], account: _Account) -> None:
        self.tasks, self.account = tasks, account
        self.numbers = itertools.count()
        self.results: list[Any] = [None] * len(tasks)
        self.through: list[int] = []
        self.errors: dict[int, BaseException] = {}
        self.stopped = False
        self.working = 0
        self.over = False
        self.ended = threading.Lock()


_Queue = SimpleQueue[tuple[Callable[[_Batch], float], _Batch] | None]


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

    What `begin` begins has an account of its own: `stage` and `cpu_seconds` are those of the thread that asks.
    """

    def __init__(self, threads: int | None = None, *, behind_window: bool = False) -> None:
        self.threads = threads or available_threads()
        self.cancel = threading.Event()
        self.on_progress: Callable[[str, float | None], None] | None = None
        self._own, self._thread = _Account(), threading.local()
        self._lock = threading.Lock()
        self._behind_window = behind_window
        self._queue: _Queue = SimpleQueue()
        self._serving: list[threading.Thread] = []
        self._first: list[_Batch] = []
        """Those that go before all others and have tasks that nobody has begun."""
        self._dismiss = weakref.finalize(self, _dismiss, self._queue, self._serving)

    @property
    def overlaps(self) -> bool:
        """Whether there are threads for what could be begun before it is needed."""
        return self.threads > 1

    @property
    def _account(self) -> _Account:
        account: _Account = getattr(self._thread, "account", self._own)
        return account

    @property
    def stage(self) -> str:
        """The one that runs."""
        return self._account.stage

    @stage.setter
    def stage(self, name: str) -> None:
        self._account.stage = name

    @property
    def cpu_seconds(self) -> float:
        """Spent in tasks so far."""
        return self._account.cpu_seconds

    def begin(self, make: Callable[[], T]) -> Begun[T]:
        """Have `make` done while the caller goes on: on a thread of its own, its tasks before those of others."""
        return Begun(self, make)

    def run(self, tasks: Sequence[Task]) -> list[Any]:
        """Results in the order of the tasks.

        Raises Cancelled as soon as the running tasks are through when `cancel` is set, and whatever a task raises.
        """
        account = self._account
        batch = _Batch(tasks, account)
        alone = min(self.threads, len(tasks)) < 2 and not account.first
        if alone and self.on_progress is None and not self._behind_window:
            batch.ended.acquire()
            self._work(batch)
        else:
            self._share(batch)
        if batch.errors:
            _raise_of(batch)
        if len(batch.through) < len(tasks):  # closed meanwhile
            raise Cancelled
        results, batch.results, batch.tasks = batch.results, [], ()  # threads that come too late still know the batch
        return results

    def _share(self, batch: _Batch) -> None:
        """Have threads do it, and wait for them."""
        count = min(self.threads, len(batch.tasks))
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
            if batch.account.first:
                self._first.append(batch)
            for _ in range(count):
                self._queue.put((self._work, batch))
        reports = self.on_progress is not None and not batch.account.first
        ended = False
        try:
            while not (ended := batch.ended.acquire(timeout=REPORT_SECONDS if reports else -1)):
                self._report(batch)
            if reports:
                self._report(batch)
        finally:
            batch.stopped = True
            if not ended:
                batch.ended.acquire()

    def _work(self, batch: _Batch) -> float:
        """On one thread: the next task that nobody has begun, until there is none; returns the CPU seconds of it.
        Threads fetch their tasks themselves, as a future for each costs the caller some 50 µs, in which nothing else
        may be left to do."""
        account = batch.account
        with self._lock:
            if batch.over:
                return 0.0
            batch.working += 1
        start, of_others = time.thread_time(), 0.0
        try:
            for number in batch.numbers:
                if number >= len(batch.tasks) or batch.stopped:
                    break
                try:
                    if self.cancel.is_set() or account.dropped:
                        raise Cancelled
                    batch.results[number] = batch.tasks[number]()
                except BaseException as error:  # for the thread that waits
                    batch.stopped, batch.errors[number] = True, error
                batch.through.append(number)
                if self._first and not account.first:
                    of_others += self._work_first()
        finally:
            spent = time.thread_time() - start
            with self._lock:
                account.cpu_seconds += spent - of_others
                if batch in self._first:
                    self._first.remove(batch)
                batch.working -= 1
                if batch.working == 0:
                    batch.over = True
                    batch.ended.release()
        return spent

    def _work_first(self) -> float:
        """What goes before the thread's own tasks, if it is still there."""
        with self._lock:
            batch = self._first[0] if self._first else None
        return self._work(batch) if batch is not None else 0.0

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


class Begun(Generic[T]):
    """What a pool has begun before it is needed. Nobody needs to wait for it: once this object is gone, none of its
    tasks begins any more."""

    def __init__(self, pool: WorkPool, make: Callable[[], T]) -> None:
        account = self._account = _Account(first=True)
        made = self._made = _Made[T]()
        weakref.finalize(self, _drop, account).atexit = False

        def work() -> None:
            pool._thread.account = account
            if pool._behind_window:
                lower_priority()
            try:
                made.result.append(make())
            except Cancelled:
                made.error = Cancelled()  # without the frames that it came through, as nobody may ever ask
            except BaseException as error:
                made.error = error

        self._pool = pool
        self._worker = threading.Thread(target=work, name="pmviewer begun", daemon=True)
        self._worker.start()

    def result(self) -> T:
        """Wait for it, once; its CPU seconds are the asking thread's from now on. Raises what it raises."""
        pool, account = self._pool, self._account
        while self._worker.is_alive():
            self._worker.join(REPORT_SECONDS if pool.on_progress is not None else None)
            if pool.on_progress is not None:
                pool.on_progress(account.stage, None)
        with pool._lock:
            pool._account.cpu_seconds += account.cpu_seconds
        if self._made.error is not None:
            error, self._made.error = self._made.error, None
            try:
                raise error
            finally:
                del error
        return self._made.result.pop()

    def drop(self) -> None:
        """Nobody wants it any more. Returns at once."""
        _drop(self._account)


@dataclass
class _Made(Generic[T]):
    """What a thread made, or why it didn't."""

    result: list[T] = field(default_factory=list)
    error: BaseException | None = None


def _drop(account: _Account) -> None:
    account.dropped = True
