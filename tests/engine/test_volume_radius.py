"""How far look-ups in media reach."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.radius import FREE_PATHS, NO_RADII, FirstRadii, free_paths, mean_radii, volume_radius
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.first_photons import TRACED
from pmviewer.engine.stages.free_paths import MOST_PATHS, paths_for
from pmviewer.engine.store import StageStore
from pmviewer.scene.grid import Grid
from pmviewer.scene.medium import Medium
from pmviewer.settings.access import SETTINGS, Estimate
from tests.render.test_media import SKY, cube_of
from tests.support.scenes import settings_of

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
    assert volume_radius(0.3, free_paths(NO_RADII, 0, Estimate()), Estimate(), media) == pytest.approx(expected)


def test_it_shrinks_with_the_passes():
    """r²ᵢ₊₁/r²ᵢ = (i + α)/(i + 1) (Knaus and Zwicker 2011)."""
    estimate = Estimate(alpha=0.5, free_paths=0.25)
    expected = 0.25 * math.sqrt((1 + 0.5) / 2 * (2 + 0.5) / 3)
    paths = free_paths(FirstRadii(1.0, 1.0, 1.0, 2.0), 2, estimate)
    assert paths == pytest.approx(expected)
    assert volume_radius(0.3, paths, estimate, [MARBLE]) == pytest.approx(expected / 50)
    measured = free_paths(FirstRadii(1.0, 1.0, 1.0, 2.0), 2, Estimate(alpha=0.5))
    assert measured == pytest.approx(8 * expected)


@pytest.mark.parametrize(
    ("per_cube", "expected"),  # photons of a pass in a cube of a free path, and 32/(π n) free paths squared
    [(0.0, 2.0), (0.5, 2.0), (10.0, math.sqrt(32 / (math.pi * 10))), (1000.0, 0.5)],
)
def test_few_photons_in_dense_media_have_wider_beams(per_cube, expected):
    """By a beam as long as a free path, whose radius holds 32 photons, in steps of 2^¼."""
    path, side, rng = 0.02, 0.4, np.random.default_rng(3)
    n = int(per_cube * (side / path) ** 3 * TRACED / SETTINGS["photons.N"].default)
    photons = rng.uniform(0.3, 0.3 + side, (n, 6)).astype(np.float32)
    assert paths_for(photons, path) == pytest.approx(expected, rel=0.12)


def test_a_walk_through_lattices_and_marching_have_half_a_free_path(pool):
    milk = Medium("milk", (30.0,) * 3, (0.9,) * 3)
    wax = Medium("wax", (100.0,) * 3, (0.9,) * 3)
    smoke = Medium("smoke", (30.0,) * 3, (0.9,) * 3, density=Grid(np.ones((2, 2, 2, 1), np.float32)))
    few = {"photons": {"N": 2000}}
    for medium, values, expected in (
        (wax, {}, MOST_PATHS),
        (smoke, {}, FREE_PATHS),
        (milk, {"estimate": {"in_media": "point"}}, FREE_PATHS),
        (milk, {"estimate": {"free_paths": 0.25}}, 0.0),
    ):
        made = Renderer(open_scene(cube_of(medium, SKY)), settings_of(**few, **values), pool, StageStore(0))
        assert made.settled_radii.free_paths == expected


def test_films_have_one_number_for_all_pictures():
    radii = [FirstRadii(1.0, 2.0, 1.0, 0.5), FirstRadii(4.0, 2.0, 1.0, 2.0)]
    assert mean_radii(radii) == FirstRadii(2.0, 2.0, 1.0, 1.0)
    assert mean_radii([FirstRadii(1.0, 2.0, 1.0)] * 2).free_paths == 0


def test_lattices_have_no_free_path_of_their_own():
    smoke = Medium("smoke", (3.0, 5.0, 1.0), (0.5,) * 3, density=Grid(np.ones((2, 2, 2, 1), np.float32)))
    assert volume_radius(0.3, 0.5, Estimate(), [smoke, MARBLE]) == pytest.approx(0.3)
    assert Medium("nothing", (0.0,) * 3).free_path == math.inf
