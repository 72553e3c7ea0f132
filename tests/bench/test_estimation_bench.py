"""CPU time to a difference, from what was measured at some passes."""

import pytest

from pmviewer.bench.measures.estimation import Point, time_to


def test_time_to_a_difference_is_between_the_points_or_carried_on():
    points = [Point(1, 1.0, 8.0, 4.0), Point(4, 4.0, 4.0, 1.0)]
    assert time_to(points, 4.0) == (pytest.approx(4.0), True)
    assert time_to(points, 2.0, by_blocks=True) == (pytest.approx(2.0), True)
    assert time_to(points, 1.0) == (pytest.approx(64.0), False), "noise falls with the root of the time"
    assert time_to(points, 9.0) == (1.0, True)


def test_a_difference_below_the_noise_of_the_references_is_no_error():
    points = [Point(1, 1.0, 8.0, 4.0), Point(4, 4.0, 0.0, 0.0)]
    seconds, measured = time_to(points, 2.0, by_blocks=True)
    assert measured
    assert 1.0 < seconds < 2.0
