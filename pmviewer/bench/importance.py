"""Importance against brute force, and what it costs (I1–I3).

Importance is a density of pixels on surfaces. For patches of the floor of the bundled scenes ∫Γ dA is compared with
the share of a million random eye paths that end there, seen directly and over one diffuse bounce; the paths have
random numbers of their own, and no density is estimated for them.

The costs are those of a moved camera: importons traced and both maps built, at the default number of importons.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.cache import StageCache
from pmviewer.engine.importance import ImportanceStage
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.tally import Tally
from pmviewer.importance.importons import Rule, joined, trace
from pmviewer.maps.importance import ImportanceMap, Importons, build_importance, importances
from pmviewer.maps.record import decode_directions
from pmviewer.render.camera import resolve_camera
from pmviewer.render.record import eye_record
from pmviewer.settings import Settings, with_values

SCENES = ("cornell_diffuse", "cornell_caustic", "cornell_glossy")
SIZE = 512
TRUTH_SEED = 991
LEAST_SHARE = 0.002
"""Cells with less of the importance than this are left out: a million paths know them too badly."""
CELLS = 6
"""Cells along an axis of the scene, of which each wall's are compared."""


def _rule(settings: Settings) -> Rule:
    return Rule(True, True, True, False, 0.0, settings.photons.glossy, settings.render.max_depth)


