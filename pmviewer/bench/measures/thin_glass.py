"""Thin glass (R9): noise in a car's cabin at equal CPU time by rule of its panes, and what each rule does to the light.

Pictures are what the diffuse surfaces of the cabin send to the camera (direct light, caustics and indirect light; not
what is seen in or through glass). Variance is that of a pass between seeds, mean over pixels, over the squared mean of
the picture; at equal time it counts by the CPU seconds of a pass. The bias is the mean's difference from the path
tracer's, which takes the panes as they are, of luminance and by channel.
"""

from __future__ import annotations

from collections.abc import Mapping
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

SCENE = "car_cabin"
RULES = ("exact", "ignored", "tinted", "tinted and reflecting")
METHODS = ("gather", "progressive")
"""The first is the source's, and has targets; the other shows all indirect light with the noise of the global map."""
SAMPLES = 4
"""Of light per pixel and pass: there is a lamp and a sky."""
TERMS = ("direct", "caustic", "indirect")
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
LESS = 20.0
"""By how much the variance is to be less at equal time, where caustics are not kept."""
OFF, COLOUR_OFF = 2.0, 2.0
"""Per cent that the mean may be off where nothing is left out, and a channel against luminance with tinted glass."""
F8 = NDArray[np.float64]


class Lab:
    """The cabin at a size of `width` by three quarters of that."""

    def __init__(self, width: int, pool: WorkPool) -> None:
        self.opened: OpenScene = open_scene(SCENE)
        self.size = {"camera.width": width, "camera.height": 3 * width // 4}
        self.pool = pool

    def render(self, values: Mapping[str, Any], passes: int) -> tuple[F8, float]:
        """Light from diffuse surfaces (h, w, 3), and the CPU seconds of a pass."""
        settings = with_values(Settings(), {**self.size, **values})
        prepare(self.opened, settings, self.pool, lambda text, share: None)
        renderer = Renderer(self.opened, settings, self.pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
        frame = renderer.frame(0)
        image: F8 = sum((frame.image(term).astype(np.float64) for term in TERMS), np.zeros(()))
        return image, renderer.tally.cpu_seconds / passes

    def seeds(self, values: Mapping[str, Any], seeds: int, passes: int) -> tuple[F8, float]:
        """Pictures (seeds, h, w, 3), and the least CPU seconds of a pass."""
        made = [self.render({**values, "render.seed": 1 + seed}, passes) for seed in range(seeds)]
        return np.stack([image for image, _ in made]), min(seconds for _, seconds in made)


def noise(images: F8, passes: int) -> float:
    """Relative variance of one pass, from pictures (seeds, h, w, 3) of so many."""
    Y = images @ LUMINANCE
    return passes * float(Y.var(axis=0, ddof=1).mean() / Y.mean() ** 2)


def run(quick: bool = False) -> BenchResult:
    """Measure the rules with both photon methods."""
    width, seeds, passes = (320, 3, 1) if quick else (320, 8, 2)
    path_width, path_passes = (24, 4096) if quick else (48, 16384)
    pool = WorkPool()
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    try:
        path, _ = Lab(path_width, pool).render({"render.method": "path"}, path_passes)
        truth = path.mean(axis=(0, 1))
        lab = Lab(width, pool)
        for method in METHODS:
            made, decided = measured(lab, method, truth, seeds, passes)
            rows += made
            if method == METHODS[0]:  # a quick path tracer's mean is off by some per cent itself
                targets += [target for target in decided if target.unit == "×" or not quick]
    finally:
        pool.close()
    columns = [
        "method",
        "thin glass",
        "variance of a pass",
        "CPU s a pass",
        "exact / this",
        "bias %",
        "red, green, blue",
    ]
    notes = [
        f"{width} × {3 * width // 4} pixels, {seeds} seeds of {passes} passes, {SAMPLES} light samples; bias against "
        f"the path tracer, {path_passes} samples in each of {path_width} × {3 * path_width // 4} pixels",
        "exact / this: variance times CPU seconds of exact caustics over that of this rule",
        "the bias holds that of the look-ups' radius, too, which falls with the passes",
    ]
    return BenchResult("Thin glass", columns, rows, targets, notes)


def measured(
    lab: Lab, method: str, truth: F8, seeds: int, passes: int
) -> tuple[list[list[str | float | int]], list[Target]]:
    """The rows of a method, and the targets that they decide; `truth` is the mean (3,) by the path tracer."""
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    exact = np.nan
    for rule in RULES:
        values = {"render.method": method, "render.thin_glass": rule, "direct.samples": SAMPLES}
        images, seconds = lab.seeds(values, seeds, passes)
        mean = images.mean(axis=(0, 1, 2))
        off, bias = 100 * (mean / truth - 1), 100 * float(mean @ LUMINANCE / (truth @ LUMINANCE) - 1)
        variance = noise(images, passes)
        exact = variance * seconds if rule == "exact" else exact
        less = exact / (variance * seconds)
        by_channel = ", ".join(f"{c:+.1f}" for c in off)
        rows.append([method, rule, variance, seconds, less, f"{bias:+.1f}", by_channel])
        of = f"{SCENE}, {method}, direct.samples = {SAMPLES}, {rule}"
        if rule in ("ignored", "tinted"):
            targets.append(Target("R9", less, LESS, "×", True, f"{of}: variance at equal CPU time, exact over this"))
        if rule.startswith("tinted"):
            worst = float(np.abs(off - bias).max())
            note = f"{of}: a channel against luminance; its mean is printed alone"
            targets.append(Target("R9", worst, COLOUR_OFF, "%", False, note))
        if rule == "tinted and reflecting":
            targets.append(Target("R9", abs(bias), OFF, "%", False, f"{of}: mean against the path tracer"))
    return rows, targets
