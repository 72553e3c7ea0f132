"""`pmviewer render --cluster`: a cluster that is lost leaves outputs, a checkpoint and a sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from pmviewer.commands.cli import main
from pmviewer.engine.cluster.passes import Elsewhere
from pmviewer.errors import ClusterError
from pmviewer.output.checkpoint_header import read_header
from pmviewer.output.exr import read_exr

pytest.importorskip("distributed")
WORDS = ["render", "cornell_diffuse", "--size", "16x12", "--set", "photons.N=2000", "--passes", "4"]


def call(output: Path, *words: str) -> int:
    try:
        main([*WORDS, "-o", str(output), *words])
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


def pictures(path: Path) -> dict[str, bytes]:
    return {name: plane.tobytes() for name, plane in read_exr(path)[0].items()}


@pytest.mark.extensive
@pytest.mark.slow
def test_a_cluster_that_is_lost_leaves_all_that_there_is(tmp_path, monkeypatch, capsys):
    assert call(tmp_path / "alone.exr") == 0
    step, kept = Elsewhere.step, tmp_path / "out.checkpoint"

    def lost(self, *arguments, **more):
        if self.renderer.passes == 2:
            raise ClusterError("The scheduler has gone.")
        return step(self, *arguments, **more)

    monkeypatch.setattr(Elsewhere, "step", lost)
    assert call(tmp_path / "out.exr", "--cluster", "local:1") == 0
    said = capsys.readouterr().err
    assert "The scheduler has gone." in said
    assert f"2 passes are kept in {kept}: go on with --resume" in said
    assert read_header(kept).passes == 2
    assert read_exr(tmp_path / "out.exr")[1]["passes"] == 2
    monkeypatch.undo()
    assert call(tmp_path / "out.exr", "--resume") == 0
    assert pictures(tmp_path / "out.exr") == pictures(tmp_path / "alone.exr")
    assert not kept.exists()


@pytest.mark.slow
def test_a_rendering_on_a_cluster_leaves_no_checkpoint(tmp_path):
    assert call(tmp_path / "out.exr", "--cluster", "local:1") == 0
    assert {file.name for file in tmp_path.iterdir()} == {"out.exr"}
