"""From the command to the window and to the first picture (P10), cold (compiling) and warm."""

from __future__ import annotations

import statistics
import tempfile
import time

from pmviewer.bench.report import BenchResult, Target
from pmviewer.bench.screen import probe, screen

SCENE = "cornell_caustic"


def run(quick: bool = False) -> BenchResult:
    """Start the real window in processes of its own; a cold start gets an empty cache folder."""
    rows: list[list[str | float | int]] = []
    warm_window, warm_image = [], []
    with screen() as environment, tempfile.TemporaryDirectory(prefix="pmviewer-bench-") as cache:
        environment["PMVIEWER_CACHE"] = cache
        cold = _start(environment)
        rows.append(["cold", *cold])
        for _ in range(2 if quick else 5):
            window, image = _start(environment)
            rows.append(["warm", window, image])
            warm_window.append(window)
            warm_image.append(image)
    targets = [
        Target("P10", cold[0], 2.0, "s", False, "cold: window"),
        Target("P10", cold[1], 40.0, "s", False, "cold: first picture"),
        Target("P10", statistics.median(warm_window), 2.0, "s", False, "warm: window"),
        Target("P10", statistics.median(warm_image), 3.0, "s", False, "warm: first picture"),
    ]
    return BenchResult(f"Start on {SCENE}", ["start", "window s", "first picture s"], rows, targets)


def _start(environment: dict[str, str]) -> tuple[float, float]:
    before = time.monotonic()
    result = probe(environment, SCENE, "start")
    return result["window"] - before, result["coarse"] - before