def _on_axis_walls(importons: Importons) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Which way the surface of each importon faces along an axis, 0 … 5, −1 for none; and all normals."""
    normals = decode_directions(importons.normals)
    axis = np.abs(normals).argmax(axis=1)
    rows = np.arange(len(axis))
    facing = 2 * axis + (normals[rows, axis] > 0)
    return np.where(np.abs(normals[rows, axis]) > 0.999, facing, -1), normals


def _cells(importons: Importons, low: NDArray[np.float64], size: float) -> dict[tuple[int, ...], float]:
    """Importance by cell of walls along the axes: (facing, plane, cell, cell) → Σ Ψ."""
    facing, _ = _on_axis_walls(importons)
    chosen = facing >= 0
    places = np.floor((importons.positions[chosen] - low) / size * CELLS).astype(np.int64)
    axis = facing[chosen] // 2
    rows = np.arange(len(axis))
    plane = np.round((importons.positions[chosen][rows, axis] - low[axis]) / size * 1000).astype(np.int64)
    other = np.stack([places[rows, (axis + 1) % 3], places[rows, (axis + 2) % 3]], axis=1)
    keys = np.column_stack([facing[chosen], plane, other])
    unique, which = np.unique(keys, axis=0, return_inverse=True)
    sums = np.bincount(which.reshape(-1), importons.weights[chosen])
    return {tuple(int(x) for x in key): float(total) for key, total in zip(unique, sums, strict=True)}


def _integral(
    made: ImportanceMap, key: tuple[int, ...], low: NDArray[np.float64], size: float, rng: np.random.Generator
) -> float:
    """∫Γ dA over a cell, by random points on it; points where Γ is 0 are those without a surface."""
    facing, plane, a, b = key
    axis, n, cell = facing // 2, 4096, size / CELLS
    points = np.empty((n, 3), np.float32)
    points[:, axis] = low[axis] + plane / 1000 * size
    points[:, (axis + 1) % 3] = low[(axis + 1) % 3] + (a + rng.random(n)) * cell
    points[:, (axis + 2) % 3] = low[(axis + 2) % 3] + (b + rng.random(n)) * cell
    normals = np.zeros((n, 3), np.float32)
    normals[:, axis] = 1 if facing % 2 else -1
    out = np.zeros(n, np.float32)
    importances(made.record, points, normals, out, 0, n)
    return float(out.mean(dtype=np.float64)) * cell * cell


def _agreement(opened: OpenScene, pool: WorkPool, N: int, truth_N: int) -> list[tuple[str, float, float, int]]:
    """For both maps: name, ratio of ∫Γ dA to brute force over whole cells together, mean |deviation| of a cell, and
    cells."""
    settings = with_values(Settings(), {"camera.width": SIZE, "camera.height": SIZE})
    camera = resolve_camera(opened.scene, settings.camera)
    eye, rule = eye_record(camera, settings, 0), _rule(settings)
    low = np.asarray(opened.flat.center, np.float64) - opened.flat.radius
    size = 2 * opened.flat.radius
    mine = joined([trace(opened.flat, eye, rule, 1, 0, N, pool.run)], SIZE * SIZE)
    truth = joined([trace(opened.flat, eye, rule, TRUTH_SEED, 0, truth_N, pool.run)], SIZE * SIZE)
    rng, found = np.random.default_rng(3), []
    for name, importons, exact in zip(("caustic", "global"), mine, truth, strict=True):
        made = build_importance(importons, "screen", opened.flat.radius, even=name == "caustic", run=pool.run)
        cells = _cells(exact, low, size)
        least = LEAST_SHARE * exact.weights.sum(dtype=np.float64)
        inner = {key: total for key, total in cells.items() if total > least and _whole(key, cells)}
        pairs = np.array([(_integral(made, key, low, size, rng), total) for key, total in inner.items()])
        ratio = float(pairs[:, 0].sum() / pairs[:, 1].sum())
        each = float(np.abs(pairs[:, 0] / pairs[:, 1] - 1).mean())
        found.append((name, ratio, each, len(pairs)))
    return found


def _whole(key: tuple[int, ...], cells: dict[tuple[int, ...], float]) -> bool:
    """Whether the four neighbours of a cell hold importance too: then it is covered by its wall."""
    facing, plane, a, b = key
    return all((facing, plane, a + i, b + j) in cells for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1)))


def _move(opened: OpenScene, pool: WorkPool, method: str, rounds: int) -> tuple[float, float]:
    """Median wall milliseconds and CPU milliseconds from a moved camera to its importance maps."""
    values = {"camera.width": SIZE, "camera.height": SIZE, "render.method": method, "importance.map": "average"}
    settings = with_values(Settings(), values)
    plan = plan_of(settings, opened.traits)
    prepare(opened, settings, pool, lambda text, share: None)
    camera = resolve_camera(opened.scene, settings.camera)
    wall, cpu = [], []
    for i in range(rounds + 1):
        moved = with_values(settings, {"camera.fov": camera.fov * (1 - 0.002 * i)})
        stage = ImportanceStage(
            opened, moved, plan, resolve_camera(opened.scene, moved.camera), 0.0, pool, StageCache(0), Tally()
        )
        begin, before = time.perf_counter(), pool.cpu_seconds
        stage.run(0)
        wall.append(1e3 * (time.perf_counter() - begin))
        cpu.append(1e3 * (pool.cpu_seconds - before))
    return float(np.median(wall[1:])), float(np.median(cpu[1:]))


def run(quick: bool = False) -> BenchResult:
    """Measure agreement and cost on the box scenes."""
    N, truth_N, rounds = (200_000, 1_000_000, 9) if quick else (400_000, 4_000_000, 25)
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    pool = WorkPool()
    try:
        for name in SCENES:
            opened = open_scene(name)
            for which, ratio, each, cells in _agreement(opened, pool, N, truth_N):
                rows.append([name, f"{which} map", cells, ratio, 100 * each, 0.0, 0.0])
                off = 100 * abs(ratio - 1)
                targets.append(Target("I1", off, 2.0, "% off brute force", False, f"{name}, {which} map"))
        for method in ("gather", "progressive"):
            wall, cpu = _move(open_scene("cornell_caustic"), pool, method, rounds)
            rows.append(["cornell_caustic", f"moved camera, {method}", 0, 0.0, 0.0, wall, cpu])
            targets.append(Target("I1", wall, 100.0, "ms", False, f"moved camera to importance maps, {method}"))
    finally:
        pool.close()
    columns = ["scene", "what", "cells", "∫Γ / brute force", "mean off by cell %", "ms", "CPU ms"]
    notes = [
        f"{N:,} importons against {truth_N:,} random eye paths of another seed, counted in cells of walls",
        f"moved camera: {Settings().importance.N:,} importons, {SIZE} × {SIZE} pixels, on {pool.threads} threads",
    ]
    return BenchResult("Importance", columns, rows, targets, notes)
