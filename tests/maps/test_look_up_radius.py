"""Automatic and progressive radius."""

from itertools import pairwise

import numpy as np
import pytest

from pmviewer.maps.radius import automatic_radius, largest_power, progressive_radius
from pmviewer.maps.search.kdtree import build_kdtree
from tests.maps.test_irradiance_estimate import UP, by_knn
from tests.support import naive_maps as naive

f4 = np.float32


@pytest.mark.parametrize("alpha", [0.1, 2 / 3, 0.999, 1.0])
def test_progressive_radius_equals_the_recurrence(alpha):
    squared = 0.3**2
    for i in range(1, 20_000):
        if i < 10 or i % 997 == 0:
            assert progressive_radius(0.3, i, alpha) == pytest.approx(np.sqrt(squared), rel=1e-9)
        squared *= (i + alpha) / (i + 1)


def test_a_delay_keeps_the_radius_for_as_many_passes_and_lets_it_shrink_as_fast_in_the_end():
    """By the recurrence as it is from pass 200 on; against none after so many that it makes no difference."""
    squared = 0.3**2
    for i in range(1, 2001):
        assert progressive_radius(0.3, i, 2 / 3, delay=200) == pytest.approx(np.sqrt(squared), rel=1e-9)
        squared *= (i + 200 + 2 / 3) / (i + 200 + 1)
    assert progressive_radius(0.3, 50, 2 / 3, delay=200) > 0.96 * 0.3
    late = [progressive_radius(1.0, 10**i, 2 / 3, delay=200) for i in (7, 10)]
    assert late[1] / late[0] == pytest.approx(10**-0.5, rel=1e-3)


def test_progressive_radius_shrinks_to_its_floor():
    radii = [progressive_radius(2.0, i, 0.5, floor=0.01) for i in (1, 2, 10, 1000, 10**12)]
    assert radii[0] == pytest.approx(2.0)
    assert all(a > b for a, b in pairwise(radii))
    assert radii[-1] == 0.01


def test_largest_power_is_by_luminance():
    photons = naive.pack(np.zeros((3, 3)), power=np.array([[4, 0, 0], [0, 2, 0], [0, 0, 8]]))
    assert largest_power(photons, 0.5) == pytest.approx(0.5 * 2 * 0.7152, rel=1e-5)
    assert largest_power(np.empty((0, 6), f4), 0.5) == 0


def test_automatic_radius_formula():
    # k photons of Φ_max in a disc of r_m give a white surface the radiance L_t.
    r = automatic_radius(50, 1e-3, 0.05)
    assert 50 * 1e-3 / (np.pi * np.pi * r**2) == pytest.approx(0.05)
    assert automatic_radius(50, 0.0, 0.05) == 0


def test_automatic_radius_gives_the_result_of_an_unlimited_search():
    """A dense caustic in a sparse surrounding five times darker than the threshold."""
    k, phi = 50, 1e-4
    means = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        sparse = rng.random((10_000, 2))
        angle, radius = rng.uniform(0, 2 * np.pi, 60_000), 0.1 * np.sqrt(rng.random(60_000))
        dense = 0.5 + np.c_[radius * np.cos(angle), radius * np.sin(angle)]
        place = np.vstack([sparse, dense])
        photons = naive.pack(np.c_[place, np.zeros(len(place))])
        tree = build_kdtree(photons, phi)
        threshold = 5 * 10_000 * phi / np.pi
        r_m = automatic_radius(k, largest_power(photons, phi), threshold)
        assert r_m < 0.5 * np.sqrt(k / (np.pi * 10_000))
        points = np.zeros((4000, 3), f4)
        points[:, :2] = rng.uniform(0.1, 0.9, (4000, 2))
        normals = np.tile(UP, (4000, 1))
        means.append([by_knn(tree, points, normals, k, r)[0].mean() for r in (r_m, 10.0)])
    limited, unlimited = np.mean(means, axis=0)
    assert limited == pytest.approx(unlimited, rel=0.005)
