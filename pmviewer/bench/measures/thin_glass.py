"""Thin glass (R9): noise in a car's cabin at equal CPU time, by rule of its panes, and what each rule does to the light.

Pictures are what the diffuse surfaces of the cabin send to the camera (direct light, caustics and indirect light; not
what is seen in or through glass). Variance is that of a pass between seeds, mean over pixels, over the squared mean of
the picture; at equal time it counts by the CPU seconds of a pass. The bias is the mean's difference from the path
tracer's, which takes the panes as they are; its tint the ratio of its means by channel.
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
RULES = ("exact", "ignored", "tinted")
METHODS = ("gather", "progressive")
TERMS = ("direct", "caustic", "indirect")
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
LESS = 20.0
"""By how much the variance is to be less at equal time."""
OFF, OFF_CHANNEL = 1.5, 3.0
"""Per cent that the mean may be off with tinted panes, of luminance and of each channel."""
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
    """Measure the three rules with both photon methods."""
    width, seeds, passes, path_passes = (32, 6, 2, 2048) if quick else (80, 16, 4, 8192)
    pool = WorkPool()
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    try:
        lab = Lab(width, pool)
        path, _ = lab.render({"render.method": "path", "render.seed": 1000}, path_passes)
        truth = path.mean(axis=(0, 1))
        for method in METHODS:
            found = {}
            for rule in RULES:
                values = {"render.method": method, "render.thin_glass": rule}
                images, seconds = lab.seeds(values, seeds, passes)
                off = 100 * (images.mean(axis=(0, 1, 2)) / truth - 1)
                bias = 100 * float(images.mean(axis=(0, 1, 2)) @ LUMINANCE / (truth @ LUMINANCE) - 1)
                found[rule] = noise(images, passes), seconds, bias, off
                less = found["exact"][0] * found["exact"][1] / (found[rule][0] * seconds)
                rows.append([method, rule, found[rule][0], seconds, less, f"{bias:+.1f}", _tints(off)])
                if rule != "exact":
                    note = f"{method}, {rule}: variance at equal CPU time, exact over this"
                    targets.append(Target("R9", less, LESS, "×", True, note))
            off, bias = found["tinted"][3], found["tinted"][2]
            targets.append(Target("R9", abs(bias), OFF, "%", False, f"{method}, tinted: mean against the path tracer"))
            worst = float(np.abs(off).max())
            note = f"{method}, tinted: its colour, the worst channel's mean against the path tracer"
            targets.append(Target("R9", worst, OFF_CHANNEL, "%", False, note))
    finally:
        pool.close()
    columns = ["method", "thin glass", "variance of a pass", "CPU s a pass", "exact / this", "bias %", "red, green, blue"]
    notes = [
        f"{width} × {3 * width // 4} pixels, {seeds} seeds of {passes} passes; the path tracer: {path_passes} samples",
        "exact / this: variance times CPU seconds of exact caustics over that of this rule",
        "the mean with exact caustics is as uncertain as its variance says",
    ]
    return BenchResult("Thin glass", columns, rows, targets, notes)


def _tints(off: F8) -> str:
    """Each channel's bias in per cent."""
    return ", ".join(f"{c:+.1f}" for c in off)
