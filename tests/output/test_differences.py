"""Differences of two pictures by numbers worked out by hand; FLIP by what its authors state."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.errors import OutputError
from pmviewer.output import flip
from pmviewer.output.difference import difference, mean_difference
from pmviewer.output.difference_views import DIFFERENCES
from pmviewer.settings.access import SETTINGS


def picture(*pixels):
    """One row of pixels."""
    return np.array([pixels], np.float32)


A = picture((0.5, 0.5, 0.5), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
B = picture((0.4, 0.4, 0.4), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0))
BY_HAND = {
    "signed": (0.1, 0.2126 - 0.7152, 0.0),
    "absolute": (0.1, 2 / 3, 0.0),
    "relative": (0.1 / 0.5, (0.2126 - 0.7152) / 0.8152, 0.0),
    "relMSE": (0.01 / 0.17, (1 / 0.01 + 1 / 1.01) / 3, 0.0),
    "MAPE": (100 * 0.1 / 0.5, 100 * (1 / 0.1 + 1 / 1.1) / 3, 0.0),
}


@pytest.mark.parametrize("kind", BY_HAND)
def test_differences_are_those_of_their_formulas(kind):
    plane = difference(kind, A, B)
    assert plane.shape == (1, 3)
    assert plane.dtype == np.float32
    np.testing.assert_allclose(plane[0], BY_HAND[kind], rtol=1e-5, atol=1e-7)
    assert mean_difference(kind, plane) == pytest.approx(np.mean(BY_HAND[kind]), rel=1e-5)


def test_every_kind_can_be_chosen_and_is_described():
    assert tuple(DIFFERENCES) == SETTINGS["compare.difference"].choices
    assert {kind for kind, view in DIFFERENCES.items() if view.signed} == {"signed", "relative"}


@pytest.mark.parametrize("kind", DIFFERENCES)
def test_what_is_not_finite_stays_so_and_counts_for_nothing(kind):
    broken = np.repeat(np.repeat(A, 4, axis=1), 12, axis=0)
    clean = broken.copy()
    broken[0, 0, 1], broken[3, 2, 0] = np.nan, np.inf
    plane = difference(kind, broken, clean)
    np.testing.assert_array_equal(np.argwhere(~np.isfinite(plane)), [[0, 0], [3, 2]])
    assert mean_difference(kind, plane) == 0


def test_pictures_of_other_sizes_have_none():
    with pytest.raises(ValueError, match="can't be compared"):
        difference("absolute", A, A[:, :2])


def test_flip_is_none_for_equal_pictures_and_grows_with_what_is_seen():
    rng = np.random.default_rng(1)
    truth = rng.uniform(0.2, 0.8, (24, 32, 3)).astype(np.float32)
    errors = []
    for amount in (0.0, 0.02, 0.3):
        off = truth.copy()
        off[:, 16:] *= 1 + amount
        plane = difference("FLIP", off, truth)
        assert plane.shape == (24, 32)
        assert plane.min() >= 0
        assert plane.max() <= 1
        errors.append(plane)
    assert errors[0].max() == 0
    assert 0 < errors[1][:, 20:].mean() < errors[2][:, 20:].mean()
    assert errors[2][:, 20:].mean() > 3 * errors[2][:, :12].mean(), "the difference is where it is"


def test_black_beside_black_differs_in_nothing():
    assert difference("FLIP", np.zeros((8, 8, 3)), np.zeros((8, 8, 3))).max() == 0


def test_without_the_evaluator_a_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setattr(flip, "find_spec", lambda name: None)
    with pytest.raises(OutputError, match=r"pip install 'pmviewer\[flip\]'"):
        difference("FLIP", A, B)
