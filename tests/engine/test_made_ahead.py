"""All of the next pass but its picture is made while this one is rendered: the same picture, the same counts."""

import gc
import threading
import weakref
from dataclasses import asdict

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.light import LightStage
from pmviewer.engine.store import KEPT_PASSES, StageStore
from pmviewer.errors import SettingError
from pmviewer.progress import Cancelled
from pmviewer.settings.access import Settings, with_values

SMALL = {"camera.width": 24, "camera.height": 16, "photons.N": 3000, "importance.N": 400, "gather.rays": 4}
PASSES = KEPT_PASSES + 4
CASES = {
    "progressive": ("cornell_caustic", {}),
    "gather": ("cornell_caustic", {"render.method": "gather"}),
    "cache": ("cornell_diffuse", {"render.method": "gather", "gather.cache": "on"}),
    "estimation": ("cornell_diffuse", {"render.method": "gather", "gather.estimation": "on"}),
    "nearest": ("cornell_caustic", {"estimate.lookup": "nearest"}),
    "radii of pixels": ("cornell_caustic", {"estimate.radius_rule": "pixel"}),
    "density control": ("cornell_caustic", {"importance.map": "screen", "importance.deposition": "density control"}),
    "guided": ("rooms_10x10", {"importance.map": "screen", "importance.emission": "Peter-Pietrek"}),
    "shadow photons": (
        "cornell_diffuse",
        {"render.method": "gather", "direct.shadow_photons": True, "direct.shadow_N": 500},
    ),
    "Keller-Wald": ("cornell_caustic", {"importance.map": "screen", "importance.deposition": "Keller-Wald"}),
    "virtual lights": ("cornell_diffuse", {"render.method": "virtual lights", "virtual.number": 50}),
    "one map": ("cornell_caustic", {"photons.renew": "once"}),
}


def told(renderer):
    """What there is to say of the film and the latest pass, without times."""
    counts = asdict(renderer.tally)
    assert counts.pop("seconds") > 0
    stages = counts.pop("stage_seconds")
    assert sum(stages.values()) == pytest.approx(counts.pop("cpu_seconds"))
    assert min(stages.values()) > 0
    counts["stages"] = sorted(stages)
    maps, light = renderer.latest.maps, renderer.light
    counts["maps"] = maps.index, maps.bytes, dict(maps.radii), light.latest is maps
    return counts


def rendered(scene, values, threads):
    """Film, what was told after each pass, how many passes were made ahead, and the photons of the latest."""
    pool, ahead = WorkPool(threads), []
    begin = pool.begin
    pool.begin = lambda make: ahead.append(1) or begin(make)
    try:
        settings = with_values(Settings(), SMALL | values | {"render.passes": PASSES})
        renderer, after_each = Renderer(open_scene(scene), settings, pool, StageStore()), []
        while not renderer.finished:
            renderer.step()
            after_each.append(told(renderer))
        photons = renderer.light.photons
        return renderer.film.sums.copy(), after_each, len(ahead), photons.global_ if photons is not None else 0
    finally:
        pool.close()


@pytest.mark.parametrize("case", CASES)
def test_the_picture_and_the_counts_are_those_of_one_thread(case):
    film, counts, ahead, photons = rendered(*CASES[case], threads=1)
    other, others, made_ahead, other_photons = rendered(*CASES[case], threads=3)
    assert ahead == 0
    assert made_ahead == (0 if case in ("radii of pixels", "one map") else PASSES - KEPT_PASSES)
    np.testing.assert_array_equal(film, other)
    np.testing.assert_array_equal(photons, other_photons)
    np.testing.assert_equal(counts, others)


@pytest.fixture
def renderer():
    pool = WorkPool(2)
    made = Renderer(open_scene("cornell_caustic"), with_values(Settings(), SMALL), pool, StageStore())
    for _ in range(KEPT_PASSES):
        made.step()
    yield made
    pool.close()


def begun_threads():
    return [thread for thread in threading.enumerate() if thread.name == "pmviewer begun"]


def test_what_fails_ahead_is_raised_by_the_pass_that_needs_it(renderer, monkeypatch):
    """And not by the pass before, whose picture is whole."""
    run = LightStage.run

    def failing(self, index, *arguments):
        if index == KEPT_PASSES + 1:
            raise SettingError("no photons today")
        return run(self, index, *arguments)

    monkeypatch.setattr(LightStage, "run", failing)
    renderer.step()
    assert renderer.passes == KEPT_PASSES + 1
    with pytest.raises(SettingError, match="no photons today"):
        renderer.step()


def test_a_pass_made_ahead_is_not_taken_for_another(renderer):
    """A pass from elsewhere comes between: the one that was made ahead is of no use."""
    plain = rendered("cornell_caustic", {}, threads=1)[0]
    renderer.step()
    apart = Renderer(renderer.scene, renderer.settings, renderer.pool, StageStore())
    renderer.add(apart.increment(renderer.passes))
    while renderer.passes < PASSES:
        renderer.step()
    np.testing.assert_array_equal(renderer.film.sums, plain)


def test_what_nobody_wants_any_more_is_given_up_and_keeps_nothing(renderer, monkeypatch):
    """A renderer goes with all that it has, while its next pass is being made."""
    entered, go_on, traced = threading.Event(), threading.Event(), []
    run = LightStage.run

    def waiting(self, index, *arguments):
        if index <= KEPT_PASSES:
            return run(self, index, *arguments)
        entered.set()
        assert go_on.wait(10)
        try:
            made = run(self, index, *arguments)
        except Cancelled:
            raise
        traced.append(index)
        return made

    monkeypatch.setattr(LightStage, "run", waiting)
    renderer.step()
    assert entered.wait(10)
    threads = begun_threads()
    renderer.drop()
    go_on.set()
    for thread in threads:
        thread.join(10)
        assert not thread.is_alive()
    assert traced == []


def test_a_cancelled_pass_drops_the_next_one(renderer, monkeypatch):
    def cancelled(self, rendered, film):
        raise Cancelled

    monkeypatch.setattr(Renderer, "_eye_pass", cancelled)
    with pytest.raises(Cancelled):
        renderer.step()
    assert renderer._next is None


def test_cancelling_a_pass_that_is_through_loses_nothing(renderer, monkeypatch):
    """What was being made ahead of the next one is given up, and made anew."""
    plain = rendered("cornell_caustic", {}, threads=1)[0]
    may, run, close = threading.Event(), LightStage.run, Renderer._close_pass

    def waiting(self, *arguments):
        if threading.current_thread().name == "pmviewer begun":
            assert may.wait(10)
        return run(self, *arguments)

    def too_late(self):
        self.pool.cancel.set()
        may.set()
        for thread in begun_threads():
            thread.join(10)
        self.pool.cancel.clear()
        close(self)

    monkeypatch.setattr(LightStage, "run", waiting)
    monkeypatch.setattr(Renderer, "_close_pass", too_late)
    renderer.step()
    monkeypatch.undo()
    while renderer.passes < PASSES:
        renderer.step()
    np.testing.assert_array_equal(renderer.film.sums, plain)


def test_a_renderer_is_free_once_nobody_knows_it():
    pool = WorkPool(2)
    try:
        renderer = Renderer(open_scene("cornell_caustic"), with_values(Settings(), SMALL), pool, StageStore())
        for _ in range(KEPT_PASSES + 1):
            renderer.step()
        film = weakref.ref(renderer.film)
        gc.disable()
        del renderer
        for thread in begun_threads():
            thread.join(10)
        assert film() is None
    finally:
        gc.enable()
        pool.close()
