"""Settings between keys."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.errors import SettingError
from pmviewer.settings.access import Settings, with_values
from pmviewer.settings.between import between, places, smooth


def keys(path, *values):
    return [with_values(Settings(), {path: value}) for value in values]


def test_numbers_go_evenly_and_by_equal_factors():
    alphas = keys("estimate.alpha", 0.5, 0.9)
    assert between(alphas, 0.25).estimate.alpha == pytest.approx(0.6)
    photons = keys("photons.N", 1000, 1_000_000, 1000)
    assert [between(photons, at).photons.N for at in (0, 1 / 3, 2 / 3, 1, 2)] == [
        1000,
        10_000,
        100_000,
        1_000_000,
        1000,
    ]


def test_choices_are_the_earlier_keys():
    methods = keys("render.method", "progressive", "gather")
    assert [between(methods, at).render.method for at in (0.0, 0.99, 1.0)] == ["progressive", "progressive", "gather"]


def test_outside_of_the_keys_are_the_ends():
    alphas = keys("estimate.alpha", 0.5, 0.9)
    assert (between(alphas, -1).estimate.alpha, between(alphas, 7).estimate.alpha) == (0.5, 0.9)


def test_what_is_equal_stays_whatever_it_is():
    both = keys("estimate.radius", "auto", "auto")
    assert between(both, 0.5) == both[0]


def test_automatic_and_a_number_have_nothing_between():
    with pytest.raises(SettingError, match=r"estimate\.radius is a number in one key and auto in another"):
        between(keys("estimate.radius", "auto", 0.1), 0.5)


def test_edits_go_along():
    ways = keys(
        "edit.changes",
        {"object.a.move": (0, 0, 0), "light.b.power": 1},
        {"object.a.move": (1, 2, 3), "light.b.power": 3},
    )
    assert between(ways, 0.5).edit.changes == {"object.a.move": (0.5, 1.0, 1.5), "light.b.power": (2.0,)}
    with pytest.raises(SettingError, match=r"object\.a\.move is edited in one key and not in another"):
        between(keys("edit.changes", {"object.a.move": (1, 2, 3)}, {}), 0.5)


def test_the_curve_passes_its_keys_without_a_corner_and_is_straight_where_they_are():
    points = np.array([(0, 0, 0), (1, 2, 0), (3, 1, 1), (4, 4, 4)], float)
    for number in range(4):
        assert np.allclose(smooth(points, number), points[number])
    step = 1e-6
    for number in (1, 2):
        before = (smooth(points, number) - smooth(points, number - step)) / step
        after = (smooth(points, number + step) - smooth(points, number)) / step
        assert np.allclose(before, after, atol=1e-4)
    line = np.array([(0, 0, 0), (1, 1, 2), (2, 2, 4)], float)
    assert np.allclose(smooth(line, 1.3), (1.3, 1.3, 2.6))
    assert np.allclose(smooth(line[:2], 0.3), (0.3, 0.3, 0.6))


def test_pictures_are_spread_from_the_first_key_to_the_last():
    assert places(5, 3) == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert places(1, 3) == [0.0]
