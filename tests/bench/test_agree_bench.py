"""What a run tells, keeps and survives; the command's options. Without Mitsuba."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pmviewer.bench import peer
from pmviewer.bench.agree import bench, results, triage
from pmviewer.bench.agree.generate import scene_of
from pmviewer.bench.agree.known import DEVIATIONS
from pmviewer.bench.agree.tree import from_json
from pmviewer.bench.agree.trial import STAGES
from pmviewer.bench.agree.verdict import DIED, Verdict
from pmviewer.bench.agree.workers import try_scenes
from pmviewer.bench.registry import run_bench
from pmviewer.errors import OutputError, PmviewerError, SettingError
from pmviewer.scene.load import load_scene
from tests.support.agreeing import comparison


def test_a_disagreement_is_saved_and_reported_and_chance_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "smallest", lambda scene, found, salt, most: scene)
    verdicts = {
        0: Verdict([comparison("path", 0.009), comparison("gather", 0.5)], lit=1),
        1: Verdict([comparison("path", 1e-9), comparison("nearest", 1e-9)], lit=1),
        2: Verdict([comparison("gather", 1e-9, known="textured light")], lit=1),
        3: Verdict(refused="Mitsuba 3: no"),
    }
    found = bench.judged(7, verdicts, tmp_path)
    assert {d.index: (d.known, d.methods[:1]) for d in found} == {
        1: ("", ("path",)),
        2: ("textured light", ("gather",)),
        3: ("", ("path",)),
    }
    file = next(d.file for d in found if d.index == 1)
    assert load_scene(file).shapes
    saved = json.loads((tmp_path / "scene_7_1.json").read_text())
    assert saved["shows"]["method"] == "path"
    assert from_json(json.dumps(saved["scene"])) == triage.without_all(scene_of(7, 1))
    result = bench.report(7, verdicts, found, "abc (4)", 12.0)
    target = result.targets[0]
    assert (target.value, target.ok) == (2, False)
    rows = {row[0]: row for row in result.rows}
    assert rows["all"][1] == 4
    assert rows["all"][3:12] == [2, 1, 1, 2, 1, 1, 1, 1, 1]
    assert any(file in note for note in result.notes)
    assert all(any(d.name in note for note in result.notes) for d in DEVIATIONS)
    agreed = bench.report(7, {0: verdicts[0]}, [], "abc (1)", 1.0)
    assert agreed.targets[0].ok


def test_verdicts_are_kept_and_a_run_goes_on_from_them(tmp_path, monkeypatch):
    """Pieces at two revisions; what was not finished, another effort or another seed does not count."""
    path, ran = tmp_path / "kept.json", []

    def tries(seed, indices):
        for index in indices:
            ran.append(index)
            yield index, Verdict([comparison("path", 1e-9 if index == 1 else 0.5, float(index))], lit=0.5)

    def run(scenes, seed=7, **more):
        ran.clear()
        return bench.run(scenes=scenes, seed=seed, json=path, **more)

    monkeypatch.setattr(peer, "installed", lambda: True)
    monkeypatch.setattr(bench, "try_scenes", tries)
    monkeypatch.setattr(bench, "smallest", lambda scene, found, salt, most: scene)
    monkeypatch.setattr(results, "revision", lambda: "aaa")
    first = run(2)
    assert ran == [0, 1]
    assert first.targets[0].value == 1
    path.write_text(path.read_text() + '{"seed": 7, "scene": 3, "verdi')
    monkeypatch.setattr(results, "revision", lambda: "bbb-dirty")
    monkeypatch.setattr(results, "sources_stamp", lambda: "0123456789")
    whole = run(4)
    assert ran == [2, 3]
    assert whole.rows[0][1] == 4
    assert whole.targets[0].value == 1
    assert "scenes by revision: aaa (2), bbb-dirty 01234567 (2)" in whole.notes
    monkeypatch.setattr(bench, "smallest", lambda *_: pytest.fail("it has been shrunk before"))
    assert run(4).rows == whole.rows
    assert ran == []
    monkeypatch.setattr(bench, "smallest", lambda scene, found, salt, most: scene)
    assert "scenes by revision: bbb-dirty 01234567 (4)" in run(4, again=True).notes
    assert ran == [0, 1]
    run(1, seed=8)
    assert ran == [0]
    monkeypatch.setattr(results, "STAGES", STAGES[:2])
    run(1)
    assert ran == [0]


def test_verdicts_whose_reason_is_no_longer_known_and_processes_that_died_are_not_kept(tmp_path):
    path = tmp_path / "kept.json"
    kept = results.Results(path, 7)
    kept.keep(1, Verdict([comparison("path", 1e-9, known="a deviation of the past")]))
    kept.keep(2, Verdict([comparison("path", 0.0, math.nan, known="textured light + vertex normals")], lit=0.25))
    kept.keep(3, Verdict(refused=DIED))
    again = results.Results(path, 7).kept({1, 2, 3})
    assert list(again) == [2]
    assert repr(again[2]) == repr(kept.kept({2})[2])  # NaN equals nothing
    with pytest.raises(OutputError, match="results can't be kept"):
        results.Results(tmp_path, 7)


WORK = """
import os
from pmviewer.bench.agree.verdict import Verdict

def work(seed, index):
    if index == 2:
        os._exit(3)
    return Verdict(lit=seed + index)
"""


def test_a_scene_that_kills_its_process_is_named_and_the_others_are_done(tmp_path, monkeypatch):
    (tmp_path / "agree_work_for_tests.py").write_text(WORK)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *(p for p in sys.path if p)]))
    from agree_work_for_tests import work

    found = dict(try_scenes(10, range(1, 5), work, processes=2))
    assert sorted(found) == [1, 2, 3, 4]
    assert found[2].refused == "the process died"
    assert [found[i].lit for i in (1, 3, 4)] == [11, 13, 14]


def test_missing_mitsuba_and_senseless_numbers_are_one_clear_error(monkeypatch):
    monkeypatch.setattr(peer, "installed", lambda: False)
    with pytest.raises(PmviewerError, match="pip install"):
        run_bench("agree", options={"scenes": 1})
    with pytest.raises(SettingError, match="at least one scene"):
        run_bench("agree", options={"scenes": 0})


def test_options_reach_the_bench_that_has_them_alone(monkeypatch):
    with pytest.raises(SettingError, match="'rays' has no option --seed"):
        run_bench("rays", options={"seed": 3, "scenes": None})


ORPHAN = """
import os, sys, time
from multiprocessing import get_context
from pmviewer.bench.agree.process import end_with

def child(parent):
    end_with(parent)
    print(os.getpid(), flush=True)
    time.sleep(60)

if __name__ == "__main__":
    get_context("spawn").Process(target=child, args=(os.getpid(),)).start()
"""


def test_workers_end_with_a_bench_that_was_killed(tmp_path):
    script = tmp_path / "orphan.py"
    script.write_text(ORPHAN)
    bench_process = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    assert bench_process.stdout is not None
    with bench_process.stdout as said:
        worker = int(said.readline())
    bench_process.kill()
    bench_process.wait()
    for _ in range(100):
        status = Path(f"/proc/{worker}/stat")
        if not status.exists() or status.read_text().rpartition(")")[2].split()[0] == "Z":
            return
        time.sleep(0.1)
    os.kill(worker, signal.SIGKILL)
    pytest.fail("the worker outlived its bench by ten seconds")
