"""Directions of gather rays (R4): variance at equal numbers of rays, by scene and by rule.

Each rule renders one pass with each of a number of seeds; a seed has the same photons by all rules. The variance of a
pixel's indirect light over the seeds is relative to the square of its mean (and a hundredth of the image's), averaged
over the pixels. It includes the photons' own, which no rule can change. Means are compared block by block.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.settings.access import Settings, with_values

LIT = "skylight_room"
SCENES = (LIT, "cornell_diffuse", "cornell_caustic", "rooms_10x10", "cornell_lights")
RULES = ("BSDF", "photon cones", "hemisphere grid")
RAYS = (4, 16)
LOWER, NEVER_WORSE = 2.0, 1.1
BLOCK = 16
MOST_Z = 4.5
"""Of a few hundred blocks, one in hundreds of runs is farther off."""


@dataclass(frozen=True)
class Measured:
    """Indirect light of every seed's picture (seeds, h, w, 3), and mean CPU seconds of the eye pass and of maps."""

    images: NDArray[np.float64]
    eye: float
    maps: float

    @property
    def variance(self) -> float:
        """Relative variance of one picture."""
        mean = self.images.mean(axis=(0, 3))
        variance = self.images.var(axis=0, ddof=1).mean(axis=2)
        return float((variance / (mean**2 + 1e-2 * mean.mean() ** 2)).mean())


def measured(opened: OpenScene, pool: WorkPool, values: dict[str, Any], seeds: int, size: int) -> Measured:
    """Pictures of size × size pixels of one pass each with `values` over the method `gather`."""
    shared = {"render.method": "gather", "camera.width": size, "camera.height": size}
    images = []
    eye = maps = 0.0
    for seed in range(1, seeds + 1):
        settings = with_values(Settings(), {**shared, "render.seed": seed, **values})
        prepare(opened, settings, pool, lambda text, share: None)
        renderer = Renderer(opened, settings, pool, StageStore(0))
        renderer.step()
        images.append(renderer.frame(0).image("indirect").astype(np.float64))
        eye += renderer.tally.stage_seconds["camera pass"] / seeds
        maps += renderer.tally.stage_seconds["maps"] / seeds
    return Measured(np.array(images), eye, maps)


def largest_z(a: Measured, b: Measured) -> float:
    """Largest difference of the means of a block between two rules, in standard errors over the seeds."""

    def blocks(images: NDArray[np.float64]) -> NDArray[np.float64]:
        n, h, w, _ = images.shape
        cut = images[:, : h - h % BLOCK, : w - w % BLOCK].mean(axis=3)
        return cut.reshape(n, h // BLOCK, BLOCK, w // BLOCK, BLOCK).mean(axis=(2, 4))

    difference = blocks(a.images) - blocks(b.images)
    error = difference.std(axis=0, ddof=1) / np.sqrt(len(difference))
    z = np.abs(difference.mean(axis=0)) / np.maximum(error, 1e-12)
    # Seeds are few: Student's t has heavier tails than the normal distribution, by this factor near 4.5.
    return float(z.max() / (1 + 6.0 / len(difference)))


def run(quick: bool = False) -> BenchResult:
    """Measure every rule in every scene."""
    seeds, size = (8, 64) if quick else (12, 80)
    rows: list[list[str | float | int]] = []
    targets = []
    pool = WorkPool()
    try:
        for scene in SCENES[:2] if quick else SCENES:
            opened = open_scene(scene)
            for rays in RAYS[:1] if quick else RAYS:
                by_bsdf = None
                for rule in RULES:
                    made = measured(opened, pool, {"gather.rays": rays, "gather.directions": rule}, seeds, size)
                    by_bsdf = by_bsdf or made
                    ratio = by_bsdf.variance / made.variance
                    efficiency = ratio * (by_bsdf.eye + by_bsdf.maps) / (made.eye + made.maps)
                    z = largest_z(made, by_bsdf)
                    mean = made.images.mean() / by_bsdf.images.mean()
                    rows.append([scene, rays, rule, made.variance, ratio, made.eye, made.maps, efficiency, mean, z])
                    if rule == "BSDF":
                        continue
                    note = f"{scene}, {rays} rays, {rule}: variance"
                    if scene == LIT:
                        targets.append(Target("R4", ratio, LOWER, "times lower", True, note))
                    else:
                        targets.append(Target("R4", 1 / ratio, NEVER_WORSE, "times", False, note))
                    targets.append(Target("R4", z, MOST_Z, "", False, f"{scene}, {rays} rays, {rule}: largest z"))
    finally:
        pool.close()
    columns = [
        "scene",
        "rays",
        "rule",
        "variance",
        "lower",
        "camera pass s",
        "maps s",
        "efficiency",
        "mean",
        "largest z",
    ]
    notes = [
        f"{seeds} seeds, {size} × {size} pixels, one pass; efficiency is variance times CPU seconds of eye pass and "
        "maps, relative to BSDF"
    ]
    return BenchResult("Directions of gather rays", columns, rows, targets, notes)
