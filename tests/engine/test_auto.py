"""Automatic mode: what it predicts, what it chooses, and what it says of the error that is left."""

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
    PATH,
    PROGRESSIVE,
    THICKER,
    assignments,
    candidates,
    given,
)
from pmviewer.engine.auto.choose import Goal, _adapts, _by_time, _values, choose
from pmviewer.engine.auto.estimate import ErrorEstimate
from pmviewer.engine.auto.measured import Costs, Measured, Numbers, Trial, Widths
from pmviewer.engine.auto.model import PHOTONS, Option, error_after, in_time, samples_for, to_error
from pmviewer.engine.auto.relative import difference, squared, variance
from pmviewer.engine.auto.trial import RARE, trial
from pmviewer.engine.auto.widths import HIDDEN, Tried, told_by
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.maps.radius import progressive_radius
from pmviewer.output.exr import read_exr
from pmviewer.output.metric import EPSILON
from pmviewer.render.film import Film
from pmviewer.render.moments import Moments
from pmviewer.render.planes import beauty_of
from pmviewer.resources import data_folder
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import SETTINGS, Settings, flat, with_values
from pmviewer.state import State

PLAIN = SceneTraits(False, True, False, False, 1)


def test_what_traits_rule_out_is_not_tried():
    def names(traits: SceneTraits, seconds: float = 10.0) -> list[str]:
        return [c.name for c in candidates(traits, Settings(), seconds)[0]]

    assert names(PLAIN) == [PROGRESSIVE.name, GATHER.name, CACHE.name, CACHE_CORNERS.name, PATH.name]
    assert names(PLAIN, 4.0) == [PROGRESSIVE.name, GATHER.name, CACHE.name, PATH.name]
    assert PATH.name not in names(replace(PLAIN, has_specular=True))
    assert PATH.name not in names(replace(PLAIN, has_findable_lights=False))
    assert CACHE.name in names(replace(PLAIN, has_media=True))  # these absorb alone
    for lit in ({"has_scattering": True}, {"media_emit": True}):
        assert not {CACHE.name, CACHE_CORNERS.name} & set(names(replace(PLAIN, has_media=True, **lit)))
    assert names(replace(PLAIN, has_diffuse=False)) == [PROGRESSIVE.name, PATH.name]


def test_large_pictures_are_planned_for_more_than_their_first_passes(cornell, pool):
    """Of 16 megapixels ten seconds are a few passes; with a time that somebody gives they are what they are."""
    large = with_values(Settings(), {"camera.width": 4096, "camera.height": 4096})
    for goal, planned in ((Goal(), math.inf), (Goal(seconds=10.0), 10.0)):
        choice = choose(cornell, large, goal, pool, lambda text, share: None)
        usual = min(m.cost(Numbers(SETTINGS["photons.N"].default)) for m in choice.trial.measured)
        assert 32 * usual > 20.0
        assert choice.seconds + choice.trial.cpu_seconds == pytest.approx(min(planned, 32 * usual))


