"""Automatic mode: what it predicts, and what it chooses."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.auto.bias import Bias, Blur, mean_over
from pmviewer.engine.auto.candidates import (
    CACHE,
    CACHE_CORNERS,
    CORNERS,
    GATHER,
    LIGHTS_CAUSTICS,
    ONE_RADIUS_NAME,
    PATH,
    PROGRESSIVE,
    SHOWN,
    Candidate,
    candidates,
)
from pmviewer.engine.auto.choose import FEWER_PHOTONS, Goal, _adapts, _by_time, _picked, _values, choose
from pmviewer.engine.auto.estimate import ErrorEstimate
from pmviewer.engine.auto.measured import Costs, Measured, Numbers, Trial, Widths
from pmviewer.engine.auto.model import PHOTONS, Option, error_after, in_time, samples_for, to_error
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.radius import FirstRadii
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.maps.radius import progressive_radius
from pmviewer.scene.analysis import SceneTraits
from pmviewer.scene.description import Shape, Sphere
from pmviewer.settings.access import SETTINGS, Settings, flat, with_values
from pmviewer.settings.presets import assignments, given
from pmviewer.state import State
from tests.photons.test_cones import stage
from tests.support.scenes import MIRROR, diffuse

RADII = FirstRadii(0.02, 0.02, 0.01)

PLAIN = SceneTraits(False, True, False, False, 1)


def test_what_traits_rule_out_is_not_tried():
    def names(traits: SceneTraits) -> list[str]:
        return [c.name for c in candidates(traits, Settings(), 10.0)[0]]

    assert names(PLAIN) == [PROGRESSIVE.name, GATHER.name, CACHE_CORNERS.name, PATH.name]
    assert PATH.name not in names(replace(PLAIN, has_specular=True))
    assert PATH.name not in names(replace(PLAIN, has_findable_lights=False))
    assert CACHE_CORNERS.name in names(replace(PLAIN, has_media=True))  # these absorb alone
    for lit in ({"has_scattering": True}, {"media_emit": True}):
        assert CACHE_CORNERS.name not in names(replace(PLAIN, has_media=True, **lit))
    assert names(replace(PLAIN, has_diffuse=False)) == [PROGRESSIVE.name, PATH.name]


def test_gathers_look_up_the_nearest_photons_where_photons_aim():
    """Progressive as well, which comes first as the default, and beside it with one radius."""
    found = candidates(PLAIN, Settings(), 10.0, aims=True)[0]
    assert [c.name for c in found] == [PROGRESSIVE.name, ONE_RADIUS_NAME, GATHER.name, CACHE_CORNERS.name, PATH.name]
    assert [c.name for c in found if not c.by_nearest] == [ONE_RADIUS_NAME, PATH.name]
    assert all(any("estimate.lookup" in said for said in c.said) for c in found if c.by_nearest)
    assert not any(c.by_nearest for c in candidates(PLAIN, Settings(), 10.0)[0])


@pytest.mark.extensive
def test_one_radius_does_not_suit_a_wide_stage(pool):
    """A ball and a mirror under a dome that reflects half, on a floor whose photons lie far apart: what is chosen has a
    tenth of the noise of indirect light that it has with one radius."""
    scene = stage("dome", more=(Shape("mirror", Sphere((3.6, 0.4, 2.5), 0.4), 2),), size=48)
    opened = open_scene(replace(scene, materials=(scene.materials[0], diffuse("dome"), MIRROR)))
    chosen = choose(opened, Settings(), Goal(seconds=8.0), pool, lambda text, share: None)
    assert chosen.trial.measured
    assert chosen.values["estimate.lookup"] == "nearest", chosen.sentences
    noise = []
    for lookup in ("nearest", "radius"):
        pictures = []
        for seed in (1, 2):
            values = {**chosen.values, "estimate.lookup": lookup, "render.seed": seed}
            renderer = Renderer(opened, with_values(Settings(), values), pool, StageStore(1 << 28))
            renderer.step()
            pictures.append(renderer.frame(0).image("indirect").astype(float))
        noise.append(((pictures[0] - pictures[1]) ** 2).mean() / 2)
    print(f"{chosen.name}: noise of a pass {noise[0]:.3g}, by one radius {noise[1]:.3g}")
    assert noise[0] < 0.1 * noise[1]


@pytest.mark.parametrize(("less", "chosen"), [(0.8, 150_000), (0.75, 50_000)])
def test_fewer_photons_than_usual_are_chosen_for_a_time_where_they_promise_a_fifth_less(less, chosen):
    """A trial meets few bright ones: what it says of fewer photons is too good rather than too bad. Of more of them it
    believes a tenth; where an error is asked for, of fewer too, as a picture that isn't there takes longer."""
    measured = Measured(CACHE, Costs(0.1, 0.0), 1.0, first=RADII)

    def option(N: int, error: float) -> Option:
        return Option(measured, Numbers(N), 20.0, error, 10.0)

    def picked(*found: Option, fewer: float = FEWER_PHOTONS) -> int:
        return _picked(list(found), lambda o: o.error, fewer).numbers.N

    usual = option(150_000, 1e-3)
    assert picked(usual, option(50_000, less * 1e-3)) == chosen
    assert picked(usual, option(50_000, 0.8e-3), fewer=1.0) == 50_000
    assert picked(usual, option(300_000, 0.9e-3)) == 300_000


