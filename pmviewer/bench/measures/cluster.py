"""Passes on a cluster of this machine's processes (X5): the same picture whatever happens to workers, flat memory, and
throughput against one process.

Workers are killed, added and frozen while they render. The clock compares two workers of one thread each with one
process of two threads, in turns; on a machine that does other things the CPU time of all processes says more.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import os
import signal
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.cluster.cluster import Cluster
from pmviewer.engine.cluster.passes import Elsewhere
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.errors import ClusterError, PmviewerError
from pmviewer.settings.access import Settings, with_values

SCENE = "cornell_caustic"
FAULTY = {"camera.width": 200, "camera.height": 150, "photons.N": 200_000}
SOAKED = {"camera.width": 64, "camera.height": 48, "photons.N": 5_000}
TIMED = {"camera.width": 512, "camera.height": 512}
STARTED = 120.0
"""Seconds that workers may take to come up."""
MIB = 1 << 20

Rows = list[list[str | float | int]]


@contextmanager
def workers(count: int) -> Iterator[tuple[Any, Cluster]]:
    """So many processes of one thread each, as Dask's cluster and as ours."""
    from distributed import LocalCluster

    local = LocalCluster(
        n_workers=count,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address=":0",
        memory_limit=0,
        silence_logs=logging.CRITICAL,
        preload=["pmviewer.engine.cluster.preload"],
    )
    processes = [nanny.process.process._process for nanny in local.workers.values()]
    cluster = Cluster(local.scheduler_address)
    try:
        until(lambda: len(cluster.members.ready) == count)
        yield local, cluster
    finally:
        cluster.close()
        for process in processes:  # a frozen one doesn't hear that it is to end
            process.kill()
        with contextlib.suppress(TimeoutError):  # its scheduler may have been closed
            local.close(timeout=10)


def until(holds: Callable[[], bool]) -> None:
    """Wait until it holds. Raises ClusterError when it doesn't for too long."""
    deadline = time.monotonic() + STARTED
    while not holds():
        if time.monotonic() > deadline:
            raise ClusterError("The workers did not come up.")
        time.sleep(0.05)


def _renderer(opened: OpenScene, values: dict[str, Any], passes: int, pool: WorkPool) -> Renderer:
    return Renderer(opened, with_values(Settings(), {**values, "render.passes": passes}), pool, StageStore(0))


def _faults(opened: OpenScene, passes: int, rows: Rows) -> Target:
    """Kill a worker in mid-pass, add one, freeze one; and compare with one process."""
    pool = WorkPool()
    alone, together = (_renderer(opened, FAULTY, passes, pool) for _ in range(2))
    for _ in range(passes):
        alone.step()
    with workers(3) as (local, cluster):
        pids = [nanny.pid for nanny in local.workers.values()]
        elsewhere, start = Elsewhere(cluster, together), time.perf_counter()
        events = {
            passes // 4: ("killed", lambda: os.kill(pids[0], signal.SIGKILL)),
            passes // 3: ("one added", lambda: local.scale(4)),
            passes // 2: ("frozen", lambda: os.kill(pids[1], signal.SIGSTOP)),
        }
        longest = 0.0
        for index in range(passes):
            if index in events:
                events[index][1]()
            before = time.perf_counter()
            elsewhere.step()
            longest = max(longest, time.perf_counter() - before)
        took = time.perf_counter() - start
        elsewhere.close()
    pool.close()
    same = np.array_equal(alone.film.sums, together.film.sums) and np.array_equal(
        alone.film.planes(), together.film.planes()
    )
    rows.append([f"local:3, one killed, one added, one frozen: {passes} passes", took, "s"])
    rows.append(["the longest wait for a pass meanwhile", longest, "s"])
    rows.append(["workers that took part", len(together.tally.workers), ""])
    return Target("X5", float(same), 1.0, "", True, "killed, added, frozen: the picture is the same bit for bit")


