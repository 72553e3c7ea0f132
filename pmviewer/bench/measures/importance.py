"""Importance against the path tracer, and what it costs (I1–I3).

Importance Γ is how many pixels look at a unit of area: the derivative of the picture, summed over its pixels, to the
radiance that leaves a place. So light is put there. In a copy of the scene all lights are dark but one: a thin patch
of a wall's own material that lies on it and emits the radiance 1, and the path tracer makes the picture. The sum of its
pixels' luminances is then ∫Γ dA over the patch, by paths of all classes, without importons, roulette or densities.

The classes of the two maps are told apart by what surfaces reflect. If the reflectance of all surfaces that store
photons is multiplied by s, a path with n such bounces counts sⁿ:

- **caustic map**, importons met before any such bounce, through mirrors and glass too: the picture P(0) with these
  surfaces black;
- **global map**, the first importon after one such bounce: the derivative (P(s) − P(0))/s at a small s, with the same
  random numbers in both. What it holds of two bounces is s times as much as there is.

After the bounce light comes over mirrors and glass, too, so importons do the same (`photons.indirect_caustics` off).

The costs are those of a moved camera: importons traced and both maps built, at the default number of importons.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.importance import ImportanceStage
from pmviewer.engine.store import StageStore
from pmviewer.engine.tally import Tally
from pmviewer.importance.importons import Rule, joined, trace
from pmviewer.maps.importance.build import build_importance
from pmviewer.maps.importance.importance_map import ImportanceMap, Importons
from pmviewer.maps.importance.look_up import importances
from pmviewer.maps.record import decode_directions
from pmviewer.render.camera import resolve_camera
from pmviewer.render.record import eye_record
from pmviewer.scene.description import LUMINANCE, Material, Mesh, Parallelogram, Scene, Shape
from pmviewer.settings.access import Settings, with_values

SCENES = ("cornell_diffuse", "cornell_caustic", "cornell_glossy")
SIZE = 512
PATH_SIZE = 128
"""Pixels along a side of the path tracer's pictures, which are of the same view."""
LEAST_SHARE = 0.002
"""Cells with less of the importance than this are left out."""
CELLS = 6
"""Cells along an axis of the scene, of which each wall's are compared."""
PATCHES = 8
"""Cells of either map that are made to emit, one at a time."""
FAINT = 1e-3
"""s."""
ABOVE = 2e-4
"""How far in front of its wall a patch lies, relative to the scene."""

Cell = tuple[int, ...]
"""(facing, plane, cell, cell): which way the wall faces along an axis (0 … 5), its place, and the cell on it."""


def _rule(settings: Settings) -> Rule:
    return Rule(True, True, True, True, 0.0, settings.photons.glossy, settings.render.max_depth)


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


def with_patch(scene: Scene, cell: Cell, plane: float, low: NDArray[np.float64], size: float) -> Scene:
    """The scene with all lights dark but a patch that covers the cell and emits the radiance 1; `plane`: the wall's
    coordinate along the axis that it faces."""
    facing, _, a, b = cell
    axis, step = facing // 2, size / CELLS
    corner, edges = np.zeros(3), np.zeros((2, 3))
    corner[axis] = plane + (1 if facing % 2 else -1) * ABOVE * size
    for edge, along, place in zip(edges, ((axis + 1) % 3, (axis + 2) % 3), (a, b), strict=True):
        corner[along], edge[along] = low[along] + place * step, step
    first, second = edges if facing % 2 else edges[::-1]  # their cross product is the front's normal
    geometry = Parallelogram(*(tuple(float(x) for x in v) for v in (corner, first, second)))  # type: ignore[arg-type]
    patch = Shape("patch", geometry, _material(scene, corner + edges.sum(axis=0) / 2), radiance=(1.0, 1.0, 1.0))
    dark = tuple(replace(shape, radiance=None, emission=None) for shape in scene.shapes)
    return replace(scene, shapes=(*dark, patch), lights=())


def _material(scene: Scene, point: NDArray[np.float64]) -> int:
    """That of the mesh with the triangle nearest to the point: by its barycentric coordinates there, and the height."""
    best = (math.inf, 0)
    for shape in scene.shapes:
        if isinstance(shape.geometry, Mesh):
            a, b, c = np.moveaxis(shape.geometry.vertices[shape.geometry.faces], 1, 0)
            n = np.cross(b - a, c - a)
            u = (np.cross(point - a, c - a) * n).sum(axis=1) / (n * n).sum(axis=1)
            v = (np.cross(b - a, point - a) * n).sum(axis=1) / (n * n).sum(axis=1)
            height = abs(((point - a) * n).sum(axis=1)) / np.linalg.norm(n, axis=1)
            inside = (u >= 0) & (v >= 0) & (u + v <= 1)
            best = min(best, (float(height[inside].min(initial=math.inf)), shape.material))
    return best[1]


def reflecting(scene: Scene, share: float, glossy: float) -> Scene:
    """The scene with `share` of the reflectance of all surfaces that store photons: diffuse ones, and metals of at
    least the roughness `glossy`. (The scenes have no others.)"""

    def dimmed(material: Material) -> Material:
        stores = material.kind == "diffuse" or (material.kind == "rough conductor" and min(material.alpha) >= glossy)
        r, g, b = material.reflectance
        return replace(material, reflectance=(share * r, share * g, share * b)) if stores else material

    return replace(scene, materials=tuple(dimmed(material) for material in scene.materials))


