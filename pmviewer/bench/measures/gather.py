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
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import relmse
from pmviewer.settings.access import Settings, with_values

SCENES = ("cornell_diffuse", "cornell_caustic", "rooms_10x10")
RAYS = 64
"""Gather rays a pixel and pass, as many as a gather without passes needs."""
FASTER, DIFFERENCE = 5.0, 1.0
SHARES = ("all", "1/4", "1/8")
Row = list[str | float | int]

LIT = "skylight_room"
PLAIN = {"estimate.lookup": "nearest", "estimate.k": 50, "gather.rays": 32}
"""Pharr's gather: every ray looks 50 photons up."""
WHOLE: dict[str, dict[str, Any]] = {
    f"{name}, {rays} rays": {**PLAIN, "gather.rays": rays, **values}
    for rays in (32, 20, 16)
    for name, values in {
        "radiance photons": {"gather.radiance_photons": "1/4"},
        "radiance photons, cones": {"gather.radiance_photons": "1/4", "gather.directions": "photon cones"},
    }.items()
}
CONVERGED = {"gather.rays": 32, "gather.directions": "photon cones", "gather.secondary": 2.0}
WHOLE_FASTER = 7.0

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
    renderer = Renderer(opened, settings, pool, StageStore(0))
    for _ in range(passes):
        renderer.step()
    image = renderer.frame(0).image("indirect") + renderer.frame(0).image("specular")
    return Gathered(
        renderer.tally.stage_seconds["camera pass"], renderer.tally.stage_seconds["maps"], image.astype(np.float64)
    )


def _wide(opened: OpenScene, pool: WorkPool, factor: float) -> float:
    """`factor` times the automatic radius, as a setting."""
    settings = with_values(Settings(), {"render.method": "gather"})
    return factor * Renderer(opened, settings, pool, StageStore(0)).first_radius / opened.flat.radius


def whole_image(pool: WorkPool, size: tuple[int, int], passes: int) -> tuple[list[Row], Target]:
    """CPU seconds, photons and maps included, and error of whole pictures of one pass of the skylight room: the plain
    gather of Pharr against radiance photons and guided directions. The reference is a gather of many passes."""
    opened = open_scene(LIT)
    image = {"render.method": "gather", "camera.width": size[0], "camera.height": size[1]}

    def picture(values: dict[str, Any], n: int = 1, seed: int = 1) -> tuple[float, NDArray[np.float64]]:
        settings = with_values(Settings(), {**image, **values, "render.seed": seed})
        prepare(opened, settings, pool, lambda text, share: None)
        renderer = Renderer(opened, settings, pool, StageStore(0))
        for _ in range(n):
            renderer.step()
        return renderer.tally.cpu_seconds, renderer.frame(0).image("indirect").astype(np.float64)

    _, target = picture(CONVERGED, passes, 77)
    seconds, made = picture(PLAIN)
    error = relmse(made, target)
    rows: list[Row] = [[LIT, "whole, 50 nearest, 32 rays", "off", "", seconds, "", 1.0, error, ""]]
    best, best_name = 0.0, "none at lower error"
    for name, values in WHOLE.items():
        spent, made = picture(values)
        found = relmse(made, target)
        rows.append([LIT, f"whole, {name}", "1/4", "", spent, "", seconds / spent, found, ""])
        if found <= error and seconds / spent > best:
            best, best_name = seconds / spent, f"{name}: relMSE {found:.3g} against {error:.3g}"
    return rows, Target("R3", best, WHOLE_FASTER, "times faster", True, f"{LIT}, whole image; {best_name}")


def run(quick: bool = False) -> BenchResult:
    """Measure every look-up with every share of radiance photons."""
    passes = 1 if quick else 4
    rows: list[Row] = []
    targets = []
    pool = WorkPool()
    try:
        made_rows, target = whole_image(pool, (96, 72) if quick else (192, 144), 8 if quick else 48)
        rows += made_rows
        targets.append(target)
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
    notes = [
        f"{passes} passes, {RAYS} gather rays a pixel and pass, CPU seconds summed over threads; whole: one "
        "pass, photons and maps included, relMSE of indirect light against many passes"
    ]
    columns = [
        "scene",
        "look-up",
        "photons",
        "look-ups s",
        "camera pass s",
        "maps s",
        "faster",
        "difference % or relMSE",
        "mean",
    ]
    return BenchResult("Radiance photons in the final gather", columns, rows, targets, notes)
