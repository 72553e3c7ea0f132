"""Weights of a single step: the lights' cells among the photons that tell their density, and their beams (R10)."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.search.kdtree import build_kdtree
from pmviewer.maps.virtual_lights import BEAM, V_BEAMS, V_OPACITY, V_Q
from pmviewer.photons.virtual.beams import beams_at
from pmviewer.photons.virtual.choice import in_media
from pmviewer.photons.virtual.density import cells, whole_discs
from pmviewer.photons.virtual.sided import SidedTree, sided_tree
from pmviewer.scene.arrays.flatten import FlatScene

Float = NDArray[np.float32]
Runner = Callable[[list[Callable[[], Any]]], list[Any]]

LIGHTS = 128
"""Lights a task whose cells are measured."""
PER_DISC = 8
"""Photons of a disc of the largest radius, see `reach_of`: dark places have none, and weigh nothing."""


class Candidates(NamedTuple):
    """Candidates of a pass as photons `found` (m, 6) and as `rows` (m, COLUMNS); those `kept` as lights (n,), how many
    candidates each stands for, `share` (n,), and watts of a `unit` of power."""

    found: Float
    rows: Float
    kept: NDArray[np.int64]
    share: Float
    unit: float


class Weighed(NamedTuple):
    """The `tree` of the photons that a place belongs to if they are closer than `reach`, and the photons that each
    light stands for, (n, k, BEAM); k may be 0."""

    tree: SidedTree | None
    reach: float
    beams: Float


class Density(NamedTuple):
    """How it is told: by all candidates (`of_map`) or the lights alone, by cells of that order, on surfaces whose gloss
    is stored from the roughness `glossy` on."""

    of_map: bool
    order: int
    glossy: float


def weigh_by_density(scene: FlatScene, candidates: Candidates, lights: Float, density: Density, run: Runner) -> Weighed:
    """Sets V_Q of the lights (n, COLUMNS), those in media left out, and V_BEAMS."""
    of_map, order, _ = density
    found, rows, kept, share, unit = candidates
    lie = ~in_media(lights)
    some, share = np.ascontiguousarray(lights[lie]), share[lie]
    beams = np.zeros((len(lights), order + 1 if of_map else 0, BEAM), np.float32)
    if of_map:
        among, numbers = found, kept[lie]
        if scene.has_media:
            surfaces = ~in_media(rows)
            among, rows, numbers = found[surfaces], rows[surfaces], (np.cumsum(surfaces) - 1)[kept][lie]
    else:
        among, rows, numbers = found[kept][lie], some, np.arange(len(some))
    reach = reach_of(scene.radius, len(among))
    tree = run([lambda: sided_tree(among, rows, unit)])[0]
    q = cells_of(scene, tree, some, numbers.astype(np.int32), density, reach, run)
    if of_map:
        q *= share
        beams[lie], lights[lie, V_BEAMS] = beams_of(scene, tree, rows, some, unit * share, (order + 1, reach), run)
    lights[lie, V_Q] = q * some[:, V_OPACITY]
    return Weighed(tree, reach, beams)


def weigh_as_printed(candidates: Candidates, lights: Float, k: int, run: Runner) -> None:
    """Sets V_Q of the lights (n, COLUMNS), those in media left out, to 1/D of the paper's form."""
    lie = ~in_media(lights)
    some = np.ascontiguousarray(lights[lie])
    tree = build_kdtree(np.ascontiguousarray(candidates.found[candidates.kept][lie]), candidates.unit)
    q = np.empty(len(some), np.float32)
    run([lambda: whole_discs(tree.record, some, max(1, min(k, tree.n - 1)), q)])
    lights[lie, V_Q] = q


def reach_of(scene_radius: float, n: int) -> float:
    """Largest radius of a disc among n photons: with PER_DISC of them were they spread over the scene's sphere."""
    return scene_radius * min(2.0, math.sqrt(4 * PER_DISC / max(n, 1)))


def cells_of(
    scene: FlatScene,
    tree: SidedTree,
    lights: Float,
    numbers: NDArray[np.int32],
    density: Density,
    reach: float,
    run: Runner,
) -> Float:
    """Area (n,) of the cell of each of the lights among the photons of a tree, which hold the lights themselves, by
    their numbers (`pmviewer.photons.virtual.density`); reach: largest radius of a cell."""
    areas = np.empty(len(lights), np.float32)
    order, glossy, widest = density.order, np.float32(density.glossy), np.float32(reach)

    def some(first: int) -> None:
        last = min(first + LIGHTS, len(lights))
        cells(scene.record, tree.record, lights, numbers, order, widest, glossy, areas, first, last)

    run([partial(some, first) for first in range(0, len(lights), LIGHTS)])
    return areas


def beams_of(
    scene: FlatScene,
    tree: SidedTree,
    candidates: Float,
    lights: Float,
    share: Float,
    disc: tuple[int, float],
    run: Runner,
) -> tuple[Float, Float]:
    """Up to k photons (n, k, BEAM) that each of the lights stands for among the candidates, and how many (n,); disc: k
    and its largest radius."""
    lights, beams = lights.copy(), np.zeros((len(lights), disc[0], BEAM), np.float32)
    if "bsdfs" not in (scene.record.dtype.names or ()):  # all scatter evenly
        return beams, lights[:, V_BEAMS]
    share, reach = share.astype(np.float32), np.float32(disc[1])

    def some(first: int) -> None:
        beams_at(tree.record, candidates, lights, reach, share, beams, first, min(first + LIGHTS, len(lights)))

    run([partial(some, first) for first in range(0, len(lights), LIGHTS)])
    return beams, lights[:, V_BEAMS]
