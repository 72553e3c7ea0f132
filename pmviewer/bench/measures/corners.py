"""Secondary gathering (R5): error of the picture near edges where surfaces meet, and away from them.

Look-ups are wide and keep their radius, so that the artefact shows: near an edge a look-up misses what the other wall
cuts off, and gather rays that end there bring too little. The error is the root mean square of the indirect light's
bias over pixels, relative to its mean there. Noise is none of it: with two seeds each of picture (a, b) and reference
(r, s), the mean of (a − r)(b − s) is that of the squared bias. The reference looks up a tenth of the radius and gathers
again at corners.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.settings.access import Settings, with_values

SCENES = ("cornell_diffuse", "skylight_room")
RADIUS = 0.05
"""Of look-ups, relative to the scene: at it corners are visibly wrong."""
THRESHOLDS = (0.0, 0.5, 1.0, 2.0, 4.0)
CHOSEN = 2.0
NEAR = 4
"""Pixels within this distance of an edge count as corners."""


def rendered(opened: OpenScene, pool: WorkPool, values: dict[str, Any], seed: int, size: int, passes: int) -> Renderer:
    """Some passes of size × size pixels with `values` over a gather of constant radius."""
    shared = {"render.method": "gather", "gather.rays": 16, "estimate.alpha": 1.0, "render.seed": seed}
    image = {"camera.width": size, "camera.height": size}
    settings = with_values(Settings(), {**shared, **image, **values})
    prepare(opened, settings, pool, lambda text, share: None)
    renderer = Renderer(opened, settings, pool, StageStore(0))
    for _ in range(passes):
        renderer.step()
    return renderer


def indirect(renderer: Renderer) -> NDArray[np.float64]:
    """Luminance-like mean of the channels of the indirect light (h, w)."""
    return renderer.frame(0).image("indirect").astype(np.float64).mean(axis=2)


def corners(renderer: Renderer) -> NDArray[np.bool_]:
    """Pixels near a place where neighbours' surfaces face different ways and touch each other."""
    frame = renderer.frame(0)
    normal, depth = frame.image("normal"), frame.image("depth")[..., 0]
    mask = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        n, z, m = (np.moveaxis(image, axis, 0) for image in (normal, depth, mask))
        turned = np.abs(n[1:] - n[:-1]).sum(axis=2) > 0.3
        together = np.abs(z[1:] - z[:-1]) < 0.03 * np.minimum(z[1:], z[:-1])
        m[1:] |= turned & together
        m[:-1] |= turned & together
    return binary_dilation(mask, iterations=NEAR)


def bias(a: NDArray, b: NDArray, r: NDArray, s: NDArray, where: NDArray[np.bool_]) -> float:
    """Root mean square of the bias over the chosen pixels, relative to the reference's mean there, in per cent."""
    squared = float(((a - r) * (b - s))[where].mean())
    return 100 * float(np.sqrt(max(squared, 0.0)) / ((r + s) / 2)[where].mean())


def run(quick: bool = False) -> BenchResult:
    """Measure thresholds from off to several look-up radii."""
    size, passes = (64, 4) if quick else (96, 16)
    rows: list[list[str | float | int]] = []
    targets = []
    pool = WorkPool()
    try:
        for scene in SCENES[:1] if quick else SCENES:
            opened = open_scene(scene)
            exact = {"estimate.radius": 0.1 * RADIUS, "gather.secondary": 4.0}
            references = [rendered(opened, pool, exact, seed, size, 2 * passes) for seed in (1, 2)]
            near = corners(references[0])
            r, s = (indirect(reference) for reference in references)
            for threshold in THRESHOLDS:
                values = {"estimate.radius": RADIUS, "gather.secondary": threshold}
                made = [rendered(opened, pool, values, seed, size, passes) for seed in (3, 4)]
                a, b = (indirect(one) for one in made)
                inside, outside = bias(a, b, r, s, near), bias(a, b, r, s, ~near)
                signed = 100 * float(((a + b - r - s)[near].mean()) / (r + s)[near].mean())
                seconds = sum(one.tally.stage_seconds["camera pass"] for one in made) / (2 * passes)
                rows.append([scene, threshold, inside, outside, f"{signed:+.2f}", seconds])
                if threshold == CHOSEN:
                    note = f"{scene}, below {threshold:g} radii: error in corners over that elsewhere"
                    targets.append(Target("R5", inside / max(outside, 1e-9), 1.0, "", False, note))
    finally:
        pool.close()
    notes = [
        f"look-up radius {RADIUS:g} of the scene, {passes} passes of 16 rays, {size} × {size} pixels; corners are "
        f"the pixels within {NEAR} of an edge, elsewhere all others"
    ]
    columns = ["scene", "secondary below", "error in corners %", "elsewhere %", "bias in corners %", "camera pass s"]
    return BenchResult("Secondary gathering", columns, rows, targets, notes)
