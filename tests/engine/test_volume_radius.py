"""How far look-ups in media reach."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.engine.radius import free_paths, volume_radius
from pmviewer.scene.grid import Grid
from pmviewer.scene.medium import Medium
from pmviewer.settings.access import Estimate

FOG = Medium("fog", (0.1, 0.2, 0.1), (0.9,) * 3)
MARBLE = Medium("marble", (50.0,) * 3, (0.99,) * 3)
INK = Medium("ink", (0.01,) * 3, (0.0,) * 3)


@pytest.mark.parametrize(
    ("media", "expected"),
    [
        ([FOG], 0.3),  # its free path is 5: the radius of surfaces
        ([MARBLE], 0.5 / 50),
        ([MARBLE, INK], 0.5 / 50),  # which scatters nothing and is not looked up
        ([MARBLE, FOG], 0.3),  # of the two; in each it is its own
        ([], 0.3),
    ],
)
def test_half_a_free_path_at_most(media, expected):
    assert volume_radius(0.3, 0, Estimate(), media) == pytest.approx(expected)


def test_it_shrinks_with_the_passes():
    """r²ᵢ₊₁/r²ᵢ = (i + α)/(i + 1) (Knaus and Zwicker 2011)."""
    estimate = Estimate(alpha=0.5, free_paths=0.25)
    expected = 0.25 * math.sqrt((1 + 0.5) / 2 * (2 + 0.5) / 3)
    assert free_paths(2, estimate) == pytest.approx(expected)
    assert volume_radius(0.3, 2, estimate, [MARBLE]) == pytest.approx(expected / 50)


def test_lattices_have_no_free_path_of_their_own():
    smoke = Medium("smoke", (3.0, 5.0, 1.0), (0.5,) * 3, density=Grid(np.ones((2, 2, 2, 1), np.float32)))
    assert volume_radius(0.3, 0, Estimate(), [smoke, MARBLE]) == pytest.approx(0.3)
    assert Medium("nothing", (0.0,) * 3).free_path == math.inf