def traced(scene: Scene, passes: int, pool: WorkPool) -> dict[str, float]:
    """By map: sum of the pixels' luminances, of SIZE² pixels, that the path tracer finds on the map's paths."""
    values = {"camera.width": PATH_SIZE, "camera.height": PATH_SIZE, "render.method": "path"}
    settings, found = with_values(Settings(), values), []
    for share in (0.0, FAINT):
        opened = open_scene(reflecting(scene, share, settings.photons.glossy))
        prepare(opened, settings, pool, lambda text, share: None)
        renderer = Renderer(opened, settings, pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
        image = renderer.frame(0).image().astype(np.float64)
        found.append(float((image @ LUMINANCE).sum()) * (SIZE / PATH_SIZE) ** 2)
    return {"caustic": found[0], "global": (found[1] - found[0]) / FAINT}


def _plane(importons: Importons, cell: Cell, low: NDArray[np.float64], size: float) -> float:
    """The coordinate of the cell's wall, which its number tells to a thousandth of the scene."""
    axis = cell[0] // 2
    off = importons.positions[:, axis] - (low[axis] + cell[1] / 1000 * size)
    facing, _ = _on_axis_walls(importons)
    near = (abs(off) < size / 1000) & (facing == cell[0])
    return float(np.median(importons.positions[near, axis]))


def _agreement(opened: OpenScene, pool: WorkPool, N: int, passes: int) -> list[tuple[str, float, float, int]]:
    """For both maps: name, ratio of ∫Γ dA to the path tracer's over all cells together, mean |deviation| of a cell,
    and cells."""
    settings = with_values(Settings(), {"camera.width": SIZE, "camera.height": SIZE})
    camera = resolve_camera(opened.scene, settings.camera)
    eye, rule = eye_record(camera, settings, 0), _rule(settings)
    low = np.asarray(opened.flat.center, np.float64) - opened.flat.radius
    size = 2 * opened.flat.radius
    mine = joined([trace(opened.flat, eye, rule, 1, 0, N, pool.run)], SIZE * SIZE)
    maps, chosen = {}, {}
    planes: dict[Cell, float] = {}
    for name, importons in zip(("caustic", "global"), mine, strict=True):
        maps[name] = build_importance(importons, "screen", opened.flat.radius, even=name == "caustic", run=pool.run)
        cells = _cells(importons, low, size)
        least = LEAST_SHARE * importons.weights.sum(dtype=np.float64)
        inner = sorted((c for c, total in cells.items() if total > least and _whole(c, cells)), key=cells.__getitem__)
        some = np.linspace(0, len(inner) - 1, min(PATCHES, len(inner))).round().astype(int)
        chosen[name] = [inner[i] for i in some]
        planes |= {cell: _plane(importons, cell, low, size) for cell in chosen[name]}
    truth = {cell: traced(with_patch(opened.scene, cell, at, low, size), passes, pool) for cell, at in planes.items()}
    rng, found = np.random.default_rng(3), []
    for name, made in maps.items():
        pairs = np.array([(_integral(made, c, low, size, rng), truth[c][name]) for c in chosen[name]])
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
            opened, moved, plan, resolve_camera(opened.scene, moved.camera), 0.0, pool, StageStore(0), Tally()
        )
        begin, before = time.perf_counter(), pool.cpu_seconds
        stage.run(0)
        wall.append(1e3 * (time.perf_counter() - begin))
        cpu.append(1e3 * (pool.cpu_seconds - before))
    return float(np.median(wall[1:])), float(np.median(cpu[1:]))


def run(quick: bool = False) -> BenchResult:
    """Measure agreement and cost on the box scenes."""
    N, passes, rounds = (200_000, 32, 9) if quick else (400_000, 128, 25)
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    pool, said = WorkPool(), f"{N:,} importons for {SIZE} × {SIZE} pixels, render.method=gather, "
    said += "importance.map=screen, photons.indirect_caustics=off"
    try:
        for name in SCENES:
            opened = open_scene(name)
            for which, ratio, each, cells in _agreement(opened, pool, N, passes):
                rows.append([name, f"{which} map", cells, ratio, 100 * each, 0.0, 0.0])
                off = 100 * abs(ratio - 1)
                targets.append(Target("I1", off, 2.0, "% off the path tracer", False, f"{name}, {which} map, {said}"))
        for method in ("gather", "progressive"):
            wall, cpu = _move(open_scene("cornell_caustic"), pool, method, rounds)
            rows.append(["cornell_caustic", f"moved camera, {method}", 0, 0.0, 0.0, wall, cpu])
            targets.append(
                Target(
                    "I1",
                    wall,
                    100.0,
                    "ms",
                    False,
                    f"moved camera to importance maps, {method}, importance.map=average, {SIZE} × {SIZE} pixels",
                )
            )
    finally:
        pool.close()
    columns = ["scene", "what", "cells", "∫Γ / path tracer", "mean off by cell %", "ms", "CPU ms"]
    notes = [
        f"{N:,} importons against the path tracer's light of a patch, {PATH_SIZE} × {PATH_SIZE} pixels, {passes} "
        f"passes, for up to {PATCHES} cells of walls of each map",
        f"moved camera: {Settings().importance.N:,} importons, {SIZE} × {SIZE} pixels, on {pool.threads} threads",
    ]
    return BenchResult("Importance", columns, rows, targets, notes)
