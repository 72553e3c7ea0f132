"""Error against time: every method on every bundled scene against its reference (P1–P5).

relMSE over all pixels; CPU seconds of rendering alone, summed over threads, scene loaded and kernels compiled. Methods
run with their default settings, and for each target once more with what automatic mode chooses for that error, whose
trial is not counted: its seconds stand in the notes.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench import peer
from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.auto.choose import Goal, choose
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.exr import read_exr
from pmviewer.output.metric import crossed_relmse, loglog_slope, metrics
from pmviewer.resources import data_folder
from pmviewer.settings.access import Settings, with_values

SCENES = ("cornell_diffuse", "cornell_caustic", "ring_caustic", "rooms_10x10")
METHODS = ("progressive", "gather", "path")
TARGETS = (
    ("P1", "cornell_caustic", 1e-2, 0.15, 0.04),
    ("P2", "cornell_caustic", 1e-3, 1.2, 0.03),
    ("P3", "cornell_diffuse", 1e-2, 0.05, 0.075),
    ("P4", "cornell_diffuse", 1e-3, 0.25, 0.04),
    ("P5a", "ring_caustic", 5e-3, 0.4, 0.5),
    ("P5b", "rooms_10x10", 1e-2, 2.5, 0.5),
)
"""Scene, relMSE, CPU seconds, and our time over Mitsuba's to the same error in the same run."""
BUDGETS = {"cornell_diffuse": 8.0, "cornell_caustic": 24.0, "ring_caustic": 8.0, "rooms_10x10": 16.0}
"""CPU seconds a curve: somewhat more than the slowest target of the scene."""
QUICK_SHARE = 0.1
PEER_BUDGET = 2.5
"""Mitsuba's budget over ours: its time to a target must be found where it is twice ours."""
PEER, PEER_COLOUR = "Mitsuba 3 path", "black"
AUTOMATIC, TRIAL_APART = "automatic", ", its trial not counted"
CHOSEN_WITH = (
    (
        ("cornell_caustic", "ring_caustic"),
        "what a trial takes bias relative to, how far it trusts it, that caustics are those of lights, and that narrow "
        "radii come first",
    ),
    (("cornell_caustic", "cornell_diffuse", "rooms_10x10"), "photons' roulette"),
    (("cornell_caustic", "cornell_diffuse", "rooms_10x10"), "how noise is taken to fall"),
    (
        ("cornell_caustic", "cornell_diffuse", "rooms_10x10"),
        "that fewer photons need not promise less than others, and how few light samples are preferred",
    ),
)
"""What of automatic mode was chosen with which scenes, said in their targets' lines: the denominator and SPREAD of
`pmviewer.engine.auto.widths`, UNSURE and MISSED of `pmviewer.engine.auto.model`, LIGHTS_CAUSTICS of
`pmviewer.engine.auto.candidates`, and what `pmviewer.engine.auto.choose` prefers; CHANNEL_ROULETTE of `candidates`; the
powers of `model` and `measured`; that FEWER_PHOTONS of `choose` does not count for an error, and EVEN of `model`."""
HELD = "how many photons look-ups of maps that are shown hold at first, and how few trajectories tell it"
"""HELD, CAUSTIC_HELD and FEW_TRACED of `pmviewer.engine.stages.spread`: with all of `SCENES`, and for every method."""
WITH_EDGES = ("cornell_diffuse", "cornell_caustic", "rooms_10x10")
EDGES = (
    "how many samples pixels with edges have, gather rays without a record of the cache, how the covered part of discs "
    "is told, how far second gathers go, how wide radii may be, and what bias noise may hide"
)
"""EDGE_RAYS of `pmviewer.engine.method`, MOST_EDGED of `pmviewer.render.edges` and CACHE_RAYS of
`pmviewer.engine.stages.irradiance_cache`, ENOUGH of `pmviewer.render.covered`, CORNERS of
`pmviewer.engine.auto.candidates`, SHOWN_WIDTHS of `pmviewer.engine.auto.model`, HIDDEN of
`pmviewer.engine.auto.widths`: with `WITH_EDGES` among others."""
AUTOMATIC_BUDGET = 8.0
"""Of the curves by what automatic mode chooses, over their target's seconds."""


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
        """−1 for unbiased noise; NaN with fewer than two points in the second half."""
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