@pytest.mark.parametrize(("less", "chosen"), [(0.85, CACHE_CORNERS), (0.7, CACHE)])
def test_ways_without_second_gathers_have_to_promise_a_fifth_less(less, chosen):
    """What they lack near edges, or find behind thin walls, a trial may overlook."""

    def option(way: Candidate, error: float) -> Option:
        return Option(Measured(way, Costs(0.1, 0.0), 1.0, first=RADII), Numbers(300_000), 20.0, error, 10.0)

    picked = _picked([option(CACHE, less * 1e-3), option(CACHE_CORNERS, 1e-3)], lambda o: o.error)
    assert picked.measured.candidate == chosen


@pytest.mark.parametrize(("less", "chosen"), [(0.85, CACHE_CORNERS), (0.65, PROGRESSIVE)])
def test_photons_shown_directly_have_to_promise_less_than_a_gather_for_a_time(less, chosen):
    """A trial thinks too well of them: where they promised as much as a gather, they never had it."""

    def option(way: Candidate, error: float) -> Option:
        return Option(Measured(way, Costs(0.1, 0.0), 1.0, first=RADII), Numbers(300_000), 20.0, error, 10.0)

    found = [option(PROGRESSIVE, less * 1e-3), option(CACHE_CORNERS, 1e-3)]
    assert _picked(found, lambda o: o.error, shown=SHOWN).measured.candidate == chosen
    assert _picked(found, lambda o: o.error).measured.candidate == PROGRESSIVE


def test_large_pictures_are_planned_for_more_than_their_first_passes(cornell, pool):
    """Of 16 megapixels ten seconds are a few passes; with a time that somebody gives they are what they are."""
    large = with_values(Settings(), {"camera.width": 4096, "camera.height": 4096})
    for goal, planned in ((Goal(), math.inf), (Goal(seconds=10.0), 10.0)):
        choice = choose(cornell, large, goal, pool, lambda text, share: None)
        usual = min(m.cost(Numbers(SETTINGS["photons.N"].default)) for m in choice.trial.measured)
        assert 32 * usual > 20.0
        assert choice.seconds + choice.trial.cpu_seconds == pytest.approx(min(planned, 32 * usual))


