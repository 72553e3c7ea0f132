"""What a trial measures: bias of radii and of gather rays, noise, what light samples do."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.auto.bias import Bias, Blur
from pmviewer.engine.auto.candidates import (
    CACHE,
    CORNERS,
    GATHER,
    PROGRESSIVE,
    THICKER,
)
from pmviewer.engine.auto.measured import Numbers
from pmviewer.engine.auto.relative import difference, nested, shown_squared, squared, variance
from pmviewer.engine.auto.runs import Trier
from pmviewer.engine.auto.trial import RARE, _farther, trial
from pmviewer.engine.auto.widths import HIDDEN, Tried, told_by
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.exr import read_exr
from pmviewer.output.metric import EPSILON
from pmviewer.render.planes import PLANES, beauty_of
from pmviewer.resources import data_folder
from pmviewer.settings.access import Settings, with_values


def beyond(x: np.ndarray) -> np.ndarray:
    """The part of a disc of radius 1 that lies beyond a straight line at x from its middle."""
    inside = np.clip(x, -1, 1)
    return (np.arccos(inside) - inside * np.sqrt(1 - inside**2)) / np.pi


@pytest.mark.parametrize("seeds", [2, 4])
@pytest.mark.parametrize("kind", ["outline", "open"])
def test_radii_are_told_by_passes_with_others(kind, seeds):
    """Made-up pictures of light that ends at a straight line, blurred by discs, or is wrong by the square of the radius
    everywhere, and noise of photons that is less in wider ones, which hold those of the narrower."""
    rng = np.random.default_rng(5)
    across = np.tile(np.arange(-100, 100) + 0.5, (60, 1))[:, :, None].repeat(3, axis=2)
    truth = 0.6 + 0.4 * (across < 0) if kind == "outline" else np.full(across.shape, 0.8)
    camera = [rng.normal(0, 0.01, truth.shape) for _ in range(seeds)]
    areas = {0.5: 0.25, 1.0: 1.0, 2.0: 4.0}
    rings = [[rng.normal(0, 0.01 * math.sqrt(a), truth.shape) for a in (0.25, 0.75, 3.0)] for _ in range(seeds)]
    photons = [dict(zip(areas, np.cumsum(parts, axis=0), strict=True)) for parts in rings]

    def blurred(width: float) -> np.ndarray:
        if kind == "outline":
            return 0.6 + 0.4 * beyond(across / (20 * width))
        return truth + 0.02 * width**2 * np.sin(across / 5)

    def bias2(width: float) -> float:
        return float(((blurred(width) - truth) ** 2 / (truth**2 + EPSILON)).mean())

    def tried(width: float) -> Tried:
        images = [blurred(width) + e + p[width] / areas[width] for e, p in zip(camera, photons, strict=True)]
        return Tried(images, 0.1 + 0.01 * width**2)

    found = told_by(tried(2.0), tried(1.0), tried(0.5), np.full(truth.shape, 0.64))
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

    found = told_by(tried(2.0), tried(1.0), tried(0.5), np.full((40, 40, 3), 0.64), HIDDEN)
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


NOTHING = 2e-5
"""Squared bias that none of the above can tell from none."""


def test_a_trial_tells_what_look_ups_at_the_ends_of_gather_rays_lack(pool):
    """Near edges, beside the path tracer, as eight passes of one radius do: next to nothing, as discs count for what is
    covered of them. Second gathers farther out are an option then, with less bias and dearer passes."""
    scene = open_scene("cornell_diffuse")
    small = {"camera.width": 64, "camera.height": 64, "photons.N": 50_000}
    base = with_values(Settings(), small)

    def mean_of(passes, **values):
        renderer = Renderer(scene, with_values(base, values), pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
        return beauty_of(renderer.film.planes()).astype(float)

    gather = GATHER.having(THICKER | CORNERS)
    for way, least, most in ((GATHER, 0.25, 1.4), (gather, 0.25, 1.4)):
        tried = trial(scene, base, [way], pool, (64, 64), 0.0, lambda text, share: None)
        paths = [mean_of(64, **{"render.method": "path", "render.seed": seed}) for seed in (5, 6)]
        lacking = [mean_of(8, **way.values, **{"estimate.alpha": 1.0, "render.seed": seed}) for seed in (7, 8)]
        true = squared(lacking, paths, np.mean(paths, axis=0), 4)
        told = tried.measured[0].bias.gathered.bias2
        print(f"{way.values}: {told:.3g} told, {true:.3g} true")
        assert least * true - NOTHING < told < most * true + NOTHING
    usual = replace(tried.measured[0], bias=Bias(gathered=Blur(1e-4)))
    farther = _farther(usual)
    assert farther.candidate.values["gather.secondary"] > gather.values["gather.secondary"]
    assert farther.bias.gathered.bias2 < 1e-4
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
            noise.append(variance(images, np.mean(images, axis=0) ** 2))
        told = (1 - 4**-1.3) * tried.measured[0].direct
        print(f"{name}: noise {noise[0]:.4f}, {noise[1]:.4f} with four times the samples; the trial: {told:.4f} less")
        assert told == pytest.approx(noise[0] - noise[1], rel=0.35)
        assert told > least * noise[0]
        assert tried.measured[0].costs.sampled > 0


@pytest.mark.parametrize("seeds", [2, 4])
@pytest.mark.parametrize(("bright", "least"), [(0.2, 0.9), (2.0, 0.7), (20.0, 0.3)])
def test_a_few_seeds_see_the_noise_of_rare_bright_pixels(seeds, bright, least):
    """One pixel of a hundred is brighter by so much, each time another. Relative to what it shows itself, which is
    bright with it, the variance of a pixel would be 2 at most with two seeds: less than a tenth of what there is."""
    rng = np.random.default_rng(seeds)
    chance = 0.01
    images = [1 - chance * bright + bright * (rng.random((100, 100, 1)) < chance) * np.ones(3) for _ in range(seeds)]
    true = chance * (1 - chance) * bright**2 / (1 + EPSILON)
    assert least * true < variance(images, shown_squared(images)) < 1.3 * true


def test_continued_random_numbers_tell_their_own_noise_alone():
    """Of made-up pictures with a hundred times as much noise of another kind, of two seeds, to 3 %."""
    rng = np.random.default_rng(3)
    few, many = [], []
    for _ in range(2):
        other, each = rng.normal(0.0, 1.0, (64, 64, 3)), rng.normal(1.0, 0.2, (8, 64, 64, 3))
        few.append(other + each[:2].mean(axis=0))
        many.append(other + each.mean(axis=0))
    true = 0.2**2 * (1 / 2 - 1 / 8) / (1 + EPSILON)
    assert nested(few, many, np.ones((64, 64, 3))) == pytest.approx(true, rel=0.03)


def test_photons_of_few_trajectories_are_the_first_of_many(pool):
    """What they make of a gather's noise is told by two seeds as by the variance over twelve."""
    scene, images = open_scene("cornell_diffuse"), {}
    for N in (4_000, 16_000):
        values = {"render.method": "gather", "camera.width": 32, "camera.height": 32, "photons.N": N}
        for seed in range(12):
            settings = with_values(Settings(), values | {"render.seed": seed, "estimate.radius": 0.03})
            renderer = Renderer(scene, settings, pool, StageStore(0))
            renderer.step()
            images[N, seed] = renderer.film.planes()[..., PLANES["indirect"]].astype(float)
    few, many = ([images[N, seed] for seed in range(12)] for N in (4_000, 16_000))
    square = np.mean(many, axis=0) ** 2
    by_two = [nested(few[i : i + 2], many[i : i + 2], square) for i in range(0, 12, 2)]
    falls = variance(few, square) - variance(many, square)
    print(f"by variances of twelve seeds {falls:.4f}, by pairs of seeds {np.round(by_two, 4)}")
    assert np.mean(by_two) == pytest.approx(falls, rel=0.2)
    assert np.std(by_two) < 0.3 * np.mean(by_two)


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


