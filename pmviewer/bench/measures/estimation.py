"""Final gather estimation against the plain final gather and the irradiance cache (R7): full gathers, difference of
pictures, and CPU time to a difference.

Shares are of the safe pixels, in the first pass at the source's resolution, with the default settings. The difference
is in indirect light: the root mean square of the picture's difference from the plain gather's in the limit, over its
mean, pixel by pixel and over blocks of 8 × 8 pixels, which keep what the eye sees as blotches. The limit is known by
two independent long plain renderings a and b: the mean of (x − a)·(x − b) holds none of their noise. Look-up radii stay
what they are in the first pass, so that all methods have the same limit.

A method that does not reach the difference within the time is carried on from its last point by 1/√time, which is the
law of noise: that is too good for what has a bias left, and is said.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
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

SCENES: Mapping[str, dict[str, Any]] = {
    "colonnade": {},
    "car_cabin": {
        "render.thin_glass": "tinted",
        "photons.N": 300_000,
        "importance.map": "screen",
        "importance.emission": "Christensen keep",
    },
}
"""What their pictures are made with: in the car few photons arrive unguided."""
SOURCE = (1024, 768)
"""Resolution of the source's figures."""
RAYS = 16
"""Gather rays of pixels that gather as usual, of all methods."""
METHODS: Mapping[str, dict[str, Any]] = {
    "plain gather": {},
    "irradiance cache": {"gather.cache": "on"},
    "gather estimation": {"gather.estimation": "on"},
}
FULL, DIFFERENCE = 4.0, 2.0
"""Per cent of the safe pixels that gather in full, and of the difference."""
BLOCK = 8
F8 = NDArray[np.float64]


@dataclass(frozen=True)
class Point:
    """A method after some passes: CPU seconds, and differences in per cent by pixel and by block."""

    passes: int
    cpu: float
    pixels: float
    blocks: float


def blocks_of(image: F8, size: int = BLOCK) -> F8:
    """Means over blocks of size × size pixels; what is left at the edges is dropped."""
    h, w = image.shape[0] // size, image.shape[1] // size
    return image[: h * size, : w * size].reshape(h, size, w, size, -1).mean(axis=(1, 3))


def difference(image: F8, first: F8, second: F8) -> float:
    """Per cent: root mean square of the image less what both others show, over their mean; both are independent."""
    product = float(((image - first) * (image - second)).mean())
    return 100 * math.sqrt(max(product, 0.0)) / float(0.5 * (first + second).mean())


def time_to(points: list[Point], bound: float, by_blocks: bool = False) -> tuple[float, bool]:
    """CPU seconds to a difference, between points by a power law; and whether it was measured, not carried on."""
    known = [(p.cpu, p.blocks if by_blocks else p.pixels) for p in points]
    for (t0, d0), (t1, d1) in pairwise(known):
        if d1 <= bound < d0:
            return t0 * (t1 / t0) ** (math.log(d0 / bound) / math.log(d0 / d1)), True
    if known[0][1] <= bound:
        return known[0][0], True
    return known[-1][0] * (known[-1][1] / bound) ** 2, False


class Lab:
    """A scene at one size."""

    def __init__(self, name: str, width: int, height: int, pool: WorkPool) -> None:
        self.opened: OpenScene = open_scene(name)
        self.values = {
            "render.method": "gather",
            "camera.width": width,
            "camera.height": height,
            "gather.rays": RAYS,
            "estimate.alpha": 1.0,
            **SCENES[name],
        }
        self.pool = pool

    def renderer(self, values: Mapping[str, Any]) -> Renderer:
        """A new one, its kernels ready."""
        settings = with_values(Settings(), {**self.values, **values})
        prepare(self.opened, settings, self.pool, lambda text, share: None)
        return Renderer(self.opened, settings, self.pool, StageStore(0))

    def limit(self, seed: int, rays: int, passes: int) -> F8:
        """Indirect light (h, w, 3) of a long plain rendering."""
        renderer = self.renderer({"gather.rays": rays, "render.seed": seed})
        for _ in range(passes):
            renderer.step()
        return renderer.frame(0).image("indirect").astype(np.float64)

    def curve(self, values: Mapping[str, Any], limits: tuple[F8, F8], budget: float) -> list[Point]:
        """Points after 1, 2, 4, … passes until the CPU seconds are spent."""
        renderer = self.renderer({**values, "render.seed": 3})
        coarse = tuple(blocks_of(limit) for limit in limits)
        points: list[Point] = []
        while renderer.tally.cpu_seconds < budget:
            renderer.step()
            if renderer.passes & (renderer.passes - 1) == 0 or renderer.tally.cpu_seconds >= budget:
                image = renderer.frame(0).image("indirect").astype(np.float64)
                off = difference(image, *limits), difference(blocks_of(image), coarse[0], coarse[1])
                points.append(Point(renderer.passes, renderer.tally.cpu_seconds, *off))
        return points