@pytest.mark.parametrize(("promised", "expected"), [((1.0, 0.8), GATHER), ((1.0, 0.7), CACHE)])
def test_of_gathers_that_promise_about_as_much_the_best_known_is_taken(promised, expected):
    """A quarter more error is nothing beside the bias of records between a trial's few pixels, and of look-ups near
    edges."""
    gather, cache = (
        Measured(way.having(more), Costs(0.1, 0.0), error, gathered=1e-9, first=RADII)
        for way, more, error in zip((GATHER, CACHE), (CORNERS, {}), promised, strict=True)
    )
    assert _by_time(Trial([gather, cache]), 10.0).name == expected.name


@pytest.mark.parametrize(
    ("way", "passes", "goal", "adapted"),
    [
        (GATHER, 32, Goal(10.0), True),
        (GATHER, 31, Goal(10.0), False),
        (GATHER, 31, Goal(), True),
        (GATHER, 99, Goal(error=1e-3), True),
        (GATHER, 99, Goal(apart=True), False),
        (PATH, 99, Goal(), False),
    ],
)
def test_samples_are_adapted_where_there_are_passes_enough(cornell, way, passes, goal, adapted):
    """Those before it is decided are less than a quarter then; whoever gives no goal looks on for longer. On a cluster
    passes do not know of one another."""
    option = Option(Measured(way, Costs(0.1, 0.0), 1.0, first=RADII), Numbers(50_000), passes, 1e-3, 10.0)
    values = _values(option, Settings(), cornell, _adapts(option, goal))
    assert (values.get("render.adaptive") == "on") == adapted


def test_ways_that_learn_from_passes_are_not_tried_on_a_cluster():
    many = replace(PLAIN, n_lights=100)
    found = [candidates(many, Settings(), 1000.0, apart) for apart in (False, True)]
    assert [any("guided" in way.name for way in ways) for ways, _ in found] == [True, False]
    assert "elsewhere" in dict(found[1][1])["importance"]


def test_caustics_are_those_of_lights_unless_that_would_miss_light():
    """Gather rays go straight through panes that reflect, and would miss what these do with light from diffuse
    surfaces; in media they find it badly."""

    def caustics(traits: SceneTraits, glass: str = "exact") -> list[dict[str, object]]:
        found, _ = candidates(traits, with_values(Settings(), {"render.thin_glass": glass}), 10.0)
        chosen = [c for c in found if c.name in (PROGRESSIVE.name, GATHER.name)]
        return [{path: c.values[path] for path in LIGHTS_CAUSTICS if path in c.values} for c in chosen]

    mirrors = replace(PLAIN, has_specular=True)
    assert caustics(PLAIN) == [{}, {}]
    assert caustics(mirrors) == [LIGHTS_CAUSTICS, LIGHTS_CAUSTICS]
    assert caustics(replace(mirrors, has_media=True)) == [LIGHTS_CAUSTICS, LIGHTS_CAUSTICS]
    assert caustics(replace(mirrors, has_media=True, has_scattering=True)) == [LIGHTS_CAUSTICS, {}]
    panes = replace(mirrors, thin_glass=("by setting",))
    assert caustics(panes, "tinted and reflecting") == [{}, {}]
    assert caustics(panes, "tinted") == caustics(mirrors)


def test_a_user_s_own_settings_of_the_method_are_told():
    assert given(Settings()) == []
    assert given(with_values(Settings(), {"camera.width": 32, "render.seed": 5})) == []
    assert given(with_values(Settings(), {"photons.N": 7, "gather.cache": "on"})) == ["photons.N", "gather.cache"]
    told = ("render.method", "render.seed")  # a default that is given is a choice
    assert given(Settings(), told) == ["render.method"]


