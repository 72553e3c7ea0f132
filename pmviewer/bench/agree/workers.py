"""Scenes side by side: one process a core, each with a Mitsuba of its own.

A scene is named by seed and number alone, so nothing but these and the outcome passes between processes. When a process
dies, the scenes it may have died of are tried again alone, and the one that kills again is reported as such.
"""

from __future__ import annotations

import atexit
import multiprocessing
import tempfile
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from pmviewer.bench.agree.generate import scene_of
from pmviewer.bench.agree.mitsuba_client import Mitsuba
from pmviewer.bench.agree.trial import Verdict, tried
from pmviewer.engine.pool import WorkPool, available_threads

_own: dict[str, Any] = {}
"""What a worker process keeps: its folder, its Mitsuba, its pool of one thread."""


def tools() -> tuple[Path, Mitsuba, WorkPool]:
    """This process's own folder, Mitsuba and pool, made with the first call and closed with the process."""
    if not _own:
        folder = tempfile.TemporaryDirectory(prefix="pmviewer-agree-")
        _own.update(folder=folder, mitsuba=Mitsuba(Path(folder.name)), pool=WorkPool(1))
        atexit.register(_close)
    return Path(_own["folder"].name), _own["mitsuba"], _own["pool"]


def _close() -> None:
    _own["mitsuba"].close()
    _own["pool"].close()
    _own["folder"].cleanup()


def try_scene(seed: int, index: int) -> Verdict:
    """All comparisons of a scene, in this process."""
    folder, mitsuba, pool = tools()
    with tempfile.TemporaryDirectory(dir=folder) as place:
        return tried(scene_of(seed, index), Path(place), mitsuba, pool, (seed, index))


def try_scenes(
    seed: int, count: int, work: Callable[[int, int], Verdict] = try_scene, processes: int | None = None
) -> Iterator[tuple[int, Verdict]]:
    """(index, verdict) of scenes 0 … count − 1 of `seed`, in the order in which they end."""
    waiting = list(range(count))
    processes = processes or available_threads()
    while waiting:
        suspects = yield from _side_by_side(seed, waiting, work, processes)
        for index in suspects:
            alone = yield from _side_by_side(seed, [index], work, 1)
            if alone:
                yield index, Verdict(refused="the process died")
                waiting.remove(index)
            else:
                waiting = [i for i in waiting if i != index]


def _side_by_side(
    seed: int, waiting: list[int], work: Callable[[int, int], Verdict], processes: int
) -> Generator[tuple[int, Verdict], None, list[int]]:
    """Try the scenes that wait, taking those off the list that are done; the scenes at work when a process died."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context) as executor:
        running: dict[Future[Verdict], int] = {}
        following = iter(list(waiting))
        try:
            while True:
                while len(running) < processes and (index := next(following, None)) is not None:
                    running[executor.submit(work, seed, index)] = index
                if not running:
                    return []
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    verdict = future.result()
                    index = running.pop(future)
                    waiting.remove(index)
                    yield index, verdict
        except BrokenProcessPool:
            return list(running.values())
