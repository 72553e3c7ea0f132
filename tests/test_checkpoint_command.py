"""`pmviewer render --checkpoint` and `--resume`: what is lost, what goes on, what is refused, and in which words."""

from __future__ import annotations

import errno
import os
import signal
from pathlib import Path

import pytest

from pmviewer.commands.checkpointing import seconds_of
from pmviewer.commands.cli import main
from pmviewer.engine.renderer import Renderer
from pmviewer.errors import SettingError
from pmviewer.output import array_file
from pmviewer.output.checkpoint_header import read_header
from pmviewer.output.exr import read_exr
from pmviewer.output.locked import Lock

SMALL = ["--size", "16x12", "--set", "photons.N=2000"]
NOW = ["--checkpoint", "0.0001s"]
"""After each pass."""


def call(*words: object) -> int:
    """Exit code of `pmviewer render cornell_diffuse WORDS`."""
    try:
        main(["render", "cornell_diffuse", *map(str, words)])
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


def pictures(path: Path) -> dict[str, bytes]:
    return {name: plane.tobytes() for name, plane in read_exr(path)[0].items()}


@pytest.fixture
def heard():
    """Ctrl+C is, which a process that was started in the background ignores."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def at_pass(monkeypatch):
    """Has something done while that pass is being rendered."""
    step = Renderer.step

    def when(number: int, do) -> None:
        def stepping(self: Renderer) -> None:
            if self.passes == number - 1:
                do()
            step(self)

        monkeypatch.setattr(Renderer, "step", stepping)

    yield when
    monkeypatch.undo()


def send(*signals: int):
    return lambda: [os.kill(os.getpid(), number) for number in signals]


@pytest.fixture
def whole(tmp_path):
    """An uninterrupted rendering of five passes."""
    path = tmp_path / "whole.exr"
    assert call("-o", path, "--passes", 5, *SMALL) == 0
    return pictures(path)


@pytest.fixture
def kept(tmp_path, capsys):
    """A picture of three passes whose checkpoint was kept."""
    path = tmp_path / "a.exr"
    assert call("-o", path, "--passes", 3, *SMALL, *NOW, "--keep-checkpoint") == 0
    capsys.readouterr()
    return path


def test_a_finished_rendering_goes_on_to_more_passes(kept, whole):
    assert call("-o", kept, "--passes", 5, "--resume", *SMALL) == 0
    assert pictures(kept) == whole
    assert sorted(path.name for path in kept.parent.iterdir()) == ["a.exr", "whole.exr"]


@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_signal_ends_after_the_pass_with_a_checkpoint(number, status, tmp_path, whole, at_pass, capsys, monkeypatch):
    path, words = tmp_path / "a.exr", ["-o", tmp_path / "a.exr", "--passes", 5, *SMALL, "--checkpoint", "1h"]
    at_pass(3, send(number))
    assert call(*words) == status
    assert read_header(path.with_suffix(".checkpoint")).passes == 3
    said = capsys.readouterr().err
    assert f"stopped with pass 3 in {path.with_suffix('.checkpoint')}" in said
    assert "--resume" in said
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    monkeypatch.undo()
    assert call(*words, "--resume") == 0
    assert pictures(path) == whole


def test_the_second_signal_does_not_wait_for_the_pass(tmp_path, at_pass, monkeypatch):
    path = tmp_path / "a.exr"
    words = ["-o", path, "--passes", 5, *SMALL]
    at_pass(3, send(signal.SIGTERM))
    assert call(*words, "--checkpoint", "1h") == 143
    at_pass(5, send(signal.SIGINT, signal.SIGTERM))
    assert call(*words, "--checkpoint", "1h", "--resume") == 130
    assert read_header(path.with_suffix(".checkpoint")).passes == 3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.checkpoint"]


def test_nothing_is_waited_for_when_all_is_kept(tmp_path, at_pass):
    path = tmp_path / "a.exr"
    at_pass(3, send(signal.SIGTERM))
    assert call("-o", path, "--passes", 5, *SMALL, *NOW) == 143
    assert read_header(path.with_suffix(".checkpoint")).passes == 2


def test_without_checkpoints_ctrl_c_hints_at_them(tmp_path, at_pass, heard, capsys):
    at_pass(2, send(signal.SIGINT))
    assert call("-o", tmp_path / "a.exr", "--passes", 5, *SMALL) == 130
    assert "--checkpoint 60s keeps" in capsys.readouterr().err


def test_resume_begins_where_there_is_nothing_yet(tmp_path, whole, capsys):
    path = tmp_path / "a.exr"
    assert call("-o", path, "--passes", 5, "--resume", *SMALL) == 0
    assert "no " in (said := capsys.readouterr().err)
    assert "beginning with the first pass" in said
    assert pictures(path) == whole


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([], ["holds 3 passes", "--resume"]),
        (["--resume", "--set", "photons.N=3000"], ["photons.N was 2000 and is 3000"]),
        (["--resume", "--seed", "7"], ["render.seed was 1 and is 7"]),
        (["--resume", "--size", "32x12"], ["camera.width was 16 and is 32"]),
        (["--resume", "--edit", "light.1.power=2"], ["edit.changes was nothing and is light.1.power=2"]),
        (["--resume", "--passes", "2"], ["3 passes already", "more than the 2 asked for"]),
    ],
)
def test_what_does_not_belong_together_is_refused(words, told, kept, capsys):
    before = kept.with_suffix(".checkpoint").read_bytes()
    assert call("-o", kept, "--passes", 5, *SMALL, "--checkpoint", "60s", *words) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert all(text in said[0] for text in told)
    assert kept.with_suffix(".checkpoint").read_bytes() == before


def test_info_tells_what_a_checkpoint_holds(kept, capsys):
    with pytest.raises(SystemExit):
        main(["info", str(kept.with_suffix(".checkpoint"))])
    told = dict(line.split(None, 1) for line in capsys.readouterr().out.splitlines())
    assert told["scene"] == "cornell_diffuse"
    assert told["passes"].startswith("3 in ")
    assert (told["size"], told["photons.N"]) == ("16 x 12", "2000")


def test_another_scene_is_refused_by_what_differs_in_it(kept, capsys):
    """The same name and settings, and another content."""
    other = ["cornell_caustic", "-o", kept, "--passes", "5", "--resume", *SMALL]
    with pytest.raises(SystemExit):
        main(["render", *map(str, other)])
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert "of another rendering: the scene has other shapes, materials and lights." in said[0]


def test_another_program_is_refused(kept, capsys, monkeypatch):
    from pmviewer.engine.checkpoint import checkpoint

    now = checkpoint.program()
    monkeypatch.setattr(checkpoint, "program", lambda: {**now, "version": "9.9.9"})
    assert call("-o", kept, "--passes", 5, "--resume", *SMALL) == 2
    assert f"pmviewer {now['version']}, and this is 9.9.9" in capsys.readouterr().err
    monkeypatch.setattr(checkpoint, "program", lambda: {**now, "sources": "0123"})
    assert call("-o", kept, "--passes", 5, "--resume", *SMALL) == 2
    assert f"other sources of pmviewer {now['version']} ({now['sources']}, now 0123)" in capsys.readouterr().err
    monkeypatch.setattr(checkpoint, "program", lambda: {**now, "processor": "another"})
    assert call("-o", kept, "--passes", 5, "--resume", *SMALL) == 0
    assert "last bits of the picture may differ" in capsys.readouterr().err


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04 nothing", None])
def test_a_damaged_checkpoint_is_one_sentence(data, kept, capsys):
    file = kept.with_suffix(".checkpoint")
    file.write_bytes(file.read_bytes()[:-100] if data is None else data)
    assert call("-o", kept, "--passes", 5, "--resume", *SMALL) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert "no whole checkpoint" in said[0]


def test_one_process_at_a_time(kept, capsys):
    lock = Lock(kept.with_suffix(".checkpoint"), "it")
    assert call("-o", kept, "--passes", 5, "--resume", *SMALL) == 2
    assert f"in use by process {os.getpid()}" in capsys.readouterr().err
    lock.release()
    assert call("-o", kept, "--passes", 5, "--resume", *SMALL) == 0


def test_a_full_disk_costs_no_more_than_a_warning(kept, whole, capsys, monkeypatch):
    """The checkpoint from before stays, rendering goes on, and that is said once."""
    before, file = kept.with_suffix(".checkpoint").read_bytes(), kept.with_suffix(".checkpoint")
    write = array_file._write

    def full(entry, array):
        write(entry, array)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(array_file, "_write", full)
    words = ["-o", kept, "--passes", 5, "--resume", *SMALL, *NOW, "--keep-checkpoint"]
    assert call(*words) == 0
    assert capsys.readouterr().err.count("no room on the disk") == 1
    assert pictures(kept) == whole
    assert file.read_bytes() == before


def test_an_output_that_cannot_be_written_costs_no_pass(tmp_path, whole, capsys, monkeypatch):
    """And what a killed process has left half-written does not stay."""
    from pmviewer.commands import rendering
    from pmviewer.errors import OutputError

    def full(*_, **__):
        raise OutputError("a.exr: no room on the disk.")

    path = tmp_path / "a.exr"
    left = tmp_path / ".pmviewer-a.checkpoint.tmp"
    left.write_bytes(b"half")
    monkeypatch.setattr(rendering, "write_frame_exr", full)
    words = ["-o", path, "--passes", 5, *SMALL, "--checkpoint", "1h"]
    assert call(*words) == 2
    assert "5 passes are kept" in capsys.readouterr().err
    assert not left.exists()
    assert read_header(path.with_suffix(".checkpoint")).passes == 5
    monkeypatch.undo()
    assert call(*words, "--resume") == 0
    assert pictures(path) == whole


def test_time_goes_on_counting(tmp_path, at_pass, monkeypatch):
    path, words = tmp_path / "a.exr", ["-o", tmp_path / "a.exr", "--as-set", *SMALL, "--checkpoint", "1h"]
    at_pass(3, send(signal.SIGTERM))
    assert call(*words, "--time", "1000") == 143
    monkeypatch.undo()
    assert call(*words, "--time", "0.001", "--resume") == 0
    assert read_exr(path)[1]["passes"] == 3


@pytest.mark.usefixtures("every_path_may_split")
def test_what_automatic_mode_has_chosen_stays(tmp_path, at_pass, monkeypatch, capsys):
    """Without a trial, for a short time; and more time may be given later."""
    path, words = tmp_path / "a.exr", ["-o", tmp_path / "a.exr", "--size", "16x12", "--checkpoint", "1h"]
    at_pass(2, send(signal.SIGTERM))
    assert call(*words, "--time", "0.5") == 143
    head = read_header(path.with_suffix(".checkpoint"))
    assert head.automatic
    monkeypatch.undo()
    capsys.readouterr()
    assert call(*words, "--passes", "3", "--resume") == 0
    assert "automatic:" not in capsys.readouterr().err
    assert read_exr(path)[1]["gather.cache"] == "on"
    assert head.settings.gather.cache == "on"


def test_times():
    assert [seconds_of(text) for text in ("60s", "10min", "1h", "90", "1.5 min", "0.5s")] == [
        60,
        600,
        3600,
        90,
        90,
        0.5,
    ]
    for text in ("0", "-5s", "soon", "5 days", "", "1e3s", "nan"):
        with pytest.raises(SettingError, match="60s, 10min or 1h"):
            seconds_of(text)


def test_the_first_pass_is_kept_whatever_the_interval(tmp_path, at_pass):
    """It may have had to compile: a rendering that is killed soon afterwards has lost nothing of it."""
    seen = []
    path = tmp_path / "a.checkpoint"
    at_pass(3, lambda: seen.append(read_header(path).passes))
    assert call("-o", tmp_path / "a.exr", "--passes", 3, *SMALL, "--checkpoint", "10h") == 0
    assert seen == [1]
