"""The tree over many triangles: the same for any number of threads, with every triangle once, and given up at once."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.kernels.accel import bvh, bvh_binary
from pmviewer.progress import Cancelled, watched

N = 3 * bvh_binary.ALONE


@pytest.fixture(scope="module")
def triangles() -> np.ndarray:
    generator = np.random.default_rng(3)
    corners = generator.uniform(-1, 1, (N, 1, 3)) + generator.uniform(-0.01, 0.01, (N, 3, 3))
    return corners.astype(np.float32)


def test_threads_do_not_change_the_tree(triangles: np.ndarray) -> None:
    nothing = np.empty((0, 12), np.float32)
    trees = []
    for threads in (1, 3):
        with watched(threads=threads):
            trees.append(bvh.build(triangles, nothing))
    assert np.array_equal(trees[0].blocks.view(np.int32), trees[1].blocks.view(np.int32))
    assert np.array_equal(trees[0].nodes.view(np.int32), trees[1].nodes.view(np.int32))
    ids = trees[0].blocks.view(np.int32)[:, 9]
    assert sorted(ids[ids >= 0].tolist()) == list(range(N))


def test_boxes_hold_what_is_below_them(triangles: np.ndarray) -> None:
    tree = bvh.build(triangles, np.empty((0, 12), np.float32))
    children = tree.nodes.view(np.int32)[:, 6]
    used = tree.nodes[:, 0] <= tree.nodes[:, 1]
    node, lane = np.nonzero(used & (children < 0))
    ids = tree.blocks.view(np.int32)[~children[node, lane], 9]
    corners = np.where((ids >= 0)[:, :, None, None], triangles[ids], np.nan).reshape(len(node), -1, 3)
    for axis in range(3):
        assert (np.nanmin(corners[:, :, axis], axis=1) == tree.nodes[node, 2 * axis, lane]).all()
        assert (np.nanmax(corners[:, :, axis], axis=1) == tree.nodes[node, 2 * axis + 1, lane]).all()
    node, lane = np.nonzero(used & (children >= 0))
    below = children[node, lane]
    for axis in range(3):
        low, high = tree.nodes[below][:, 2 * axis].min(axis=1), tree.nodes[below][:, 2 * axis + 1].max(axis=1)
        assert (low == tree.nodes[node, 2 * axis, lane]).all()
        assert (high == tree.nodes[node, 2 * axis + 1, lane]).all()


def test_building_stops_when_nobody_wants_the_tree(triangles: np.ndarray) -> None:
    with pytest.raises(Cancelled), watched(unwanted=lambda: True):
        bvh.build(triangles, np.empty((0, 12), np.float32))
