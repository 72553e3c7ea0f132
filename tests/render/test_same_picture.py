"""What must not change a picture: threads, caches, the scene's size. And what must: seeds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.scene.description import Sphere
from tests.render.test_media import mixed_scene
from tests.support.scenes import cornell_box, rendered, settings_of

METHODS = ["progressive", "gather", "path", "global map", "caustic map"]


def settings_for(method, **more):
    return settings_of(render={"method": method}, photons={"N": 20_000}, **more)


@pytest.mark.parametrize("lookup", ["radius", "nearest"])
@pytest.mark.parametrize("method", METHODS)
def test_threads_change_nothing(method, lookup):
    settings = settings_for(method, estimate={"lookup": lookup})
    opened = open_scene(cornell_box(size=64))
    one, two = (rendered(opened, settings, 3, threads) for threads in (1, 2))
    assert np.array_equal(one.film.sums, two.film.sums)
    assert (one.tally.rays, one.tally.emitted, one.tally.stored) == (
        two.tally.rays,
        two.tally.emitted,
        two.tally.stored,
    )
    assert one.tally.dropped == {"photons": 0, "samples": 0}


def test_caches_change_nothing():
    """The film is the same whether photons and maps were made for it or for another camera before."""
    opened = open_scene(cornell_box())
    pool = WorkPool(1)
    cache = StageStore()
    films = []
    for camera in ({"fov": 50.0}, {}, {}):
        renderer = Renderer(opened, settings_for("progressive", camera=camera), pool, cache)
        for _ in range(6):
            renderer.step()
        films.append(renderer.film.sums)
    fresh = rendered(opened, settings_for("progressive"), 6)
    pool.close()
    assert np.array_equal(films[1], films[2])
    assert np.array_equal(films[1], fresh.film.sums)
    assert not np.array_equal(films[0], films[1])


@pytest.mark.parametrize("method", METHODS)
def test_seed_changes_the_noise_alone(method):
    images = [
        rendered(cornell_box(size=32), settings_of(render={"method": method, "seed": seed}, photons={"N": 20_000}), 6)
        .frame(1)
        .image()
        for seed in (1, 2)
    ]
    assert not np.array_equal(*images)
    assert images[0].mean() == pytest.approx(images[1].mean(), rel=0.03)


def rel_mse(image, reference):
    return float(((image - reference) ** 2 / (reference**2 + 1e-2)).mean())


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scale", [1e-4, 1e5])
def test_size_of_the_scene_changes_nothing(method, scale):
    """Lengths times the scale, powers by its square, radiance alike: the same random numbers give the same picture but
    for rounding, which now and then sends a path elsewhere."""
    settings = settings_for(method)
    expected, scaled = (rendered(cornell_box(s), settings, 4) for s in (1.0, scale))
    a, b = expected.frame(1).image().astype(float), scaled.frame(1).image().astype(float)
    print(f"{method} at {scale:g}: mean ratio {b.mean() / a.mean():.5f}, relMSE between both {rel_mse(b, a):.1e}")
    assert scaled.tally.dropped == {"photons": 0, "samples": 0}
    assert b.mean() == pytest.approx(a.mean(), rel=0.005)
    assert rel_mse(b, a) < 0.05 * rel_mse(a, a.mean())
    assert scaled.tally.stored["global"] == pytest.approx(expected.tally.stored["global"], rel=0.002)


def test_place_of_the_scene_changes_nothing():
    """Moved by ten times its size, where float32 knows coordinates to a millionth."""
    scene = cornell_box()
    offset = np.array([10.0, -7.0, 5.0])

    def moved(geometry):
        if isinstance(geometry, Sphere):
            return replace(geometry, center=tuple(np.add(geometry.center, offset)))
        return replace(geometry, corner=tuple(np.add(geometry.corner, offset)))

    camera = replace(
        scene.camera,
        origin=tuple(np.add(scene.camera.origin, offset)),
        target=tuple(np.add(scene.camera.target, offset)),
    )
    shifted = replace(scene, camera=camera, shapes=tuple(replace(s, geometry=moved(s.geometry)) for s in scene.shapes))
    for method in ("progressive", "path"):
        a, b = (rendered(s, settings_for(method), 6).frame(1).image().astype(float) for s in (scene, shifted))
        print(f"{method} moved: mean ratio {b.mean() / a.mean():.5f}")
        assert b.mean() == pytest.approx(a.mean(), rel=0.01)


@pytest.mark.extensive
@pytest.mark.parametrize(
    ("scene", "widened"),
    [(cornell_box(size=16), "every_surface"), (mixed_scene(64), "any_light_in_media")],
    ids=["mirror and glass", "fog"],
)
@pytest.mark.parametrize("method", ["path", "progressive", "gather"])
def test_what_else_kernels_know_changes_no_picture(method, scene, widened, request):
    """Kernels for scenes like this alone, and those for any material, texture and light, or for any medium."""
    own, any_ = [], []
    for pictures in (own, any_):
        for seed in (1, 2, 3, 4):
            settings = settings_of(render={"method": method, "seed": seed}, photons={"N": 20_000})
            pictures.append(rendered(scene, settings, 16).frame(1).image().mean((0, 1)))
        if pictures is own:
            request.getfixturevalue(widened)
    error = np.hypot(*(np.std(pictures, axis=0, ddof=1) / 2 for pictures in (own, any_)))
    difference = np.abs(np.mean(own, axis=0) - np.mean(any_, axis=0))
    assert (difference < 4 * error + 1e-6).all(), (difference, error)
    assert (error < 0.01 * np.mean(own, axis=0)).all(), "it could be seen"
