"""Radiance photons against the plain final gather (R3): time of the gather's look-ups, and how the image differs.

The time of look-ups is that of the eye pass less that of the same rays in a nearly empty grid; with radiance photons it
includes computing them. Sorting them is in the column of the maps. Images of the same rays and photons are compared in
their indirect term, pixel by pixel: what differs is the error of taking the nearest radiance photon.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.cache import StageCache
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.settings import Settings, with_values

SCENES = ("cornell_diffuse", "cornell_caustic", "rooms_10x10")
RAYS = 64
"""Gather rays a pixel and pass, as many as a gather without passes needs."""
FASTER, DIFFERENCE = 5.0, 1.0
SHARES = ("all", "1/4", "1/8")

LOOKUPS: dict[str, dict[str, Any]] = {
    "50 nearest": {"estimate.lookup": "nearest"},
    "radius": {},
    "4 × radius": {"wide": 4.0},
}
"""Look-ups by name: those of the papers' gather, the method's own, and wide ones for a smooth first pass."""


@dataclass(frozen=True)
class Gathered:
    """CPU seconds of the eye pass and of building maps, and the indirect term of the image."""

    eye: float
    maps: float
    image: NDArray[np.float64]


def gathered(opened: OpenScene, pool: WorkPool, values: dict[str, Any], passes: int) -> Gathered:
    """Render some passes with `values` over the settings of a gather of many rays."""
    settings = with_values(Settings(), {"render.method": "gather", "gather.rays": RAYS, **values})
    prepare(opened, settings, pool, lambda text, share: None)
    renderer = Renderer(opened, settings, pool, StageCache(0))
    for _ in range(passes):
        renderer.step()
    image = renderer.frame(0).image("indirect") + renderer.frame(0).image("specular")
    return Gathered(renderer.stage_seconds["eye pass"], renderer.stage_seconds["maps"], image.astype(np.float64))


def _wide(opened: OpenScene, pool: WorkPool, factor: float) -> float:
    """`factor` times the automatic radius, as a setting."""
    settings = with_values(Settings(), {"render.method": "gather"})
    return factor * Renderer(opened, settings, pool, StageCache(0)).first_radius / opened.flat.radius


def run(quick: bool = False) -> BenchResult:
    """Measure every look-up with every share of radiance photons."""
    passes = 1 if quick else 4
    rows: list[list[str | float | int]] = []
    targets = []
    pool = WorkPool()
    try:
        for scene in SCENES[:1] if quick else SCENES:
            opened = open_scene(scene)
            rays = gathered(opened, pool, {"photons.N": 100}, passes).eye
            for name, chosen in LOOKUPS.items():
                values = dict(chosen)
                if "wide" in values:
                    values["estimate.radius"] = _wide(opened, pool, values.pop("wide"))
                plain = gathered(opened, pool, values, passes)
                rows.append([scene, name, "off", plain.eye - rays, plain.eye, plain.maps, 1.0, "", ""])
                for share in SHARES:
                    made = gathered(opened, pool, {**values, "gather.radiance_photons": share}, passes)
                    faster = (plain.eye - rays) / max(made.eye - rays, 1e-9)
                    difference = np.abs(made.image - plain.image).mean() / plain.image.mean()
                    ratio = made.image.mean() / plain.image.mean()
                    spent = made.eye - rays
                    rows.append(
                        [scene, name, share, spent, made.eye, made.maps, faster, 100 * difference, f"{ratio:.4f}"]
                    )
                    if share == "1/4":
                        note = f"{scene}, {name}, {share}: look-ups"
                        targets.append(Target("R3", faster, FASTER, "times faster", True, note))
                        note = f"{scene}, {name}, {share}: image difference"
                        targets.append(Target("R3", 100 * float(difference), DIFFERENCE, "%", False, note))
    finally:
        pool.close()
    notes = [f"{passes} passes, {RAYS} gather rays a pixel and pass, CPU seconds summed over threads"]
    columns = ["scene", "look-up", "photons", "look-ups s", "eye pass s", "maps s", "faster", "difference %", "mean"]
    return BenchResult("Radiance photons in the final gather", columns, rows, targets, notes)
