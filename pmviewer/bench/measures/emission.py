"""Guided emission: photons traced for the same error of indirect light, without and with it (I6).

A hundred rooms with a light in each, seen by the scene's camera, which looks through doors into others, and by one in
the corner room that sees this room alone. The error is the mean squared error of the indirect term over many seeds,
relative to the squared mean; the truth is the mean of the unbiased variants, which all have the same expectation: z
tells how far their means are apart in standard errors. All trajectories count, those of test photons too, and so do
the pieces that photons are split into: each is traced as a photon is.

Without guiding the error is measured for several numbers of photons (MORE), and read off at the error of each variant:
so many photons over those of the variant are the gain. The ratio of errors at one number of photons is not, since a
part of the error is that of camera rays, which photons do not mend.

Beside each gain stands what the best table of emission could gain in that view by itself, with the strata that a pass
has and without splitting (`pmviewer.bench.measures.emission_bound`).

Weights are those of the photons that are stored in important places.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.measures.deposition import held_for
from pmviewer.bench.measures.emission_bound import Bound, Float, bound_of
from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.emission import guidance_of
from pmviewer.engine.store import StageStore
from pmviewer.maps.power import luminances
from pmviewer.photons.emission.guided import TEST_SHARE
from pmviewer.settings.access import Settings, with_values

SCENE = "rooms_10x10"
VIEWS: dict[str, dict[str, object]] = {
    "one room": {"camera.origin": (3.5, 1.6, 3.5), "camera.target": (0.5, 1.0, 0.8), "camera.fov": 70.0},
    "scene's camera": {},
}
VARIANTS = ("off", "Peter-Pietrek", "Christensen discard", "Christensen keep")
UNBIASED = ("off", "Peter-Pietrek", "Christensen keep")
SEEDS, QUICK_SEEDS, FIRST_SEED = 20, 12, 100
MORE = (4, 12)
"""How many times as many photons without guiding, with a third of the seeds."""
CHOSEN = "; how photons split, and what test photons count, was chosen by the scene's camera"
"""Of `pmviewer.photons.emission.window` and PRIOR, said in the targets' own line."""
MOST_SPREAD = 100.0
"""Bound for the largest weight over the median."""
DARK = 0.01
"""Added to the squared mean, relative to its average: black pixels don't decide."""


@dataclass(frozen=True)
class Measured:
    """One variant: indirect images (seeds, h, w, 3) after all passes; trajectories, and pieces of others, of a run, and
    stored photons; weights of stored photons in important places, all seeds together."""

    images: NDArray[np.float64]
    traced: float
    stored: int
    weights: NDArray[np.float64]

    @property
    def mean(self) -> tuple[float, float]:
        """Mean of the pixels and its standard error."""
        each = self.images.mean(axis=(1, 2, 3))
        return float(each.mean()), float(each.std(ddof=1) / len(each) ** 0.5)


