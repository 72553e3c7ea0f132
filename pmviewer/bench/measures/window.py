"""Frames per second of the real window while the session computes on all cores and N is dragged (P11)."""

from __future__ import annotations

import statistics

from pmviewer.bench.report import BenchResult, Target
from pmviewer.bench.screen import probe, screen

SCENE = "cornell_caustic"


def run(quick: bool = False) -> BenchResult:
    """Median and 95th percentile of the time between swaps."""
    seconds = 5.0 if quick else 15.0
    with screen() as environment:
        intervals = probe(environment, SCENE, "frames", str(seconds))["intervals"]
    ordered = sorted(1e3 * interval for interval in intervals)
    median = statistics.median(ordered)
    slow = ordered[int(0.95 * (len(ordered) - 1))]
    rows: list[list[str | float | int]] = [[SCENE, len(ordered), median, slow, ordered[-1], 1e3 / median]]
    columns = ["scene", "frames", "median ms", "p95 ms", "max ms", "frames/s"]
    targets = [Target("P11", 1e3 / median, 30, "frames/s", True, "median, computing on all cores, N dragged")]
    return BenchResult("Window while computing", columns, rows, targets)
