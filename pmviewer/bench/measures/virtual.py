"""Virtual lights (R10): error of each estimator against the plain sum, at equal number of lights and at equal CPU time.

Pictures are the indirect light alone, against the path tracer's. relMSE is the mean over pixels and seeds of
(I − R)²/(R² + (ε·mean R)²) of luminance, ε = 0.05; the bias of a pixel is that of the mean over seeds. Pixels look at
their middle fifth alone, in the reference as well: a pixel over an edge shows one of two surfaces in a pass, and its
mean is neither, an error of up to twenty that no estimator has a part in. At equal time
each estimator renders as many passes as fit into the same CPU seconds, those of its slowest competitor's two.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
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
from pmviewer.engine.tally import Tally
from pmviewer.settings.access import Settings, with_values

SCENES = ("corner_room", "glossy_room")
ESTIMATORS: Mapping[str, Mapping[str, Any]] = {
    "unweighted": {"virtual.estimator": "unweighted"},
    "clamped": {"virtual.estimator": "clamped"},
    "single step, own density": {"virtual.estimator": "single step", "virtual.density": "virtual lights"},
    "single step": {"virtual.estimator": "single step"},
    "single step, c = 1": {"virtual.estimator": "single step", "virtual.normalisation": "none"},
    "full path": {"virtual.estimator": "full path"},
    "full path, per object": {"virtual.estimator": "full path", "virtual.normalisation": "per object"},
    "every vertex": {"virtual.estimator": "every vertex"},
    "modified": {"virtual.estimator": "modified"},
    "printed single step": {"virtual.estimator": "printed single step"},
    "printed full path": {"virtual.estimator": "printed full path"},
}
CONVERGING = ("unweighted", "single step", "full path", "every vertex", "modified")
EPSILON = 0.05
MIDDLES: Mapping[str, Any] = {"render.filter": "box", "render.filter_radius": 0.1}
"""Settings by which a pixel looks at its middle fifth."""
CHOSEN = "; the share of gather rays on gloss was chosen in glossy_room"
"""IN_A_LOBE of `pmviewer.render.virtual_lights.gathered`, said in the target's own line."""
CHOSEN_WITH = "corner_room"
"""Scene by which two numbers were chosen, said in its targets' lines: PER_DISC of
`pmviewer.photons.virtual.single_step`, and LEAST of `pmviewer.photons.virtual.lights`."""
CHOSEN_RADIUS = "; the largest radius of cells was chosen with this scene among others"
CHOSEN_LEAST = "; the least number of trajectories was chosen with this scene"
AS_SEEN = ", ".join(f"{name}={value}" for name, value in MIDDLES.items())
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
F8 = NDArray[np.float64]


@dataclass(frozen=True)
class Effort:
    """Width and height of the pictures, lights of a pass, seeds, passes of the path tracer, passes to converge."""

    size: int
    lights: int
    seeds: int
    path_passes: int
    passes: int


FULL, QUICK = Effort(96, 200, 30, 4096, 256), Effort(32, 100, 4, 512, 16)


