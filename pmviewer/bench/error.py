"""Error against time: every method on every bundled scene against its reference (P1–P5).

relMSE over all pixels; CPU seconds of rendering alone, summed over threads, scene loaded and kernels compiled.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.cache import StageCache
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.output.exr import read_exr
from pmviewer.output.metric import loglog_slope, metrics
from pmviewer.resources import data_folder
from pmviewer.settings import Settings, with_values

SCENES = ("cornell_diffuse", "cornell_caustic", "ring_caustic", "rooms_10x10")
METHODS = ("progressive", "gather", "path")
TARGETS = (
    ("P1", "cornell_caustic", 1e-2, 0.4),
    ("P2", "cornell_caustic", 1e-3, 20.0),
    ("P3", "cornell_diffuse", 1e-2, 0.25),
    ("P4", "cornell_diffuse", 1e-3, 2.8),
    ("P5a", "ring_caustic", 5e-3, 1.5),
    ("P5b", "rooms_10x10", 1e-2, 10.0),
)
FIRST_STEP = ("progressive", "cornell_caustic", 1e-2, 1.0)


@dataclass(frozen=True)
class Curve:
    """Error of one method on one scene at passes 1, 2, 4 … `slope` is that of log error against log passes over the
    second half of the points."""

    scene: str
    method: str
    passes: list[int]
    cpu: list[float]
    error: list[float]
    ratio: list[float]

    @property
    def slope(self) -> float:
        half = len(self.passes) // 2
        return loglog_slope(self.passes[half:], self.error[half:]) if len(self.passes) - half > 1 else math.nan

    def time_to(self, error: float) -> float:
        """CPU seconds at which the error falls to that value, by log-log interpolation; inf if it never does."""
        for i, value in enumerate(self.error):
            if value <= error:
                if i == 0:
                    return self.cpu[0]
                a, b = math.log(self.error[i - 1]), math.log(value)
                share = (a - math.log(error)) / (a - b)
                return math.exp((1 - share) * math.log(self.cpu[i - 1]) + share * math.log(self.cpu[i]))
        return math.inf


def reference(scene: str) -> np.ndarray:
    """The scene's converged reference image (h, w, 3) float64."""
    layers, _ = read_exr(data_folder("scenes") / scene / "reference.exr")
    return layers[""].astype(np.float64)


def measure(opened: OpenScene, method: str, budget: float, threads: int | None = None, limit: int = 4096) -> Curve:
    """Render until `budget` CPU seconds are spent; the error is taken at passes 1, 2, 4, … and at the end."""
    settings = with_values(Settings(), {"render.method": method, "render.passes": limit})
    pool = WorkPool(threads)
    target = reference(opened.scene.name)
    curve = Curve(opened.scene.name, method, [], [], [], [])
    try:
        prepare(opened, settings, pool, lambda text, share: None)
        Renderer(opened, settings, pool, StageCache(0)).step()
        renderer = Renderer(opened, settings, pool, StageCache(0))
        while not renderer.finished:
            renderer.step()
            spent = renderer.cpu_seconds
            last = spent >= budget or renderer.finished
            if last or renderer.passes & (renderer.passes - 1) == 0:
                image = renderer.frame(0).image().astype(np.float64)
                measured = metrics(image, target)
                curve.passes.append(renderer.passes)
                curve.cpu.append(spent)
                curve.error.append(measured.relmse_all)
                curve.ratio.append(measured.mean_ratio)
            if last:
                break
    finally:
        pool.close()
    return curve


def run(quick: bool = False) -> BenchResult:
    """Measure all curves; also writes a plot when matplotlib is installed."""
    budget = 2.0 if quick else 24.0
    started = time.perf_counter()
    curves = [measure(open_scene(scene), method, budget) for scene in SCENES for method in METHODS]
    rows: list[list[str | float | int]] = []
    for curve in curves:
        for n, cpu, error, ratio in zip(curve.passes, curve.cpu, curve.error, curve.ratio, strict=True):
            slope = curve.slope if n == curve.passes[-1] else ""
            rows.append([curve.scene, curve.method, n, cpu, error, f"{ratio:.4f}", slope])
    targets = []
    for target, scene, error, bound in TARGETS:
        best = min((c for c in curves if c.scene == scene), key=lambda c: c.time_to(error))
        note = f"{scene} to relMSE {error:g}, best method: {best.method}"
        targets.append(Target(target, best.time_to(error), bound, "CPU s", False, note))
    method, scene, error, bound = FIRST_STEP
    curve = next(c for c in curves if (c.method, c.scene) == (method, scene))
    targets.append(Target("P1", curve.time_to(error), bound, "CPU s", False, f"first step: {method} on {scene}"))
    notes = [f"budget {budget:g} CPU s a curve, {time.perf_counter() - started:.0f} s in all"]
    notes.append(plot(curves, Path("bench-error.png")))
    columns = ["scene", "method", "passes", "CPU s", "relMSE", "mean ratio", "slope"]
    return BenchResult("Error against time", columns, rows, targets, notes)


def plot(curves: list[Curve], path: Path) -> str:
    """Write the curves as a picture; a sentence saying where, or why not."""
    try:
        import matplotlib
    except ImportError:
        return "no plot: install the bench extra for matplotlib"
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 2, figsize=(11, 8), sharey=True, layout="constrained")
    for axis, scene in zip(axes.flat, SCENES, strict=True):
        for curve in curves:
            if curve.scene == scene:
                axis.loglog(
                    curve.cpu, curve.error, marker="o", markersize=3, label=f"{curve.method} ({curve.slope:.2f})"
                )
        for target, of_scene, error, bound in TARGETS:
            if of_scene == scene:
                axis.plot(bound, error, "x", color="black")
                axis.annotate(target, (bound, error), textcoords="offset points", xytext=(5, 5))
        axis.set(title=scene, xlabel="CPU seconds", ylabel="relMSE")
        axis.grid(alpha=0.3)
        axis.legend(title="method (slope)")
    figure.savefig(path, dpi=120)
    pyplot.close(figure)
    return f"plot written to {path}"
