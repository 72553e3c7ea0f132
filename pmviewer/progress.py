"""What long work says while it goes on, and how it learns that nobody wants it any more.

Whoever starts the work listens (`watched`); the work itself, however deep down, calls `stage` and `check`, and
`parallel` for what runs on several threads. Nobody needs to listen.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

Task = Callable[[], Any]


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
    with ThreadPoolExecutor(threads, "pmviewer load") as pool:
        number: dict[Future[Any], int] = {pool.submit(task): i for i, task in enumerate(tasks)}
        waiting, results = set(number), []
        try:
            while waiting:
                done, waiting = wait(waiting, timeout=0.1, return_when=FIRST_COMPLETED)
                check()
                for future in done:
                    result = future.result()
                    results.append((number[future], result))
                    for task in more(result):
                        added = pool.submit(task)
                        number[added] = len(number)
                        waiting.add(added)
        finally:
            for future in waiting:
                future.cancel()
    return sorted(results, key=lambda pair: pair[0])
