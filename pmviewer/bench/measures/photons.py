"""Photon tracing: trajectories per second and core (P8), bytes per stored photon with structure (P13)."""

from __future__ import annotations

import statistics
import time

import numpy as np

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.maps.search.grid import build_grid
from pmviewer.maps.search.kdtree import build_kdtree
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.settings.access import Photons


def run(quick: bool = False) -> BenchResult:
    """Trace passes of several scenes on one thread; CPU time, median of rounds."""
    N = 200_000 if quick else 1_000_000
    rounds = 3 if quick else 7
    pool = WorkPool(1)
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    for name in ("cornell_diffuse", "cornell_caustic", "ring_caustic", "rooms_10x10"):
        opened = open_scene(name)
        settings = Photons(q=1.0)
        specular = opened.traits.has_specular
        seconds: list[float] = []
        photons: PhotonMaps | None = None
        for index in range(rounds + 1):
            before, start = pool.cpu_seconds, time.perf_counter()
            photons = trace_pass(opened.flat, settings, 1, index * N, N, specular, pool.run)
            seconds.append(pool.cpu_seconds - before)
            wall = time.perf_counter() - start
        assert photons is not None
        spent = statistics.median(seconds[1:])
        stored = len(photons.global_) + len(photons.caustic)
        rows.append([name, N / spent / 1e6, stored / spent / 1e6, photons.rays / spent / 1e6, stored / N, wall])
        if name == "cornell_caustic":
            note = "emitted, traced and stored trajectories, Sobol, one core"
            targets.append(Target("P8", N / spent / 1e6, 3.5, "M/s", True, note))
            grid = build_grid(photons.global_, 0.01 * opened.flat.radius, photons.global_unit)
            tree = build_kdtree(photons.global_, photons.global_unit)
            targets.append(Target("P13", grid.bytes / grid.n, 31, "bytes/photon", False, "grid of a progressive pass"))
            targets.append(Target("P13", tree.bytes / tree.n, 31, "bytes/photon", False, "kd-tree"))
    pool.close()
    columns = ["scene", "M trajectories/s", "M stored/s", "M rays/s", "stored per trajectory", "wall s"]
    return BenchResult(
        "Photon tracing, one core, q = 1", columns, rows, targets, [f"numpy {np.__version__}, {N} a pass"]
    )