def reference_noise(scene: str) -> float:
    """relMSE of its noise, by two halves of its own (`scenes/make/reference.py`)."""
    _, said = read_exr(data_folder("scenes") / scene / "reference.exr")
    return float(said["noise"])


def measure(
    opened: OpenScene,
    method: str,
    budget: float,
    threads: int | None = None,
    limit: int = 4096,
    values: dict[str, Any] | None = None,
    show: Callable[[Renderer], tuple[NDArray[np.float32], float]] | None = None,
    other: NDArray[np.float64] | None = None,
) -> Curve:
    """Render until `budget` CPU seconds are spent; the error is taken at passes 1, 2, 4, … and at the end. `values` are
    further settings; `show` makes another picture of the renderer's than the image, in so many CPU seconds. With an
    `other` reference, independent of the scene's, their noise is no part of the error."""
    settings = with_values(Settings(), {"render.method": method, "render.passes": limit, **(values or {})})
    pool = WorkPool(threads)
    target = reference(opened.scene.name)
    curve = Curve(opened.scene.name, method, [], [], [], [])
    try:
        prepare(opened, settings, pool, lambda text, share: None)
        Renderer(opened, settings, pool, StageStore(0)).step()
        renderer = Renderer(opened, settings, pool, StageStore(0))
        while not renderer.finished:
            renderer.step()
            spent = renderer.tally.cpu_seconds
            last = spent >= budget or renderer.finished
            if last or renderer.passes & (renderer.passes - 1) == 0:
                image, more = show(renderer) if show is not None else (renderer.frame(0).image(), 0.0)
                measured = metrics(image.astype(np.float64), target)
                curve.passes.append(renderer.passes)
                curve.cpu.append(spent + more)
                curve.error.append(measured.relmse_all if other is None else crossed_relmse(image, target, other))
                curve.ratio.append(measured.mean_ratio)
            if last:
                break
    finally:
        pool.close()
    print(curve.scene, method, f"{curve.error[-1]:.3g} after {curve.cpu[-1]:.3g} CPU s", file=sys.stderr, flush=True)
    return curve


def measure_peer(scene: str, budget: float) -> Curve:
    """Mitsuba's path integrator on the same file, its samples per pixel in place of passes. Raises PmviewerError."""
    spp, cpu, images = peer.error_images(scene, budget)
    found = [metrics(image.astype(np.float64), reference(scene)) for image in images]
    method = f"{PEER}, {peer.variant()}"
    return Curve(scene, method, spp, cpu, [m.relmse_all for m in found], [m.mean_ratio for m in found])


def chosen_for(opened: OpenScene, error: float) -> tuple[dict[str, Any], str]:
    """The settings that automatic mode chooses for that error, and a sentence about them."""
    pool = WorkPool()
    try:
        choice = choose(opened, Settings(), Goal(error=error), pool, lambda text, share: None)
    finally:
        pool.close()
    changed = ", ".join(f"{path} = {value}" for path, value in choice.changed.items()) or "the defaults"
    of, spent = f"{error:g} on {opened.scene.name}", choice.trial.cpu_seconds
    return dict(choice.values), f"automatic mode for {of}: {changed}; {spent:.2g} CPU s of trial besides"


def automatic(scene: str, error: float, budget: float) -> tuple[Curve, str]:
    """The curve of what automatic mode chooses for that error, and a sentence about its choice."""
    opened = open_scene(scene)
    values, said = chosen_for(opened, error)
    curve = measure(opened, values["render.method"], budget, values=values)
    return replace(curve, method=f"{AUTOMATIC} for {error:g}"), said


def chosen_with(best: Curve) -> str:
    """What of a curve's way of rendering was chosen with its scene, as an end of its target's line."""
    by_choice = best.method.startswith(AUTOMATIC)
    found = [what for scenes, what in CHOSEN_WITH if by_choice and best.scene in scenes]
    found += [HELD, EDGES] if best.scene in WITH_EDGES else [HELD]
    return (TRIAL_APART if by_choice else "") + "; chosen with this scene among others: " + "; ".join(found)


