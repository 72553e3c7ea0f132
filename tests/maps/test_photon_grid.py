"""The fixed-radius grid against brute force."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from pmviewer.errors import PmviewerError
from pmviewer.maps.search.grid import build_grid, count_in_radius, grid_steps
from pmviewer.tasks import in_steps
from tests.support import naive_maps as naive

f4 = np.float32


def counts(grid, points, radius):
    out = np.full(len(points), -1, np.int32)
    count_in_radius(grid.record, np.ascontiguousarray(points, f4), f4(radius), 0, len(points), out)
    return out


def brute_force(positions, points, radius):
    d2 = ((positions[None].astype(f4) - np.asarray(points, f4)[:, None]) ** 2).sum(axis=2)
    return (d2 < f4(radius) ** 2).sum(axis=1)


@pytest.mark.parametrize("radius", [0.003, 0.02, 0.1, 0.7, 5.0])
def test_counts_equal_brute_force(radius):
    positions = naive.clustered(5000, 1)
    points = np.vstack([naive.clustered(150, 2), np.random.default_rng(3).uniform(-2, 2, (50, 3))])
    grid = build_grid(naive.pack(positions), radius)
    for smaller in (radius, 0.6 * radius):
        found, expected = counts(grid, points, smaller), brute_force(positions, points, smaller)
        # A photon at the radius to the last bit may fall on either side.
        assert np.mean(found == expected) > 0.98
        assert np.abs(found - expected).max() <= 1
    assert expected.sum() > 0


def test_both_layouts_are_covered():
    photons = naive.pack(naive.clustered(5000, 1))
    assert build_grid(photons, 0.003).hashed
    assert not build_grid(photons, 0.1).hashed


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_any_scale(scale):
    positions = naive.clustered(4000, 4)
    points = naive.clustered(200, 5)
    grid = build_grid(naive.pack(positions * f4(scale)), 0.05 * scale)
    difference = counts(grid, points * f4(scale), 0.05 * scale) - brute_force(positions, points, 0.05)
    assert np.abs(difference).max() <= 1
    assert np.count_nonzero(difference) <= 4


def test_empty_map():
    grid = build_grid(np.empty((0, 6), f4), 0.1)
    assert grid.n == 0
    np.testing.assert_array_equal(counts(grid, np.zeros((3, 3)), 0.1), 0)


def test_one_photon():
    grid = build_grid(naive.pack(np.array([[1, 2, 3]])), 0.5)
    np.testing.assert_array_equal(counts(grid, [[1, 2, 3], [1, 2, 3.49], [1, 2, 3.51], [9, 9, 9]], 0.5), [1, 1, 0, 0])


@pytest.mark.parametrize("place", [0.0, 1.0, -7e4])
def test_all_photons_at_one_point(place):
    grid = build_grid(naive.pack(np.full((100_003, 3), place)), 0.1)
    np.testing.assert_array_equal(counts(grid, np.full((2, 3), place), 0.1), 100_003)


def test_photons_far_apart_need_no_more_memory():
    rng = np.random.default_rng(6)
    positions = rng.uniform(-1e6, 1e6, (3000, 3)).astype(f4)
    positions[1500:] = positions[:1500] + f4(0.25)
    grid = build_grid(naive.pack(positions), 0.01)
    assert grid.hashed
    assert grid.bytes < 31 * grid.n + 1000
    same = (positions[None] == positions[:, None]).all(axis=2).sum(axis=1)
    np.testing.assert_array_equal(counts(grid, positions, 0.01), same)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_points_that_are_no_points_find_nothing(bad):
    grid = build_grid(naive.pack(naive.clustered(1000, 7)), 0.1)
    np.testing.assert_array_equal(counts(grid, [[bad, 0, 0], [0, bad, 0], [0, 0, bad], [3e38, 0, 0]], 0.1), 0)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_photons_that_are_nowhere_do_no_harm(bad):
    positions = naive.clustered(1000, 8)
    photons = naive.pack(np.vstack([positions, [[bad, 0, 0]]]))
    found = counts(build_grid(photons, 0.3), positions[:20], 0.3)
    assert np.abs(found - brute_force(positions, positions[:20], 0.3)).max() <= 1


def test_order_is_by_cell_and_then_of_the_input():
    positions = naive.clustered(20_000, 9)
    photons = naive.pack(positions, light=np.arange(20_000))
    for radius in (0.003, 0.05):
        grid = build_grid(photons, radius)
        order = (grid.photons.view(np.uint32)[:, 5] >> 16).astype(int)
        np.testing.assert_array_equal(np.sort(order), np.arange(20_000))
        np.testing.assert_array_equal(grid.photons, photons[order])
        starts = np.zeros(grid.n, bool)
        starts[grid.starts[:-1][grid.starts[:-1] < grid.n]] = True
        assert (starts[1:] | (np.diff(order) > 0)).all()


def test_input_is_left_alone():
    photons = naive.pack(naive.clustered(1000, 10))
    before = photons.copy()
    photons.flags.writeable = False
    build_grid(photons, 0.1)
    np.testing.assert_array_equal(photons.view(np.uint32), before.view(np.uint32))


@pytest.mark.parametrize("n", [10_000, 200_000])
@pytest.mark.parametrize("radius", [1e-4, 1e-3, 1e-2, 1e-1])
def test_bytes_per_photon(n, radius):
    assert build_grid(naive.pack(naive.clustered(n, 11)), radius).bytes <= 31 * n


@pytest.mark.parametrize("radius", [0.0, -1.0, np.nan, np.inf])
def test_bad_radius(radius):
    with pytest.raises(PmviewerError, match="radius"):
        build_grid(np.empty((0, 6), f4), radius)


def test_bad_power_unit():
    with pytest.raises(PmviewerError, match=r"[Pp]ower"):
        build_grid(np.empty((0, 6), f4), 1.0, 0.0)


@pytest.mark.parametrize("radius", [0.1, 0.003])
def test_a_grid_built_in_pieces_is_the_same(radius):
    """On any number of threads, dense and hashed; chosen classes as if the others had not been given."""
    photons = naive.pack(naive.clustered(70_001, 5))
    words = photons.view(np.uint32)
    words[:, 3] = words[:, 3] & ~np.uint32(0xC0) | np.arange(len(photons), dtype=np.uint32) % 4 << 6
    chosen = photons[np.isin(np.arange(len(photons)) % 4, (0, 3))]
    for given, classes, wanted in ((photons, 0b1111, photons), (photons, 0b1001, chosen), (photons[:0], 0b1111, [])):
        whole = build_grid(np.ascontiguousarray(wanted) if len(wanted) else given, radius)
        with ThreadPoolExecutor(3) as threads:
            steps = [grid_steps(given, radius, 1.0, pieces, classes) for pieces in (1, 3, 8)]
            parts = in_steps(steps, lambda tasks: [done.result() for done in map(threads.submit, tasks)])
        for made in parts:
            np.testing.assert_array_equal(made.starts, whole.starts)
            np.testing.assert_array_equal(made.photons, whole.photons)
            assert made.n == len(wanted)
            assert made.record[list(made.record.dtype.names)[2:]] == whole.record[list(made.record.dtype.names)[2:]]