class Lab:
    """A scene with its reference."""

    def __init__(self, name: str, effort: Effort, pool: WorkPool) -> None:
        self.opened: OpenScene = open_scene(name)
        self.effort, self.pool = effort, pool
        self.R, _ = self.render({"render.method": "path", "render.seed": 7}, effort.path_passes)

    def render(self, values: Mapping[str, Any], passes: int) -> tuple[F8, float]:
        """Luminance of the indirect light (h, w), and the CPU seconds of a pass."""
        image, tally = self._rendered(values, passes)
        return image, tally.cpu_seconds / passes

    def staged(self, values: Mapping[str, Any]) -> tuple[F8, Mapping[str, float]]:
        """Luminance of the indirect light (h, w) of one pass, and its CPU seconds by stage."""
        image, tally = self._rendered(values, 1)
        return image, tally.stage_seconds

    def _rendered(self, values: Mapping[str, Any], passes: int) -> tuple[F8, Tally]:
        size = {"camera.width": self.effort.size, "camera.height": self.effort.size}
        settings = with_values(Settings(), {**size, **MIDDLES, **values})
        prepare(self.opened, settings, self.pool, lambda text, share: None)
        renderer = Renderer(self.opened, settings, self.pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
        return renderer.frame(0).image("indirect").astype(np.float64) @ LUMINANCE, renderer.tally

    def lit(self, changes: Mapping[str, Any], passes: int, seeds: int, lights: int | None = None) -> tuple[F8, float]:
        """Pictures (seeds, h, w) by virtual lights; the least CPU seconds of a pass."""
        values = {"render.method": "virtual lights", "virtual.number": lights or self.effort.lights, **changes}
        made = [self.render({**values, "render.seed": 100 + seed}, passes) for seed in range(seeds)]
        return np.stack([image for image, _ in made]), min(seconds for _, seconds in made)

    def errors(self, images: F8) -> tuple[float, float, float]:
        """relMSE, 99.9th percentile of the relative error, and signed difference of the means in per cent."""
        shown = self.R > 0
        scale = self.R**2 + (EPSILON * self.R.mean()) ** 2
        squared = (images - self.R) ** 2 / scale
        percentile = float(np.quantile(np.sqrt(squared[:, shown]), 0.999))
        return float(squared.mean()), percentile, 100 * float(images.mean() / self.R.mean() - 1)


def run(quick: bool = False) -> BenchResult:
    """Measure every estimator in both rooms."""
    effort = QUICK if quick else FULL
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    pool = WorkPool()
    try:
        for name in SCENES[:1] if quick else SCENES:
            made, decided = measured(Lab(name, effort, pool), name)
            rows += made
            targets += decided
    finally:
        pool.close()
    columns = [
        "scene",
        "estimator",
        "CPU s a pass",
        "relMSE, one pass",
        "/ unweighted",
        "99.9 % of pixels within",
        "bias % (N/4)",
        "bias %",
        "passes in equal time",
        "relMSE there",
        "/ unweighted there",
        f"off % after {effort.passes} passes",
    ]
    notes = [
        f"{effort.size} × {effort.size} pixels, of each its middle fifth, {effort.lights} virtual lights a pass, "
        f"{effort.seeds} seeds; the reference is the path tracer's indirect light, {effort.path_passes} samples each",
        "99.9 % of pixels within: that percentile of the relative error of pixels and seeds, one pass",
    ]
    return BenchResult("Virtual lights", columns, rows, targets, notes)


def measured(lab: Lab, name: str) -> tuple[list[list[str | float | int]], list[Target]]:
    """The rows of a scene, and the targets that they decide."""
    effort = lab.effort
    once = {estimator: lab.lit(changes, 1, effort.seeds) for estimator, changes in ESTIMATORS.items()}
    budget = 2 * max(seconds for _, seconds in once.values())
    rows: list[list[str | float | int]] = []
    found: dict[str, tuple[float, float, float, float]] = {}
    for estimator, changes in ESTIMATORS.items():
        images, seconds = once[estimator]
        error, percentile, bias = lab.errors(images)
        fewer = lab.errors(lab.lit(changes, 1, effort.seeds, max(1, effort.lights // 4))[0])[2]
        passes = max(1, round(budget / seconds))
        timed = lab.errors(lab.lit(changes, passes, max(2, effort.seeds // 4))[0])[0]
        off = np.nan
        if estimator in CONVERGING:
            off = lab.errors(lab.lit(changes, effort.passes, 1)[0])[2]
        found[estimator] = error, percentile, timed, off
        plain = found["unweighted"]
        cells: list[str | float | int] = [
            error,
            error / plain[0],
            percentile,
            f"{fewer:+.2f}",
            f"{bias:+.2f}",
            passes,
            timed,
            timed / plain[2],
        ]
        rows.append([name, estimator, seconds, *cells, f"{off:+.2f}" if np.isfinite(off) else "–"])
        print(*rows[-1], file=sys.stderr, flush=True)
    return rows, targets_of(found, name)


def targets_of(found: Mapping[str, tuple[float, float, float, float]], name: str) -> list[Target]:
    """Of a scene, by (relMSE, percentile, relMSE at equal time, distance after many passes) of the estimators."""
    error, percentile, timed, _ = found["unweighted"]
    single, full, every = found["single step"], found["full path"], found["every vertex"]
    equal, seen = "relMSE at equal number of lights", f"; {AS_SEEN}"
    radius, least = (CHOSEN_RADIUS, CHOSEN_LEAST) if name == CHOSEN_WITH else ("", "")
    chosen = {"unweighted": "", "single step": radius}  # all others are by whole paths
    targets = [
        Target("R10", single[0] / error, 0.05, "", False, f"{name}: single step, {equal}{seen}{radius}"),
        Target(
            "R10", single[2] / timed, 0.1, "", False, f"{name}: single step, relMSE at equal CPU time{seen}{radius}"
        ),
        Target("R10", full[0] / error, 0.1, "", False, f"{name}: full path, {equal}{seen}{least}"),
        Target("R10", every[0] / error, 0.1, "", False, f"{name}: every vertex, {equal}{seen}{least}"),
        Target(
            "R10",
            percentile / single[1],
            5.0,
            "×",
            True,
            f"{name}: single step, 99.9th percentile of the error{seen}{radius}{CHOSEN}",
        ),
    ]
    for estimator in CONVERGING:
        note = f"{name}: {estimator}, mean of the picture after many passes{seen}{chosen.get(estimator, least)}"
        targets.append(Target("R10", abs(found[estimator][3]), 0.5, "%", False, note))
    return targets
