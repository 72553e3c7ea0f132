"""Frame coherence (T2): in the scene of three glasses, the middle one moves between two frames.

A photon's random numbers belong to its index alone, so photons that do not meet the moved glass take the same paths
(course guide §5.1, figure 5.1). Measured: the share of the photons around the other glasses that are bit for bit the
same in both frames, and the variance of the frames' difference there, against that to a frame with another seed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.engine.frame import Frame
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.settings.access import Settings, with_values

SCENE = "three_glasses"
STEP = 0.01
"""How far the middle glass moves, in m: a step of an animation."""
BORDER = 0.065
"""Half the distance between glasses: what lies farther from the middle of the row belongs to the other two."""
TABLE = 1e-3
"""Photons below this height lie on the table."""


@dataclass(frozen=True)
class Shot:
    """One frame: its caustic photons as rows of 24 bytes, the rendered frame, and where each pixel looks."""

    photons: NDArray[np.float32]
    frame: Frame


def shoot(opened: OpenScene, seed: int, photons: int, passes: int, pool: WorkPool) -> Shot:
    """Render `passes` passes; the photons are those of the first."""
    values = {"render.seed": seed, "photons.N": photons}
    settings = with_values(Settings(), values)
    prepare(opened, settings, pool, lambda text, share: None)
    renderer = Renderer(opened, settings, pool, StageStore(0))
    renderer.step()
    cloud = renderer.frame(0).clouds["caustic"].photons.copy()
    for _ in range(passes - 1):
        renderer.step()
    return Shot(cloud, renderer.frame(0))


def others(photons: NDArray[np.float32]) -> NDArray[np.float32]:
    """The photons on the table in the places of the glasses that stay."""
    return photons[(np.abs(photons[:, 0]) > BORDER) & (photons[:, 1] < TABLE)]


def identical(before: NDArray[np.float32], after: NDArray[np.float32]) -> float:
    """Share of the rows of `before` that are in `after` bit for bit."""
    rows = [np.ascontiguousarray(p).view(np.dtype((np.void, p.dtype.itemsize * p.shape[1]))).ravel()
            for p in (before, after)]  # fmt: skip
    return float(np.isin(rows[0], rows[1]).mean()) if len(before) else float("nan")


def beside(opened: OpenScene, frame: Frame) -> NDArray[np.bool_]:
    """(h, w) pixels that look at the table where the other glasses' caustics fall."""
    pose, (h, w) = frame.camera, frame.image().shape[:2]
    x, z = np.meshgrid(np.linspace(-0.4, 0.4, 801), np.linspace(-0.2, 0.45, 651), indexing="ij")
    points = np.stack([x, np.zeros_like(x), z], axis=-1)[np.abs(x) > BORDER]
    column, row, depth = pose.project(points).T
    inside = (depth > 0) & (column >= 0) & (column < w) & (row >= 0) & (row < h)
    seen = np.zeros((h, w), bool)
    seen[row[inside].astype(int), column[inside].astype(int)] = True
    return seen


def run(quick: bool = False) -> BenchResult:
    """Move the middle glass and compare with the frame before and with a re-seeded one."""
    photons, passes, steps = (150_000, 1, (STEP,)) if quick else (600_000, 4, (STEP / 4, STEP, 2 * STEP))
    rows: list[list[Cell]] = []
    targets = []
    pool = WorkPool()
    try:
        still = open_scene(SCENE)
        first = shoot(still, 1, photons, passes, pool)
        mask = beside(still, first.frame)
        for step in steps:
            moved = open_scene(SCENE, {"x": f"{step:g}"})
            coherent, fresh = (shoot(moved, seed, photons, passes, pool) for seed in (1, 2))
            kept, kept_fresh = (identical(others(first.photons), others(s.photons)) for s in (coherent, fresh))
            variance = [_variance(first.frame, s.frame, mask, "caustic") for s in (coherent, fresh)]
            whole = [_variance(first.frame, s.frame, mask, None) for s in (coherent, fresh)]
            fall, fall_whole = variance[1] / variance[0], whole[1] / whole[0]
            rows.append(
                [f"{1000 * step:g} mm", len(others(first.photons)), kept, kept_fresh, *variance, fall, fall_whole]
            )
            if step == STEP:
                targets += [
                    Target("T2", kept, 0.9, "", True, "photons of the other glasses that are bit-identical"),
                    Target("T2", fall, 10.0, "×", True, "fall of the caustics' frame-difference variance there"),
                ]
    finally:
        pool.close()
    columns = [
        "moved by",
        "photons there",
        "identical",
        "… re-seeded",
        "variance",
        "… re-seeded",
        "fall",
        "fall (image)",
    ]
    notes = [
        f"{SCENE}, {photons:,} trajectories, {passes} passes, {int(mask.sum())} pixels of the other glasses' table"
    ]
    return BenchResult("Frame coherence", columns, rows, targets, notes)


def _variance(a: Frame, b: Frame, mask: NDArray[np.bool_], term: str | None) -> float:
    images = [frame.image(term) if term else frame.image() for frame in (a, b)]
    difference = (images[0].astype(np.float64) - images[1].astype(np.float64))[mask]
    return float((difference**2).mean())
