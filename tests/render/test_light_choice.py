"""Choosing among lights, by distance and by photons (R2): unbiased whatever they say, and each rule as defined."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.errors import SceneError
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.memory import stack_i4
from pmviewer.maps.radius import neighbourhood
from pmviewer.maps.search.grid import build_grid
from pmviewer.output.metric import z_test
from pmviewer.render.direct.by_distance import DEFENSIVE as DEFENSIVE_FAR
from pmviewer.render.direct.by_photons import DEFENSIVE, MOST_CANDIDATES
from pmviewer.render.direct.choice import (
    BY_DISTANCE,
    BY_PHOTONS,
    CHOICES,
    KELLER_WALD,
    LIST_WORDS,
    LISTED,
    chosen_light,
    expected_samples,
)
from pmviewer.render.direct.choose import choose_by_rule
from pmviewer.render.direct.samples import SAMPLES
from pmviewer.render.eye import DIRECT
from pmviewer.render.planes import beauty_of
from pmviewer.render.record import EYE_DTYPE
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import (
    Camera,
    ConstantEnvironment,
    DirectionalLight,
    Parallelogram,
    PointLight,
    Scene,
    Shape,
    Sphere,
)
from pmviewer.settings.access import SETTINGS
from pmviewer.settings.schema.direct import MOST_BY_DISTANCE
from tests.support.naive_maps import pack
from tests.support.scenes import box_walls, diffuse, rendered, settings_of

SIZE, SEEDS = 16, 24
N_LIGHTS = 8
RULES = {
    "distance": {"choice": "distance"},
    "photons": {"choice": "photons"},
    "photons, small radius": {"choice": "photons", "choice_radius": 0.02, "samples": 3},
    "Keller-Wald, few samples": {"choice": "Keller-Wald", "con_samples": 1, "noncon_samples": 1},
    "Keller-Wald, a sample for each": {"choice": "Keller-Wald", "con_samples": 9, "noncon_samples": 2},
}


def four_rooms():
    """2 × 2 rooms with doorways, two lights in each of different kind and power; the camera sees one and a door."""

    def wall(name, corner, u, v):
        return Shape(name, Parallelogram(corner, u, v), 0)

    shapes = list(box_walls(2.0))
    for low, high in ((-2.0, -1.3), (-0.6, 0.6), (1.3, 2.0)):
        shapes.append(wall("x wall", (0.0, -2.0, low), (0.0, 4.0, 0.0), (0.0, 0.0, high - low)))
        shapes.append(wall("z wall", (low, -2.0, 0.0), (0.0, 4.0, 0.0), (high - low, 0.0, 0.0)))
    for i, (x, z) in enumerate([(1, 1), (-1, 1), (1, -1), (-1, -1), (0.5, 1.4), (-1.5, -0.4)]):
        radiance = (4.0 + 3 * i, 6.0, 9.0 - i)
        panel = Parallelogram((x - 0.2, 1.9, z - 0.2), (0.4, 0.0, 0.0), (0.0, 0.0, 0.4))
        shapes.append(Shape(f"panel {i}", panel, 1, radiance))
    shapes.append(Shape("ball", Sphere((-1.5, 0.8, 1.6), 0.15), 1, (10.0, 8.0, 3.0)))
    materials = (diffuse(), diffuse("black", (0.0,) * 3))
    camera = Camera((1.8, 0.0, 1.8), (-1.0, -0.5, 0.6), (0, 1, 0), 80.0, near=0.0, far=np.inf)
    point = PointLight("point", (1.4, 0.0, -1.2), (1.0, 1.0, 2.0))
    return Scene("four rooms", None, tuple(shapes), materials, (point,), camera, SIZE, SIZE)


@pytest.fixture(scope="module")
def rooms():
    opened = open_scene(four_rooms())
    assert opened.flat.record[0]["n_lights"] == opened.traits.n_lights == N_LIGHTS
    return opened


def direct_light(opened, method, seeds=SEEDS, **direct):
    """Mean and variance of the mean, (h, w, 3), of direct light over renderings of different seeds."""
    images = []
    pool = WorkPool(1)
    for seed in range(1, seeds + 1):
        groups = {"render": {"method": method, "seed": seed}, "photons": {"N": 1500}, "direct": direct}
        renderer = Renderer(opened, settings_of(**groups), pool, StageStore(0))
        renderer.step()
        renderer.step()
        assert renderer.tally.dropped == {"photons": 0, "samples": 0}
        images.append(renderer.film.sums[:, DIRECT : DIRECT + 3].reshape(SIZE, SIZE, 3) / 2)
    pool.close()
    return np.mean(images, axis=0), np.var(images, axis=0, ddof=1) / seeds


@pytest.fixture(scope="module")
def by_power(rooms):
    """The yardstick, with many samples by power."""
    return direct_light(rooms, "progressive", choice="power", samples=48)


@pytest.mark.parametrize("mis", [True, False])
@pytest.mark.parametrize("rule", RULES)
def test_every_rule_has_the_expectation_of_sampling_by_power(rule, mis, rooms, by_power):
    method = "gather" if rule == "photons" else "progressive"
    mean, variance = direct_light(rooms, method, mis=mis, **RULES[rule])
    outcome = z_test(mean, variance, *by_power, block=4)
    print(f"{rule}, MIS {mis}: {outcome}")
    assert outcome.passes()
    assert mean.mean() == pytest.approx(by_power[0].mean(), rel=0.05)


@pytest.mark.parametrize("rule", ["distance", "photons", "Keller-Wald, few samples"])
def test_fewer_samples_by_nearness_are_less_noisy(rule, rooms):
    rules = ({"samples": SAMPLES, **RULES[rule]}, {"samples": SAMPLES, "choice": "power"})
    noise = [direct_light(rooms, "progressive", **direct)[1].mean() for direct in rules]
    print(f"{rule}: variance {noise[0]:.2e}, by power {noise[1]:.2e}")
    assert noise[0] < 0.5 * noise[1]


@pytest.mark.parametrize("rule", RULES)
def test_leaving_lights_out_is_darker_or_equal(rule, rooms, by_power):
    mean, variance = direct_light(rooms, "progressive", biased=True, **RULES[rule])
    error = np.sqrt((variance + by_power[1]).sum()) / mean.size
    print(f"{rule}, biased: {mean.mean():.5f} of {by_power[0].mean():.5f}, ± {error:.5f}")
    assert mean.mean() < by_power[0].mean() + 4 * error
    if "small" in rule:
        assert mean.mean() < by_power[0].mean() - 4 * error
    else:
        assert mean.mean() > 0.95 * by_power[0].mean()


def test_many_lights_are_chosen_by_photons_and_one_is_not(rooms):
    automatic = rendered(rooms, settings_of(photons={"N": 5000}), 1)
    photons = rendered(rooms, settings_of(photons={"N": 5000}, direct={"choice": "photons"}), 1)
    power = rendered(rooms, settings_of(photons={"N": 5000}, direct={"choice": "power"}), 1)
    assert np.array_equal(automatic.film.sums, photons.film.sums)
    assert not np.array_equal(power.film.sums, photons.film.sums)
    assert automatic.tally.radius["light choice"] > 0
    assert "light choice" not in power.tally.radius


def test_threads_and_caches_change_nothing(rooms):
    settings = settings_of(photons={"N": 20_000}, direct={"choice": "Keller-Wald"})
    pool, cache, films = WorkPool(2), StageStore(), []
    for _ in range(2):
        renderer = Renderer(rooms, settings, pool, cache)
        for _ in range(6):
            renderer.step()
        films.append(renderer.film.sums)
    pool.close()
    films.append(rendered(rooms, settings, 6).film.sums)
    assert np.array_equal(films[0], films[1])
    assert np.array_equal(films[0], films[2])


def test_shadow_rays_are_counted(rooms):
    settings = settings_of(photons={"N": 5000}, direct={"choice": "Keller-Wald", "con_samples": 3, "noncon_samples": 2})
    statistics = rendered(rooms, settings, 2).frame(1).statistics
    assert 0 < statistics.shadow_rays < statistics.rays
    assert statistics.shadow_rays_per_pixel == statistics.shadow_rays / (2 * SIZE * SIZE)
    assert 0.5 < statistics.shadow_rays_per_pixel <= 5


# The rules themselves, at a point with photons laid out by hand -------------------------------------------------------


@kernel
def _choose(scenes, eyes, grids, u, m, light, light_m):
    """m: float32 (lights,); light, light_m: (samples, len(u)). Returns known lights and samples."""
    scene, eye = scenes[0], eyes[0]
    zero, one = np.float32(0.0), np.float32(1.0)
    choice = choose_by_rule(scene, eye, grids[0], (zero, zero, zero), (zero, one, zero), stack_i4(LIST_WORDS))
    for i in range(len(m)):
        m[i] = expected_samples(scene, choice, np.int64(i))
    for s in range(choice[4]):
        for i in range(len(u)):
            light[s, i], light_m[s, i] = chosen_light(scene, choice, s, u[i])
    return choice[1], choice[4]


def lights_scene(powers):
    """A floor and panels of the given powers (relative)."""
    floor = Shape("floor", Parallelogram((-1, 0, -1), (0, 0, 2), (2, 0, 0)), 0)
    square = Parallelogram((0, 1, 0), (0.1, 0, 0), (0, 0, 0.1))
    shapes = (floor, *(Shape(f"light {i}", square, 0, (float(p),) * 3) for i, p in enumerate(powers)))
    camera = Camera((0, 3, 0), (0, 0, 0), (0, 0, 1), 40.0, near=0.0, far=np.inf)
    return flatten(Scene("lights", None, shapes, (diffuse(),), (), camera, 8, 8))


def choose(powers, photons, rule, samples=1, con=1, non=1, biased=False, radius=0.5):
    """Expected samples of each light, known lights, and the shares of the lights in actual samples.

    `photons` are the lights of photons that lie around the origin, facing up.
    """
    values = {
        "choice": rule,
        "light_samples": samples,
        "con_samples": con,
        "noncon_samples": non,
        "biased": biased,
        "choice_radius": radius,
    }
    photons = np.asarray(photons, int)
    random = np.random.default_rng(3)
    place = np.zeros((len(photons), 3))
    place[:, ::2] = random.uniform(-0.2, 0.2, (len(photons), 2))
    record = pack(place.astype(np.float32), (0.0, 1.0, 0.0), light=photons) if len(photons) else np.empty((0, 6), "f4")
    return _chosen(lights_scene(powers), values, record, radius)


def _chosen(flat, values, record, radius):
    """The same of whatever lights, by these values of the eye record and packed photons."""
    eye = np.zeros(1, EYE_DTYPE)
    for name, value in values.items():
        eye[name] = value
    grid, n = build_grid(record, radius), len(flat.light_power)
    u = (np.arange(4096, dtype=np.float32) + np.float32(0.5)) / np.float32(4096)
    m = np.zeros(n, np.float32)
    light = np.full((80, len(u)), -1, np.int64)
    light_m = np.zeros((80, len(u)), np.float32)
    known, total = _choose(flat.record, eye, grid.record, u, m, light, light_m)
    drawn = np.bincount(light[:total].ravel(), minlength=n) / len(u)
    assert np.all((light_m[:total] == m[light[:total]]) | (light_m[:total] == 0))
    return m, known, drawn


def test_paths_have_the_same_light_by_either_rule_and_less_noise_by_distance(rooms):
    """In all terms: the rule is used at each of a path's surfaces, and by the weights of lights that it meets."""
    pool = WorkPool(1)

    def images(choice, first):
        for seed in range(first, first + 40):
            settings = settings_of(render={"method": "path", "seed": seed}, direct={"choice": choice})
            renderer = Renderer(rooms, settings, pool, StageStore(0))
            renderer.step()
            yield beauty_of(renderer.film.planes()).astype(float)

    near, power = (np.array(list(images(*how))) for how in (("distance", 1), ("power", 100)))
    pool.close()
    moments = [moment for of in (near, power) for moment in (of.mean(0), of.var(0, ddof=1) / len(of))]
    outcome = z_test(*moments, block=4)
    print(f"{outcome}; variance {near.var(0).mean():.3g}, by power {power.var(0).mean():.3g}")
    assert outcome.passes()
    assert near.mean() == pytest.approx(power.mean(), rel=0.05)
    assert near.var(0).mean() < 0.85 * power.var(0).mean()


