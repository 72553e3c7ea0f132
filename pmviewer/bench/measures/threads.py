"""Threads: two against one by the clock, and the serial share of a pass by stage (P19).

The clock says little on a machine that does other things. The shares come from CPU times: each task's own, and the main
thread's between them. From these follows how long a pass would take on any number of threads that nothing else uses:
every call of the pool ends with its last task, and who called it waits; while a pass's picture is rendered, the stages
before that of the next one run beside it, and first. The serial share s is Amdahl's, of T(n)/T(1) = s + (1 − s)/n; it
holds what only one thread can do as well as the waiting for the last task of a stage. That of a single stage is what it
would be with nothing beside it.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import Task, WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.progress import available_threads
from pmviewer.settings.access import Settings, with_values

CASES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("cornell_caustic", {}),
    ("rooms_10x10", {}),
    ("cornell_caustic", {"render.method": "gather"}),
    ("cornell_diffuse", {"render.method": "gather", "gather.cache": "on"}),
)
SIZE = {"camera.width": 512, "camera.height": 512}
PASSES, QUICK_PASSES, SKIPPED = 12, 8, 4
"""Passes, of which the first are not counted: they fill the stage store and the caches."""
BLOCK = 4
"""Passes that are clocked together: a part of each is done during the one before."""
TURNS, QUICK_TURNS = 5, 2
"""Blocks that are clocked, each after a pass that is not: what has been made ahead of that, nobody waited for."""
THREADS = (2, 8, 32)
BETWEEN, RENDERED = "between stages", "camera pass"
Way = list[list[float]]
"""CPU seconds of tasks that run side by side, and of those that follow when all of these are through, and so on."""


@dataclass
class _Stage:
    """CPU seconds of the main thread and of the tasks of each call of the pool."""

    main: float = 0.0
    calls: list[list[float]] = field(default_factory=list)

    @property
    def alone(self) -> float:
        """On one thread."""
        return self.main + sum(map(sum, self.calls))

    def on(self, threads: int) -> float:
        """On so many."""
        return self.main + sum(makespan(tasks, threads) for tasks in self.calls)


class WatchedPool(WorkPool):
    """Remembers by stage what its tasks and the thread that calls it cost, in CPU seconds: it may have more threads
    than there are processors."""

    def __init__(self, threads: int = 1) -> None:
        self.stages: dict[str, _Stage] = {}
        self.passes: list[tuple[Way, Way]] = []
        """Of each pass: what can be made ahead, and the rest."""
        self._name, self._since = BETWEEN, time.thread_time()
        super().__init__(threads)

    @property
    def overlaps(self) -> bool:
        """Never: what runs beside something else can't be told from it."""
        return False

    def begin_pass(self) -> None:
        """What follows is of one more."""
        self.note()
        self.passes.append(([], []))

    @property
    def stage(self) -> str:
        """The one that runs."""
        return self._name

    @stage.setter
    def stage(self, name: str) -> None:
        self.note()
        self._name = name or BETWEEN

    def note(self) -> None:
        """What the calling thread has done since the last note belongs to the stage."""
        now = time.thread_time()
        self.stages.setdefault(self._name, _Stage()).main += now - self._since
        self._way([now - self._since])
        self._since = now

    def _way(self, tasks: list[float]) -> None:
        if self.passes:
            self.passes[-1][self._name in (BETWEEN, RENDERED)].append(tasks)

    def run(self, tasks: Sequence[Task]) -> list[Any]:
        """As the pool's own."""
        spent = [0.0] * len(tasks)

        def timed(number: int, task: Task) -> Any:
            start = time.thread_time()
            try:
                return task()
            finally:
                spent[number] = time.thread_time() - start

        results = super().run([partial(timed, number, task) for number, task in enumerate(tasks)])
        self.note()
        self.stages.setdefault(self._name, _Stage()).calls.append(spent)
        self._way(spent)
        return results


def makespan(tasks: Sequence[float], threads: int) -> float:
    """Seconds until the last task is through, when each thread takes the next one as soon as it is free."""
    free = [0.0] * min(threads, max(len(tasks), 1))
    for task in tasks:
        heapq.heapreplace(free, free[0] + task)
    return max(free)


def together(first: Way, second: Way, threads: int) -> float:
    """Seconds until both ways are through, when a thread that is free takes the next task of the `first`, if one may
    begin, and else of the `second`."""
    ways = [[step[::-1] for step in way if step] for way in (first, second)]
    running: list[tuple[float, int]] = []
    left, now = [0, 0], 0.0
    while True:
        for way, steps in enumerate(ways):
            while steps and not steps[0] and not left[way]:
                steps.pop(0)
            while steps and steps[0] and len(running) < threads:
                left[way] += 1
                heapq.heappush(running, (now + steps[0].pop(), way))
        if not running:
            return now
        now, way = heapq.heappop(running)
        left[way] -= 1


