"""Compiling ahead: which clicks there are, in which process, when it begins and how it ends."""

from __future__ import annotations

import json
import threading
import time
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from pmviewer.commands import compiling
from pmviewer.engine import prepare
from pmviewer.engine.ahead import ahead as ahead_module
from pmviewer.engine.ahead import child
from pmviewer.engine.ahead.ahead import Ahead
from pmviewer.engine.ahead.beside import compile_beside
from pmviewer.engine.ahead.clicks import clicks, other_kinds, type_of_record
from pmviewer.engine.ahead.helper import Helper
from pmviewer.engine.ahead.requests import Clicks, NextSteps
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.session import Session
from pmviewer.errors import PmviewerError
from pmviewer.kernels.accel.bvh import build, builder_kernels
from pmviewer.kernels.compile import jit
from pmviewer.settings.access import Settings, with_values
from tests.support.scenes import diffuse_box, settings_of

PATIENCE = 300.0


@pytest.fixture(scope="module")
def box():
    return open_scene(diffuse_box(size=8))


@pytest.fixture(scope="module")
def at_the_start(box):
    """The clicks from the defaults."""
    return clicks(box, Settings())


def test_clicks_are_those_that_run_something_else(at_the_start):
    found = {click.text: click.settings for click in at_the_start}
    assert next(iter(found)) == ""
    assert {"render.method = gather", "render.method = path", "estimate.lookup = nearest"} <= found.keys()
    assert found["estimate.lookup = nearest"] == with_values(Settings(), {"estimate.lookup": "nearest"})
    assert not [text for text in found if text.startswith(("free_camera.", "display.tone", "render.passes"))]
    assert [text for text in found if text.startswith("camera.")] == ["camera.aperture: most"], "a lens"
    assert "render.filter = tent" in found


def test_from_another_state_other_clicks_matter(box, at_the_start):
    """What only gathering uses is one click away from gathering alone."""
    here = {click.text for click in at_the_start}
    there = {click.text for click in clicks(box, settings_of(render={"method": "gather"}))}
    assert {"gather.directions = photon cones", "render.method = progressive"} <= there - here


def test_what_a_trial_tries_is_compiled_after_the_methods(at_the_start):
    """The irradiance cache is more than one click away, and automatic mode tries it."""
    found = at_the_start
    ways = [n for n, click in enumerate(found) if click.text.startswith("automatic mode: ")]
    assert any(found[n].settings.gather.cache == "on" for n in ways)
    assert all(click.text.startswith("render.") for click in found[1 : ways[0]])


@pytest.mark.usefixtures("every_path_may_split")
def test_after_its_clicks_nothing_is_left_to_compile(box, at_the_start):
    """A click is a picture as the window makes it: what it has rendered small, the session renders large."""
    click = next(each for each in at_the_start if each.text == "estimate.lookup = nearest")
    pool = WorkPool(1)
    click.run(pool)
    pool.close()
    before = jit_misses()
    session = Session(1, with_values(click.settings, {"render.passes": 1}))
    session.open(box.scene)
    assert session.wait(1, PATIENCE)
    session.close()
    assert jit_misses() == before


def jit_misses() -> int:
    """Functions that this process had to compile, because nobody had."""
    import gc

    # By the type: isinstance asks a weak proxy for what it stood for, which may be gone.
    kernels = [each for each in gc.get_objects() if issubclass(type(each), jit._KernelDispatcher)]
    return sum(sum(each.stats.cache_misses.values()) for each in kernels)


@pytest.mark.extensive
def test_other_kinds_of_scenes_have_other_records(box):
    found = other_kinds(box.flat.record.dtype, Settings())
    kinds = [open_scene(each.scene).flat.record.dtype for each in found]
    assert kinds == [type_of_record(each.scene) for each in found]
    assert len({str(kind) for kind in kinds}) == len(kinds) >= 2
    assert box.flat.record.dtype not in kinds


def test_a_helper_compiles_the_eye_pass_from_types_alone(box):
    helper = Helper()
    helper.ask(NextSteps(box.flat.record.dtype, box.traits, Settings()))
    helper.wait()
    assert helper._process.returncode == 0


def test_a_waiting_helper_compiles_the_tree_builder_for_all_scenes():
    kernels = [call.args[1] for call in builder_kernels()]
    build(np.random.default_rng(2).uniform(-1, 1, (20, 3, 3)).astype(np.float32), np.zeros((0, 12), np.float32))
    assert {kernel.py_func.__name__ for kernel in kernels} == {"collapse", "plan_range", "subtree", "triangle_boxes"}
    for call in builder_kernels():
        call()
    assert [len(kernel.signatures) for kernel in kernels] == [1] * 4, "other types than those of a tree's own"


def test_a_helper_tells_how_far_it_is(box, at_the_start):
    heard = []
    helper = Helper()
    every = len(at_the_start) + 50  # the first alone
    helper.ask(Clicks(box.scene, box.flat.record.dtype, Settings(), every), lambda: heard.append(helper.progress))
    helper.wait()
    assert helper.finished
    assert (heard[0].part, heard[0].of, heard[0].text) == (1, 1, "")
    assert heard[-1] is None


def test_a_stand_in_that_compiles_something_else_is_refused(box, capsys):
    """In this process, without a start: a helper is finished when it has said "done"."""
    child.all_clicks(Clicks(box.scene, np.dtype([("other", "i8")]), Settings()))
    assert [list(json.loads(line)) for line in capsys.readouterr().out.splitlines()] == [["failed"]]


