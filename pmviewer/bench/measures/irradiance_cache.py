"""The irradiance cache against the plain final gather (R6): gathers saved, difference of images, error against time.

The difference is in indirect light alone, over its mean. "mean" is that of the absolute difference from the plain
gather with the same photons and camera rays, the noise of both included. "RMS" is free of the plain gather's noise: the
root of the mean of (cached − first)·(cached − second), where the second plain rendering has another seed. The gathers
of all have as many rays.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.measures.error import Curve, measure, reference
from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import squared_error
from pmviewer.settings.access import Settings, with_values

SCENES = ("cornell_diffuse", "cornell_caustic")
RAYS = 64
"""Rays of a gather, in the cache and without it."""
COUNTED: dict[str, Any] = {"gather.rays": RAYS, "render.edge_rays": 1}
"""Where gathers are counted, pixels have one sample."""
FEWER, DIFFERENCE = 10.0, 2.0
P3, P4 = (1e-2, 0.25), (1e-3, 2.8)
"""relMSE and CPU seconds on the first scene."""
METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    "progressive": ("progressive", {}),
    "gather": ("gather", {}),
    "gather, cache": ("gather", {"gather.cache": "on"}),
    "progressive, N/3": ("progressive", {"photons.N": 50_000}),
    "gather, cache, N/3": ("gather", {"gather.cache": "on", "photons.N": 50_000, "gather.cache_samples": 32}),
}
"""Curves of error against time: at the default settings, and with fewer photons a pass."""
TERMS = ("emission", "direct", "indirect")


def _renderer(opened: OpenScene, pool: WorkPool, values: dict[str, Any]) -> Renderer:
    settings = with_values(Settings(), {"render.method": "gather", **values})
    prepare(opened, settings, pool, lambda text, share: None)
    return Renderer(opened, settings, pool, StageStore(0))


def _gathered(renderer: Renderer) -> NDArray[np.float64]:
    frame = renderer.frame(0)
    return frame.image("indirect").astype(np.float64)


def _plain(opened: OpenScene, pool: WorkPool, seed: int, passes: int) -> tuple[NDArray[np.float64], Renderer]:
    renderer = _renderer(opened, pool, {"render.seed": seed, **COUNTED})
    for _ in range(passes):
        renderer.step()
    return _gathered(renderer), renderer


def difference(image: NDArray[np.float64], first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Root mean square of the image less what both others show, over the mean; both are independent."""
    product = float(((image - first) * (image - second)).mean())
    return math.sqrt(max(product, 0.0)) / float(0.5 * (first + second).mean())


def _gathers(opened: OpenScene, pool: WorkPool, passes: int) -> tuple[list[list[str | float | int]], list[Target]]:
    """Rows and targets of one scene: the cache at passes 1, 2, 4, … against the plain gather after all passes. Pixels
    have one sample each, as those have that the source counts gathers of: more of them at edges are more gathers."""
    first, plain = _plain(opened, pool, 1, passes)
    second, _ = _plain(opened, pool, 2, passes)
    name = opened.scene.name
    plain_cpu = plain.tally.stage_seconds["camera pass"] / passes
    rows: list[list[str | float | int]] = [[name, "off", passes, "", 1.0, "", plain_cpu, "", ""]]
    cached = _renderer(opened, pool, {"gather.cache": "on", "gather.cache_samples": RAYS, **COUNTED})
    fewer = percent = math.nan
    while cached.passes < passes:
        cached.step()
        if cached.passes & (cached.passes - 1) == 0:
            statistics = cached.frame(0).statistics
            image = _gathered(cached)
            percent = 100 * float(np.abs(image - first).mean() / first.mean())
            rms = 100 * difference(image, first, second)
            fewer = (cached.tally.cached + cached.tally.gathered) / (cached.tally.records + cached.tally.gathered)
            spent = (
                cached.tally.stage_seconds["camera pass"] + cached.tally.stage_seconds["irradiance cache"]
            ) / cached.passes
            share = 100 * statistics.interpolated
            rows.append([name, "on", cached.passes, statistics.cache_records, fewer, share, spent, percent, rms])
    note = f"{name}, {cached.passes} passes, {RAYS} rays a gather, render.edge_rays=1"
    targets = [Target("R6", fewer, FEWER, "times fewer gathers", True, note)]
    targets.append(Target("R6", percent, DIFFERENCE, "%", False, f"{note}: difference in indirect light"))
    return rows, targets


def _term_errors(opened: OpenScene, pool: WorkPool, passes: int) -> str:
    """Which term holds the error: relMSE of each against a longer run of itself, after the second pass."""
    renderer = _renderer(opened, pool, {"gather.cache": "on"})
    early: dict[str, NDArray[np.float32]] = {}
    while renderer.passes < passes:
        renderer.step()
        if renderer.passes == 2:
            early = {term: renderer.frame(0).image(term) for term in TERMS}
    final = renderer.frame(0)
    target = reference(opened.scene.name)
    held = [
        f"{term} {float(squared_error(early[term] - final.image(term) + target, target).mean()):.2e}" for term in TERMS
    ]
    return f"{opened.scene.name}: relMSE by term after two passes with the cache: {', '.join(held)}"


def run(quick: bool = False) -> BenchResult:
    """Gathers and difference on the Cornell boxes; then error against time on the diffuse one."""
    passes, budget = (4, 1.0) if quick else (16, 8.0)
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    notes = []
    pool = WorkPool()
    try:
        for scene in SCENES[:1] if quick else SCENES:
            more, reached = _gathers(open_scene(scene), pool, passes)
            rows += more
            targets += reached
        opened = open_scene(SCENES[0])
        notes.append(_term_errors(opened, pool, 2 * passes))
    finally:
        pool.close()
    for name, (method, values) in METHODS.items():
        curve: Curve = measure(opened, method, budget, values=values)
        points = ", ".join(f"{cpu:.2f} s {error:.1e}" for cpu, error in zip(curve.cpu, curve.error, strict=True))
        notes.append(f"{SCENES[0]}, {name}: {points}")
        for target, (error, bound) in (("P3", P3), ("P4", P4)):
            note = f"{SCENES[0]} to relMSE {error:g}, {name}"
            targets.append(Target(target, curve.time_to(error), bound, "CPU s", False, note))
    columns = ["scene", "cache", "passes", "records", "fewer", "interpolated %", "CPU s a pass", "mean %", "RMS %"]
    return BenchResult("Irradiance cache in the final gather", columns, rows, targets, notes)