def serial_share(alone: float, together: float, threads: int) -> float:
    """Amdahl's s of times on one thread and on several."""
    return (threads * together / alone - 1) / (threads - 1) if alone > 0 else 0.0


def _clocked(opened: OpenScene, settings: Settings, threads: Sequence[int], turns: int) -> list[float]:
    """Seconds of a pass, by the clock, on so many threads each: those of the quickest BLOCK. They take turns, so that a
    busy moment of the machine hits them all."""
    pools = [WorkPool(n) for n in threads]
    best = [float("inf")] * len(pools)
    try:
        renderers = [Renderer(opened, settings, pool, StageStore(0)) for pool in pools]
        for renderer in renderers:
            for _ in range(SKIPPED):
                renderer.step()
        for _ in range(turns):
            for k, renderer in enumerate(renderers):
                renderer.step()
                start = time.perf_counter()
                for _ in range(BLOCK):
                    renderer.step()
                best[k] = min(best[k], (time.perf_counter() - start) / BLOCK)
    finally:
        for pool in pools:
            pool.close()
    return best


def _watched(opened: OpenScene, settings: Settings, threads: int, passes: int) -> tuple[dict[str, _Stage], float]:
    """What the counted passes cost by stage where so many threads are there, and the seconds that they take then."""
    pool = WatchedPool(threads)
    try:
        prepare(opened, settings, pool, lambda text, share: None)
        renderer = Renderer(opened, settings, pool, StageStore(0))
        for index in range(passes):
            if index == SKIPPED:
                pool.note()
                pool.stages.clear()
            if index >= SKIPPED:
                pool.begin_pass()
            renderer.step()
            pool.stage = ""
    finally:
        pool.close()
    return pool.stages, sum(together(*ways, threads) for ways in pool.passes)


def run(quick: bool = False) -> BenchResult:
    """A row for each stage of each case, then the pass as a whole."""
    passes = QUICK_PASSES if quick else PASSES
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    for scene, values in CASES[: 2 if quick else None]:
        opened, settings = open_scene(scene), with_values(Settings(), {**SIZE, **values})
        watched = {n: _watched(opened, settings, n, passes) for n in THREADS}
        one, two = _clocked(opened, settings, (1, 2), QUICK_TURNS if quick else TURNS)
        name = f"{scene}, {settings.render.method}{', cache' if settings.gather.cache == 'on' else ''}"
        alone = {n: sum(stage.alone for stage in stages.values()) for n, (stages, _) in watched.items()}
        times = {n: seconds for n, (_, seconds) in watched.items()}
        few, counted = watched[THREADS[0]][0], passes - SKIPPED
        for title, stage in sorted(few.items(), key=lambda item: -item[1].alone):
            lost = [
                (n * own.on(n) - own.alone) / (n - 1) / alone[n]
                for n, (stages, _) in watched.items()
                for own in [stages.get(title, _Stage())]
            ]
            rows.append([name, title, 1e3 * stage.alone / counted, *(f"{share:.1%}" for share in lost), ""])
        shares = {n: serial_share(alone[n], times[n], n) for n in THREADS}
        speed = f"{one / two:.2f}×"
        rows.append([name, "pass", 1e3 * alone[2] / counted, *(f"{shares[n]:.1%}" for n in THREADS), speed])
        targets.append(Target("P19", alone[2] / times[2], 1.9, "×", True, f"{name}: two threads, by CPU times"))
        targets.append(Target("P19", 100 * shares[8], 2.0, "%", False, f"{name}: serial share on eight threads"))
        if available_threads() > 1:
            targets.append(Target("P19", one / two, 1.9, "×", True, f"{name}: two threads, by the clock"))
    columns = ["case", "stage", "CPU ms a pass", *(f"serial on {n}" for n in THREADS), "clock, 2 threads"]
    notes = [
        "512×512; a stage's serial share is of the whole pass, with nothing beside it; in a pass the stages before the "
        "camera pass run beside that of the pass before; clocks are those of the quickest "
        f"of {QUICK_TURNS if quick else TURNS} blocks of {BLOCK} passes, one thread and two in "
        "turn, and need a machine that does nothing else",
        "serial on n: what a pass on n threads that nothing else uses takes longer than 1/n, by each task's CPU time",
    ]
    return BenchResult("Threads", columns, rows, targets, notes)
