"""What all benches found: kept, read again, and shown on one page; and what a pass would take on many threads."""

from __future__ import annotations

import math
import time

import pytest

from pmviewer.bench.collected import Kept, load, save
from pmviewer.bench.measures import everything
from pmviewer.bench.measures.threads import WatchedPool, makespan, serial_share, together
from pmviewer.bench.page import write_plot
from pmviewer.bench.report import BenchResult, Target
from pmviewer.errors import SceneError

TARGET = Target("P9", 87, 100, "ms", False, "a | b")
CURVES = BenchResult(
    "Curves", ["scene", "method", "CPU s", "relMSE"], [["box", "path", 1.0, 0.1], ["box", "path", 2.0, 0.05]], [TARGET]
)


def test_results_are_read_as_they_were_kept(tmp_path):
    odd = Target("P1", math.inf, 0.4, "s", False)
    kept = [
        Kept("rays", CURVES, "", 3.5, True, "abc"),
        Kept("lookup", BenchResult("b", ["a"], [["x"]], [odd]), "", 1.0, False, ""),
        Kept("photons", None, "it took too long", 9.0, False, ""),
    ]
    for one in kept:
        save(tmp_path, one)
    found = load(tmp_path, ["photons", "rays", "missing", "lookup"])
    assert found == [kept[2], kept[0], kept[1]]


def test_the_report_says_what_held_and_what_failed(tmp_path):
    save(tmp_path, Kept("rays", CURVES, "", 3.5, True, "abc"))
    save(tmp_path, Kept("photons", None, "it took too long", 9.0, True, "abc"))
    result = everything.report(folder=tmp_path)
    assert [list(row) for row in result.rows[:2]] == [
        ["rays", 3.5, 1, 0, ""],
        ["photons", 9.0, 0, 0, "it took too long"],
    ]
    page = (tmp_path / "benchmarks.md").read_text("utf-8")
    assert "| rays (quick) | P9 | 87 ms | ≤ 100 | held | a \\| b |" in page
    assert "it took too long" in page
    assert "revision abc" in page
    assert "P9,87,ms,100,False,True,a | b" in (tmp_path / "benchmarks.csv").read_text("utf-8")


def test_the_same_method_of_two_benches_is_two_curves(tmp_path, monkeypatch):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    drawn: list[str] = []
    draw = pyplot.Axes.loglog

    def noted(self: object, *xy: object, label: str, **how: object) -> object:
        drawn.append(label)
        return draw(self, *xy, label=label, **how)

    monkeypatch.setattr(pyplot.Axes, "loglog", noted)
    kept = [Kept(name, CURVES, "", 1.0, True, "") for name in ("error", "denoise")]
    assert write_plot(tmp_path / "images" / "curves.png", kept)
    assert drawn == ["path", "path (denoise)"]


def test_a_folder_without_results_and_a_file_that_is_none_are_said(tmp_path):
    with pytest.raises(SceneError, match="no results here"):
        everything.report(folder=tmp_path)
    (tmp_path / "rays.json").write_text("{}")
    with pytest.raises(SceneError, match="no result of a bench"):
        everything.report(folder=tmp_path)


def test_a_bench_that_fails_or_hangs_is_a_line_and_no_end(tmp_path, monkeypatch):
    monkeypatch.setattr(everything, "BENCHES", {"nothing": ("", "")})
    result = everything.run(True, tmp_path)
    assert "There is no bench 'nothing'" in str(result.rows[0][4])
    monkeypatch.setattr(everything, "LEAST", 0.01)
    everything._one("rays", tmp_path, True, 0.05)
    assert "took too long" in load(tmp_path, ["rays"])[0].failed


def test_long_benches_run_quick_and_so_do_those_that_take_too_long(tmp_path, monkeypatch):
    asked: list[tuple[str, bool]] = []

    def stand_in(name: str, folder: object, quick: bool, seconds: float) -> bool:
        asked.append((name, quick))
        return name != "slow" or quick

    monkeypatch.setattr(everything, "BENCHES", dict.fromkeys(("rays", "slow", "media", "files"), ("", "")))
    monkeypatch.setattr(everything, "_one", stand_in)
    save(tmp_path, Kept("rays", CURVES, "", 3.5, False, "abc"))
    save(tmp_path, Kept("media", CURVES, "", 3.5, True, "abc"))
    everything.run(False, tmp_path)
    assert asked == [("rays", False), ("slow", False), ("slow", True), ("media", True)]
    page = (tmp_path / "benchmarks.md").read_text("utf-8")
    assert "| rays | P9 |" in page
    assert "| media (quick) | P9 |" in page
    assert "- whole: rays\n" in page


def test_makespan_and_serial_share_are_those_of_small_examples():
    assert makespan([3, 1, 1, 1], 2) == 3
    assert makespan([1, 1, 1, 3], 2) == 4, "the long one comes last"
    assert makespan([2, 2], 8) == 2
    assert makespan([], 4) == 0
    assert serial_share(10, 5, 2) == pytest.approx(0)
    assert serial_share(10, 10, 2) == pytest.approx(1)
    assert serial_share(10, 1 + 9 / 4, 4) == pytest.approx(0.1)


def test_two_ways_share_threads_and_the_first_goes_first():
    assert together([[1], [1]], [[1, 1]], 1) == 4
    assert together([[1], [1]], [[1, 1]], 2) == 2, "what the first leaves free the second takes"
    assert together([[1], [2, 2], [1]], [], 2) == 4
    assert together([], [[3, 1], [], [1]], 2) == 4, "a step begins when the one before is through"
    assert together([[2, 2]], [[1, 1]], 2) == 3, "nothing of the second begins while the first has tasks"
    assert together([], [[1, 1, 1, 3]], 2) == together([[1, 1, 1, 3]], [], 2) == 4, "the long one comes last"
    assert together([], [], 4) == 0


def test_a_watched_pool_tells_tasks_from_the_thread_that_waits():
    def burn(seconds: float) -> None:
        end = time.thread_time() + seconds
        while time.thread_time() < end:
            pass

    pool = WatchedPool(2)
    pool.stage = "maps"
    burn(0.02)
    pool.run([lambda: burn(0.03), lambda: burn(0.01)])
    pool.stage = ""
    burn(0.02)
    pool.note()
    pool.close()
    maps = pool.stages["maps"]
    assert 0.02 <= maps.main < 0.03
    assert maps.calls[0] == pytest.approx([0.03, 0.01], rel=0.3)
    assert pool.stages["between stages"].main >= 0.02
