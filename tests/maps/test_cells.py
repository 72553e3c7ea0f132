"""Boxes of a photon map's structure, against the photons themselves."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.inspection import Wanted
from pmviewer.engine.wanted import divided_map
from pmviewer.maps.search.cells import cells_of_map
from pmviewer.maps.search.grid import build_grid
from pmviewer.maps.search.kdtree import build_kdtree
from pmviewer.maps.search.parts import parts_of


def photons(n: int, seed: int = 0) -> np.ndarray:
    """(n, 6) photons in a box, many of them in one corner."""
    random = np.random.default_rng(seed)
    records = np.zeros((n, 6), np.float32)
    records[:, :3] = random.uniform(-1, 3, (n, 3)) * (1, 2, 0.5)
    records[: n // 3, :3] = random.normal(0, 0.05, (n // 3, 3))
    return records


def inside(cells, places: np.ndarray, slack: float = 0.0) -> np.ndarray:
    """(boxes,) photons within each box, faces included, which may be `slack` farther out."""
    low, high = cells.low[:, None] - slack, cells.high[:, None] + slack
    return ((places >= low) & (places <= high)).all(axis=2).sum(axis=1)


def test_nodes_of_a_tree_hold_its_photons_and_halve_their_parents():
    records = photons(1000)
    cells = cells_of_map("global", build_kdtree(records), levels=4, limit=1000)
    assert (cells.kind, cells.depth, cells.total, len(cells.low)) == ("kd-tree", 6, 31, 31)
    np.testing.assert_array_equal(np.bincount(cells.level), [1, 2, 4, 8, 16])
    for level in range(5):
        of_level = cells.photons[cells.level == level]
        assert of_level.sum() == 1000
        assert of_level.max() - of_level.min() <= 1, "balanced"
    # No two of these photons share a coordinate; the one that a plane goes through is on the faces of both sides.
    found = inside(cells, records[:, :3])
    assert (found >= cells.photons).all()
    assert (found <= cells.photons + 6).all()
    volume = np.prod((cells.high - cells.low).astype(float), axis=1)
    for level in range(1, 5):
        assert volume[cells.level == level].sum() == pytest.approx(volume[0], rel=1e-5)
    np.testing.assert_array_equal(cells.low[0], records[:, :3].min(axis=0))
    np.testing.assert_array_equal(cells.high[0], records[:, :3].max(axis=0))


def test_levels_end_where_the_limit_or_the_leaves_are():
    tree = build_kdtree(photons(1000))
    for limit, last in ((100, 5), (127, 6), (126, 5), (62, 4), (1, 0)):
        cells = cells_of_map("global", tree, levels=24, limit=limit)
        assert cells.level.max() == last
        assert len(cells.low) == 2 ** (last + 1) - 1 <= limit
        assert cells.total == 127
    cells = cells_of_map("caustic", parts_of([tree, build_kdtree(photons(50, 1))]), levels=24, limit=1000)
    assert (cells.parts, cells.photons[0]) == (2, 1000)


@pytest.mark.parametrize(("radius", "hashed"), [(0.2, False), (0.004, True)])
def test_cells_of_a_grid_hold_its_photons(radius, hashed):
    records = photons(1000)
    grid = build_grid(records, radius)
    assert grid.hashed == hashed
    cells = cells_of_map("caustic", grid, levels=3, limit=100_000)
    assert cells.kind == ("hashed grid" if hashed else "grid")
    assert cells.photons.sum() == 1000
    assert (cells.photons > 0).all()
    np.testing.assert_allclose(cells.high - cells.low, 2 * radius, rtol=1e-2)
    assert len(np.unique(cells.low, axis=0)) == len(cells.low)
    slack = 1e-6
    assert (inside(cells, records[:, :3], slack) >= cells.photons).all()
    assert (inside(cells, records[:, :3], -1e-5) <= cells.photons).all()
    assert cells.total == len(cells.low)


@pytest.mark.parametrize("radius", [0.05, 0.004])
def test_cells_beyond_the_limit_are_put_together(radius):
    """Blocks of cells side by side, which hold all photons and are the smallest that keep within the limit."""
    records = photons(1000)
    grid = build_grid(records, radius)
    every = cells_of_map("global", grid, levels=3, limit=100_000)
    some = cells_of_map("global", grid, levels=3, limit=40)
    assert some.total == every.total > 40 >= len(some.low)
    assert some.photons.sum() == 1000
    assert some.side > every.side == 1
    np.testing.assert_allclose(some.high - some.low, some.side * 2 * radius, rtol=1e-2)
    assert len(np.unique(some.low, axis=0)) == len(some.low)
    np.testing.assert_allclose(inside(some, records[:, :3], 1e-6), some.photons, atol=1)
    assert len(cells_of_map("global", grid, levels=3, limit=len(some.low) - 1).low) < len(some.low)


def test_a_map_without_photons_has_no_cells():
    none = np.empty((0, 6), np.float32)
    assert cells_of_map("global", build_grid(none, 0.1), 3, 100) is None
    assert cells_of_map("global", build_kdtree(none), 3, 100) is None


def test_cells_are_those_of_a_map_that_there_is():
    class Plan:
        caustic_classes, global_classes, volume = 3, 0, False

    assert divided_map("global", Plan) == "caustic"
    assert divided_map("caustic", Plan) == "caustic"
    held, asked = Wanted(cells=("global", 6, 2000)), Wanted(cells=("global", 7, 2000))
    assert asked.lacks(held)
    assert not held.lacks(held)
    assert not Wanted().lacks(held)
