"""The tree over many triangles: the same for any number of threads, with every triangle once, and given up at once."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.kernels import scene as K
from pmviewer.kernels.accel import bvh, bvh_binary
from pmviewer.kernels.accel.raycast import cast_closest
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


@pytest.mark.parametrize("room", [64, 5])
def test_a_begun_tree_is_finished_with_what_comes_later(triangles: np.ndarray, room: int) -> None:
    """A floor and a sphere come later, with room or without: rays meet what they meet in a tree built at once."""
    n = len(triangles)
    floor = [[[-3, -1, -3], [3, -1, -3], [3, -1, 3]], [[-3, -1, -3], [3, -1, 3], [-3, -1, 3]]] * 3
    everything = np.concatenate([triangles, np.array(floor, np.float32)])
    sphere = np.array([[0, 0, 1.2, 0, 0, 0, 1, 0.5, 0, 1, 0, 0]], np.float32)
    trees = [
        bvh.build(everything, sphere, started=bvh.begun(everything, n, room)),
        bvh.build(everything, sphere),
    ]
    ids = trees[0].blocks.view(np.int32)[:, 9]
    assert sorted(ids[ids >= 0].tolist()) == list(range(len(everything)))
    found = [closest(tree) for tree in trees]
    assert np.array_equal(found[0][0], found[1][0])
    assert set(found[0][1].tolist()) >= {-1, len(everything)}
    assert {int(i) // n for i in found[0][1]} == {-1, 0, 1}
    overlapping = found[0][1] >= n  # the floor is there three times
    assert np.array_equal(found[0][1][~overlapping], found[1][1][~overlapping])


def test_a_begun_tree_without_more_is_the_tree(triangles: np.ndarray) -> None:
    nothing = np.empty((0, 12), np.float32)
    trees = [bvh.build(triangles, nothing, started=bvh.begun(triangles, N, 8)), bvh.build(triangles, nothing)]
    assert np.array_equal(trees[0].blocks.view(np.int32), trees[1].blocks.view(np.int32))
    assert np.array_equal(trees[0].nodes.view(np.int32), trees[1].nodes.view(np.int32))
    assert bvh.begun(np.zeros((5, 3, 3), np.float32), 3, 2) is None


def closest(tree: bvh.Bvh) -> tuple[np.ndarray, np.ndarray]:
    """Distance and primitive that rays from around meet."""
    generator = np.random.default_rng(8)
    origins = generator.uniform(-4, 4, (4000, 3)).astype(np.float32)
    directions = generator.uniform(-1, 1, (4000, 3)) - origins
    directions = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).astype(np.float32)
    record = np.zeros(1, K.SCENE_DTYPE)
    tree.store(record[0])
    t, prim, uv = np.empty(4000, np.float32), np.empty(4000, np.int32), np.empty((4000, 2), np.float32)
    near, far = np.full(4000, 1e-4, np.float32), np.full(4000, np.inf, np.float32)
    cast_closest(record[0], origins, directions, near, far, t, prim, uv)
    return t, prim
