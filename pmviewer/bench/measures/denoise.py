"""Error against time of denoised pictures, the denoiser's own time included (P16).

By the large network, which makes the view and the layer of files, and, where a pass costs little, by the small one of
the window's preview; also of what automatic mode chooses for a target's error without denoising.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.measures.error import AUTOMATIC, SCENES, Curve, chosen_for, chosen_with, measure
from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.output.denoise import denoised

SMALL = ", small network"
FAST = f"progressive{SMALL}"
METHODS: dict[str, dict[str, Any]] = {
    "progressive": {},
    FAST: {},
    "gather": {},
    "gather, cache": {"gather.cache": "on"},
}
"""By name, with the settings beside the method that are no defaults."""
TARGETS = (
    ("cornell_caustic", 1e-2, 0.3),
    ("cornell_caustic", 1e-3, 2.3),
    ("cornell_diffuse", 1e-2, 0.2),
    ("cornell_diffuse", 1e-3, 0.7),
    ("rooms_10x10", 1e-2, 0.5),
    ("ring_caustic", 5e-3, 1.0),
)
BUDGETS = {"cornell_diffuse": 3.0, "cornell_caustic": 5.0, "ring_caustic": 3.0, "rooms_10x10": 3.0}
"""CPU seconds a curve, twice the slowest target of the scene and more."""
AUTOMATIC_BUDGET = 3.0
"""Of the curves by what automatic mode chooses, over their target's seconds."""
QUICK_SHARE = 0.25


def picture(renderer: Renderer, fast: bool = False) -> tuple[NDArray[np.float32], float]:
    """The renderer's picture without its noise, and the CPU seconds that the denoiser took for it."""
    frame = renderer.frame(0)
    start = time.process_time()
    image = denoised(frame.image(), frame.image("albedo"), frame.image("normal"), renderer.pool.threads, fast=fast)
    return image, time.process_time() - start


def run(quick: bool = False) -> BenchResult:
    """Curves of the photon methods on every scene of `bench error`, denoised after 1, 2, 4 … passes. Raises OutputError
    without Open Image Denoise."""
    nothing = np.zeros((16, 16, 3), np.float32)
    for fast in (False, True):
        denoised(nothing, nothing, nothing, fast=fast)  # its weights are unpacked with the first picture
    curves: dict[tuple[str, str], Curve] = {}
    rows: list[list[Cell]] = []
    for scene in SCENES:
        budget = BUDGETS[scene] * (QUICK_SHARE if quick else 1.0)
        for name, values in METHODS.items():
            opened, method = open_scene(scene), name.split(",")[0]
            plain = measure(opened, method, budget, values=values)
            show = partial(picture, fast=name == FAST)
            curve = curves[scene, name] = measure(opened, method, budget, values=values, show=show)
            rows += _rows(curve, name, plain)
    targets, notes = [], []
    for scene, error, bound in TARGETS:
        mine = {name: curve for (of, name), curve in curves.items() if of == scene}
        found, said = _automatic(scene, error, bound * (QUICK_SHARE if quick else 1.0))
        notes.append(said)
        for curve in found:
            mine[curve.method] = curve
            rows += _rows(curve, curve.method)
        best = min(mine, key=lambda name: mine[name].time_to(error))
        note = f"{scene} denoised to relMSE {error:g}, best method: {best}"
        if best.startswith(AUTOMATIC):
            note += chosen_with(mine[best])
        targets.append(Target("P16", mine[best].time_to(error), bound, "CPU s", False, note))
    columns = ["scene", "method", "passes", "CPU s", "relMSE before", "relMSE", "mean ratio"]
    return BenchResult("Denoised pictures: error against time", columns, rows, targets, notes)


def _automatic(scene: str, error: float, bound: float) -> tuple[list[Curve], str]:
    """The curves of what automatic mode chooses for that error, by both networks, and a sentence about its choice."""
    opened = open_scene(scene)
    values, said = chosen_for(opened, error)
    curves = []
    for ending, fast in (("", False), (SMALL, True)):
        show = partial(picture, fast=fast)
        curve = measure(opened, values["render.method"], AUTOMATIC_BUDGET * bound, values=values, show=show)
        curves.append(replace(curve, method=f"{AUTOMATIC} for {error:g}{ending}"))
    return curves, said


def _rows(curve: Curve, name: str, plain: Curve | None = None) -> list[list[Cell]]:
    """The table's rows of a curve; `plain`: of the same way without denoising."""
    before = dict(zip(plain.passes, plain.error, strict=True)) if plain is not None else {}
    points = zip(curve.passes, curve.cpu, curve.error, curve.ratio, strict=True)
    return [[curve.scene, name, n, cpu, before.get(n, ""), error, f"{ratio:.4f}"] for n, cpu, error, ratio in points]