@pytest.mark.parametrize("steady", [False, True])
def test_what_the_model_promises_is_what_sums_over_passes_say(steady):
    """Against sums written out by Knaus and Zwicker's recurrence, from its start or from the 80th pass on, four times
    as many as are planned for."""
    costs, widths = Costs(0.1, 1e-6, shown=2e-6), Widths(caustic=0.5, shown=2.0)
    bias = Bias(Blur(3e-4, 1.0), Blur(1e-4, 1.5))
    m = Measured(PROGRESSIVE, costs, eye=0.02, caustic=50.0, shown=300.0, gathered=7.0, bias=bias)
    area, areas = 1.0, []
    for i in range(1, 21):
        areas.append(area)
        late = 80 * steady + i
        area *= (late + 2 / 3) / (late + 1)
    looked_up = (300.0 / 4 + 50.0 * 4) * sum(1 / a for a in areas) / 20
    noise = 0.02 / 20**1.1 + (looked_up + 7.0) / 50_000 / 20
    blurred = 1e-4 * 2**3 * (sum(a**0.75 for a in areas) / 20) ** 2
    blurred += 3e-4 / 4 * (sum(a**0.5 for a in areas) / 20) ** 2
    numbers = Numbers(50_000, widths)
    assert error_after(m, numbers, 20, steady) == pytest.approx(noise + blurred, rel=2e-3 if steady else 1e-6)
    seconds = 20 * (0.1 + 50_000 * (1e-6 + 4 * 2e-6))
    if steady:
        in_all = in_time(m, numbers, seconds)
        assert (in_all.error, in_all.delay) == (pytest.approx(noise + blurred, rel=5e-3), 80)
    else:
        reached = to_error(m, numbers, noise + blurred)
        assert (reached.seconds, reached.delay) == (pytest.approx(seconds, rel=1e-3), 0)


def test_light_samples_divide_their_part_of_the_noise_and_cost_what_they_cost():
    """In all passes alike; and the number that suits follows from both."""
    costs = Costs(0.1, 1e-6, sampled=0.02)
    m = Measured(PROGRESSIVE, costs, eye=0.05, gathered=7.0, direct=0.04, complement=1.5)
    noise = 0.01 / 20**1.1 + 0.04 / (4 * 20) ** 1.5 + 7.0 / 50_000 / 20
    assert error_after(m, Numbers(50_000, samples=4), 20) == pytest.approx(noise, rel=1e-6)
    assert m.cost(Numbers(50_000, samples=4)) == pytest.approx(0.1 + 3 * 0.02 + 0.05)

    def best(m: Measured, seconds: float) -> int:
        return samples_for(m, lambda numbers: in_time(m, numbers, seconds).error)

    free, dear = (replace(m, costs=replace(costs, sampled=sampled)) for sampled in (0.0, 1.0))
    assert best(replace(m, direct=0.0), 1.0) == best(dear, 1.0) == 1
    assert best(free, 1.0) == 8
    assert 1 < best(m, 1.0) < 8
    assert best(m, 1.0) > best(m, 100.0) == 1  # photons make the noise of many passes


def test_a_radius_that_may_never_get_there_is_expected_to_take_longer():
    """Of two radii of the same promise, the one whose bias alone comes near the error."""
    blur = Bias(caustic=Blur(8e-3, 0.65))
    m = Measured(PROGRESSIVE, Costs(0.05, 1e-6), eye=0.01, caustic=300.0, bias=blur)
    every = [to_error(m, Numbers(200_000, Widths(caustic=width)), 5e-3) for width in (0.7, 0.35)]
    assert every[0].seconds < 2 * every[1].seconds
    wide, narrow = (option.expected / option.seconds for option in every)
    assert narrow < 1.1 < 1.4 < wide


def test_a_bias_is_known_where_a_rendering_goes_on(cornell):
    """Through the text of a checkpoint."""
    error = ErrorEstimate(8, 8, Settings(), plan_of(Settings(), cornell.traits))
    error.bias = Bias(Blur(1e-3, 0.8), Blur(2e-4), 3e-5)
    state = error.state()
    other = ErrorEstimate(8, 8, Settings(), plan_of(Settings(), cornell.traits))
    other.restore(State(json.loads(json.dumps(state.numbers)), state.arrays))
    assert other.bias == error.bias
    assert other.bias(16) < error.bias(1) == pytest.approx(1.23e-3)


