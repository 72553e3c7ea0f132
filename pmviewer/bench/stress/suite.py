"""Every stress case in turn: finite, unbiased or biased as stated, in bounded time and memory, or answered in words."""

from __future__ import annotations

import queue
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from itertools import groupby

from pmviewer.bench.guarded import Ended, Guarded, Limits
from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.bench.stress.answers import THREADS, row_of
from pmviewer.bench.stress.drawn import drawn
from pmviewer.bench.stress.inputs import inputs
from pmviewer.bench.stress.lab import Case, Outcome, Row
from pmviewer.bench.stress.media import media
from pmviewer.bench.stress.sizes import counts, meshes, pictures, radii, scales
from pmviewer.bench.stress.surfaces import lights, materials, overlaps

LONGEST = 600.0
"""Seconds for all cases together, kernels that nobody compiled before among them."""
PROCESSES = 2
"""That run cases side by side: most of the time compiles kernels, which takes one processor."""
LIMITS = Limits(cpu=600, idle=300, memory=16 << 30)
"""Of a case; one beyond them is wrong."""
_AT_ONCE = 8
"""Neighbouring cases of a group that one process runs: they share kernels."""
_FRESH = 512 << 20
"""Bytes that a process may hold when it runs a case that needs much itself."""
OWN_KERNELS = "drawn"
"""The group whose cases don't."""


def all_cases() -> list[Case]:
    """In the order of the table."""
    of_settings = [*scales(), *radii(), *counts()]
    of_scenes = [*materials(), *overlaps(), *lights(), *media(), *meshes(), *pictures(), *inputs()]
    return of_settings + of_scenes + drawn()


def run(quick: bool = False) -> BenchResult:
    """Run all cases; `quick` only those that take a second or two each, and says so."""
    cases = all_cases()
    started = time.perf_counter()
    rows = run_cases(cases, [i for i, case in enumerate(cases) if not (quick and case.long)], _tell)
    return table(rows, time.perf_counter() - started)


def _tell(row: Row) -> None:
    print(f"{row.case.group}, {row.case.name}: {row.verdict}, {row.seconds:.1f} s", file=sys.stderr, flush=True)


def run_cases(cases: list[Case], numbers: list[int], tell: Callable[[Row], None]) -> list[Row]:
    """Rows of those of `all_cases` that have these numbers, in their order. `tell` hears of each when it is there. A
    case that ends its process, or exceeds the limits, is a row as others. Those that need much memory run alone at the
    end, one after the other."""
    large = [i for i in numbers if cases[i].long]
    units = [
        group[i : i + each]
        for name, found in groupby((i for i in numbers if i not in large), lambda i: cases[i].group)
        for group, each in [(list(found), 1 if name == OWN_KERNELS else _AT_ONCE)]
        for i in range(0, len(group), each)
    ]
    units.sort(key=lambda unit: cases[unit[0]].group != OWN_KERNELS)  # they take longest
    idle: queue.SimpleQueue[Guarded] = queue.SimpleQueue()
    servers = [Guarded("pmviewer.bench.stress.server") for _ in range(PROCESSES)]
    for server in servers:
        idle.put(server)

    def work(unit: list[int]) -> list[tuple[int, Row]]:
        server = idle.get()
        try:
            return [(i, _asked(server, i, cases[i])) for i in unit]
        finally:
            idle.put(server)

    rows: dict[int, Row] = {}

    def take(found: list[tuple[int, Row]]) -> None:
        for i, row in found:
            rows[i] = row
            tell(row)

    try:
        with ThreadPoolExecutor(PROCESSES) as pool:
            futures = [pool.submit(work, unit) for unit in units]
            try:
                for future in as_completed(futures):
                    take(future.result())
            except BaseException:  # stopped: nobody waits for the cases that run
                pool.shutdown(wait=False, cancel_futures=True)
                for server in servers:
                    server.close()
                raise
        for i in large:
            for server in servers:
                server.renew(_FRESH)
            take([(i, _asked(servers[0], i, cases[i]))])
    finally:
        for server in servers:
            server.close()
    return [rows[i] for i in numbers]


def _asked(server: Guarded, number: int, case: Case) -> Row:
    started = time.perf_counter()
    try:
        return row_of(case, server.ask({"case": number}, LIMITS))
    except Ended as ended:
        return Row(case, Outcome(problem=str(ended)), time.perf_counter() - started, 0.0, 0.0)


def cells(row: Row) -> list[Cell]:
    """A line of the table that `pmviewer bench stress` prints."""
    o = row.outcome
    measured = "" if o.value != o.value else f"{o.value:.5g} ± {o.error:.1g}"
    expected = "" if o.expected is None else f"{o.expected:.5g}"
    return [
        row.case.group,
        row.case.name,
        row.case.truth,
        expected,
        measured,
        row.verdict,
        row.seconds,
        row.cpu,
        round(row.memory),
    ]


def table(rows: list[Row], seconds: float) -> BenchResult:
    """The table, its remarks and its targets. `seconds`: by the clock, for all."""
    wrong = [row for row in rows if row.wrong]
    notes = [f"{r.case.group}, {r.case.name}: {r.outcome.bias}" for r in rows if r.outcome.bias]
    notes += [f"{r.case.group}, {r.case.name}: says “{said}”" for r in rows for said in r.outcome.said[:1]]
    notes += [f"{r.case.group}, {r.case.name}: WRONG, {r.wrong}" for r in wrong]
    cpu = sum(row.cpu for row in rows)
    how = f"{PROCESSES} processes of {THREADS} threads"
    notes.append(f"{seconds:.0f} s by the clock, {cpu:.0f} s of processor time, in {how}")
    largest = max(rows, key=lambda row: row.memory)
    targets = [
        Target("stress", len(wrong), 0, "cases wrong", False, f"of {len(rows)} cases"),
        Target("stress time", seconds, LONGEST, "s", False, f"all cases, in {how}"),
        Target("stress memory", largest.memory / 1024, 16.0, "GiB", False, f"most: {largest.case.name}"),
    ]
    columns = ["group", "case", "truth", "expected", "measured", "verdict", "s", "CPU s", "MiB"]
    return BenchResult("Stress", columns, [cells(row) for row in rows], targets, notes)