def against_peer(curves: list[Curve], peers: list[Curve]) -> list[Target]:
    """Our best time over Mitsuba's for each target; where its budget ran out first, an upper bound of the ratio."""
    targets = []
    for target, scene, error, _, share in TARGETS:
        best = min((c for c in curves if c.scene == scene), key=lambda c: c.time_to(error))
        curve = next(c for c in peers if c.scene == scene)
        theirs = curve.time_to(error)
        note = f"of the time of {curve.method} to relMSE {error:g} on {scene}"
        if not math.isfinite(theirs):
            theirs, note = curve.cpu[-1], note + f", which it did not reach within {curve.cpu[-1]:.3g} CPU s"
        note += f"; {best.method}{chosen_with(best)}"
        targets.append(Target(f"{target} peer", best.time_to(error) / theirs, share, "", False, note))
    return targets


def run(quick: bool = False) -> BenchResult:
    """Measure all curves, Mitsuba's too if it is installed; also writes a plot when matplotlib is installed."""
    share = QUICK_SHARE if quick else 1.0
    budgets = {scene: share * seconds for scene, seconds in BUDGETS.items()}
    started = time.perf_counter()
    curves = [measure(open_scene(scene), method, budgets[scene]) for scene in SCENES for method in METHODS]
    notes = ["CPU s a curve: " + ", ".join(f"{scene} {budgets[scene]:.3g}" for scene in SCENES)]
    for _, scene, error, bound, _ in TARGETS:
        curve, said = automatic(scene, error, min(budgets[scene], AUTOMATIC_BUDGET * bound))
        curves.append(curve)
        notes.append(said)
    peers: list[Curve] = []
    if peer.installed():
        peers = [measure_peer(scene, PEER_BUDGET * budgets[scene]) for scene in SCENES]
        notes.append(f"{PEER}: {peer.variant()}, samples per pixel as passes, {PEER_BUDGET:g} times the CPU seconds")
    else:
        notes.append(peer.MISSING)
    rows: list[list[str | float | int]] = []
    for curve in sorted(curves + peers, key=lambda c: SCENES.index(c.scene)):
        for n, cpu, error, ratio in zip(curve.passes, curve.cpu, curve.error, curve.ratio, strict=True):
            slope = curve.slope if n == curve.passes[-1] else ""
            rows.append([curve.scene, curve.method, n, cpu, error, f"{ratio:.4f}", slope])
    targets = []
    for target, scene, error, bound, _ in TARGETS:
        best = min((c for c in curves if c.scene == scene), key=lambda c: c.time_to(error))
        note = f"{scene} to relMSE {error:g}, best: {best.method}{chosen_with(best)}"
        targets.append(Target(target, best.time_to(error), bound, "CPU s", False, note))
    if peers:
        targets += against_peer(curves, peers)
    notes.append(f"{time.perf_counter() - started:.0f} s in all")
    notes.append(plot(curves + peers, Path("bench-error.png")))
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

    figure, axes = pyplot.subplots(2, 2, figsize=(11, 10), sharey=True, layout="constrained")
    for axis, scene in zip(axes.flat, SCENES, strict=True):
        for number, curve in enumerate(curve for curve in curves if curve.scene == scene):
            colour = PEER_COLOUR if curve.method.startswith(PEER) else f"C{number}"
            label = f"{curve.method} ({curve.slope:.2f})"
            axis.loglog(curve.cpu, curve.error, marker="o", markersize=3, color=colour, label=label)
        for target, of_scene, error, bound, _ in TARGETS:
            if of_scene == scene:
                axis.plot(bound, error, "x", color="black")
                axis.annotate(target, (bound, error), textcoords="offset points", xytext=(5, 5))
        axis.set(title=scene, xlabel="CPU seconds", ylabel="relMSE")
        axis.grid(alpha=0.3)
        axis.legend(
            title="method (slope)",
            loc="upper center",
            bbox_to_anchor=(0.5, -0.13),
            ncols=2,
            fontsize="small",
            frameon=False,
        )
    figure.savefig(path, dpi=120)
    pyplot.close(figure)
    return f"plot written to {path}"
