"""What automatic mode says of the error that is left, from the picture alone."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.auto.estimate import ErrorEstimate
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.output.metric import EPSILON
from pmviewer.render.film import Film
from pmviewer.render.moments import Moments
from pmviewer.settings.access import Settings, with_values


def noted(width: int, height: int) -> Film:
    film = Film(width, height)
    film.moments = Moments(width * height)
    return film


def add(film: Film) -> None:
    """What was added to the sums is a pass."""
    film.moments.add(film.sums, film.channels, 0, len(film.sums))
    film.moments.close_pass()
    film.passes += 1


@pytest.mark.parametrize("passes", [2, 8, 24, 100])
def test_independent_passes_have_the_error_that_they_are_estimated_to_have(cornell, passes):
    """Against made-up noise of known variance on a known picture."""
    rng = np.random.default_rng(passes)
    w = h = 64
    truth = np.full((h * w, 3), 0.7)
    film = noted(w, h)
    error = ErrorEstimate(w, h, Settings(), plan_of(Settings(), cornell.traits))
    for _ in range(passes):
        film.sums[:, 0:3] += 0.25 * truth
        film.sums[:, 12:15] += 0.75 * truth + rng.normal(0, 0.3, truth.shape)
        add(film)
        error.add(film)
    expected = 0.09 / passes / (0.49 + EPSILON)
    assert error.latest is not None
    assert error.latest.low < expected < error.latest.high
    assert error.latest.relmse == pytest.approx(expected, rel=0.45)


@pytest.mark.parametrize("wide", [1, 2, 16])
def test_the_noise_of_a_picture_of_contrasts_is_relative_to_each_pixel(cornell, wide):
    """Stripes of 0.1 and 1, each with noise of a fifth of itself: what is around a pixel is not what it shows."""
    rng = np.random.default_rng(wide)
    w = h = 64
    truth = np.repeat(np.where(np.arange(w) // wide % 2, 1.0, 0.1)[None], h, axis=0).reshape(-1, 1) * np.ones(3)
    film = noted(w, h)
    error = ErrorEstimate(w, h, Settings(), plan_of(Settings(), cornell.traits))
    for _ in range(16):
        film.sums[:, 0:3] += truth * rng.normal(1.0, 0.2, truth.shape)
        add(film)
        error.add(film)
    expected = float((0.04 / 16 * truth**2 / (truth**2 + EPSILON)).mean())
    assert error.latest is not None
    assert error.latest.relmse == pytest.approx(expected, rel=0.3)


def test_one_bright_pixel_does_not_hide_in_its_own_brightness(cornell):
    """A pixel that is a hundred times too bright once is wrong by far more than its own size says."""
    film = noted(32, 32)
    error = ErrorEstimate(32, 32, Settings(), plan_of(Settings(), cornell.traits))
    for i in range(2):
        film.sums[:, 0:3] += 1.0
        if i:
            film.sums[300, 0:3] += 100.0
        add(film)
        error.add(film)
    alone = 50.0**2 / 51.0**2 / 1024
    assert error.latest is not None
    assert error.latest.relmse > 10 * alone


def test_a_bright_path_does_not_hide_in_what_a_filter_makes_of_it(cornell):
    """Its neighbours are as bright by the same path; what is wrong of all nine is relative to what is around them."""
    film = noted(32, 32)
    error = ErrorEstimate(32, 32, Settings(), plan_of(Settings(), cornell.traits), reach=1)
    spread = np.outer([0.25, 0.5, 0.25], [0.25, 0.5, 0.25])
    for i in range(2):
        film.sums[:, 0:3] += 1.0
        if i:
            film.sums.reshape(32, 32, -1)[8:11, 11:14, 0:3] += 100.0 * spread[..., None]
        add(film)
        error.add(film)
    wrong = 50.0 * spread  # of the mean of both
    assert error.latest is not None
    assert error.latest.relmse > 8 * (wrong**2 / (1.0 + wrong) ** 2).sum() / 1024


def test_passes_that_share_one_photon_map_tell_nothing(cornell):
    once = with_values(Settings(), {"photons.renew": "once"})
    assert not ErrorEstimate(8, 8, once, plan_of(once, cornell.traits)).tells


@pytest.fixture(scope="module")
def cornell():
    return open_scene("cornell_diffuse")
