"""pmviewer against Mitsuba 3 on the same files: is the picture the same?

The bundled scenes that Mitsuba can read, and one small scene for each material, texture and light
(`pmviewer.bench.feature_scenes`): independent runs of each side, compared block by block (`pmviewer.bench.agreement`).

The path tracer must agree within noise alone. The gather and the progressive method are consistent, not unbiased: their
look-ups blur corners and edges by their radius, and only in the limit of many passes is nothing left of it. They are
therefore tested with a small radius, and must agree within noise and a small share of each block's radiance.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench import peer
from pmviewer.bench.agreement import Agreement, agreement
from pmviewer.bench.feature_scenes import write_scenes
from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.settings.access import Settings, with_values

SIGNIFICANCE = 1e-4
"""Below this a row disagrees. There are some hundred rows: chance alone makes one fail once in a hundred runs."""
RADIUS_SHARE = 0.25
"""Look-up radius of the photon methods relative to the automatic one: bias must shrink below the noise of a block."""


@dataclass(frozen=True)
class Case:
    """A scene at a size: samples per run of both path tracers, passes per run of photon methods, pixels of a block
    (larger for caustics, whose few bright paths are far from Gaussian), and the share by which photon methods may
    differ; the path tracer by `path_tolerance`. `file` is a scene that is not bundled, `settings` are ours for it."""

    scene: str
    parameters: Mapping[str, str]
    spp: int
    passes: int
    block: int
    tolerance: float = 0.03
    file: Path | None = None
    path_tolerance: float = 0.0
    settings: Mapping[str, object] = field(default_factory=dict)

    @property
    def source(self) -> str | Path:
        """What to open: a file, or a bundled scene's name."""
        return self.file or self.scene


SQUARE = {"res": "64"}
CASES = (
    Case("cornell_diffuse", SQUARE, 128, 16, 8),
    Case("cornell_glossy", SQUARE, 128, 16, 8),
    Case("cornell_lights", SQUARE, 128, 16, 8),
    Case("rooms_10x10", SQUARE, 128, 16, 16),
    Case("skylight_room", {"width": "64", "height": "48"}, 128, 32, 16),
    Case("cornell_caustic", SQUARE, 128, 16, 32),
    Case("cornell_water", SQUARE, 128, 16, 32),
)
QUICK = ("cornell_diffuse", "cornell_glossy")
METHODS = ("path", "gather", "progressive")
FEATURE_METHODS = ("path", "progressive")
COLUMNS = (
    "scene",
    "method",
    "runs",
    "passes",
    "block",
    "tolerance",
    "tests",
    "noise",
    "mean ratio",
    "± (1 σ)",
    "largest t",
    "p",
)


def feature_cases(folder: Path) -> list[Case]:
    """One case per material, texture and light; writes their files into `folder`."""
    return [Case(name, {}, 64, 8, 8, 0.02, file) for name, file in write_scenes(folder).items()]


def our_runs(
    opened: OpenScene, method: str, passes: int, runs: int, pool: WorkPool, more: Mapping[str, object] | None = None
) -> NDArray[np.float64]:
    """(runs, h, w, 3) images with different seeds. `more` settings may tell the radius, which is a share of the
    automatic one otherwise."""
    images = []
    values: dict[str, object] = {"render.method": method, **(more or {})}
    if method != "path" and "estimate.radius" not in values:
        automatic = Renderer(opened, with_values(Settings(), values), pool, StageStore(0)).first_radius
        values["estimate.radius"] = max(RADIUS_SHARE * automatic / opened.flat.radius, 1e-5)
    for seed in range(1, runs + 1):
        settings = with_values(Settings(), values | {"render.seed": seed})
        if seed == 1:
            prepare(opened, settings, pool, lambda text, share: None)
        renderer = Renderer(opened, settings, pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
        images.append(renderer.frame(0).image().astype(np.float64))
    return np.stack(images)


def compare(
    case: Case, methods: tuple[str, ...], runs: int, pool: WorkPool
) -> Iterator[tuple[str, int, float, Agreement, OpenScene]]:
    """Method, its passes per run, tolerance, the outcome and our scene, method by method."""
    opened = open_scene(str(case.source), case.parameters)
    theirs = peer.independent_images(case.source, case.parameters, runs, case.spp)
    for method in methods:
        tolerance = case.path_tolerance if method == "path" else case.tolerance
        # A path tracer's pass is one sample per pixel.
        passes = case.spp if method == "path" else case.passes
        found = agreement(our_runs(opened, method, passes, runs, pool, case.settings), theirs, case.block, tolerance)
        print(
            f"{case.scene}, {method}: p {found.p_value:.3g}, mean ratio {found.ratio:.4f}", file=sys.stderr, flush=True
        )
        yield method, passes, tolerance, found, opened


def run(quick: bool = False) -> BenchResult:
    """Test every method on every scene. Raises PmviewerError without Mitsuba."""
    runs = 8 if quick else 16
    started = time.perf_counter()
    variant = peer.variant()
    rows: list[list[Cell]] = []
    targets = []
    pool = WorkPool()
    with tempfile.TemporaryDirectory() as folder:
        cases: list[tuple[Case, tuple[str, ...]]] = [
            (case, METHODS) for case in CASES if not quick or case.scene in QUICK
        ]
        # The last method is left out where time is short: it compiles the photon kernels for each kind of scene.
        cases += [(case, FEATURE_METHODS[: 1 if quick else None]) for case in feature_cases(Path(folder))]
        try:
            for case, methods in cases:
                for method, passes, tolerance, found, opened in compare(case, methods, runs, pool):
                    rows.append(
                        [case.scene, method, runs, passes, case.block, tolerance, found.blocks, found.noise,
                         f"{found.ratio:.4f}", f"{found.ratio_error:.4f}", found.largest, found.p_value]
                    )  # fmt: skip
                    note = f"p of {method} and Mitsuba 3 on {case.scene} being equal"
                    if tolerance:
                        note += f" within {tolerance:.0%} of a block"
                    note += f"; mean ratio {found.ratio:.4f}"
                    if opened.scene.warnings:
                        note += "; this scene is approximated: " + opened.scene.warnings[0]
                    targets.append(Target("Mitsuba", found.p_value, SIGNIFICANCE, "", True, note))
        finally:
            pool.close()
    notes = [
        f"Mitsuba 3, {variant}, path; {runs} independent runs a side; noise: median standard error of a block",
        f"photon methods at {RADIUS_SHARE:g} of the automatic radius: they converge as it shrinks, a wide look-up "
        "blurs corners",
        "left out: scenes with what Mitsuba lacks (absorption, schlick, ward, displacement) and caustics of small "
        "lights, which its path tracer does not find",
        f"{time.perf_counter() - started:.0f} s in all",
    ]
    return BenchResult("Agreement with Mitsuba 3", COLUMNS, rows, targets, notes)
