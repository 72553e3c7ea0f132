"""Rays that look for lights: none that may meet one is left out, and none is cast where light samples suffice."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.lights.light import sample_one_light
from pmviewer.kernels.lights.reach import may_meet_light, samples_by_power_suffice
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.scene import light_of
from pmviewer.render.direct.by_distance import choose_by_distance, samples_by_distance_suffice
from pmviewer.render.direct.choice import LIST_WORDS, expected_samples
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Camera, Parallelogram, Scene, Shape
from tests.support.scenes import diffuse, light_scene, panel, rendered, settings_of

AREA_LIGHTS = ("parallelogram", "disk", "sphere", "sphere inside", "cylinder", "cylinder inside", "mesh")


@kernel
def _asked(scenes, points, directions, may, met):
    scene = scenes[0]
    for i in range(len(points)):
        p, d = points[i], directions[i]
        may[i] = may_meet_light(scene, (p[0], p[1], p[2]), (d[0], d[1], d[2]))
        far = np.float32(np.inf)
        _, prim, _, _ = closest_hit(scene, p[0], p[1], p[2], d[0], d[1], d[2], np.float32(0.0), far)
        met[i] = prim >= 0 and light_of(scene, prim) >= 0


@kernel
def _densities(scenes, n, points, numbers, shares, suffice, least):
    scene = scenes[0]
    for i in range(len(points)):
        p = (points[i, 0], points[i, 1], points[i, 2])
        suffice[i] = samples_by_power_suffice(scene, n, p)
        least[i] = np.inf
        for light in range(scene.n_lights):
            for j in range(len(numbers)):
                _, _, _, pdf, _ = sample_one_light(scene, light, p, numbers[j, 0], numbers[j, 1])
                if pdf > 0:
                    least[i] = min(least[i], n * shares[light] * pdf)


@kernel
def _densities_by_distance(scenes, n, points, numbers, suffice, least):
    scene = scenes[0]
    for i in range(len(points)):
        p = (points[i, 0], points[i, 1], points[i, 2])
        choice = choose_by_distance(scene, p, n, stack_i4(LIST_WORDS))
        suffice[i] = samples_by_distance_suffice(scene, choice, p)
        least[i] = np.inf
        for light in range(scene.n_lights):
            m = expected_samples(scene, choice, light)
            for j in range(len(numbers)):
                _, _, _, pdf, _ = sample_one_light(scene, light, p, numbers[j, 0], numbers[j, 1])
                if pdf > 0:
                    least[i] = min(least[i], m * pdf)


def rays(n, seed=1):
    """Origins around the lights; every fourth direction along an axis, with zeros of both signs."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-3, 3, (n, 3)).astype(np.float32)
    directions = rng.normal(size=(n, 3))
    axes = np.eye(3)[rng.integers(0, 3, n)] * rng.choice([-1.0, 1.0], (n, 1))
    directions[::4] = axes[::4]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return points, directions.astype(np.float32)


def asked(scene, points, directions):
    may, met = np.zeros(len(points), bool), np.zeros(len(points), bool)
    flat = flatten(scene)  # which keeps what its record points to
    _asked(flat.record, points, directions, may, met)
    return may, met


@pytest.mark.parametrize("names", [*((name,) for name in AREA_LIGHTS), ("disk", "mesh", "point")], ids=" ".join)
def test_no_ray_that_meets_a_light_is_left_out(names):
    points, directions = rays(20_000)
    may, met = asked(light_scene(*names, floor=False), points, directions)
    assert met.sum() > 100
    assert may[met].all()
    if "inside" not in names[0]:
        assert may[~met].mean() < 0.2


def test_rays_into_a_sky_always_may_and_to_a_point_never():
    points, directions = rays(100)
    assert asked(light_scene("environment", "disk"), points, directions)[0].all()
    assert not asked(light_scene("point"), points, directions)[0].any()


