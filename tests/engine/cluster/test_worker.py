"""What runs on a worker, in this process."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine import memory
from pmviewer.engine.cluster import worker
from pmviewer.engine.cluster.packed import PackedIncrement, unpack
from pmviewer.engine.cluster.shared_memory import Segment, Written
from pmviewer.engine.cluster.worker import (
    Asked,
    Failed,
    Rendered,
    digest_of,
    hold_scene,
    packed_scene,
    packed_settings,
    render_pass,
    stop,
)
from pmviewer.engine.opened import open_scene
from pmviewer.settings.access import Settings, with_values

SMALL = {"camera.width": 8, "camera.height": 6, "photons.N": 200}


@pytest.fixture(autouse=True)
def bench(monkeypatch):
    """A worker that has nothing at hand."""
    monkeypatch.setattr(worker, "_bench", worker._Bench())
    yield worker._bench
    if worker._bench.pool is not None:
        worker._bench.pool.close()


def asked(run="run", scene="scene", index=0, **values):
    return Asked(run, scene, packed_settings(with_values(Settings(), {**SMALL, **values})), index, 1)


def test_a_few_scenes_and_renderers_are_kept(bench):
    opened = open_scene("cornell_diffuse")
    for number in range(5):
        assert hold_scene(packed_scene(opened), f"scene {number}") == digest_of(opened.flat)
        for index in range(2):
            assert isinstance(render_pass(asked(scene=f"scene {number}", index=index)), Rendered)
        assert len(bench.scenes) <= worker.KEPT_SCENES
        assert len(bench.renderers) <= worker.KEPT_RENDERERS
    assert len(bench.scenes) == worker.KEPT_SCENES
    gone = render_pass(asked(scene="scene 0"))
    assert isinstance(gone, Failed)
    assert gone.lacks_scene


def test_what_goes_wrong_is_told(monkeypatch):
    assert isinstance(hold_scene(b"no scene", "broken"), Failed)
    hold_scene(packed_scene(open_scene("cornell_diffuse")), "scene")
    monkeypatch.setattr(memory, "available_memory", lambda: 10_000)
    huge = render_pass(asked())
    assert isinstance(huge, Failed)
    assert huge.final
    assert "needs about" in huge.text
    monkeypatch.undo()
    hold_scene(packed_scene(open_scene("cornell_diffuse")), "scene")
    assert isinstance(render_pass(asked()), Rendered), "and the worker goes on"


@pytest.mark.skipif(sys.platform != "linux", reason="no such memory on this system")
@pytest.mark.parametrize("region", [False, True])
def test_whole_passes_are_written_to_memory_that_is_lent(region):
    """And what they add there is what travels otherwise; passes of a region travel."""
    hold_scene(packed_scene(open_scene("cornell_diffuse")), "scene")
    values = {"region.on": region, "region.right": 0.5, "region.bottom": 0.5}
    travels = render_pass(asked(index=1, **values))
    assert isinstance(travels.increment, PackedIncrement)
    segment = Segment(1 << 20)
    there = render_pass(replace(asked(index=1, **values), handle=segment.handle))
    assert isinstance(there.increment, PackedIncrement if region else Written)
    if not region:
        sent = unpack(travels.increment, np.zeros(there.increment.columns)).sums
        assert np.array_equal(segment.increment(there.increment).sums, sent)
    segment.close()


@pytest.mark.parametrize("values", [{}, {"overlays.global.show": True, "edit.changes": {"light.1.power": 2.0}}])
def test_settings_travel_as_what_was_changed(values):
    settings = with_values(Settings(), {**SMALL, **values})
    packed = packed_settings(settings)
    assert len(packed) < 400
    assert worker._settings(packed) == settings


def test_passes_of_a_run_that_was_stopped_are_not_rendered():
    hold_scene(packed_scene(open_scene("cornell_diffuse")), "scene")
    stop("old")
    dropped = render_pass(asked(run="old"))
    assert isinstance(dropped, Failed)
    assert dropped.cancelled
    assert isinstance(render_pass(asked(run="new")), Rendered)
