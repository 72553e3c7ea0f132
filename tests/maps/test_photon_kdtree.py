"""The kd-tree against brute force and against scipy's cKDTree."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pmviewer.errors import PmviewerError
from pmviewer.maps.search.k_nearest import MAX_K, knn
from pmviewer.maps.search.kdtree import build_kdtree
from tests.support import naive_maps as naive

f4 = np.float32


@pytest.mark.parametrize("n", [1, 2, 15, 16, 17, 31, 33, 64, 65, 500, 4001])
@pytest.mark.parametrize(("k", "max_radius"), [(1, np.inf), (7, np.inf), (50, np.inf), (50, 0.3)])
def test_neighbours_equal_brute_force(n, k, max_radius):
    positions = naive.clustered(n, n)
    points = np.vstack([naive.clustered(20, 1), np.random.default_rng(2).uniform(-3, 3, (10, 3))]).astype(f4)
    indices, squared = knn(build_kdtree(naive.pack(positions)), points, k, max_radius)
    for point, found, d2 in zip(points, indices, squared):
        expected = naive.neighbours(positions, point, k, max_radius)
        m = len(expected)
        np.testing.assert_array_equal(found, np.r_[expected, np.full(k - m, -1)])
        np.testing.assert_allclose(d2[:m], ((positions[expected] - point) ** 2).sum(axis=1), rtol=1e-5)
        assert np.isinf(d2[m:]).all()


def test_neighbours_equal_ckdtree_on_a_million_clustered_photons():
    positions = naive.clustered(1_000_000, 3)
    points = naive.clustered(4000, 4)
    points = points[np.lexsort(np.floor(points * 10).T)]
    indices, squared = knn(build_kdtree(naive.pack(positions)), points, 50)
    distance, expected = cKDTree(positions.astype(np.float64)).query(points.astype(np.float64), 50)
    np.testing.assert_allclose(np.sqrt(squared), distance, rtol=1e-6)
    same = (np.sort(indices, axis=1) == np.sort(expected, axis=1)).all(axis=1)
    # Where float32 can't tell the 50th from the 51st, either is right: the distances above agree.
    assert same.mean() > 0.9995


def test_order_of_neighbours_is_all_that_ordered_changes():
    tree = build_kdtree(naive.pack(naive.clustered(3000, 5)))
    points = naive.clustered(100, 6)
    ordered, free = knn(tree, points, 20, 0.5), knn(tree, points, 20, 0.5, ordered=False)
    assert (np.diff(np.where(np.isinf(ordered[1]), f4(1e9), ordered[1]), axis=1) >= 0).all()
    for a, b in zip(ordered, free):
        np.testing.assert_array_equal(np.sort(a, axis=1), np.sort(b, axis=1))


def test_shuffled_points_find_the_same():
    tree = build_kdtree(naive.pack(naive.clustered(20_000, 7)))
    points = naive.clustered(2000, 8)
    shuffle = np.random.default_rng(9).permutation(len(points))
    np.testing.assert_array_equal(knn(tree, points, 30)[0][shuffle], knn(tree, points[shuffle], 30)[0])


def test_empty_map():
    indices, squared = knn(build_kdtree(np.empty((0, 6), f4)), np.zeros((2, 3), f4), 5)
    assert (indices == -1).all()
    assert np.isinf(squared).all()


def test_all_photons_at_one_point():
    tree = build_kdtree(naive.pack(np.ones((100_003, 3))))
    indices, squared = knn(tree, np.array([[1, 1, 1], [1, 1, 2]], f4), 200)
    assert all(len(set(row)) == 200 for row in indices.tolist())
    np.testing.assert_array_equal(squared, np.repeat([[0.0], [1.0]], 200, axis=1))


def test_duplicates_all_count():
    positions = np.repeat(naive.clustered(100, 10), 7, axis=0)
    points = positions[::70]
    indices, squared = knn(build_kdtree(naive.pack(positions)), points, 21)
    for row, d2, point in zip(indices, squared, points):
        assert len(set(row.tolist())) == 21
        expected = np.sort(((positions - point) ** 2).sum(axis=1))[:21]
        np.testing.assert_allclose(d2, expected, rtol=1e-5)


@pytest.mark.parametrize("scale", [1e-4, 1e5])
def test_any_scale(scale):
    positions, points = naive.clustered(5000, 11), naive.clustered(200, 12)
    expected = knn(build_kdtree(naive.pack(positions)), points, 25)
    found = knn(build_kdtree(naive.pack(positions * f4(scale))), points * f4(scale), 25)
    np.testing.assert_allclose(found[1], expected[1] * f4(scale) ** 2, rtol=1e-4)


def test_points_that_are_no_points_find_nothing():
    tree = build_kdtree(naive.pack(naive.clustered(1000, 13)))
    points = np.array([[np.nan, 0, 0], [0, np.inf, 0], [0, 0, 0]], f4)
    indices, _ = knn(tree, points, 5)
    assert (indices[:2] == -1).all()
    assert (indices[2] >= 0).all()


def test_same_tree_for_any_number_of_threads():
    photons = naive.pack(naive.clustered(30_000, 14))
    serial = build_kdtree(photons)
    for threads in (1, 3):
        with ThreadPoolExecutor(threads) as pool:
            threaded = build_kdtree(photons, pool=pool)
        np.testing.assert_array_equal(threaded.index, serial.index)
        np.testing.assert_array_equal(threaded.planes, serial.planes)
        np.testing.assert_array_equal(threaded.payload, serial.payload)


def test_largest_k():
    positions = naive.clustered(5000, 15)
    points = naive.clustered(5, 16)
    indices, _ = knn(build_kdtree(naive.pack(positions)), points, MAX_K)
    for point, row in zip(points, indices):
        np.testing.assert_array_equal(np.sort(row), np.sort(naive.neighbours(positions, point, MAX_K)))


@pytest.mark.parametrize("k", [0, -1, MAX_K + 1])
def test_bad_k(k):
    with pytest.raises(PmviewerError, match="neighbours"):
        knn(build_kdtree(np.empty((0, 6), f4)), np.zeros((1, 3), f4), k)


def test_bytes_per_photon():
    tree = build_kdtree(naive.pack(naive.clustered(100_000, 17)))
    assert tree.bytes <= 31 * tree.n
