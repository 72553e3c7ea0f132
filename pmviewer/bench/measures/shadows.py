"""Shadow rays that shadow photons save, and what they do to the picture (T8).

The same pixels with the same random numbers are rendered with and without shadow photons: their difference is the bias
alone, free of noise. Both are also measured against a picture of many more passes by another seed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import relmse_drop
from pmviewer.settings.access import Settings, with_values

SCENES = ("cognac", "ring_caustic", "cornell_caustic")
TARGET_SCENE = "cognac"
FEWEST = (4, 8, 16)
TRUTH_SEED = 77


@dataclass(frozen=True)
class Run:
    """A picture of everything that direct light has a part in, and what it cost."""

    image: NDArray[np.float64]
    rays: int
    saved: int
    eye_cpu: float
    shadow_cpu: float


def render(opened: OpenScene, size: int, passes: int, pool: WorkPool, values: dict[str, object]) -> Run:
    """Render the direct and the specular term at size × size pixels."""
    base: dict[str, object] = {"camera.width": size, "camera.height": size, "photons.N": 1000}
    renderer = Renderer(opened, with_values(Settings(), base | values), pool, StageStore(0))
    prepare(opened, renderer.settings, pool, lambda text, share: None)
    for _ in range(passes):
        renderer.step()
    frame = renderer.frame(0)
    image = frame.image("direct").astype(np.float64) + frame.image("specular")
    seconds = frame.statistics.stage_seconds
    rays, saved = frame.statistics.shadow_rays, frame.statistics.saved_rays
    return Run(image, rays, saved, seconds["camera pass"], seconds.get("shadow photons", 0.0))


def run(quick: bool = False) -> BenchResult:
    """Measure the scenes at several numbers of photons that it takes."""
    size, passes = (64, 8) if quick else (128, 16)
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    pool = WorkPool()
    try:
        for name in SCENES:
            opened = open_scene(name)
            plain = render(opened, size, passes, pool, {})
            truth = render(opened, size, 8 * passes, pool, {"render.seed": TRUTH_SEED}).image
            pixels = size * size * passes
            rows.append(
                [name, "off", plain.rays / pixels, 0.0, 0.0, 1.0, relmse_drop(plain.image, truth), plain.eye_cpu, 0]
            )
            default = Settings().direct.shadow_fewest
            for fewest in FEWEST:
                values: dict[str, object] = {"direct.shadow_photons": True, "direct.shadow_fewest": fewest}
                found = render(opened, size, passes, pool, values)
                saved = 100 * found.saved / max(found.saved + found.rays, 1)
                difference = 100 * float(np.abs(found.image - plain.image).mean() / plain.image.mean())
                mean = float(found.image.mean() / plain.image.mean())
                cost = found.eye_cpu, found.shadow_cpu
                error = relmse_drop(found.image, truth)
                rows.append([name, str(fewest), found.rays / pixels, saved, difference, mean, error, *cost])
                if name == TARGET_SCENE and fewest == default:
                    note = f"{name}, direct.shadow_photons=true photons.N=1000, {size} × {size}"
                    targets.append(Target("T8", saved, 70.0, "% of the shadow rays saved", True, note))
                    targets.append(Target("T8", difference, 1.0, "% mean image difference", False, note))
    finally:
        pool.close()
    columns = [
        "scene",
        "fewest photons",
        "shadow rays/pixel",
        "saved %",
        "difference %",
        "mean ratio",
        "relMSE to the truth",
        "camera pass CPU s",
        "shadow photons CPU s",
    ]
    notes = [
        f"{size} × {size} pixels, {passes} passes, direct and specular term; difference: mean |with − without|/mean",
        f"truth: {8 * passes} passes by another seed; what is off to it is mostly noise of the pixels",
    ]
    return BenchResult("Shadow photons", columns, rows, targets, notes)
