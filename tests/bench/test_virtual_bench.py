"""The bench of virtual lights: its errors are what they are called, and its targets read the right numbers."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.bench.measures import virtual


class Flat(virtual.Lab):
    def __init__(self):
        self.R = np.full((4, 4), 2.0)
        self.effort = virtual.Effort(4, 10, 3, 1, 1)


def test_errors_of_pictures_that_are_a_tenth_too_bright():
    error, percentile, bias = Flat().errors(np.full((3, 4, 4), 2.2))
    assert error == pytest.approx(0.01 / 1.0025)
    assert percentile == pytest.approx(0.1, rel=2e-3)
    assert bias == pytest.approx(10.0)


def test_targets_compare_with_the_plain_sum():
    found = dict.fromkeys(virtual.ESTIMATORS, (0.4, 6.0, 0.2, 0.1))
    found["single step"] = (0.01, 1.0, 0.01, -0.7)
    found["full path"] = (0.1, 1.0, 0.1, 0.2)
    targets = {target.note.partition(";")[0]: target for target in virtual.targets_of(found, "room")}
    assert all("render.filter_radius=0.1" in target.note for target in virtual.targets_of(found, "room"))
    assert targets["room: single step, relMSE at equal number of lights"].value == pytest.approx(0.025)
    assert targets["room: single step, relMSE at equal CPU time"].value == pytest.approx(0.05)
    assert not targets["room: full path, relMSE at equal number of lights"].ok
    assert targets["room: single step, 99.9th percentile of the error"].value == pytest.approx(6.0)
    assert not targets["room: single step, mean of the picture after many passes"].ok
    assert targets["room: full path, mean of the picture after many passes"].ok
