"""Final gather estimation, alone (R7) and with reprojection (R8), against the plain final gather and the irradiance
cache: full gathers, gather rays, difference of pictures, and CPU time to a difference.

Shares are of the safe pixels, in the first pass at the source's resolution, with the default settings. The difference
is in indirect light: the root mean square of the picture's difference from the plain gather's in the limit, over its
mean, pixel by pixel and over blocks of 8 × 8 pixels, which keep what the eye sees as blotches. The limit is known by
two independent long plain renderings a and b: the mean of (x − a)·(x − b) holds none of their noise. Look-up radii stay
what they are in the first pass, so that all methods have the same limit.

The source's gathers with reprojection are said to be as good as one of 65 × 65 rays in each pixel. So is measured what
reprojection costs in rays per safe pixel, and the error of irradiance that it leaves at interpolated pixels beside that
of a gather of as many rays there as a hemisphere of 65 × 65 has cells, both against the same photons seen by two
independent sets of gathers.

A method that does not reach the difference within the time is carried on from its last point by 1/√time, which is the
law of noise: that is too good for what has a bias left, and is said.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
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
from pmviewer.maps.hemisphere import strata
from pmviewer.render.counts import N_COUNTS
from pmviewer.render.gather.estimation import ESTIMATE, TOLD, gather_samples
from pmviewer.render.gather.tiles import INTERPOLATED
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
    "gather reprojection": {"gather.estimation": "on", "gather.reprojection": "on"},
}
COMPARED = (
    ("R7", "gather estimation", ("plain gather", "irradiance cache")),
    ("R8", "gather reprojection", ("plain gather", "irradiance cache", "gather estimation")),
)
"""Whose CPU time is compared with whose."""
FULL, DIFFERENCE = 4.0, 2.0
"""Per cent of the safe pixels that gather in full, and of the difference."""
LONG = "as long as car_cabin needs, where few photons arrive"
"""How the time of the curves was chosen."""
LEAST = 0.01
"""Per cent that two references can tell at best: their noise may well make less of it, or nothing."""
FULL_REPROJECTED, RAYS_A_PIXEL = 2.0, 19.0
"""Per cent of the safe pixels that gather in full with reprojection, and gather rays per safe pixel."""
REPROJECTED, WHOLE = 1800, 4096
"""Rays of full gathers with reprojection, as many as stay below the bound on rays per safe pixel in both scenes; and
about as many as 65 × 65 cells."""
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
    """CPU seconds to a difference, between points by a power law; and whether it was measured, not carried on.
    Differences below what the references can tell count as `LEAST`."""
    known = [(p.cpu, max(p.blocks if by_blocks else p.pixels, LEAST)) for p in points]
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


def reprojected(name: str, size: tuple[int, int], samples: int, pool: WorkPool) -> tuple[str, list[Target]]:
    """A pass with reprojected gathers of so many rays in words, and the targets of its shares, rays and error."""
    values = {"gather.estimation_samples": samples, "gather.rays": 1}
    renderer = Lab(name, *size, pool).renderer({**METHODS["gather reprojection"], **values})
    renderer.step()
    counts = renderer.tally.estimates
    full, some, rays = (counts[key] / counts["safe"] for key in ("full", "partial", "shot"))
    ours, brute, mean = errors(renderer, pool)
    spent = renderer.tally.stage_seconds["gather estimation"]
    note = (
        f"{name}, {size[0]} × {size[1]}, reprojected gathers of {samples} rays: {full:.2%} of the safe pixels in full, "
        f"{some:.2%} in part, {rays:.1f} rays per safe pixel ({counts['shot'] / (size[0] * size[1]):.1f} per pixel), "
        f"{spent:.1f} CPU s; irradiance of interpolated pixels off by {ours:.2%} (rms over its mean; its mean by "
        f"{mean - 1:+.2%}), of gathers of {WHOLE} rays there by {brute:.2%}"
    )
    setting = f"gather.reprojection, gather.estimation_samples={samples}, chosen for it"
    against = f"error of interpolated irradiance over that of {WHOLE} rays in each pixel"
    return note, [
        Target("R8", 100 * full, FULL_REPROJECTED, "%", False, f"{name}: safe pixels that gather in full; {setting}"),
        Target("R8", rays, RAYS_A_PIXEL, "rays", False, f"{name}: gather rays per safe pixel; {setting}"),
        Target("R8", ours / brute, 1.0, "×", False, f"{name}: {against}; {setting}"),
    ]


def errors(renderer: Renderer, pool: WorkPool, points: int = 2000) -> tuple[float, float, float]:
    """Root mean squares of the errors of irradiance, over its mean, at random interpolated pixels: of the pass's
    estimates, and of gathers of `WHOLE` rays in each of them; and the estimates' mean over the true one. The truth is
    known by two independent sets of gathers, whose noise is in neither product."""
    latest = renderer.latest
    estimates = latest.estimates if latest is not None else None
    assert latest is not None
    assert estimates is not None
    known = estimates.known
    assert known is not None
    interpolated = np.flatnonzero(estimates.how.reshape(-1) == INTERPOLATED).astype(np.int32)
    there = np.sort(np.random.default_rng(1).choice(interpolated, min(points, len(interpolated)), replace=False))

    def gathered(index: int, samples: int) -> F8:
        eye, cache = latest.given.eye.copy(), latest.given.cache.copy()
        eye["index"] += index
        cache["rings"], cache["sectors"] = strata(samples)
        given = latest.given._replace(eye=eye, cache=cache)
        plane, told = (np.zeros((len(known.count), columns), np.float32) for columns in (ESTIMATE, TOLD))
        counts = np.zeros(N_COUNTS, np.int64)
        pool.run(
            [
                partial(gather_samples, given, part, known.samples, plane, told, counts, 0, len(part))
                for part in np.array_split(there, 8 * pool.threads)
            ]
        )
        return plane[there, :3].astype(np.float64)

    first, second, brute = gathered(1, 2 * WHOLE), gathered(2, 2 * WHOLE), gathered(3, WHOLE)
    ours = estimates.plane[there, :3].astype(np.float64)
    mean = float(2 * ours.mean() / (first + second).mean())
    return difference(ours, first, second) / 100, difference(brute, first, second) / 100, mean


def times(name: str, curves: Mapping[str, list[Point]]) -> list[Target]:
    """CPU time of the estimation to the difference against each of the others, and of reprojection against that."""
    targets = []
    for by_blocks, what in ((False, "pixels"), (True, "blocks")):
        for feature, ours_name, others in COMPARED:
            ours, measured = time_to(curves[ours_name], DIFFERENCE, by_blocks)
            for other in others:
                theirs, known = time_to(curves[other], DIFFERENCE, by_blocks)
                carried = "" if measured and known else ", carried on"
                note = f"{name}: CPU time to {DIFFERENCE:g} % by {what}, of {ours_name} over {other}{carried}"
                targets.append(Target(feature, ours / theirs, 1.0, "×", False, note))
    return targets


def run(quick: bool = False) -> BenchResult:
    """Shares at the source's resolution; then the difference against CPU time."""
    width, budget, rays, passes = (160, 8.0, 16, 4) if quick else (320, 45.0, 32, 6)
    pool = WorkPool()
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    notes = [f"limits: two plain gathers of {passes} passes of {rays} rays; all others gather {RAYS} rays as usual"]
    try:
        for name in SCENES:
            told, target = shares(name, SOURCE, pool)
            targets.append(target)
            notes.append(
                f"{name}, {SOURCE[0]} × {SOURCE[1]}, first pass: {told[0]:.1f} % of the pixels safe; of these "
                f"{told[1]:.2f} % sparse gathers, {told[2]:.2f} % full gathers in all, {told[3]:.1f} % interpolated, "
                f"{told[4]:.1f} % left to the plain gather"
            )
            note, shown = reprojected(name, SOURCE, REPROJECTED, pool)
            notes.append(note)
            targets += shown
            lab = Lab(name, width, 3 * width // 4, pool)
            limits = lab.limit(1, rays, passes), lab.limit(2, rays, passes)
            curves = {method: lab.curve(values, limits, budget) for method, values in METHODS.items()}
            for method, points in curves.items():
                for p in points:
                    rows.append([name, method, p.passes, p.cpu, p.pixels, p.blocks])
                last = points[-1]
                if method == "gather estimation":
                    note = f"{name}: difference by blocks of {BLOCK} × {BLOCK} after {last.cpu:.0f} CPU s, {LONG}"
                    targets.append(Target("R7", last.blocks, DIFFERENCE, "%", False, note))
            targets += times(name, curves)
    finally:
        pool.close()
    columns = ["scene", "method", "passes", "CPU s", "pixels %", "blocks %"]
    notes.append(f"{width} × {3 * width // 4} pixels, radii kept; 'carried on': from the last point by 1/√time")
    return BenchResult("Final gather estimation", columns, rows, targets, notes)