@pytest.mark.parametrize("delay", [0, 50, 20_000])
def test_far_beyond_the_passes_that_are_summed_up_means_follow_their_power_law(delay):
    whole = [progressive_radius(1.0, i, delay=delay) ** -2 for i in range(1, 30_001)]
    assert mean_over(30_000, -2.0, delay) == pytest.approx(sum(whole) / 30_000, rel=1e-3)
    assert mean_over(np.array([1.0, 30_000]), -2.0)[0] == 1.0


def test_radii_are_settings():
    """Each width scales its own look-ups alone."""
    settings = Settings()
    assert Widths().values(settings, RADII) == {}
    both = {"estimate.radius": 0.04, "estimate.caustic_radius": 0.5}
    assert Widths(2.0, 2.0).values(settings, RADII) == both
    assert Widths(caustic=0.5).values(settings, RADII) == {"estimate.caustic_radius": 0.25}
    assert Widths(shown=2.0).values(settings, RADII) == both | {"estimate.caustic_radius": 0.25}
    sparse = FirstRadii(0.02, 0.08, 0.04)
    assert Widths(caustic=0.5).values(settings, sparse) == {"estimate.caustic_radius": 1.0}
    media = {"estimate.volume_radius": 0.25}
    assert Widths(shown=0.5).values(settings, sparse) == media | {
        "estimate.radius": 0.04,
        "estimate.caustic_radius": 1.0,
    }


def test_without_time_for_a_trial_traits_choose(cornell):
    pool = WorkPool(1)
    try:
        choice = choose(cornell, Settings(), Goal(seconds=0.01), pool, lambda text, share: None)
    finally:
        pool.close()
    assert choice.changed == dict(CACHE_CORNERS.values)
    assert math.isnan(choice.expected)
    assert "too few" in choice.sentences[0]


def test_a_trial_that_takes_far_too_long_is_given_up(cornell, monkeypatch):
    """After three pictures, and what they took counts."""
    monkeypatch.setattr("pmviewer.engine.auto.choose.MOST_SHARE", 1e-5)
    small, pool = with_values(Settings(), {"camera.width": 16, "camera.height": 16}), WorkPool(1)
    try:
        choice = choose(cornell, small, Goal(seconds=4.0), pool, lambda text, share: None)
        spent = pool.cpu_seconds
    finally:
        pool.close()
    assert choice.changed == dict(CACHE_CORNERS.values)
    assert math.isnan(choice.expected)
    assert "a trial would take" in choice.sentences[0]
    assert not choice.trial.measured
    assert 0 < choice.trial.cpu_seconds <= spent


def test_a_trial_that_took_all_the_time_leaves_settings_that_can_be(cornell, monkeypatch):
    """Negative time would choose the dearest pass, and a delay below 0."""
    dear = Measured(GATHER, Costs(1.0, 1e-6), 0.04, gathered=100.0)
    took = Trial([replace(dear, candidate=PROGRESSIVE, costs=Costs(0.7, 6e-7)), dear], 5.0, 5.0, 1936, 2)
    monkeypatch.setattr("pmviewer.engine.auto.choose.trial", lambda *arguments: took)
    pool = WorkPool(1)
    try:
        choice = choose(cornell, Settings(), Goal(seconds=4.0), pool, lambda text, share: None)
    finally:
        pool.close()
    assert choice.values["estimate.delay"] >= 0
    assert choice.values["photons.N"] == min(PHOTONS)
    assert choice.seconds > 0


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
    for choice in found:  # for a time radii wait, where there are any, and the log says so
        waits = choice.values["render.method"] != "path"
        assert (choice.values["estimate.delay"] >= 4) == waits
        assert any("estimate.delay" in sentence for sentence in choice.sentences) == waits


@pytest.fixture(scope="module")
def cornell():
    return open_scene("cornell_diffuse")