POWERS = np.array([1.0, 2.0, 4.0, 1.0, 8.0])
SHARES = POWERS / POWERS.sum()
NEAR = [1] * 30 + [4] * 10


def test_photons_share_the_samples_but_for_a_defensive_part():
    m, known, drawn = choose(POWERS, NEAR, BY_PHOTONS, samples=2)
    photons = np.array([0, 0.75, 0, 0, 0.25])
    assert known == 2
    assert m == pytest.approx(2 * ((1 - DEFENSIVE) * photons + DEFENSIVE * SHARES), rel=1e-4)
    assert drawn == pytest.approx(m, abs=2e-3)
    m, _, drawn = choose(POWERS, NEAR, BY_PHOTONS, samples=2, biased=True)
    assert m == pytest.approx(2 * photons)
    assert drawn == pytest.approx(m, abs=2e-3)


def test_distances_share_the_samples_but_for_a_defensive_part():
    """Lights of one power, at heights 1 and 3 above the point and a lamp that it lies in, whose size counts."""
    floor = Shape("floor", Parallelogram((-1, 0, -1), (0, 0, 2), (2, 0, 0)), 0)

    def square(height, side):
        corner = (-side / 2, height, -side / 2)
        return Shape("light", Parallelogram(corner, (side, 0, 0), (0, 0, side)), 0, (1 / side**2,) * 3)

    lights = (square(1.0, 0.1), square(3.0, 0.1), square(0.0, 2 * math.sqrt(2)))
    camera = Camera((0, 3, 0), (0, 0, 0), (0, 0, 1), 40.0, near=0.0, far=np.inf)
    flat = flatten(Scene("lights", None, (floor, *lights), (diffuse(),), (), camera, 8, 8))
    near = np.array([1.0, 1 / 9, 1 / 4])  # a square's ball has half of its diagonal
    expected = 3 * ((1 - DEFENSIVE_FAR) * near / near.sum() + DEFENSIVE_FAR / 3)
    m, known, drawn = _chosen(flat, {"choice": BY_DISTANCE, "light_samples": 3}, np.empty((0, 6), "f4"), 0.5)
    assert known == 3
    assert m == pytest.approx(expected, rel=1e-4)
    assert drawn == pytest.approx(m, abs=2e-3)