def _soak(opened: OpenScene, passes: int, rows: Rows) -> list[Target]:
    """Memory of this process and of the workers, from a fifth of the passes to the end."""
    import psutil

    pool = WorkPool(1)
    renderer = _renderer(opened, SOAKED, passes, pool)
    with workers(2) as (local, cluster):
        processes = [psutil.Process(nanny.pid) for nanny in local.workers.values()]

        def held() -> tuple[float, float]:
            gc.collect()
            return psutil.Process().memory_info().rss / MIB, sum(p.memory_info().rss for p in processes) / MIB

        elsewhere, start, before = Elsewhere(cluster, renderer), time.perf_counter(), (0.0, 0.0)
        for index in range(passes):
            elsewhere.step()
            if index == passes // 5:
                before = held()
        took, after = time.perf_counter() - start, held()
        elsewhere.close()
    pool.close()
    rows.append([f"soak of {passes} passes", took, "s"])
    targets = []
    for who, first, last in zip(("this process", "two workers"), before, after):
        rows.append([f"memory of {who} after a fifth of the passes", first, "MiB"])
        rows.append([f"memory of {who} at the end", last, "MiB"])
        note = f"soak of {passes} passes: growth of {who} over the last four fifths"
        targets.append(Target("X5", 100 * (last / first - 1), 5.0, "%", False, note))
    return targets


def _throughput(opened: OpenScene, passes: int, rounds: int, rows: Rows) -> list[Target]:
    """Two workers of one thread each against one process of two threads, in turns."""
    import psutil

    pool = WorkPool(2)
    clock: list[float] = []
    spent = {"one process": 0.0, "workers": 0.0}

    with contextlib.closing(Cluster("local:2", 2)) as cluster:
        until(lambda: len(cluster.members.ready) == 2)
        processes = [psutil.Process(), *psutil.Process().children(recursive=True)]

        def cpu() -> float:
            return sum(sum(p.cpu_times()[:2]) for p in processes)

        for number in range(rounds + 1):
            times = {}
            for who in ("one process", "workers"):
                renderer = _renderer(opened, TIMED, passes, pool)
                elsewhere = Elsewhere(cluster, renderer) if who == "workers" else None
                start, before = time.perf_counter(), cpu()
                for _ in range(passes):
                    if elsewhere is None:
                        renderer.step()
                    else:
                        elsewhere.step()
                times[who] = time.perf_counter() - start
                if number:  # the first loads kernels and brings the scene there
                    spent[who] += cpu() - before
                if elsewhere is not None:
                    elsewhere.close()
            if number:
                clock.append(times["one process"] / times["workers"])
                rows += [[f"{passes} passes, {who}, round {number}", took, "s"] for who, took in times.items()]
    pool.close()
    for who, seconds in spent.items():
        rows.append([f"CPU time of a pass, {who}", seconds / (rounds * passes), "s"])
    by_cpu = spent["one process"] / spent["workers"]
    note = "two workers of one thread each against one process of two threads"
    return [
        Target("X5", statistics.median(clock), 0.9, "×", True, f"{note}: throughput by the clock"),
        Target("X5", by_cpu, 0.9, "×", True, f"{note}: by the CPU time of all processes"),
    ]


def _refusals(rows: Rows) -> Target:
    """What can't be a cluster is refused in a sentence, in seconds."""
    longest = 0.0
    for where in ("tcp://127.0.0.1:9", "nowhere", "local:0", "tls://127.0.0.1:9", "none.json"):
        start = time.perf_counter()
        try:
            Cluster(where).close()
            said = "not refused"
            longest = float("inf")
        except PmviewerError as error:
            said = str(error)
        took = time.perf_counter() - start
        longest = max(longest, took)
        rows.append([f"{where}: {said}", took, "s"])
    return Target("X5", longest, 15.0, "s", False, "addresses that are none: the longest until it is said")


def run(quick: bool = False) -> BenchResult:
    """A row for each thing measured."""
    opened, rows = open_scene(SCENE), Rows()
    targets = [
        _faults(opened, 24 if quick else 60, rows),
        *_throughput(opened, 12 if quick else 24, 1 if quick else 3, rows),
        *_soak(opened, 100 if quick else 1000, rows),
        _refusals(rows),
    ]
    notes = ["all processes on this machine; clocks need one that does nothing else, CPU times don't"]
    return BenchResult("Cluster", ["what", "value", "unit"], rows, targets, notes)
