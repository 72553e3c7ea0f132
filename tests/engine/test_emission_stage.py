"""Guided emission in the renderer: switched by settings, with each method, the same whoever asks (I6)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.scene.description import Parallelogram, Scene
from tests.support.scenes import MIRROR, box_walls, cornell_box, diffuse, panel, rendered, settings_of

SIZE = 16
VARIANTS = ("Peter-Pietrek", "Christensen discard", "Christensen keep")


def settings(emission, method="gather", N=4000, photons=None, render=None, **importance):
    importance = {"map": "average", "N": 1500, "emission": emission} | importance
    return settings_of(
        render={"method": method, **(render or {})}, photons={"N": N, **(photons or {})}, importance=importance
    )


@pytest.mark.parametrize("method", ["gather", "progressive", "caustic map", "global map"])
@pytest.mark.parametrize("emission", VARIANTS)
def test_methods(method, emission):
    """Each works with a mirror and glass, keeps to its number of photons, and says what the lights got."""
    renderer = rendered(open_scene(cornell_box(size=SIZE)), settings(emission, method), 2)
    frame = renderer.frame(1)
    assert np.isfinite(frame.beauty).all()
    assert 0 < frame.statistics.emitted <= 8000
    assert frame.lights.names == renderer.scene.flat.light_names
    np.testing.assert_allclose(frame.lights.factor, 1.0)
    assert frame.statistics.deposited["global"].arrived >= frame.statistics.stored_in_pass["global"]


def test_off_and_without_importance():
    """Nothing is computed, or a sentence says why not; other settings say when they have no effect."""
    scene = open_scene(cornell_box(size=SIZE))
    off, without = rendered(scene, settings("off"), 1), rendered(scene, settings("Peter-Pietrek", map="off"), 1)
    plain = rendered(scene, settings("off", map="off"), 1)
    for renderer in (off, without):
        assert renderer.frame(1).lights is None
        assert renderer.light.photons.guided is None
        np.testing.assert_array_equal(renderer.film.sums, plain.film.sums)
    assert any("needs importance" in text for text in without.frame(1).statistics.warnings)
    on = settings("Christensen keep")
    assert "importance.map" in inactive_reason(
        "importance.emission", settings("Peter-Pietrek", map="off"), scene.traits
    )
    for path in ("photons.projection", "photons.q_rule", "importance.important", "overlays.projection.show"):
        assert inactive_reason(path, on, scene.traits) is not None
    for path in ("importance.emission", "importance.tests"):
        assert inactive_reason(path, on, scene.traits) is None
    assert inactive_reason("importance.tests", settings("off"), scene.traits) is not None
    assert inactive_reason("importance.important", settings("Christensen discard"), scene.traits) is None


@pytest.mark.parametrize("emission", VARIANTS)
def test_passes_are_the_same_whoever_asks(emission):
    """Other threads, cached photons, a coarse frame before; with deposition rules and one map for all passes."""
    scene = open_scene(cornell_box(size=SIZE))
    for more in ({}, {"deposition": "Keller-Wald"}, {"deposition": "density control"}):
        first = rendered(scene, settings(emission, **more), 2)
        pool, cache = WorkPool(3), StageStore(1 << 28)
        try:
            for _ in range(2):
                other = Renderer(scene, settings(emission, **more), pool, cache)
                other.coarse_frame(1)
                other.step()
                other.step()
                np.testing.assert_array_equal(first.film.sums, other.film.sums)
        finally:
            pool.close()
    once = rendered(scene, settings(emission, photons={"renew": "once"}), 2)
    assert once.frame(1).statistics.emitted <= 4000


def test_the_mean_is_that_of_other_photons():
    """Indirect light over seeds: equal with light choice, guides and all that counts photons."""
    scene = open_scene(cornell_box(size=SIZE))
    means = {}
    for emission in ("off", "Peter-Pietrek", "Christensen keep"):
        each = []
        for seed in range(8):
            chosen = settings(emission, "progressive", photons={"q": 0.5}, render={"seed": seed})
            frame = rendered(scene, chosen, 1).frame(1)
            each.append([frame.image(term).mean() for term in ("indirect", "caustic")])
        means[emission] = np.mean(each, axis=0), np.std(each, axis=0, ddof=1) / 8**0.5
    for emission in ("Peter-Pietrek", "Christensen keep"):
        (a, da), (b, db) = means[emission], means["off"]
        assert np.all(np.abs(a - b) < 4 * np.hypot(da, db))


def test_paths_of_guided_photons():
    pool = WorkPool(2)
    try:
        scene = open_scene(cornell_box(size=SIZE))
        renderer = Renderer(scene, settings("Christensen keep"), pool, StageStore(0))
        renderer.step()
        paths = renderer.inspect(Wanted(paths=50)).paths
    finally:
        pool.close()
    assert paths.n == 50
    assert (paths.counts > 1).all()


@pytest.mark.usefixtures("every_path_may_split")
def test_a_camera_that_sees_mirrors_alone():
    """Nothing is important: photons leave by power, and a sentence says so."""
    box, shown = cornell_box(), box_walls(materials=(1,) * 6)
    hidden = replace(box_walls(0.2)[2], geometry=Parallelogram((5.0, 0.0, 0.0), (0.0, 0.0, 0.2), (0.2, 0.0, 0.0)))
    black = diffuse("black", (0.0, 0.0, 0.0))
    materials = (diffuse(), MIRROR, black)
    scene = Scene("mirrors", None, (*shown, panel(material=2), hidden), materials, (), box.camera, SIZE, SIZE)
    frame = rendered(open_scene(scene), settings("Peter-Pietrek", render={"max_depth": 4}), 1).frame(1)
    assert np.isfinite(frame.beauty).all()
    assert frame.lights is None
    assert any("no place is important" in text for text in frame.statistics.warnings)


def test_too_few_photons_to_test_the_lights():
    frame = rendered(open_scene(cornell_box(size=SIZE)), settings("Christensen keep", N=500, tests=1024), 1).frame(1)
    assert frame.lights is None
    assert any("too few" in text for text in frame.statistics.warnings)