def two_lights():
    """A wide dim light and a small bright one, which gets most of the samples."""
    wide = Shape("wide", Parallelogram((-1, 2, -1), (2, 0, 0), (0, 0, 2)), 0, (0.2,) * 3)
    small = Shape("small", Parallelogram((0.5, 1.5, 0), (0.1, 0, 0), (0, 0, 0.1)), 0, (300.0,) * 3)
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 40.0, near=0.0, far=np.inf)
    return Scene("two", None, (wide, small), (diffuse(),), (), camera, 8, 8)


@pytest.mark.parametrize(
    "scene", [light_scene("disk"), light_scene("sphere", "mesh"), two_lights()], ids=lambda s: s.name
)
@pytest.mark.parametrize("n", [1, 8])
def test_where_samples_suffice_each_is_ten_times_as_dense_as_a_diffuse_lobe(scene, n):
    flat = flatten(scene)
    rng = np.random.default_rng(2)
    points = (rng.normal(size=(2000, 3)) * rng.uniform(0.1, 20, (2000, 1)) ** 2 / 20).astype(np.float32)
    numbers = rng.random((64, 2), dtype=np.float32)
    luminance = flat.light_power @ np.array([0.212671, 0.715160, 0.072169])
    suffice, least = np.zeros(len(points), bool), np.zeros(len(points))
    _densities(flat.record, n, points, numbers, luminance / luminance.sum(), suffice, least)
    assert 0.05 < suffice.mean() < 0.99
    assert (least[suffice] >= 0.999 * 10 / math.pi).all()


@pytest.mark.parametrize("scene", [light_scene("sphere", "mesh"), two_lights()], ids=lambda s: s.name)
@pytest.mark.parametrize("n", [1, 8])
def test_where_samples_by_distance_suffice_each_is_ten_times_as_dense(scene, n):
    flat = flatten(scene)
    rng = np.random.default_rng(3)
    points = (rng.normal(size=(2000, 3)) * rng.uniform(0.1, 20, (2000, 1)) ** 2 / 20).astype(np.float32)
    suffice, least = np.zeros(len(points), bool), np.zeros(len(points))
    _densities_by_distance(flat.record, n, points, rng.random((64, 2), dtype=np.float32), suffice, least)
    assert 0.05 < suffice.mean() < 0.99
    assert (least[suffice] >= 0.999 * 10 / math.pi).all()


def test_where_there_is_a_sky_samples_by_distance_never_suffice():
    flat = flatten(light_scene("disk", "environment"))
    points = np.random.default_rng(4).normal(size=(200, 3)).astype(np.float32)
    suffice = np.ones(len(points), bool)
    _densities_by_distance(flat.record, 8, points, np.zeros((0, 2), np.float32), suffice, np.zeros(len(points)))
    assert not suffice.any()


def floor_below(height, half):
    floor = Parallelogram((-0.1, 0, -0.1), (0, 0, 0.2), (0.2, 0, 0))
    shapes = (Shape("floor", floor, 0), panel(half=half, y=height, radiance=(1.0,) * 3, material=1))
    camera = Camera((0, 0.05, 0.3), (0, 0, 0), (0, 1, 0), 20.0, near=0.0, far=np.inf)
    return Scene("panel", None, shapes, (diffuse(), diffuse("black", (0.0,) * 3)), (), camera, 24, 24)


@pytest.mark.parametrize(("height", "half", "looks"), [(10.0, 0.5, False), (0.2, 0.5, True)], ids=["far", "near"])
def test_far_lights_are_left_to_their_samples(height, half, looks):
    """Far away, direct light is bit for bit what it is without multiple importance sampling, by as many rays."""
    counted, films = [], []
    for mis in (True, False):
        settings = settings_of(direct={"mis": mis}, photons={"N": 1000})
        renderer = rendered(floor_below(height, half), settings, passes=32)
        counted.append(renderer.tally.rays)
        films.append(renderer.frame(1).image("direct"))
    assert (counted[0] > counted[1]) == looks
    assert np.array_equal(*films) != looks
    assert films[0].mean() == pytest.approx(films[1].mean(), rel=0.03)