def test_sun_and_sky_count_as_from_the_scene_s_radius():
    floor = Shape("floor", Parallelogram((-1, 0, -1), (0, 0, 2), (2, 0, 0)), 0)
    radius = math.sqrt(2)
    sky, point = ConstantEnvironment("sky", (1.0,) * 3), PointLight("point", (0, 0.5, 0), (1.0,) * 3)
    sun = DirectionalLight("sun", (0, -1, 0), (1.0,) * 3)
    camera = Camera((0, 3, 0), (0, 0, 0), (0, 0, 1), 40.0, near=0.0, far=np.inf)
    flat = flatten(Scene("lights", None, (floor,), (diffuse(),), (sky, point, sun), camera, 8, 8))
    power = np.array([4 * math.pi**2 * radius**2, 4 * math.pi, math.pi * radius**2])
    near = power / [radius**2, 0.5**2, radius**2]
    expected = (1 - DEFENSIVE_FAR) * near / near.sum() + DEFENSIVE_FAR * power / power.sum()
    m, _, drawn = _chosen(flat, {"choice": BY_DISTANCE, "light_samples": 1}, np.empty((0, 6), "f4"), 0.5)
    assert m == pytest.approx(expected, rel=1e-4)
    assert drawn == pytest.approx(m, abs=2e-3)


