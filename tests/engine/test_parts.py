"""The session's parts: work pool, cache, plan of stages, radii, camera."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.method import ALL, MANY_LIGHTS, plan_of
from pmviewer.engine.pool import Cancelled, WorkPool
from pmviewer.engine.radius import first_radius, pass_radius, typical_distance
from pmviewer.engine.store import StageStore
from pmviewer.errors import SettingError
from pmviewer.maps.record import CAUSTIC, INDIRECT, INDIRECT_CAUSTIC
from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Camera
from tests.support.scenes import GLASS, MIRROR, ball_in_environment, cornell_box, diffuse_box, settings_of


@pytest.fixture
def pool():
    made = WorkPool(2)
    yield made
    made.close()


def test_pool_keeps_the_order_of_tasks(pool):
    heard = []
    tasks = [lambda i=i: (time.sleep(0.01 * (10 - i)), i)[1] for i in range(10)]
    pool.on_progress = lambda stage, share: heard.append(share)
    assert pool.run(tasks) == list(range(10))
    assert len(heard) > 2
    assert heard == sorted(heard)
    assert heard[0] < 1
    assert heard[-1] == 1
    assert pool.cpu_seconds >= 0
    assert pool.run([]) == []


def test_pool_passes_errors_on_and_works_afterwards(pool):
    def fail():
        raise ValueError("broken task")

    with pytest.raises(ValueError, match="broken task"):
        pool.run([fail, lambda: 1])
    assert pool.run([lambda: 2]) == [2]


def test_pool_that_is_closed_meanwhile_says_so():
    """Nobody gets half of the results: here the only thread is busy while the second task waits."""
    begun, gate, pool, ended = threading.Event(), threading.Event(), WorkPool(1), []

    def long():
        begun.set()
        gate.wait(10)

    def ask():
        try:
            pool.run([long, lambda: 2])
        except Cancelled:
            ended.append("cancelled")

    asking = threading.Thread(target=ask)
    asking.start()
    begun.wait(10)
    closing = threading.Thread(target=pool.close)
    closing.start()
    while not pool.cancel.is_set():
        time.sleep(0.001)
    gate.set()
    closing.join(10)
    asking.join(10)
    assert ended == ["cancelled"]


def test_pool_cancels_what_has_not_started(pool):
    started = []
    gate = threading.Event()

    def task():
        started.append(1)
        gate.wait(10)

    def cancel():
        pool.cancel.set()
        gate.set()

    timer = threading.Timer(0.1, cancel)
    timer.start()
    with pytest.raises(Cancelled):
        pool.run([task] * 50)
    assert len(started) == 2
    with pytest.raises(Cancelled):
        pool.run([lambda: 1])
    pool.cancel.clear()
    assert pool.run([lambda: 1]) == [1]


def test_cache_forgets_what_was_unused_for_longest():
    cache = StageStore(budget=100)
    made = []

    def get(key, size=30):
        return cache.get(key, lambda: made.append(key) or key, lambda _: size)

    assert [get(k) for k in "abc"] == ["a", "b", "c"]
    get("a")
    get("d")  # 120 bytes: b goes
    assert made == ["a", "b", "c", "d"]
    get("a")
    get("c")
    assert made == ["a", "b", "c", "d"]
    get("b")
    assert made[-1] == "b"
    assert cache.bytes <= 100
    get("big", size=80)  # more than half of the budget is not kept
    get("big", size=80)
    assert made[-2:] == ["big", "big"]
    cache.clear()
    assert cache.bytes == 0
    get("a")
    assert made[-1] == "a"


def plan(method, scene, **photons):
    return plan_of(settings_of(render={"method": method}, photons=photons), analyse(scene))


def test_plan_runs_what_is_needed_alone():
    box, plain = cornell_box(), diffuse_box()
    both = 1 << CAUSTIC | 1 << INDIRECT_CAUSTIC
    assert plan("path", box).path
    assert not plan("path", box).photons
    assert plan("progressive", box).caustic_mask == both
    assert plan("progressive", box).global_mask == 1 << INDIRECT
    assert plan("progressive", box, indirect_caustics=False).caustic_mask == 1 << CAUSTIC
    assert plan("progressive", box, indirect_caustics=False).global_mask == 1 << INDIRECT | 1 << INDIRECT_CAUSTIC
    assert plan("gather", box).global_classes == ALL
    assert plan("gather", box).global_mask == 0
    assert plan("gather", box).gather
    assert plan("global map", box).global_mask == ALL
    assert not plan("global map", box).direct
    assert plan("caustic map", box).caustic_mask == both
    assert plan("progressive", plain).caustic_mask == 0
    assert not plan("caustic map", plain).photons
    assert not plan("progressive", ball_in_environment(GLASS)).photons
    assert not plan("progressive", ball_in_environment(GLASS)).direct
    for method in ("progressive", "gather", "path", "global map", "caustic map"):
        for scene in (box, plain, ball_in_environment(MIRROR)):
            skipped = plan(method, scene).skipped
            assert all(stage and reason for stage, reason in skipped)
            assert len({stage for stage, _ in skipped}) == len(skipped)


@pytest.mark.parametrize("method", ["progressive", "gather"])
def test_photons_choose_among_many_lights(method):
    one = analyse(cornell_box())
    few, many = replace(one, n_lights=MANY_LIGHTS - 1), replace(one, n_lights=MANY_LIGHTS)

    def choice(traits, wanted, method=method):
        chosen = plan_of(settings_of(render={"method": method}, direct={"choice": wanted}), traits)
        assert ("light choice by photons" in dict(chosen.skipped)) == (chosen.direct and not chosen.asks_photons)
        return chosen.choice

    assert [choice(traits, "auto") for traits in (one, few, many)] == ["power", "distance", "photons"]
    crowd = replace(one, n_lights=1000)
    assert [choice(traits, "distance") for traits in (one, few, many, crowd)] == [
        "power",
        "distance",
        "distance",
        "power",
    ]
    for rule in ("power", "photons", "Keller-Wald"):
        assert [choice(traits, rule) for traits in (one, few, many)] == ["power", rule, rule]
        assert choice(many, rule, "path") == ("power" if rule == "power" else "distance")
        assert choice(crowd, rule, "path") == "power"
        assert choice(many, rule, "global map") == "power"


def test_settings_of_the_light_choice_say_when_they_do_nothing():
    one = analyse(cornell_box())
    many = replace(one, n_lights=100)
    names = ("samples", "choice", "choice_radius", "con_samples", "noncon_samples", "biased")

    def active(traits, method="progressive", **direct):
        settings = settings_of(render={"method": method}, direct=direct)
        return [name for name in names if inactive_reason(f"direct.{name}", settings, traits) is None]

    assert active(one) == ["samples"]
    assert active(many, choice="power") == ["samples", "choice"]
    assert active(many) == ["samples", "choice", "choice_radius", "biased"]
    assert active(many, choice="Keller-Wald") == list(names[1:])
    assert active(many, choice="Keller-Wald", biased=True) == ["choice", "choice_radius", "con_samples", "biased"]
    assert active(many, "path") == ["samples", "choice"]
    assert active(many, "global map") == []


def test_radius_follows_the_pixels_footprint():
    scene = cornell_box(size=100)
    flat = flatten(scene)
    settings = settings_of()
    camera = resolve_camera(scene, settings.camera)
    assert 0.5 < typical_distance(flat, camera) < 2.0
    automatic = first_radius(flat, camera, settings.estimate, False)
    footprint = typical_distance(flat, camera) * camera.pixel_angle()
    assert footprint < automatic < 8 * footprint
    wide = resolve_camera(scene, settings_of(camera={"width": 400, "height": 400}).camera)
    assert first_radius(flat, wide, settings.estimate, False) == pytest.approx(automatic / 4, rel=0.2)
    chosen = settings_of(estimate={"radius": 0.03}).estimate
    assert first_radius(flat, camera, chosen, False) == pytest.approx(0.03 * flat.radius)
    away = CameraPose((0, 0, 50), (0, 0, 100), (0, 1, 0), 40, 100, 100)
    assert typical_distance(flat, away) == flat.radius


def test_radius_shrinks_to_its_floor_and_no_further():
    estimate = settings_of(estimate={"floor": 0.01, "alpha": 0.5}).estimate
    radii = [pass_radius(0.1, i, estimate, 2.0) for i in (0, 1, 10, 1000, 10**9)]
    assert radii[0] == pytest.approx(0.1)
    assert radii[1] == pytest.approx(0.1 * np.sqrt(1.5 / 2))
    assert radii == sorted(radii, reverse=True)
    assert radii[-1] == 0.02


def test_camera_projects_where_its_rays_go():
    camera = CameraPose((1, 2, 3), (0.5, 0, -1), (0, 1, 0), 50.0, 64, 40)
    eye, corner, right, down = camera.ray_frame()
    pixels = np.array([[0.5, 0.5], [63.5, 39.5], [10.25, 30.75]])
    points = eye + 2.5 * (corner + pixels[:, :1] * right + pixels[:, 1:] * down)
    assert camera.project(points)[:, :2] == pytest.approx(pixels)
    assert camera.project(points)[:, 2] == pytest.approx(2.5)  # rays of `ray_frame` have unit depth
    clip = camera.projection_matrix(0.1, 100) @ camera.view_matrix() @ np.vstack([points.T, np.ones(3)])
    screen = (clip[:2] / clip[3]).T
    assert (screen[:, 0] + 1) * 32 == pytest.approx(pixels[:, 0])
    assert (1 - screen[:, 1]) * 20 == pytest.approx(pixels[:, 1])
    assert camera.pixel_angle() == pytest.approx(2 * np.tan(np.radians(25)) / 64)


def test_camera_orientation():
    """Looking along −z with y upright, x runs to the right of the image; a mirrored frame turns that round."""
    camera = CameraPose((0, 0, 0), (0, 0, -1), (0, 1, 0), 90.0, 10, 10)
    assert camera.project(np.array([[0.5, 0.2, -1.0]]))[0] == pytest.approx((7.5, 4.0, 1.0))
    mirrored = CameraPose((0, 0, 0), (0, 0, -1), (0, 1, 0), 90.0, 10, 10, mirrored=True)
    assert mirrored.project(np.array([[0.5, 0.2, -1.0]]))[0] == pytest.approx((2.5, 4.0, 1.0))


@pytest.mark.parametrize(
    ("axis", "width", "height", "horizontal"),
    [("x", 80, 40, 60.0), ("y", 80, 40, 98.2132), ("smaller", 80, 40, 98.2132), ("larger", 80, 40, 60.0),
     ("smaller", 40, 80, 60.0), ("larger", 40, 80, 32.2042), ("diagonal", 60, 80, 38.2132)],
)  # fmt: skip
def test_field_of_view_of_each_axis(axis, width, height, horizontal):
    scene = diffuse_box()
    camera = Camera((0, 0, 1), (0, 0, 0), (0, 1, 0), 60.0, fov_axis=axis)
    scene = type(scene)(scene.name, None, scene.shapes, scene.materials, (), camera, width, height)
    assert resolve_camera(scene, settings_of().camera).fov == pytest.approx(horizontal, abs=1e-3)


def test_camera_that_looks_along_its_up_vector():
    camera = CameraPose((0, 5, 0), (0, 0, 0), (0, 1, 0), 40.0, 8, 8)
    right, top, forward = camera.axes()
    assert np.abs(np.array([right, top, forward]) @ np.array([right, top, forward]).T - np.eye(3)).max() < 1e-12
    assert forward == pytest.approx((0, -1, 0))


def test_camera_without_a_direction_is_refused():
    with pytest.raises(SettingError, match="coincide"):
        CameraPose((1, 1, 1), (1, 1, 1), (0, 1, 0), 40.0, 8, 8).axes()
