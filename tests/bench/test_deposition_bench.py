"""The difference in the mean of pictures of a few seeds, told apart from their noise."""

import numpy as np
import pytest

from pmviewer.bench.measures.deposited import bias


def test_a_difference_below_the_noise_is_found():
    rng = np.random.default_rng(1)
    off = rng.choice([-0.03, 0.03], (60, 80)) + rng.normal(0, 0.2, (8, 60, 80))
    found = bias(off, 2.0)
    assert found.likely == pytest.approx(1.5, rel=0.15)
    assert found.likely < found.at_most < 2.0


def test_noise_alone_is_no_difference():
    """Over many tries the squares average to nothing, and the standard error says how much they scatter."""
    rng = np.random.default_rng(2)
    tries = [bias(rng.normal(0, 0.2, (5, 40, 40)), 1.0) for _ in range(200)]
    squared, errors = np.array([t.squared for t in tries]), np.array([t.error for t in tries])
    assert abs(squared.mean()) < 4 * squared.std() / np.sqrt(len(tries))
    assert np.sqrt((errors**2).mean()) == pytest.approx(squared.std(), rel=0.4)
    assert np.mean([t.at_most == 0 for t in tries]) < 0.1