def shares(name: str, size: tuple[int, int], pool: WorkPool) -> tuple[list[float], Target]:
    """Per cent of the pixels that are safe, and of these sparse, in full, interpolated and left; and whether few enough
    gather in full."""
    renderer = Lab(name, *size, pool).renderer({"gather.estimation": "on", "gather.rays": 1})
    renderer.step()
    counts = renderer.tally.estimates
    safe = counts["safe"]
    of_safe = [100 * counts[key] / safe for key in ("sparse", "gathered", "interpolated", "left")]
    told = [100 * safe / (size[0] * size[1]), *of_safe]
    note = f"{name}: safe pixels that gather in full, first pass; default gather.estimation_contrast chosen for it"
    return told, Target("R7", of_safe[1], FULL, "%", False, note)


def times(name: str, curves: Mapping[str, list[Point]]) -> list[Target]:
    """CPU time of the estimation to the difference against each of the others."""
    targets = []
    for by_blocks, what in ((False, "pixels"), (True, "blocks")):
        ours, measured = time_to(curves["gather estimation"], DIFFERENCE, by_blocks)
        for other in ("plain gather", "irradiance cache"):
            theirs, known = time_to(curves[other], DIFFERENCE, by_blocks)
            carried = "" if measured and known else ", carried on"
            note = f"{name}: CPU time to {DIFFERENCE:g} % by {what}, of estimation over {other}{carried}"
            targets.append(Target("R7", ours / theirs, 1.0, "×", False, note))
    return targets


def run(quick: bool = False) -> BenchResult:
    """Shares at the source's resolution; then the difference against CPU time."""
    width, budget, rays, passes = (160, 4.0, 16, 4) if quick else (320, 25.0, 32, 6)
    size = (512, 384) if quick else SOURCE
    pool = WorkPool()
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    notes = [f"limits: two plain gathers of {passes} passes of {rays} rays; all others gather {RAYS} rays as usual"]
    try:
        for name in SCENES:
            told, target = shares(name, size, pool)
            if not quick:
                targets.append(target)
            notes.append(
                f"{name}, {size[0]} × {size[1]}, first pass: {told[0]:.1f} % of the pixels safe; of these "
                f"{told[1]:.2f} % sparse gathers, {told[2]:.2f} % full gathers in all, {told[3]:.1f} % interpolated, "
                f"{told[4]:.1f} % left to the plain gather"
            )
            lab = Lab(name, width, 3 * width // 4, pool)
            limits = lab.limit(1, rays, passes), lab.limit(2, rays, passes)
            curves = {method: lab.curve(values, limits, budget) for method, values in METHODS.items()}
            for method, points in curves.items():
                for p in points:
                    rows.append([name, method, p.passes, p.cpu, p.pixels, p.blocks])
                last = points[-1]
                if method == "gather estimation":
                    note = f"{name}: difference by blocks of {BLOCK} × {BLOCK} after {last.cpu:.0f} CPU s"
                    targets.append(Target("R7", last.blocks, DIFFERENCE, "%", False, note))
            targets += times(name, curves)
    finally:
        pool.close()
    columns = ["scene", "method", "passes", "CPU s", "pixels %", "blocks %"]
    notes.append(f"{width} × {3 * width // 4} pixels, radii kept; 'carried on': from the last point by 1/√time")
    return BenchResult("Final gather estimation", columns, rows, targets, notes)
