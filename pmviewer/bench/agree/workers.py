"""Scenes side by side: one process a core, each with a Mitsuba of its own.

A scene is named by seed and number alone, so nothing but these and the outcome passes between processes. When a process
dies, the scenes it may have died of are tried again alone, and the one that kills again is reported as such.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path

from pmviewer.bench.agree.generate import scene_of
from pmviewer.bench.agree.process import end_with, tools
from pmviewer.bench.agree.triage import all_explained, explainer
from pmviewer.bench.agree.trial import tried
from pmviewer.bench.agree.verdict import DIED, Verdict
from pmviewer.engine.pool import available_threads

OWN_KERNELS = 8
"""Each such scene runs the kernels that are compiled for what is in it and no more, as users' scenes do. Compiling
them takes longer than rendering, so that the others share those for all kinds of surfaces."""


def try_scene(seed: int, index: int) -> Verdict:
    """All comparisons of a scene, in this process, and what those that may be disagreements come from."""
    folder, mitsuba, pool = tools()
    scene, salt, shared = scene_of(seed, index), (seed, index), index % OWN_KERNELS > 0
    with tempfile.TemporaryDirectory(dir=folder) as place:
        explain = explainer(scene, salt, shared)
        verdict = tried(scene, Path(place), mitsuba, pool, salt, shared_kernels=shared, explain=explain)
    return replace(verdict, comparisons=all_explained(scene, verdict.comparisons, salt, shared))


def try_scenes(
    seed: int,
    indices: Sequence[int],
    work: Callable[[int, int], Verdict] = try_scene,
    processes: int | None = None,
) -> Iterator[tuple[int, Verdict]]:
    """(index, verdict) of these scenes of `seed`, in the order in which they end."""
    waiting = list(indices)
    processes = processes or available_threads()
    while waiting:
        suspects = yield from _side_by_side(seed, waiting, work, processes)
        for index in suspects:
            alone = yield from _side_by_side(seed, [index], work, 1)
            if alone:
                yield index, Verdict(refused=DIED)
                waiting.remove(index)
            else:
                waiting = [i for i in waiting if i != index]


def _side_by_side(
    seed: int, waiting: list[int], work: Callable[[int, int], Verdict], processes: int
) -> Generator[tuple[int, Verdict], None, list[int]]:
    """Try the scenes that wait, taking those off the list that are done; the scenes at work when a process died."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, context, end_with, (os.getpid(),)) as executor:
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