def measure(
    opened: OpenScene, values: dict[str, object], variant: str, passes: int, pool: WorkPool, seeds: int
) -> Measured:
    """Render with every seed."""
    images: list[NDArray[np.float64]] = []
    weights: list[NDArray[np.float64]] = []
    traced, stored = 0.0, 0
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        chosen = {"importance.emission": variant, "importance.map": "average", "render.seed": seed}
        settings = with_values(Settings(), values | chosen)
        if seed == FIRST_SEED:
            prepare(opened, settings, pool, lambda text, share: None)
        renderer = Renderer(opened, settings, pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
            assert renderer.light.photons is not None
            traced += renderer.light.photons.pieces / seeds
        frame = renderer.frame(0)
        images.append(frame.image("indirect").astype(np.float64))
        traced += frame.statistics.emitted / seeds
        stored = frame.statistics.stored["global"]
        if len(weights) < 4:
            weights.append(important_weights(renderer))
    made = Measured(np.array(images), traced, stored, np.concatenate(weights))
    what = f"{variant}, {round(traced):,} traced, {seeds} seeds: mean {made.mean[0]:.5g} ± {made.mean[1]:.2g}"
    print(what, file=sys.stderr, flush=True)
    return made


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


def compare(
    view: str,
    passes: int,
    opened: OpenScene,
    values: dict[str, object],
    N: int,
    pool: WorkPool,
    trajectories: int,
    seeds: int,
) -> BenchResult:
    """All variants for one view; trajectories: for the bound."""
    values = values | {"photons.N": N}
    made = {variant: measure(opened, values | VIEWS[view], variant, passes, pool, seeds) for variant in VARIANTS}
    truth = np.mean([made[variant].images.mean(axis=0) for variant in UNBIASED[1:]], axis=0)
    weight = 1 / (truth**2 + DARK * (truth**2).mean())
    error = {}
    for variant, m in made.items():
        spread = (m.images.var(axis=0, ddof=1) * weight).mean()
        bias = ((m.images.mean(axis=0) - truth) ** 2 * weight).mean() - spread / seeds
        error[variant] = float(spread + (max(bias, 0.0) if variant not in UNBIASED else 0.0))
    rows: list[list[str | float | int]] = []
    targets = []
    errors, traced = [error["off"]], [made["off"].traced]
    for more in MORE:
        some = measure(opened, values | VIEWS[view] | {"photons.N": more * N}, "off", passes, pool, seeds // 3)
        errors.append(float((some.images.var(axis=0, ddof=1) * weight).mean()))
        traced.append(some.traced)
        rows.append([view, "off", round(some.traced), some.stored, errors[-1], 1.0, 0.0, 0.0, 1.0, 1.0])
    bound = _bound(view, opened, values, weight, pool, trajectories)
    for variant, m in made.items():
        gain, z, spread = held_for(error[variant], errors, traced) / m.traced, 0.0, [1.0, 1.0]
        if variant != "off":
            others = [made[v].mean for v in UNBIASED if v != variant]
            (mean, own), (other, its) = m.mean, min(others, key=lambda pair: pair[1])
            z = (mean - other) / float(np.hypot(own, its))
            low, median, high, largest = np.percentile(m.weights, (1, 50, 99, 100))
            spread = [high / low, largest / median]
            changed = ", ".join(f"{path}={value}" for path, value in (values | VIEWS[view]).items())
            what = f"{view}, importance.emission={variant}, importance.map=average, {changed}, {passes} passes"
            best = f"; without splitting the best table of {bound.n} strata gains {bound.least:.3g} to {bound.most:.3g}"
            targets.append(Target("I6", gain, 8.0, "× fewer traced photons", True, what + best + CHOSEN))
            targets.append(Target("I6", spread[1], MOST_SPREAD, "× the median is the largest weight", False, what))
            if variant in UNBIASED:
                targets.append(Target("I6", abs(z), 3.0, "standard errors off in the mean", False, what))
        bias = 100 * (m.mean[0] / float(truth.mean()) - 1)
        rows.append([view, variant, round(m.traced), m.stored, error[variant], gain, bias, z, *spread])
    columns = ["view", "emission", "traced", "stored", "error", "gain", "mean %", "z", "weights 99/1", "largest/median"]
    return BenchResult("Guided emission", columns, rows, targets)


def _bound(
    view: str, opened: OpenScene, values: dict[str, object], weight: Float, pool: WorkPool, trajectories: int
) -> Bound:
    """What the best table of a pass's strata gains in the view."""
    settings = with_values(Settings(), values | VIEWS[view])
    renderer = Renderer(opened, settings, pool, StageStore(0))
    renderer.step()
    most = int(TEST_SHARE["Peter-Pietrek"] * settings.photons.N) // max(2, settings.importance.tests)
    return bound_of(renderer, weight, most, trajectories)


def run(quick: bool = False) -> BenchResult:
    """Compare the variants; `quick` leaves out the corner room, takes fewer photons and pixels."""
    N, size, passes, trajectories = (30_000, 24, 2, 400_000) if quick else (60_000, 48, 2, 1_500_000)
    seeds = QUICK_SEEDS if quick else SEEDS
    views = ["scene's camera"] if quick else list(VIEWS)
    values = {
        "render.method": "progressive",
        "camera.width": size,
        "camera.height": size,
        "estimate.alpha": 1.0,
    }
    opened, pool = open_scene(SCENE), WorkPool()
    try:
        parts = [compare(view, passes, opened, values, N, pool, trajectories, seeds) for view in views]
    finally:
        pool.close()
    notes = [
        f"{SCENE}, {size} × {size} pixels, {passes} passes of {N:,} photons, {seeds} seeds, one look-up radius",
        "z and mean against the other unbiased variants; Christensen discard is biased, which its error includes",
    ]
    rows, targets = [row for part in parts for row in part.rows], [t for part in parts for t in part.targets]
    return BenchResult("Guided emission", parts[0].columns, rows, targets, notes)
