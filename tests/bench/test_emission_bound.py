"""The bound of guided emission: its arithmetic, by cases worked out by hand."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pmviewer.bench.measures.emission_bound import Seen, best_saving, saving_of
from pmviewer.photons.emission.strata import Strata
from tests.support.naive_maps import pack


def strata(power):
    n = len(power)
    return Strata(np.zeros(n, np.int32), np.zeros(1, np.int32), np.array([[1, 1, n, 1]], np.int32), np.array(power))


def test_saving_of_the_best_table():
    """Alike strata save nothing; one light of ten that matters alone saves ten; p ∝ q√V beats other tables."""
    assert best_saving(strata([0.25] * 4), np.full(4, 3.0)) == pytest.approx(1)
    assert best_saving(strata([0.1] * 10), np.eye(10)[0]) == pytest.approx(10)
    q, V = np.array([0.2, 0.3, 0.5]), np.array([9.0, 1.0, 4.0])
    tables = np.random.default_rng(1).dirichlet(np.ones(3), 20_000)
    tried = (q * V).sum() / (q * q * V / tables).sum(axis=1)
    assert tried.max() <= best_saving(strata(q), V) <= 1.01 * tried.max()


def test_saving_of_a_known_table():
    """By hand for two strata, and never more than that of the best table, however noisy what is known."""
    two = strata([0.5, 0.5])
    share = np.array([0.9 * 0.75 + 0.05, 0.9 * 0.25 + 0.05])
    by_hand = 4 / (0.75 / share[0] + 1.25 / share[1])
    assert saving_of(two, np.array([9.0, 1.0]), np.array([3.0, 5.0])) == pytest.approx(by_hand)
    rng = np.random.default_rng(2)
    q, V = rng.dirichlet(np.ones(50)), rng.exponential(size=50) ** 3
    noisy = [saving_of(strata(q), V * rng.exponential(size=50), V) for _ in range(200)]
    assert max(noisy) <= saving_of(strata(q), V, V) * 1.02
    assert max(noisy) <= best_saving(strata(q), V)
    assert saving_of(two, np.zeros(2), np.ones(2)) == 1


def test_value_of_photons():
    """Squared power times the worth of the pixels in reach, on the photon's side."""
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    up = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]], np.float32)
    weights = np.array([[1.0, 2.0, 3.0], [10.0, 0.0, 0.0]])
    photons = pack(np.array([[0.1, 0, 0], [0.5, 0, 0], [5, 0, 0]], np.float32))
    words = photons.view(np.uint32)
    words[:, 3] = 2047 << 20 | 2047 << 8  # from above
    words[:, 4], words[:, 5] = 48 << 10 | 47 << 26, 47 << 10  # powers 2, 1, 1
    found = Seen(cKDTree(places), up, weights, 0.6).value(photons)
    np.testing.assert_allclose(found, [4 + 2 + 3, 4 + 2 + 3 + 40, 0])
    below = Seen(cKDTree(places), -up, weights, 0.6).value(photons)
    np.testing.assert_allclose(below, 0)
