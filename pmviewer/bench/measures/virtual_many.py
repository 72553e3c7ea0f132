"""Very many virtual lights, of which each pixel asks for few (R10): what a pass costs, and what choosing by the tree
over them saves.

Errors as in `pmviewer.bench.measures.virtual`. Making lights is tracing, choosing, their densities and the tree; the
eye pass is all else. What doesn't grow faster than the number of lights is linear; what a pixel pays may grow with
the depth of the tree.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pmviewer.bench.measures.virtual import SCENES, Effort, Lab
from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.pool import WorkPool

NUMBERS = (1_000, 10_000, 100_000)
PER_PIXEL = 64
CHOICES = ("even", "light tree")
ESTIMATORS = ("unweighted", "single step")
FULL, QUICK = Effort(96, 200, 4, 2048, 0), Effort(32, 200, 2, 256, 0)
COLUMNS = (
    "scene",
    "estimator",
    "lights",
    "asked",
    "choice",
    "CPU s of making lights",
    "of the eye pass",
    "relMSE",
    "99.9 % of pixels within",
    "relMSE × eye pass, to 200 asked whole",
)


def run(quick: bool = False) -> BenchResult:
    """Measure both choices in both rooms."""
    effort = QUICK if quick else FULL
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    pool = WorkPool(1)
    try:
        for name in SCENES[:1] if quick else SCENES:
            lab = Lab(name, effort, pool)
            for estimator in ESTIMATORS:
                made, decided = measured(lab, name, estimator, NUMBERS[:2] if quick else NUMBERS)
                rows += made
                targets += decided
    finally:
        pool.close()
    notes = [
        f"{effort.size} × {effort.size} pixels, {PER_PIXEL} lights asked a pixel, {effort.seeds} seeds, one pass; one "
        "thread",
        "bounds were set after a quick run: sorting is n·log n, 1.67 × a light from 1,000 to 100,000",
        "relMSE × eye pass: the time that a pixel's light takes for the same error, the lights being made already",
    ]
    return BenchResult("Many virtual lights", list(COLUMNS), rows, targets, notes)


def measured(
    lab: Lab, name: str, estimator: str, numbers: tuple[int, ...]
) -> tuple[list[list[str | float | int]], list[Target]]:
    """The rows of an estimator in a scene, and the targets that they decide."""
    rows: list[list[str | float | int]] = []
    plain = cost(lab, {"virtual.estimator": estimator, "virtual.number": lab.effort.lights})
    base = plain[1] * plain[2]
    rows.append([name, estimator, lab.effort.lights, lab.effort.lights, "all", *plain, 1.0])
    found: dict[tuple[int, str], tuple[float, float, float, float]] = {}
    for number in numbers:
        for choice in CHOICES:
            values = {"number": number, "per_pixel": PER_PIXEL, "choice": choice, "estimator": estimator}
            one = cost(lab, {f"virtual.{key}": value for key, value in values.items()})
            found[number, choice] = one
            rows.append([name, estimator, number, PER_PIXEL, choice, *one, one[1] * one[2] / base])
    return rows, targets_of(found, name, estimator)


def cost(lab: Lab, values: Mapping[str, Any]) -> tuple[float, float, float, float]:
    """CPU seconds of making a pass's lights and of its eye pass, least of the seeds', relMSE, and the 99.9th percentile
    of the relative error."""
    images, making, eye = [], [], []
    for seed in range(lab.effort.seeds):
        image, stages = lab.staged({"render.method": "virtual lights", "render.seed": 100 + seed, **values})
        images.append(image)
        making.append(stages.get("virtual lights", 0.0))
        eye.append(stages["camera pass"])
    error, percentile, _ = lab.errors(np.stack(images))
    return min(making), min(eye), error, percentile


def targets_of(
    found: Mapping[tuple[int, str], tuple[float, float, float, float]], scene: str, estimator: str
) -> list[Target]:
    """By (making, eye pass, relMSE, percentile) of the number of lights and the choice: growth from the least to the
    most lights, and where nothing weighs spikes down the tree's over the even choice's, with the most."""
    least, most, name = min(n for n, _ in found), max(n for n, _ in found), f"{scene}, {estimator}"
    targets = []
    for choice in CHOICES:
        few, many = found[least, choice], found[most, choice]
        growth = (many[0] / most) / (few[0] / least)
        note = f"{name}, {choice}: CPU time of making a light, {most:,} over {least:,}"
        targets.append(Target("R10", growth, 2.0, "×", False, note))
        note = f"{name}, {choice}: eye pass with {most:,} lights over {least:,}"
        targets.append(Target("R10", many[1] / few[1], 3.0, "×", False, note))
    if estimator == "unweighted":
        spikes = found[most, "even"][3] / found[most, "light tree"][3]
        targets.append(
            Target("R10", spikes, 2.0, "×", True, f"{name}: 99.9th percentile of the error, even over light tree")
        )
    return targets
