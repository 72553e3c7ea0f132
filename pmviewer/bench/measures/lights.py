"""Many lights: shadow rays that each rule of choosing lights needs for the same error of direct light (R2).

The scene has a hundred lights of nearly the same power, so that "power" samples them almost uniformly. The error is
relMSE's variance part, from two seeds: half their mean squared difference. All rules have the same expectation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.measures.error import reference
from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import EPSILON, block_means
from pmviewer.settings.access import Settings, with_values

SCENE = "rooms_10x10"
SEEDS = (11, 12)
RULES: dict[str, dict[str, object]] = {
    "power": {"direct.choice": "power", "photons.N": 1000},  # direct light then asks no photons
    "photons": {"direct.choice": "photons"},
    "Keller-Wald": {"direct.choice": "Keller-Wald", "direct.con_samples": 1, "direct.noncon_samples": 1},
}


@dataclass(frozen=True)
class RuleCurve:
    """Error of direct light after so many shadow rays per pixel."""

    rule: str
    passes: list[int]
    rays: list[float]
    error: list[float]
    cpu: list[float]

    def rays_to(self, error: float) -> float:
        """Shadow rays per pixel to that error by log-log interpolation; beyond the curve, error ∝ 1/rays."""
        if error < min(self.error):
            return self.rays[-1] * self.error[-1] / error
        order = np.argsort(self.error)
        return math.exp(np.interp(math.log(error), np.log(self.error)[order], np.log(self.rays)[order]))


def measure_rule(opened: OpenScene, rule: str, passes: int, size: int, pool: WorkPool) -> RuleCurve:
    """Render the scene with both seeds at size × size pixels; errors after 1, 2, 4, … passes."""
    values = RULES[rule] | {"render.method": "progressive", "camera.width": size, "camera.height": size}
    runs = [Renderer(opened, with_values(Settings(), values | {"render.seed": s}), pool, StageStore(0)) for s in SEEDS]
    prepare(opened, runs[0].settings, pool, lambda text, share: None)
    target = reference(SCENE)
    weight = 1 / (block_means(target, len(target) // size) ** 2 + EPSILON)
    curve = RuleCurve(rule, [], [], [], [])
    for n in range(1, passes + 1):
        for run in runs:
            run.step()
        if n & (n - 1) == 0:
            frames = [run.frame(0) for run in runs]
            a, b = (frame.image("direct").astype(np.float64) for frame in frames)
            curve.passes.append(n)
            curve.rays.append(n * _mean([frame.statistics.shadow_rays_per_pixel for frame in frames]))
            curve.error.append(float(((a - b) ** 2 / 2 * weight).mean()))
            curve.cpu.append(_mean([frame.statistics.stage_seconds["camera pass"] for frame in frames]))
    return curve


def _mean(values: list[float] | NDArray[np.float64]) -> float:
    return float(np.mean(values))


def run(quick: bool = False) -> BenchResult:
    """Measure the rules and compare them at the error of one pass of each."""
    size, many, few = (64, 128, 2) if quick else (128, 512, 4)
    opened, pool = open_scene(SCENE), WorkPool()
    try:
        curves = [measure_rule(opened, rule, many if rule == "power" else few, size, pool) for rule in RULES]
    finally:
        pool.close()
    rows: list[list[str | float | int]] = []
    for curve in curves:
        for n, rays, error, cpu in zip(curve.passes, curve.rays, curve.error, curve.cpu, strict=True):
            share = rays / curves[0].rays_to(error)
            rows.append([curve.rule, n, rays, error, cpu, share])
    photons = curves[1]
    ratio = photons.rays[0] / curves[0].rays_to(photons.error[0])
    note = f"{SCENE}, rule photons against power at relMSE {photons.error[0]:.3g} of direct light"
    columns = [
        "rule",
        "passes",
        "shadow rays/pixel",
        "relMSE (direct)",
        "camera pass CPU s",
        "rays/power's at this error",
    ]
    notes = [f"{size} × {size} pixels, two seeds; lights of nearly equal power, so that power is nearly uniform"]
    return BenchResult("Choice of lights", columns, rows, [Target("R2", ratio, 0.25, "", False, note)], notes)
