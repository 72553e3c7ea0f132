"""What long work says while it goes on, and how it learns that nobody wants it any more.

Whoever starts the work listens (`watched`); the work itself, however deep down, calls `stage` and `check`, and
`parallel` for what runs on several threads. Nobody needs to listen.
"""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from dataclasses import dataclass, replace
from typing import Any, TypeVar

T = TypeVar("T")
Task = Callable[[], Any]
_EVERY = 0.1
"""Seconds between two looks at whether parallel work is still wanted."""


class Cancelled(Exception):
    """Work was dropped because nobody wants its result any more."""


@dataclass(frozen=True)
class _Watch:
    tell: Callable[[str], None] | None
    unwanted: Callable[[], bool] | None
    threads: int | None


_watch: ContextVar[_Watch | None] = ContextVar("pmviewer_watch", default=None)


@contextmanager
def watched(
    tell: Callable[[str], None] | None = None,
    unwanted: Callable[[], bool] | None = None,
    threads: int | None = None,
) -> Iterator[None]:
    """Within this context (of this thread) `tell` hears of the stages, `unwanted` says when to stop by Cancelled, and
    `parallel` uses `threads` threads."""
    token = _watch.set(_Watch(tell, unwanted, threads))
    try:
        yield
    finally:
        _watch.reset(token)


def stage(text: str) -> None:
    """Say what begins now ("reading chair.obj"). Raises Cancelled when the work is unwanted."""
    check()
    watch = _watch.get()
    if watch is not None and watch.tell is not None:
        watch.tell(text)


def check() -> None:
    """Raises Cancelled when the work is unwanted."""
    watch = _watch.get()
    if watch is not None and watch.unwanted is not None and watch.unwanted():
        raise Cancelled


@contextmanager
def beside(task: Callable[[], T]) -> Iterator[Callable[[], T]]:
    """Within this context the task runs on a thread of its own; calling what is given, once, waits for its result, and
    raises what it raises. At the end the task is stopped as unwanted if it still runs."""
    left, watch = threading.Event(), _watch.get() or _Watch(None, None, None)
    unwanted = watch.unwanted or _never

    def run() -> T:
        _watch.set(replace(watch, unwanted=lambda: left.is_set() or unwanted()))
        return task()

    with ThreadPoolExecutor(1, "pmviewer beside") as pool:
        begun = [pool.submit(copy_context().run, run)]

        def result() -> T:
            future = begun.pop()
            try:
                return future.result()
            finally:
                del future  # as in `grown`

        try:
            yield result
        finally:
            left.set()


def _never() -> bool:
    return False


def available_threads() -> int:
    """Processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def parallel(tasks: Sequence[Task]) -> list[Any]:
    """Results of the tasks, which run without the GIL on as many threads as there are processors.

    Raises Cancelled between tasks, and whatever a task raises.
    """
    return [result for _, result in grown(list(tasks), lambda result: ())] if len(tasks) > 1 else [t() for t in tasks]


def grown(tasks: list[Task], more: Callable[[Any], Sequence[Task]]) -> list[tuple[int, Any]]:
    """Results of the tasks and of those that `more` makes of each result, numbered and in the order of being added."""
    watch = _watch.get()
    threads = (watch.threads if watch is not None else None) or available_threads()
    done: queue.SimpleQueue[Future[Any]] = queue.SimpleQueue()
    number: dict[Future[Any], int] = {}
    results: list[tuple[int, Any]] = []
    pool = ThreadPoolExecutor(threads, "pmviewer load")

    def add(task: Task) -> None:
        future = pool.submit(task)
        number[future] = len(number)
        future.add_done_callback(done.put)

    def ended() -> tuple[int, Any] | None:
        try:
            future = done.get(timeout=_EVERY)
        except queue.Empty:
            return None
        try:
            return number[future], future.result()
        finally:
            del future

    try:
        for task in tasks:
            add(task)
        while len(results) < len(number):
            check()
            if (one := ended()) is not None:
                results.append(one)
                for task in more(one[1]):
                    add(task)
    finally:
        pool.shutdown(cancel_futures=True)
        # An error knows the frames that it came through: no frame may know it, by a future, or they all stay.
        number.clear()
        while not done.empty():
            done.get()
    return sorted(results, key=lambda pair: pair[0])
