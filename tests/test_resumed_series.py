"""`--resume`: finished pictures are left out, whatever else changed is rendered again, and a kill loses one picture."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from pmviewer.commands.cli import main
from pmviewer.engine.renderer import Renderer
from pmviewer.output.png import read_png

SMALL = ["--size", "12x12", "--passes", "1", "--set", "photons.N=500"]
WAY = ["--vary", "light.1.power=1..4", "--pictures", "4"]


@pytest.fixture
def steps(monkeypatch):
    """Passes that were rendered."""
    made = []
    step = Renderer.step

    def counted(self):
        made.append(self.settings)
        step(self)

    monkeypatch.setattr(Renderer, "step", counted)
    return made


def run(*words):
    """The exit code of a series of the diffuse Cornell box."""
    try:
        main(["series", "cornell_diffuse", *SMALL, *map(str, words)])
    except SystemExit as end:
        return end.code
    return 0


def pictures(folder, name="p"):
    return {path.name: path.read_bytes() for path in sorted(folder.glob(f"{name}_*"))}


def test_finished_pictures_are_left_out(tmp_path, steps, capsys):
    """And the film and the sheet made of them are the same."""
    files = ["-o", tmp_path / "p.png", "-o", tmp_path / "f.gif", "--sheet", tmp_path / "s.png", "--resume"]
    assert run(*WAY, *files) == 0
    assert len(steps) == 4
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    assert run(*WAY, *files) == 0
    assert len(steps) == 4
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before
    assert "4 of 4 pictures were there already" in capsys.readouterr().out


def test_what_is_no_more_what_it_was_is_rendered_again(tmp_path, steps, capsys):
    files = ["-o", tmp_path / "p.png", "--resume"]
    assert run(*WAY, *files) == 0
    first = pictures(tmp_path)
    (tmp_path / "p_0002.png").unlink()
    (tmp_path / "p_0003.png").write_bytes(first["p_0003.png"][:-20])
    (tmp_path / "p.pictures" / "000004.json").write_text('{"made_of": {')
    steps.clear()
    assert run(*WAY, *files) == 0
    assert len(steps) == 3
    said = capsys.readouterr().out
    for words in ("Picture 2 is rendered again", "is not there", "Picture 3 is rendered again", "is another one"):
        assert words in said
    for name, data in pictures(tmp_path).items():
        np.testing.assert_array_equal(read_png(tmp_path / name)[0], read_png_of(data, tmp_path), err_msg=name)
    steps.clear()
    assert run(*WAY, *files, "--set", "photons.q=0.5") == 0
    assert len(steps) == 4
    assert "photons.q was 1.0 and is 0.5" in capsys.readouterr().out


def read_png_of(data, folder):
    (folder / "again.png").write_bytes(data)
    return read_png(folder / "again.png")[0]


def test_pictures_of_other_settings_in_their_place_are_no_finished_ones(tmp_path, steps):
    """Kept, then rendered otherwise without --resume: the files are not what was kept."""
    files = ["-o", tmp_path / "p.png"]
    assert run(*WAY, *files, "--resume") == 0
    first = pictures(tmp_path)
    assert run(*WAY, *files, "--set", "render.seed=7") == 0
    steps.clear()
    assert run(*WAY, *files, "--resume") == 0
    assert len(steps) == 4
    for name, data in first.items():
        np.testing.assert_array_equal(read_png(tmp_path / name)[0], read_png_of(data, tmp_path))


def test_a_folder_that_is_a_file(tmp_path, capsys):
    (tmp_path / "p.pictures").write_text("mine")
    assert run(*WAY, "-o", tmp_path / "p.png", "--resume") == 2
    assert "finished pictures can't be kept there" in capsys.readouterr().err
    assert (tmp_path / "p.pictures").read_text() == "mine"


@pytest.mark.extensive
@pytest.mark.slow
def test_killed_in_mid_picture_it_goes_on(tmp_path):
    """SIGKILL at three moments: no half file, at most one picture lost, and in the end those of a run undisturbed."""
    way = ["--vary", "light.1.power=1..4", "--pictures", "8"]
    words = ["series", "cornell_diffuse", "--size", "32x32", "--set", "photons.N=20000", "--passes", "40", *way]
    files = ["-o", str(tmp_path / "p.png"), "--resume"]
    done = 0
    for wanted in (1, 3, 5):
        child = subprocess.Popen(
            [sys.executable, "-m", "pmviewer", *words, *files],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )
        limit = time.monotonic() + 120
        while len(list(tmp_path.glob("p.pictures/*.json"))) < wanted and child.poll() is None:
            assert time.monotonic() < limit
            time.sleep(0.005)
        child.send_signal(signal.SIGKILL)
        child.wait()
        kept = sorted(tmp_path.glob("p.pictures/*.json"))
        assert len(kept) >= done
        done = len(kept)
        for path in kept:
            json.loads(path.read_text())
        for path in tmp_path.glob("p_*.png"):
            assert read_png(path)[0].shape == (32, 32, 3)
    for last in (files, ["-o", str(tmp_path / "q.png")]):
        with pytest.raises(SystemExit):
            main([*words, *last])
    for number in range(1, 9):
        one, other = (read_png(tmp_path / f"{name}_{number:04d}.png")[0] for name in "pq")
        np.testing.assert_array_equal(one, other)
    assert not list(tmp_path.glob("p.pictures/.pmviewer-*"))