def test_a_trial_has_the_number_of_photons_that_it_is_planned_with(pool):
    """Not the one that pictures have by default: little time is soon spent on photons."""
    base = with_values(Settings(), {"camera.width": 64, "camera.height": 64, "photons.N": 20_000})
    trier = Trier(open_scene("cornell_diffuse"), base, pool, (40, 40), math.inf)
    for candidate in (PROGRESSIVE, CACHE):
        assert [run.N for run in trier.planned(candidate).runs] == [20_000, 5_000]


@pytest.mark.parametrize(("seconds", "pixels", "N"), [(1e-6, 40 * 40, 20_000), (1e6, 80 * 80, 100_000)])
def test_a_trial_is_made_smaller_where_pixels_and_photons_cost_more_than_it_may_take(seconds, pixels, N, pool):
    """Down to what still tells something; what costs little enough stays."""
    base = with_values(Settings(), {"camera.width": 128, "camera.height": 128, "photons.N": 100_000})
    trier = Trier(open_scene("cornell_diffuse"), base, pool, (80, 80), math.inf)
    trier.begin()
    trier.fit([PROGRESSIVE, CACHE], seconds)
    assert (trier.pixels, trier.scale) == (pixels, 128 * 128 / pixels)
    for candidate in (PROGRESSIVE, CACHE):
        chosen = trier.planned(candidate).runs[0].settings
        assert (chosen.camera.width * chosen.camera.height, chosen.photons.N) == (pixels, N)