def test_a_helper_ends_with_its_parent_and_at_once_when_stopped():
    helper = Helper()
    assert helper._process.poll() is None
    helper._process.stdin.close()
    assert helper._process.wait(PATIENCE) != 0  # nobody asked it for anything
    helper.stop()
    helper = Helper()
    helper.stop()
    assert helper._process.poll() is not None


class Fake:
    """Stands for the helper process: waits until it is stopped or told to finish."""

    made: ClassVar[list[Fake]] = []

    def __init__(self) -> None:
        self.request, self.finished, self.stopped = None, False, False
        self.progress = SimpleNamespace(part=3, of=20, text="estimate.lookup = nearest")
        self._ended = threading.Event()
        Fake.made.append(self)

    def ask(self, request, on_change=lambda: None):
        self.request = request
        on_change()

    def wait(self):
        self._ended.wait(PATIENCE)

    def finish(self):
        self.finished, self.progress = True, None
        self._ended.set()

    def stop(self):
        self.stopped, self.progress = True, None
        self._ended.set()


@pytest.fixture
def quick(monkeypatch, tmp_path):
    """No waiting for quiet, no processes, marks of its own."""
    monkeypatch.setattr(ahead_module, "QUIET", 0.0)
    monkeypatch.setattr(ahead_module, "Helper", Fake)
    monkeypatch.setattr(ahead_module, "CACHE_FOLDER", tmp_path)
    Fake.made = []


def until(condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_it_begins_when_it_is_quiet_and_is_not_done_twice(box, quick):
    heard = threading.Event()
    ahead = Ahead(2, heard.set)
    ahead.shown(box, Settings())
    until(lambda: Fake.made)
    assert heard.wait(PATIENCE)
    assert ahead.text == "estimate.lookup = nearest (3 of 20)"
    assert Fake.made[0].request.record == box.flat.record.dtype
    Fake.made[0].finish()
    until(lambda: ahead_module.finished_mark(box.flat.record.dtype, Settings()).exists())
    assert ahead.text == ""
    again = Ahead(2, lambda: None)
    again.shown(box, Settings())
    again._timer.join()
    assert len(Fake.made) == 1


def test_a_change_waits_for_what_is_being_compiled_and_comes_next(box, quick):
    ahead = Ahead(2, lambda: None)
    ahead.shown(box, Settings())
    until(lambda: Fake.made)
    ahead.shown(box, settings_of(render={"method": "gather"}))
    Fake.made[0].finish()
    until(lambda: len(Fake.made) == 2)
    assert Fake.made[1].request.settings.render.method == "gather"
    ahead.close()
    assert Fake.made[1].stopped


def test_stopping_lasts_until_something_is_changed(box, quick):
    ahead = Ahead(2, lambda: None)
    ahead.shown(box, Settings())
    until(lambda: Fake.made)
    ahead.stop()
    assert Fake.made[0].stopped
    ahead.shown(box, Settings())
    assert ahead._timer is None
    ahead.shown(box, settings_of(render={"method": "path"}))
    until(lambda: len(Fake.made) == 2)
    ahead.close()


def test_the_setting_turns_it_off(box, quick):
    ahead = Ahead(2, lambda: None)
    ahead.shown(box, settings_of(display={"compile_ahead": False}))
    assert ahead._timer is None


def test_where_nobody_clicks_nothing_is_compiled_for_it(box, quick):
    ahead = Ahead(2, lambda: None, clicks=False)
    ahead.shown(box, Settings())
    assert ahead._timer is None


def test_a_change_of_a_number_is_no_other_state(box, quick):
    ahead = Ahead(2, lambda: None)
    ahead.shown(box, Settings())
    until(lambda: Fake.made)
    ahead.shown(box, settings_of(photons={"N": 12345}))
    Fake.made[0].finish()
    until(lambda: not ahead.text)
    assert len(Fake.made) == 1


def test_a_helper_that_waits_is_used_or_ended(box, quick, monkeypatch):
    """It was started before it was known whether there is something to compile."""
    waiting = Fake()
    monkeypatch.setattr(prepare.Step, "is_kept", False)
    assert compile_beside(waiting, box.flat.record.dtype, box.traits, Settings(), 2) is waiting
    assert isinstance(waiting.request, NextSteps)
    needless = Fake()
    monkeypatch.setattr(prepare.Step, "is_kept", True)
    assert compile_beside(needless, box.flat.record.dtype, box.traits, Settings(), 2) is None
    assert needless.stopped


def test_compile_shares_the_clicks_among_processes(quick, monkeypatch, capsys):
    monkeypatch.setattr(compiling, "Helper", Ready)
    monkeypatch.setattr(compiling, "available_threads", lambda: 3)
    compiling.compile_clicks("cornell_caustic")
    assert [(each.request.every, each.request.offset) for each in Fake.made] == [(3, 0), (3, 1), (3, 2)]
    assert capsys.readouterr().out.splitlines() == ["compiling estimate.lookup = nearest"] * 3
    compiling.compile_clicks("cornell_caustic")
    assert len(Fake.made) == 3, "what is marked as done is not done again"


def test_compile_says_when_a_process_failed(quick, monkeypatch):
    monkeypatch.setattr(compiling, "Helper", Failing)
    with pytest.raises(PmviewerError, match="not compiled ahead"):
        compiling.compile_clicks("cornell_caustic")


class Ready(Fake):
    """Done at once."""

    def wait(self):
        self.finish()


class Failing(Fake):
    """Dies."""

    def wait(self):
        self.stop()