def test_few_contributing_samples_are_spread_by_photons():
    m, _, drawn = choose(POWERS, NEAR, KELLER_WALD, con=1, non=2)
    others = np.array([1, 0, 1, 1, 0]) * SHARES
    assert m == pytest.approx(np.array([0, 0.75, 0, 0, 0.25]) + 2 * others / others.sum(), rel=1e-4)
    assert drawn == pytest.approx(m, abs=2e-3)


def test_enough_contributing_samples_are_stratified():
    """At least one on each contributing light, exactly as many as m says, all S_con spent."""
    m, known, drawn = choose(POWERS, [*NEAR, 0], KELLER_WALD, con=9, non=1)
    assert known == 3
    near = m[[0, 1, 4]]
    assert np.all(near >= 1)
    assert np.array_equal(near, np.round(near))
    assert near.sum() == 9
    assert np.array_equal(drawn[[0, 1, 4]], near)
    assert drawn[[2, 3]] == pytest.approx(m[[2, 3]], abs=2e-3)


def test_biased_keller_wald_samples_contributing_lights_alone():
    m, _, drawn = choose(POWERS, NEAR, KELLER_WALD, con=4, biased=True)
    assert np.array_equal(m > 0, [False, True, False, False, True])
    assert np.array_equal(drawn, m)