@pytest.mark.parametrize(("promised", "expected"), [((1.0, 0.95), GATHER), ((1.0, 0.8), CACHE)])
def test_of_gathers_that_promise_about_as_much_the_best_known_is_taken(promised, expected):
    """A tenth more error is nothing beside the bias of records between a trial's few pixels."""
    gather, cache = (
        Measured(way.having(more), Costs(0.1, 0.0), error, gathered=1e-9, radius=0.01)
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
    option = Option(Measured(way, Costs(0.1, 0.0), 1.0, radius=0.01), Numbers(50_000), passes, 1e-3, 10.0)
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
    noise = 0.01 / 20**1.1 + 0.04 / 4 / 20**1.5 + 7.0 / 50_000 / 20
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


def beyond(x: np.ndarray) -> np.ndarray:
    """The part of a disc of radius 1 that lies beyond a straight line at x from its middle."""
    inside = np.clip(x, -1, 1)
    return (np.arccos(inside) - inside * np.sqrt(1 - inside**2)) / np.pi


@pytest.mark.parametrize("seeds", [2, 4])
@pytest.mark.parametrize("kind", ["outline", "open"])
def test_radii_are_told_by_passes_with_others(kind, seeds):
    """Made-up pictures of light that ends at a straight line, blurred by discs, or is wrong by the square of the radius
    everywhere, and noise of photons that is less in wider ones."""
    rng = np.random.default_rng(5)
    across = np.tile(np.arange(-100, 100) + 0.5, (60, 1))[:, :, None].repeat(3, axis=2)
    truth = 0.6 + 0.4 * (across < 0) if kind == "outline" else np.full(across.shape, 0.8)
    camera = [rng.normal(0, 0.01, truth.shape) for _ in range(seeds)]
    photons = [rng.normal(0, 0.01, truth.shape) for _ in range(seeds)]

    def blurred(width: float) -> np.ndarray:
        if kind == "outline":
            return 0.6 + 0.4 * beyond(across / (20 * width))
        return truth + 0.02 * width**2 * np.sin(across / 5)

    def bias2(width: float) -> float:
        return float(((blurred(width) - truth) ** 2 / (truth**2 + EPSILON)).mean())

    def tried(width: float) -> Tried:
        images = [blurred(width) + e + p / width for e, p in zip(camera, photons, strict=True)]
        return Tried(images, 0.1 + 0.01 * width**2)

    mean = np.full(truth.shape, 0.8)
    found = told_by(tried(2.0), tried(1.0), tried(0.5), mean)
    assert found.blur.wider(2.0).bias2 - found.blur.bias2 == pytest.approx(bias2(2.0) - bias2(1.0), rel=0.1)
    assert found.blur.bias2 == pytest.approx(bias2(1.0), rel=0.2)
    assert found.variance == pytest.approx(0.01**2 / (0.64 + EPSILON), rel=0.15)
    assert found.cost == pytest.approx(0.01)


@pytest.mark.parametrize(("noise", "expected"), [(0.02, "little"), (20.0, "hidden")])
def test_a_wide_radius_is_not_free_of_bias_because_noise_hides_it(noise, expected):
    """Pictures of one brightness, blurred by nothing, whose differences are noise: a trial that sees little says that
    as much as is usual may be there, one that sees well says how little there is."""
    rng = np.random.default_rng(7)

    def tried(width: float) -> Tried:
        return Tried([0.8 + rng.normal(0, noise, (40, 40, 3)) for _ in range(2)], 0.1)

    found = told_by(tried(2.0), tried(1.0), tried(0.5), np.full((40, 40, 3), 0.8), HIDDEN)
    if expected == "hidden":
        assert found.blur.wider(2.0).bias2 - found.blur.bias2 > 1.5 * HIDDEN
    else:
        assert found.blur.bias2 < 0.1 * HIDDEN


@pytest.mark.usefixtures("every_path_may_split")
def test_a_trial_sees_bias_that_is_narrower_than_its_pixels_are_apart(pool):
    """Caustics of a ring of metal, thinner than the radius: by a trial of few pixels that are as small as the
    picture's, as it shows in the picture itself against the scene's reference."""
    scene = open_scene("ring_caustic")
    camera = {"camera.width": 128, "camera.height": 128}
    tried = trial(scene, with_values(Settings(), camera), [PROGRESSIVE], pool, (48, 48), 0.0, lambda text, share: None)
    layers, _ = read_exr(data_folder("scenes") / "ring_caustic" / "reference.exr")
    reference = layers[""].astype(float).reshape(128, 2, 128, 2, 3).mean(axis=(1, 3))
    images = []
    for seed in (11, 12):
        renderer = Renderer(scene, with_values(Settings(), camera | {"render.seed": seed}), pool, StageStore(0))
        renderer.step()
        images.append(beauty_of(renderer.film.planes()).astype(float))
    bias2 = squared(images, [reference, reference], reference)
    assert bias2 > 5e-3
    assert tried.measured[0].bias.caustic.bias2 == pytest.approx(bias2, rel=0.4)


def test_a_trial_tells_what_look_ups_at_the_ends_of_gather_rays_lack(pool):
    """Near edges, beside the path tracer, as eight passes of one radius do: as much, or with the thick discs and second
    gathers of automatic mode, which leave little of it, a third to the whole. Second gathers farther out are an option
    then, with less bias and dearer passes."""
    scene = open_scene("cornell_diffuse")
    base = with_values(Settings(), {"camera.width": 64, "camera.height": 64, "photons.N": 50_000})

    def mean_of(passes, **values):
        renderer = Renderer(scene, with_values(base, values), pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
        return beauty_of(renderer.film.planes()).astype(float)

    gather = GATHER.having(THICKER | CORNERS)
    for way, least, most in ((GATHER, 0.6, 1.4), (gather, 0.25, 1.4)):
        tried = trial(scene, base, [way], pool, (64, 64), 0.0, lambda text, share: None)
        paths = [mean_of(64, **{"render.method": "path", "render.seed": seed}) for seed in (5, 6)]
        lacking = [mean_of(8, **way.values, **{"estimate.alpha": 1.0, "render.seed": seed}) for seed in (7, 8)]
        true = squared(lacking, paths, np.mean(paths, axis=0), 4)
        told = tried.measured[0].bias.gathered.bias2
        print(f"{way.values}: {told:.3g} told, {true:.3g} true")
        assert least * true < told < most * true
    usual, farther = tried.measured
    assert farther.candidate.values["gather.secondary"] > gather.values["gather.secondary"]
    assert farther.bias.gathered.bias2 < told
    assert farther.cost(Numbers(50_000)) > usual.cost(Numbers(50_000))


@pytest.mark.usefixtures("every_path_may_split")
def test_a_trial_of_few_pixels_has_the_records_of_the_whole_picture(pool):
    """Noise of a pass with the irradiance cache, by the trial and by four passes of the picture itself."""
    scene, N = open_scene("cornell_diffuse"), 20_000
    settings = with_values(Settings(), {"camera.width": 128, "camera.height": 128, "photons.N": N})
    tried = trial(scene, settings, [GATHER, CACHE], pool, (32, 32), 0.0, lambda text, share: None)
    cached = next(m for m in tried.measured if m.candidate is CACHE)
    images = []
    for seed in range(4):
        renderer = Renderer(scene, with_values(settings, {**CACHE.values, "render.seed": seed}), pool, StageStore(0))
        renderer.step()
        images.append(beauty_of(renderer.film.planes()).astype(float))
    noise = (np.var(images, axis=0, ddof=1) / (np.mean(images, axis=0) ** 2 + EPSILON)).mean()
    assert 0.6 < (cached.eye + cached.gathered / RARE / N) / noise < 1.7


def test_a_trial_tells_what_light_samples_do(pool):
    """Noise of passes with few photons, and what of it is left with four times the light samples: by the trial and by
    pictures. Four lights in a box, where a third of it goes, and one."""
    for name, least in (("cornell_lights", 0.3), ("cornell_diffuse", 0.0)):
        scene = open_scene(name)
        settings = with_values(Settings(), {"camera.width": 96, "camera.height": 96, "photons.N": 40_000})
        tried = trial(scene, settings, [PROGRESSIVE], pool, (48, 48), 100.0, lambda text, share: None)
        usual = plan_of(settings, scene.traits).light_samples
        noise = []
        for samples in (usual, 4 * usual):
            images = []
            for seed in range(4):
                values = {"direct.samples": samples, "photons.N": 10_000, "render.seed": seed}
                renderer = Renderer(scene, with_values(settings, values), pool, StageStore(0))
                renderer.step()
                images.append(beauty_of(renderer.film.planes()).astype(float))
            noise.append(variance(images, np.mean(images, axis=0)))
        told = 0.75 * tried.measured[0].direct
        print(f"{name}: noise {noise[0]:.4f}, {noise[1]:.4f} with four times the samples; the trial: {told:.4f} less")
        assert told == pytest.approx(noise[0] - noise[1], rel=0.35)
        assert told > least * noise[0]
        assert tried.measured[0].costs.sampled > 0


@pytest.mark.parametrize("seeds", [2, 4, 6])
def test_a_difference_knows_its_noise(seeds):
    """Of made-up pictures that differ by a third of their noise: 400 times, with seeds of their own."""
    rng = np.random.default_rng(seeds)
    true, found = 0.04, []
    for _ in range(400):
        images = list(rng.normal(1 + true, 3 * true, (seeds, 16, 16, 3)))
        found.append(difference(images, [np.ones((16, 16, 3))] * seeds, np.ones((16, 16, 3))))
    values, errors = np.array(found).T
    assert values.mean() == pytest.approx(true**2 / (1 + EPSILON), abs=3 * values.std() / 20)
    assert 0.9 < math.sqrt((errors**2).mean()) / values.std() < 1.35


def test_a_trial_takes_more_seeds_where_time_is_left(pool):
    scene = open_scene("cornell_diffuse")
    settings = with_values(Settings(), {"camera.width": 32, "camera.height": 32, "photons.N": 2000})
    short, long = (
        trial(scene, settings, [PROGRESSIVE], pool, (16, 16), seconds, lambda text, share: None)
        for seconds in (0.0, 100.0)
    )
    assert (short.seeds, long.seeds) == (2, 6)


def test_radii_are_settings():
    """Each width scales its own look-ups alone."""
    settings = Settings()
    assert Widths().values(settings, 0.02) == {}
    assert Widths(2.0, 2.0).values(settings, 0.02) == {"estimate.radius": 0.04}
    assert Widths(caustic=0.5).values(settings, 0.02) == {"estimate.caustic_radius": 0.25}
    assert Widths(shown=2.0).values(settings, 0.02) == {"estimate.radius": 0.04, "estimate.caustic_radius": 0.25}


def test_without_time_for_a_trial_traits_choose(cornell):
    pool = WorkPool(1)
    try:
        choice = choose(cornell, Settings(), Goal(seconds=0.01), pool, lambda text, share: None)
    finally:
        pool.close()
    assert choice.changed == {**CACHE.values, **THICKER}
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
    assert choice.changed == {**CACHE.values, **THICKER}
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
