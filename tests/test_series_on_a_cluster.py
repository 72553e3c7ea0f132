"""Series on a cluster: the same pictures, and none that is half done when the cluster goes."""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np
import pytest

from pmviewer.commands import series_steps
from pmviewer.commands.cli import main
from pmviewer.output.png import read_png

WORDS = ["cornell_diffuse", "--vary", "photons.N=500,1000", "--size", "12x12", "--passes", "3"]


def run(*words):
    """The exit code."""
    try:
        main([*map(str, words)])
    except SystemExit as end:
        return end.code
    return 0


def test_a_cluster_that_is_lost_leaves_no_half_picture(tmp_path, monkeypatch, capsys):
    """The first picture stays, and the second is rendered later; the film is not made."""
    rendered = []

    @contextmanager
    def lost(renderer, cluster, bar):
        def step():
            if len(rendered) == 5:
                return False
            rendered.append(renderer)
            renderer.step()
            return True

        yield step

    monkeypatch.setattr(series_steps, "passes_of", lost)
    files = ["-o", tmp_path / "p.png", "-o", tmp_path / "f.gif", "--resume"]
    assert run("series", *WORDS, *files) == 2
    assert "is not finished" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.pictures", "p_0001.png"]
    monkeypatch.undo()
    assert run("series", *WORDS, *files) == 0
    assert "1 of 2 pictures were there already" in capsys.readouterr().out


@pytest.mark.parametrize("command", ["series", "sweep"])
def test_what_is_no_cluster(tmp_path, capsys, command):
    assert run(command, *WORDS, "-o", tmp_path / "p.png", "--cluster", "somewhere") == 2
    assert "--cluster somewhere is no cluster" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.extensive
@pytest.mark.slow
def test_pictures_from_workers_are_those_of_this_process(tmp_path):
    pytest.importorskip("distributed")
    way = [
        "cornell_diffuse",
        "--vary",
        "light.1.power=1,2",
        "--set",
        "photons.N=500",
        "--size",
        "12x12",
        "--passes",
        "2",
    ]
    assert run("series", *way, "-o", tmp_path / "far.png", "--cluster", "local:1") == 0
    assert run("series", *way, "-o", tmp_path / "near.png") == 0
    for number in (1, 2):
        far, near = (read_png(tmp_path / f"{name}_{number:04d}.png")[0] for name in ("far", "near"))
        np.testing.assert_array_equal(far, near)
