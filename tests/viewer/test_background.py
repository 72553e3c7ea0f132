"""Work beside the window: guarded, one after the other in a lane, cancelled or finished when the window closes."""

from __future__ import annotations

import threading
import time
import weakref

import pytest

from pmviewer.errors import OutputError
from pmviewer.progress import check
from pmviewer.viewer.background import COMPARING, FILES, MEASURING, Background


@pytest.fixture
def said() -> list[tuple[str, str]]:
    return []


@pytest.fixture
def background(said):
    return Background(lambda level, text: said.append((level, text)))


def raising(error):
    def work():
        raise error

    return work


def test_results_and_errors_are_one_sentence_each(background, said):
    woken = threading.Event()
    background.on_done = woken.set
    background.start(FILES, "writing EXR", lambda: "wrote picture.exr")
    assert woken.wait(10)
    background.start(FILES, "writing EXR", raising(OutputError("picture.exr: the disk is full. Free some space.")))
    background.start(FILES, "writing EXR", raising(ValueError("odd")))
    background.start(FILES, "writing EXR", raising(MemoryError()))
    background.start(FILES, "writing EXR", lambda: "")
    assert background.finish()
    assert said == [
        ("info", "wrote picture.exr"),
        ("error", "picture.exr: the disk is full. Free some space."),
        ("error", "writing EXR: unexpected ValueError: odd"),
        ("error", "writing EXR: not enough memory."),
    ]
    assert background.running() == []


def test_a_lane_does_one_thing_after_the_other_and_lanes_do_not_wait_for_each_other(background, said):
    go, first, order = threading.Event(), threading.Event(), []

    def slow():
        first.set()
        go.wait(10)
        order.append("slow")
        return ""

    background.start(FILES, "slow", slow)
    quick = background.start(FILES, "quick", lambda: order.append("quick") or "")
    assert first.wait(10)
    other = background.start(MEASURING, "other", lambda: order.append("other") or "")
    assert other.done.wait(10)
    assert [work.title for work in background.running(FILES)] == ["slow", "quick"]
    assert not quick.done.is_set()
    go.set()
    assert quick.done.wait(10)
    assert order == ["other", "slow", "quick"]


def test_what_is_cancelled_ends_with_a_line_in_the_log(background, said):
    asked, stopped = threading.Event(), threading.Event()

    def looking():
        asked.set()
        while True:
            check()
            time.sleep(0.001)

    work = background.start(MEASURING, "measuring", looking)
    waiting = background.start(MEASURING, "never begun", lambda: "begun")
    begun = threading.Event()
    other = background.start(COMPARING, "comparing", lambda: begun.set() or str(stopped.wait(10)), stop=stopped.set)
    assert asked.wait(10)
    assert begun.wait(10)
    for each in (waiting, work, other):
        each.cancel()
    assert all(each.done.wait(10) for each in (work, waiting, other))
    assert set(said) == {("info", "measuring: cancelled."), ("info", "True")}


def test_a_closing_window_finishes_files_and_leaves_the_rest(background, said):
    written, never = threading.Event(), threading.Event()

    def write():
        time.sleep(0.3)
        written.set()
        return "wrote it"

    background.start(FILES, "writing", write)
    begun_it = threading.Event()

    def listening_to_nobody():
        begun_it.set()
        never.wait(60)
        return ""

    deaf = background.start(MEASURING, "deaf", listening_to_nobody)
    assert begun_it.wait(10)
    begun = time.monotonic()
    assert not background.finish(patience=0.2)
    assert time.monotonic() - begun < 30
    assert written.is_set()
    assert said == [("info", "wrote it")]
    assert deaf.running
    assert deaf.cancelled
    late = background.start(MEASURING, "too late", lambda: "begun")
    assert not late.running
    kept = background.start(FILES, "kept", lambda: "wrote another")
    assert kept.done.wait(10)
    assert said[1:] == [("info", "wrote another")]
    never.set()
    assert deaf.done.wait(10)


def test_work_that_is_done_holds_nothing_of_what_it_was_done_with(background):
    """Whoever started it may keep it: a scene would stay in memory with it."""

    class Scene:
        pass

    scene = Scene()
    gone = weakref.ref(scene)
    work = background.start(COMPARING, "comparing", lambda of=scene: f"{of is not None}", stop=lambda of=scene: None)
    assert work.done.wait(10)
    del scene
    until = time.monotonic() + 10
    while gone() is not None and time.monotonic() < until:  # the thread is at its last words
        time.sleep(0.01)
    assert gone() is None
    work.cancel()
