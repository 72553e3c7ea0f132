"""Every stress case in turn: finite, unbiased or biased as stated, in bounded time and memory, or answered in words."""

from __future__ import annotations

import sys
from collections.abc import Callable

from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.bench.stress.drawn import drawn
from pmviewer.bench.stress.inputs import inputs
from pmviewer.bench.stress.lab import Case, Lab, Row, run_case
from pmviewer.bench.stress.media import media
from pmviewer.bench.stress.sizes import counts, meshes, pictures, radii, scales
from pmviewer.bench.stress.surfaces import lights, materials, overlaps
from pmviewer.engine.pool import WorkPool

LONGEST = 600.0
"""Seconds for all cases together, with compiled kernels."""


def all_cases() -> list[Case]:
    """In the order of the table."""
    of_settings = [*scales(), *radii(), *counts()]
    of_scenes = [*materials(), *overlaps(), *lights(), *media(), *meshes(), *pictures(), *inputs()]
    return of_settings + of_scenes + drawn()


def run(quick: bool = False) -> BenchResult:
    """Run all cases; `quick` only those that take a second or two each, and says so."""
    cases = all_cases()
    if quick:
        cases = [case for case in cases if not case.long]
    return table(run_cases(cases, _tell))


def _tell(row: Row) -> None:
    print(f"{row.case.group}, {row.case.name}: {row.verdict}, {row.seconds:.1f} s", file=sys.stderr, flush=True)


def run_cases(cases: list[Case], tell: Callable[[Row], None] | None = None) -> list[Row]:
    """On two threads, so that times mean the same everywhere. `tell` hears of each row."""
    pool, rows = WorkPool(2), []
    try:
        lab = Lab(pool)
        for case in cases:
            rows.append(run_case(lab, case))
            if tell is not None:
                tell(rows[-1])
    finally:
        pool.close()
    return rows


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


def table(rows: list[Row]) -> BenchResult:
    """The table, its remarks and its targets."""
    wrong = [row for row in rows if row.wrong]
    notes = [f"{r.case.group}, {r.case.name}: {r.outcome.bias}" for r in rows if r.outcome.bias]
    notes += [f"{r.case.group}, {r.case.name}: says “{said}”" for r in rows for said in r.outcome.said[:1]]
    notes += [f"{r.case.group}, {r.case.name}: WRONG, {r.wrong}" for r in wrong]
    total = sum(row.seconds for row in rows)
    cpu = sum(row.cpu for row in rows)
    notes.append(f"{total:.0f} s by the clock, {cpu:.0f} s of processor time, on two threads")
    largest = max(rows, key=lambda row: row.memory)
    targets = [
        Target("stress", len(wrong), 0, "cases wrong", False, f"of {len(rows)} cases"),
        Target("stress time", total, LONGEST, "s", False, "all cases on two threads"),
        Target("stress memory", largest.memory / 1024, 16.0, "GiB", False, f"most: {largest.case.name}"),
    ]
    columns = ["group", "case", "truth", "expected", "measured", "verdict", "s", "CPU s", "MiB"]
    return BenchResult("Stress", columns, [cells(row) for row in rows], targets, notes)
