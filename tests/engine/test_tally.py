"""What passes rendered apart have counted adds up to what one process counts."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.engine.tally import Tally
from pmviewer.settings.access import Settings, with_values

SMALL = {"camera.width": 20, "camera.height": 16, "photons.N": 3000, "gather.rays": 4}
OF_CLOCKS = {"seconds", "cpu_seconds", "stage_seconds"}


def renderer(settings: Settings, threads: int) -> Renderer:
    return Renderer(open_scene("cornell_caustic"), settings, WorkPool(threads), StageStore())


def counted(tally: Tally, rays: int, made: int = 0) -> None:
    tally.rays += rays
    if made:
        with tally.once("importons"):
            tally.rays += made
            tally.dropped["importons"] = 3


def test_what_is_made_once_counts_once():
    alone, here = Tally(), Tally()
    there = [Tally(in_parts=True), Tally(in_parts=True)]
    counted(alone, 10, made=100)
    counted(alone, 20)
    counted(there[0], 10, made=100)
    counted(there[1], 20, made=100)
    for index, tally in enumerate(there):
        here.merge(tally.take(index))
    assert here.rays == alone.rays == 130
    assert here.dropped == alone.dropped == {"photons": 0, "samples": 0, "importons": 3}
    assert there[0].rays == 0, "taken"


def test_what_is_made_for_later_passes_does_not_count_yet():
    there, here = Tally(in_parts=True), Tally()
    with there.once("importons 3", 3):
        there.rays += 7
    here.merge(there.take(2))
    assert here.rays == 0
    here.merge(there.take(3))
    assert here.rays == 7


def test_aside_counts_for_nothing():
    tally = Tally(rays=5, radius={"global": 1.0})
    with tally.aside():
        tally.rays += 10
        tally.set_maps({"global": 0.5}, 100, 10)
        with tally.once("photons"):
            tally.emitted += 3
    assert repr(tally) == repr(Tally(rays=5, radius={"global": 1.0}))


@pytest.mark.slow
@pytest.mark.parametrize(
    "values",
    [
        {"importance.map": "footprint"},
        {"render.method": "gather", "gather.cache": "on"},
        {"render.method": "virtual lights"},
        {"photons.renew": "once"},
    ],
    ids=["importance", "cache", "virtual lights", "photons once"],
)
def test_statistics_are_those_of_one_process(values):
    settings = with_values(Settings(), {**SMALL, **values})
    alone, whole = renderer(settings, 2), renderer(settings, 1)
    elsewhere = [renderer(settings, 1), renderer(settings, 1)]
    made = {}
    for other in elsewhere:
        other.tally.in_parts = True
    for index in (1, 0, 2):
        other = elsewhere[index % 2]
        made[index] = other.increment(index), other.told(), other.tally.take(index)
    for index in range(3):
        alone.step()
        increment, told, tally = made[index]
        whole.add(increment, told)
        whole.tally.merge(tally)
    one, many = alone.frame(0).statistics, whole.frame(0).statistics
    assert one.rays > 0
    for field in dataclasses.fields(one):
        if field.name not in OF_CLOCKS:
            assert repr(getattr(many, field.name)) == repr(getattr(one, field.name)), field.name
    assert many.stage_seconds.keys() == one.stage_seconds.keys()
    assert whole.latest is None
    whole.recall()
    clouds = whole.frame(0).clouds
    for name, cloud in alone.frame(0).clouds.items():
        np.testing.assert_array_equal(clouds[name].photons.view(np.uint32), cloud.photons.view(np.uint32))
    assert repr(whole.frame(0).statistics.rays) == repr(one.rays), "photons that are looked at count for nothing"
