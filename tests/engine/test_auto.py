"""Automatic mode: what it predicts, what it chooses, and what it says of the error that is left."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.auto.candidates import CACHE, GATHER, PATH, PROGRESSIVE, assignments, candidates, given
from pmviewer.engine.auto.choose import Goal, choose
from pmviewer.engine.auto.estimate import ErrorEstimate
from pmviewer.engine.auto.model import error_after, seconds_to
from pmviewer.engine.auto.trial import Costs, Measured
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import EPSILON
from pmviewer.render.film import Film
from pmviewer.render.moments import Moments
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import SETTINGS, Settings, flat, with_values

PLAIN = SceneTraits(False, True, False, False, 1)


def test_what_traits_rule_out_is_not_tried():
    def names(traits: SceneTraits) -> list[str]:
        return [c.name for c in candidates(traits, 0.2, 10.0)[0]]

    assert names(PLAIN) == [PROGRESSIVE.name, GATHER.name, CACHE.name, PATH.name]
    assert PATH.name not in names(replace(PLAIN, has_specular=True))
    assert PATH.name not in names(replace(PLAIN, has_findable_lights=False))
    assert CACHE.name not in names(replace(PLAIN, has_media=True))
    assert names(replace(PLAIN, has_diffuse=False)) == [PROGRESSIVE.name, PATH.name]


def test_a_user_s_own_settings_of_the_method_are_told():
    assert given(Settings()) == []
    assert given(with_values(Settings(), {"camera.width": 32, "render.seed": 5})) == []
    assert given(with_values(Settings(), {"photons.N": 7, "gather.cache": "on"})) == ["photons.N", "gather.cache"]


def test_what_the_model_promises_is_what_sums_over_passes_say():
    """Against sums written out by Knaus and Zwicker's recurrence."""
    m = Measured(PROGRESSIVE, Costs(0.1, 1e-6, 0.0), eye=0.02, photons=300.0, bias2=1e-4, radius=0.01, blurs=True)
    area, areas = 1.0, []
    for i in range(1, 21):
        areas.append(area)
        area *= (i + 2 / 3) / (i + 1)
    noise = 0.02 / 20**1.25 + 300.0 / 50_000 / 4 * sum(1 / a for a in areas) / 400
    bias = 1e-4 * 2**3 * (sum(a**0.75 for a in areas) / 20) ** 2
    assert error_after(m, 50_000, 2.0, 20) == pytest.approx(noise + bias, rel=1e-6)
    assert seconds_to(m, 50_000, 2.0, noise + bias) == pytest.approx(20 * 0.15, rel=1e-3)


def test_without_time_for_a_trial_traits_choose(cornell):
    pool = WorkPool(1)
    try:
        choice = choose(cornell, Settings(), Goal(seconds=0.01), pool, lambda text, share: None)
    finally:
        pool.close()
    assert choice.changed == {"render.method": "gather", "gather.cache": "on"}
    assert math.isnan(choice.expected)
    assert "too few" in choice.sentences[0]


@pytest.mark.usefixtures("every_path_may_split")
def test_a_trial_picks_settings_that_alone_give_the_same_picture(cornell):
    """What it chose stands in plain settings; of what it doesn't set nothing is changed, and the same trial picks the
    same method again."""
    small = with_values(Settings(), {"camera.width": 24, "camera.height": 24, "render.seed": 3})
    pool = WorkPool(2)
    try:
        found = [choose(cornell, small, Goal(seconds=6.0), pool, lambda text, share: None) for _ in range(2)]
        chosen = with_values(small, dict(found[0].values))
        pictures = []
        for settings in (chosen, with_values(small, found[0].changed)):
            renderer = Renderer(cornell, settings, pool, StageStore(0))
            renderer.step()
            pictures.append(renderer.film.sums.copy())
            assert renderer.error.bias in [choice.bias for choice in found]  # both trials may have picked the same
            assert renderer.error.bias is not None
        other = with_values(chosen, {"estimate.k": 51})
        assert Renderer(cornell, other, pool, StageStore(0)).error.bias is None
    finally:
        pool.close()
    assert np.array_equal(pictures[0], pictures[1])
    assert found[0].trial.measured
    assert all(m.eye > 0 and m.costs.base > 0 for m in found[0].trial.measured)
    before, after = flat(small), flat(chosen)
    assert {path for path in SETTINGS if before[path] != after[path]} <= set(assignments({}))
    assert found[0].expected < 0.05
    assert found[0].name in found[0].sentences[0]


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


def test_passes_that_share_one_photon_map_tell_nothing(cornell):
    once = with_values(Settings(), {"photons.renew": "once"})
    assert not ErrorEstimate(8, 8, once, plan_of(once, cornell.traits)).tells


@pytest.fixture(scope="module")
def cornell():
    return open_scene("cornell_diffuse")
