"""`python docs/cluster_scale.py`: measure a pass, its way and its merging on this machine, and draw how far a cluster
would scale with them (images/cluster-scale.png). Needs the extras `cluster` and `bench`.

The model: n workers together finish n passes in the time of one; a pass takes the line for its bytes and the client for
being received and added, both one at a time. The slowest of the three is the speed: r(n) = 1 / max(t/n, b/B, m).
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pmviewer.engine.cluster.packed import pack
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.render.film import Increment
from pmviewer.settings.access import Settings, with_values

SCENE, SIZE, PASSES = "cornell_caustic", 512, 10
WORKERS = np.unique(np.geomspace(1, 1000, 200).round().astype(int))
GIGABIT = 1e9 / 8
PICTURE = Path(__file__).resolve().parent / "images" / "cluster-scale.png"


@dataclass(frozen=True)
class Costs:
    """Of one pass: seconds on a worker of one thread, bytes on the line, seconds of the client."""

    work: float
    size: float
    merge: float

    def rate(self, workers: np.ndarray, line: float) -> np.ndarray:
        """Passes a second by the number of workers, over a line of so many bytes a second."""
        return 1.0 / np.maximum(self.work / workers, max(self.size / line, self.merge))

    def limit(self, line: float) -> float:
        """Workers from which on more of them bring nothing."""
        return self.work / max(self.size / line, self.merge)


def median(call: Callable[[], object], times: int) -> float:
    """CPU seconds of a call, which other work on this machine changes little."""
    took = []
    for _ in range(times):
        start = time.process_time()
        call()
        took.append(time.process_time() - start)
    return float(np.median(took))


def received() -> float:
    """CPU seconds that Dask's client and scheduler, both in this process, take for a task and its small result."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0", silence_logs=logging.CRITICAL) as local,
        Client(local) as client,
    ):
        client.submit(abs, -1, key="first").result()
        start = time.process_time()
        futures = [client.submit(abs, -i, key=f"task {i}") for i in range(500)]
        for future in futures:
            future.result()
        return (time.process_time() - start) / len(futures)


def measured() -> tuple[Costs, float, float, float]:
    """The costs of a pass; of the client's seconds those for unpacking onto the film, for the estimate of the
    error, and for the task."""
    settings = with_values(Settings(), {"camera.width": SIZE, "camera.height": SIZE})
    opened = open_scene(SCENE)
    there, here = (Renderer(opened, settings, WorkPool(1), StageStore(0)) for _ in range(2))
    made: list[Increment] = []
    work = median(lambda: made.append(there.increment(len(made))), PASSES)
    spans = there.film.spans(1)
    pack(made[0], spans)
    packing = median(lambda: pack(made[0], spans), 5)
    packed = pack(made[0], spans)
    film = there.film
    packed.add_to(film)
    unpacking = median(lambda: packed.add_to(film), 5)
    adding = median(lambda: here.add(packed), PASSES) - unpacking
    task = received()
    raw = made[0].sums.nbytes
    print(
        f"{SCENE} {SIZE}²: pass {work:.3f} s, packing {packing:.3f} s, {raw / 1e6:.1f} MB → {packed.bytes / 1e6:.2f} MB"
    )
    print(f"client: unpacking onto the film {unpacking:.4f} s, error and moments {adding:.4f} s, a task {task:.4f} s")
    return Costs(work + packing, packed.bytes, unpacking + adding + task), unpacking, adding, task


def main() -> None:
    """Measure, print and draw."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    costs, unpacking, adding, task = measured()
    # A sum of eight passes is no float32 any more and as large as float64; each of its passes is still added somewhere.
    eight = replace(costs, size=2 * costs.size / 8, merge=(2 * unpacking + adding + task) / 8)
    half = replace(costs, size=costs.size / 2)
    # Sixteen times the photons and samples in a pass: an increment of the same size for sixteen times the work.
    large = Costs(16 * costs.work, costs.size, costs.merge)
    cases = [
        ("as it is, 1 Gbit/s", costs, 1.0, GIGABIT, "C0", "-"),
        ("as it is, 10 Gbit/s", costs, 1.0, 10 * GIGABIT, "C0", "--"),
        ("float16 deltas, 1 Gbit/s", half, 1.0, GIGABIT, "C1", "-"),
        ("tree: sums of 8 passes, 1 Gbit/s", eight, 1.0, GIGABIT, "C2", "-"),
        ("tree: sums of 8 passes, 10 Gbit/s", eight, 1.0, 10 * GIGABIT, "C2", "--"),
        ("passes 16 times as large, 1 Gbit/s", large, 16.0, GIGABIT, "C3", "-"),
    ]
    figure, axes = plt.subplots(figsize=(7.2, 4.6), dpi=110)
    axes.plot(WORKERS, WORKERS, color="0.8", linewidth=1, label="ideal")
    for label, of, worth, line, colour, style in cases:
        axes.plot(WORKERS, worth * of.rate(WORKERS, line) * costs.work, style, color=colour, label=label)
        print(f"{label}: up to {of.limit(line):.0f} workers, {worth * of.limit(line) / of.work * costs.work:.0f}×")
    axes.set(xscale="log", yscale="log", xlim=(1, 1000), ylim=(1, 1000))
    axes.set(xlabel="workers of one thread", ylabel="times one worker's speed", title=f"{SCENE}, {SIZE} × {SIZE}")
    axes.grid(alpha=0.3, which="both")
    axes.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(PICTURE)
    print(f"wrote {PICTURE.name}, {PICTURE.stat().st_size // 1024} KB")


if __name__ == "__main__":
    main()