def test_no_photons_near():
    for rule, samples in ((BY_PHOTONS, 3), (KELLER_WALD, 2)):
        m, known, drawn = choose(POWERS, [], rule, samples=3, con=5, non=2)
        assert known == 0
        assert m == pytest.approx(samples * SHARES, rel=1e-4)
        assert drawn == pytest.approx(m, abs=2e-3)
        m, _, drawn = choose(POWERS, [], rule, samples=3, con=5, non=2, biased=True)
        assert not m.any()
        assert not drawn.any()


def test_all_lights_near_leave_nothing_for_the_others():
    m, known, drawn = choose(POWERS, [0, 1, 2, 3, 4, 4], KELLER_WALD, con=6, non=3)
    assert known == 5
    assert np.array_equal(m, [1, 1, 1, 1, 2])
    assert np.array_equal(drawn, m)


def test_photons_of_unknown_lights_are_passed_over():
    m, known, _ = choose(POWERS, [*NEAR, 5, 65535], BY_PHOTONS)
    assert known == 2
    assert m == pytest.approx(choose(POWERS, NEAR, BY_PHOTONS)[0])


@pytest.mark.parametrize("rule", [BY_PHOTONS, KELLER_WALD])
def test_more_lights_than_a_list_holds(rule):
    """Lights beyond the list are sampled like those without photons."""
    powers = np.linspace(1, 2, 100)
    m, known, drawn = choose(powers, np.repeat(np.arange(100), 3), rule, con=8, non=2)
    assert known == LISTED
    assert np.all(m > 0)
    assert m.sum() == pytest.approx(1 if rule == BY_PHOTONS else 10, rel=1e-4)
    assert drawn == pytest.approx(m, abs=3e-3)


def test_a_crowd_of_photons_is_thinned_evenly():
    lights = np.random.default_rng(1).permutation([1] * (9 * MOST_CANDIDATES) + [3] * (3 * MOST_CANDIDATES))
    m, known, _ = choose(POWERS, lights, BY_PHOTONS, biased=True)
    assert known == 2
    assert m[[1, 3]] == pytest.approx([0.75, 0.25], abs=0.05)


def test_a_scene_without_light_is_refused():
    with pytest.raises(SceneError):
        lights_scene([])


def test_rules_are_those_of_the_setting():
    assert SETTINGS["direct.choice"].choices == ("auto", *CHOICES)
    assert MOST_BY_DISTANCE == LISTED


def test_neighbourhood_holds_about_as_many_photons_as_wanted():
    random = np.random.default_rng(2)
    plane = np.zeros((40_000, 3), np.float32)
    plane[:, :2] = random.uniform(0, 1, (40_000, 2))
    radius = neighbourhood(plane, 64)
    assert 50 < np.pi * radius**2 * len(plane) < 130
    assert neighbourhood(plane[:1]) == neighbourhood(plane[:0]) == 0
    assert neighbourhood(np.zeros((10, 3), np.float32)) == 0
    assert 0 < neighbourhood(plane[:2]) < 2
