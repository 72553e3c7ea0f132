"""From a dragged slider to the first new frame (P9): everything that the window has, but the window itself."""

from __future__ import annotations

import statistics
import time

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.session import Session
from pmviewer.errors import PmviewerError
from pmviewer.settings.access import Settings, get, with_values

SCENE = "cornell_caustic"
SIZE = 512


def run(quick: bool = False) -> BenchResult:
    """Change one setting at a time while the session refines; time until a frame of the new version is published."""
    rounds = 8 if quick else 24
    start = {"camera.width": SIZE, "camera.height": SIZE}
    session = Session(settings=with_values(Settings(), start))
    rows: list[list[str | float | int]] = []
    everything: list[float] = []
    try:
        session.open(SCENE)
        if not session.wait(passes=2, timeout=300):
            raise PmviewerError(f"The session did not start: {session.status.text}")
        for path, values in (
            ("photons.N", (100_000, 150_000, 250_000, 400_000)),
            ("photons.q", (0.2, 0.4, 0.6, 0.8)),
            ("estimate.radius", (0.004, 0.006, 0.01, 0.016)),
            ("camera.fov", (36.0, 38.0, 40.0, 42.0)),
            ("render.method", ("gather", "progressive", "global map", "caustic map")),
        ):
            times = _drag(session, path, values, rounds)
            everything += times
            rows.append([path, statistics.median(times), _quantile(times, 0.95), max(times)])
    finally:
        session.close()
    rows.append(["all", statistics.median(everything), _quantile(everything, 0.95), max(everything)])
    targets = [
        Target("P9", statistics.median(everything), 33, "ms", False, f"median, {SCENE} {SIZE}×{SIZE}"),
        Target("P9", _quantile(everything, 0.95), 66, "ms", False, "95th percentile"),
    ]
    return BenchResult("Slider to first new frame", ["setting", "median ms", "p95 ms", "max ms"], rows, targets)


def _drag(session: Session, path: str, values: tuple, rounds: int) -> list[float]:
    """Milliseconds from each change to its first frame; the session renders passes in between, as under a real drag."""
    times = []
    for i in range(rounds):
        value = values[i % len(values)]
        if get(session.settings, path) == value:
            continue
        start = time.perf_counter()
        version = session.set(with_values(session.settings, {path: value}))
        while True:
            frame = session.frame
            if frame is not None and frame.version >= version:
                break
            if session.status.state == "failed" or time.perf_counter() - start > 60:
                raise PmviewerError(f"No frame after {path} = {value}: {session.status.text}")
            time.sleep(0.0005)
        if i >= 1:  # the first change of a kind may still load a kernel
            times.append((time.perf_counter() - start) * 1e3)
        time.sleep(0.05 + 0.01 * (i % 7))
    return times


def _quantile(values: list[float], share: float) -> float:
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]
