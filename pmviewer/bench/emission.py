"""Guided emission: photons traced for the same error of indirect light, without and with it (I6).

A hundred rooms with a light in each, seen by the scene's camera, which looks through doors into others, and by one in
the corner room that sees this room alone. The error is the mean squared error of the indirect term over many seeds,
relative to the squared mean; the truth is the mean of the unbiased variants, which all have the same expectation: z
tells how far their means are apart in standard errors. All trajectories count, those of test photons too. Errors fall
as 1/N, so the ratio of errors at equal N is that of the photons for equal error.

Weights are those of the photons that are stored in important places.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.cache import StageCache
from pmviewer.engine.emission import guidance_of
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.maps.power import luminances
from pmviewer.settings import Settings, with_values

SCENE = "rooms_10x10"
VIEWS: dict[str, dict[str, object]] = {
    "one room": {"camera.origin": (3.5, 1.6, 3.5), "camera.target": (0.5, 1.0, 0.8), "camera.fov": 70.0},
    "scene's camera": {},
}
VARIANTS = ("off", "Peter-Pietrek", "Christensen discard", "Christensen keep")
UNBIASED = ("off", "Peter-Pietrek", "Christensen keep")
SEEDS, FIRST_SEED = 30, 100
MOST_SPREAD = 100.0
"""Bound for the largest weight over the median."""
DARK = 0.01
"""Added to the squared mean, relative to its average: black pixels don't decide."""


@dataclass(frozen=True)
class Measured:
    """One variant: indirect images (seeds, h, w, 3) after all passes; trajectories and stored photons of a run; weights
    of stored photons in important places, all seeds together."""

    images: NDArray[np.float64]
    traced: int
    stored: int
    weights: NDArray[np.float64]

    @property
    def mean(self) -> tuple[float, float]:
        """Mean of the pixels and its standard error."""
        each = self.images.mean(axis=(1, 2, 3))
        return float(each.mean()), float(each.std(ddof=1) / len(each) ** 0.5)


def measure(opened: OpenScene, values: dict[str, object], variant: str, passes: int, pool: WorkPool) -> Measured:
    """Render with every seed."""
    images: list[NDArray[np.float64]] = []
    weights: list[NDArray[np.float64]] = []
    traced = stored = 0
    for seed in range(FIRST_SEED, FIRST_SEED + SEEDS):
        chosen = {"importance.emission": variant, "importance.map": "average", "render.seed": seed}
        settings = with_values(Settings(), values | chosen)
        if seed == FIRST_SEED:
            prepare(opened, settings, pool, lambda text, share: None)
        renderer = Renderer(opened, settings, pool, StageCache(0))
        for _ in range(passes):
            renderer.step()
        frame = renderer.frame(0)
        images.append(frame.image("indirect").astype(np.float64))
        traced, stored = frame.statistics.emitted, frame.statistics.stored["global"]
        if len(weights) < 4:
            weights.append(important_weights(renderer))
    return Measured(np.array(images), traced, stored, np.concatenate(weights))


def important_weights(renderer: Renderer) -> NDArray[np.float64]:
    """Luminance of the latest pass's global photons in important places, relative to Φ/N; (0,) without guided emission,
    when all have 1."""
    guidance, photons = guidance_of(renderer.settings, renderer.plan, renderer.importance), renderer.light.photons
    if guidance is None or photons is None:
        return np.empty(0)
    rows, weights = photons.global_, np.empty(len(photons.global_), np.float32)
    luminances(rows.view(np.uint32), weights)
    importance = next(goal.importance for goal in guidance.sought if goal.photons == "global" and goal.places)
    important = importance(rows[:, :3], photons.normals) >= guidance.important
    return weights[important].astype(np.float64)


def compare(view: str, passes: int, opened: OpenScene, values: dict[str, object], pool: WorkPool) -> BenchResult:
    """All variants for one view."""
    made = {variant: measure(opened, values | VIEWS[view], variant, passes, pool) for variant in VARIANTS}
    truth = np.mean([made[variant].images.mean(axis=0) for variant in UNBIASED[1:]], axis=0)
    weight = 1 / (truth**2 + DARK * (truth**2).mean())
    error = {}
    for variant, m in made.items():
        spread = (m.images.var(axis=0, ddof=1) * weight).mean()
        bias = ((m.images.mean(axis=0) - truth) ** 2 * weight).mean() - spread / SEEDS
        error[variant] = float(spread + (max(bias, 0.0) if variant not in UNBIASED else 0.0))
    rows: list[list[str | float | int]] = []
    targets = []
    for variant, m in made.items():
        gain, z, spread = error["off"] / error[variant], 0.0, [1.0, 1.0]
        if variant != "off":
            others = [made[v].mean for v in UNBIASED if v != variant]
            (mean, own), (other, its) = m.mean, min(others, key=lambda pair: pair[1])
            z = (mean - other) / float(np.hypot(own, its))
            low, median, high, largest = np.percentile(m.weights, (1, 50, 99, 100))
            spread = [high / low, largest / median]
            targets.append(Target("I6", gain, 8.0, "× fewer traced photons", True, f"{view}, {variant}"))
            bound, what = MOST_SPREAD, "largest weight over the median in important places"
            targets.append(Target("I6", spread[1], bound, "", False, f"{view}, {variant}: {what}"))
            if variant in UNBIASED:
                targets.append(
                    Target("I6", abs(z), 3.0, "standard errors", False, f"{view}, {variant}: |z| of the mean")
                )
        bias = 100 * (m.mean[0] / float(truth.mean()) - 1)
        rows.append([view, variant, m.traced, m.stored, error[variant], gain, bias, z, *spread])
    columns = ["view", "emission", "traced", "stored", "error", "gain", "mean %", "z", "weights 99/1", "largest/median"]
    return BenchResult("Guided emission", columns, rows, targets)


def run(quick: bool = False) -> BenchResult:
    """Compare the variants; `quick` leaves out the scene's camera, takes fewer photons and pixels."""
    N, size, passes = (30_000, 24, 2) if quick else (60_000, 48, 2)
    values = {
        "render.method": "progressive",
        "camera.width": size,
        "camera.height": size,
        "photons.N": N,
        "estimate.alpha": 1.0,
    }
    opened, pool = open_scene(SCENE), WorkPool()
    try:
        parts = [compare(view, passes, opened, values, pool) for view in list(VIEWS)[: 1 if quick else 2]]
    finally:
        pool.close()
    notes = [
        f"{SCENE}, {size} × {size} pixels, {passes} passes of {N:,} photons, {SEEDS} seeds, one look-up radius",
        "z and mean against the other unbiased variants; Christensen discard is biased, which its error includes",
    ]
    rows, targets = [row for part in parts for row in part.rows], [t for part in parts for t in part.targets]
    return BenchResult("Guided emission", parts[0].columns, rows, targets, notes)
