"""The command line as a user meets it: commands, files, one-line errors."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pmviewer.commands.choosing import wants_choice
from pmviewer.commands.cli import main
from pmviewer.commands.job import Job, Stop
from pmviewer.output.exr import read_exr
from pmviewer.output.png import read_png
from pmviewer.output.session_file import write_session
from pmviewer.settings.access import SETTINGS, Settings, with_values

QUICK = ["--passes", "2", "--size", "24x16", "--set", "photons.N=2000"]


def call(*words: str) -> int:
    """Exit code of `pmviewer WORDS`."""
    try:
        main(list(words))
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


def test_scenes_info_settings_and_bench_list(capsys):
    assert call("scenes") == 0
    assert "cornell_caustic" in capsys.readouterr().out
    assert call("info", "cornell_diffuse") == 0
    told = capsys.readouterr().out
    assert "light pass" in told
    assert "no mirror or glass" in told
    assert call("settings") == 0
    told = capsys.readouterr().out
    assert all(f"{path} = " in told for path in SETTINGS)
    assert call("bench", "list") == 0
    assert "latency" in capsys.readouterr().out


def test_automatic_mode_chooses_for_a_time_where_nobody_has():
    plain, timed = Job("cornell_diffuse", Settings()), Stop(seconds=5.0)
    assert wants_choice(timed, plain)
    assert not wants_choice(Stop(passes=5), plain)
    assert not wants_choice(timed, replace(plain, told=("photons.q",)))
    assert not wants_choice(timed, replace(plain, passes=64)), "a session file's picture was made with the defaults"
    assert wants_choice(Stop(seconds=5.0, auto=True), replace(plain, passes=64))


def test_render_tells_where_the_light_went(tmp_path, capsys):
    """Nothing leaves the closed box, and the shares add up."""
    assert call("render", "cornell_diffuse", "-o", str(tmp_path / "a.png"), "--stats", *QUICK) == 0
    told = dict(line.split("  ", 1) for line in capsys.readouterr().out.splitlines() if "  " in line)
    told = {name.strip(): text.strip() for name, text in told.items()}
    assert told["photons emitted"] == "4,000"
    shares = [float(told[f"energy {name}"].split("%")[0]) for name in ("absorbed", "escaped", "terminated", "dropped")]
    assert sum(shares) == pytest.approx(100, abs=0.01)
    assert "±" in told["energy absorbed"]


def test_render_writes_both_formats_and_the_same_for_any_threads(tmp_path, capsys):
    files = [tmp_path / f"{threads}.exr" for threads in (1, 2)]
    for threads, path in zip("12", files, strict=True):
        png = str(path.with_suffix(".png"))
        assert call("render", "cornell_caustic", "-o", str(path), "-o", png, "--threads", threads, *QUICK) == 0
    first, metadata = read_exr(files[0])
    second, _ = read_exr(files[1])
    assert first[""].shape == (16, 24, 3)
    for layer in first:
        np.testing.assert_array_equal(first[layer], second[layer])
    assert any("photons.N" in key and value == 2000 for key, value in metadata.items())
    pixels, _ = read_png(files[0].with_suffix(".png"))
    assert pixels.shape[:2] == (16, 24)
    assert pixels.max() > 100


def test_errors_against_a_reference_are_printed_while_rendering_and_by_compare(tmp_path, capsys):
    truth, again = str(tmp_path / "truth.exr"), str(tmp_path / "again.exr")
    assert call("render", "cornell_diffuse", "-o", truth, *QUICK) == 0
    capsys.readouterr()
    longer = ["--passes", "3", *QUICK[2:]]
    assert call("render", "cornell_diffuse", "-o", again, *longer, "--reference", truth) == 0
    head, *rows = capsys.readouterr().out.splitlines()[:-1]
    assert head.split()[:3] == ["pass", "seconds", "relMSE"]
    assert [int(row.split()[0]) for row in rows] == [1, 2, 3]
    errors = [float(row.split()[2]) for row in rows]
    assert errors[1] == 0, "the same two passes"
    assert errors[2] > 0
    assert call("compare", again, truth) == 0
    assert f"relMSE {errors[2]:.4e}" in " ".join(capsys.readouterr().out.split())


def test_session_file_renders_what_it_was_saved_from(tmp_path, capsys):
    settings = with_values(
        Settings(), {"photons.N": 2000, "camera.width": 24, "camera.height": 16, "render.method": "gather"}
    )
    write_session(tmp_path / "s.toml", settings, "cornell_diffuse", 2)
    assert call("render", str(tmp_path / "s.toml"), "-o", str(tmp_path / "a.exr")) == 0
    same = [*QUICK, "--set", "render.method=gather"]
    assert call("render", "cornell_diffuse", "-o", str(tmp_path / "b.exr"), *same) == 0
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr")[0][""], read_exr(tmp_path / "b.exr")[0][""])


def test_search_path_finds_what_a_scene_names(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("pmviewer.scene.load._search_paths", [])
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "utf-8")
    shape = '<shape type="obj"><string name="filename" value="t.obj"/></shape><emitter type="constant"/>'
    (tmp_path / "s.xml").write_text(f'<scene version="3.0.0">{shape}</scene>', "utf-8")
    assert call("info", str(tmp_path / "s.xml")) == 2
    assert "--search-path" in capsys.readouterr().err
    assert call("info", str(tmp_path / "s.xml"), "--search-path", str(tmp_path / "meshes")) == 0
    assert call("info", str(tmp_path / "s.xml"), "--search-path", str(tmp_path / "gone")) == 2
    assert "not a folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["render", "nowhere.xml", "-o", "x.exr"], "nowhere.xml"),
        (["render", "cornell_diffuse", "-o", "x.jpg"], "Use .exr or .png"),
        (["render", "cornell_diffuse", "-o", "no/such/x.exr"], "does not exist"),
        (["render", "cornell_diffuse", "-o", "x.exr", "--size", "big"], "WIDTHxHEIGHT"),
        (["render", "cornell_diffuse", "-o", "x.exr", "--size", "0x10"], "camera.width"),
        (["render", "cornell_diffuse", "-o", "x.exr", "--set", "photons.M=3"], "photons.M"),
        (["render", "cornell_diffuse", "-o", "x.exr", "--set", "photons.N=none"], "whole number"),
        (["render", "cornell_diffuse", "-o", "x.exr", "--passes", "2", "--time", "2"], "exclude"),
        (["render", "cornell_diffuse", "-o", "x.exr", "--passes", "2", "--error", "0.1"], "exclude"),
        (["render", "cornell_diffuse", "-o", "x.exr", "--auto", "--set", "photons.N=9"], "chooses photons.N itself"),
        (["render", "cornell_diffuse", "-o", "x.exr", "--auto", "--set", "photons.q=1"], "chooses photons.q itself"),
        (["render", "cornell_diffuse", "-o", "x.exr", "-D", "res"], "name=value"),
        (["render", "cornell_diffuse", "-o", "x.exr", "--size", "16x16", "--reference", "auto"], "256×256"),
        (["render", "cornell_diffuse", "-o", "x.exr", "--reference", "no.exr"], "no.exr"),
        (["render", "cornell_diffuse", "-o", "x.exr", "--set", "camera.fov=50", "--reference", "auto"], "own camera"),
        (["compare", "no.exr", "other.exr"], "other.exr"),
        (["bench", "nonsense"], "nonsense"),
        (["info", "broken.toml"], "broken.toml"),
    ],
)
def test_bad_input_is_one_line(words, told, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert call(*words) == 2
    shown = capsys.readouterr().err.strip()
    assert shown.startswith("pmviewer: error: ")
    assert told in shown
    assert "\n" not in shown
    assert not list(tmp_path.iterdir())


def test_without_a_screen_the_default_command_renders_to_a_file(tmp_path):
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    environment["PYTHONPATH"] = str(Path(__file__).resolve().parent.parent)
    size = ["--set", "camera.width=16", "--set", "camera.height=16", "--set", "photons.N=500"]
    run = subprocess.run(
        [sys.executable, "-m", "pmviewer", "cornell_diffuse", *size],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert "no display" in run.stderr
    assert (tmp_path / "cornell_diffuse.png").stat().st_size > 300
    assert (tmp_path / "cornell_diffuse.exr").exists()


def test_the_table_of_commands_is_light():
    """`--help` waits neither for the compiler nor for the window's libraries."""
    heavy = "{'numba', 'numpy', 'pydantic', 'rich.progress', 'moderngl', 'glfw', 'imgui_bundle', 'scipy'}"
    code = f"import sys, pmviewer.commands.cli; print(sorted({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_the_window_does_not_wait_for_the_compiler():
    """It opens while the engine is being imported behind it."""
    code = "import sys, pmviewer.viewer.app; print({'numba', 'scipy', 'trimesh', 'OpenEXR'} & {*sys.modules})"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told.strip() == "set()"


def test_the_window_is_given_scene_settings_threads_and_parameters(monkeypatch, tmp_path):
    given = {}

    def run_viewer(scene, settings, threads, parameters, snapshots, cluster, make, chosen):
        given.update(scene=scene, N=settings.photons.N, threads=threads, parameters=dict(parameters))
        given.update(snapshots=snapshots, cluster=cluster, chosen=chosen)
        return 0

    monkeypatch.setattr("pmviewer.viewer.app.run_viewer", run_viewer)
    (tmp_path / "a.exr").touch()
    options = ("--set", "photons.N=7", "--threads", "2", "-D", "res=64", "--snapshot", str(tmp_path / "a.exr"))
    options += ("--cluster", "local:2")
    assert call("a.xml", *options) == 0
    wanted = {"scene": "a.xml", "N": 7, "threads": 2, "parameters": {"res": "64"}}
    assert given == wanted | {"snapshots": ((1, tmp_path / "a.exr"),), "cluster": "local:2", "chosen": True}
    for words, chosen in ((("--set", "photons.q=1"), True), (("--set", "camera.width=64"), False), ((), False)):
        assert call("a.xml", *words) == 0
        assert given["chosen"] is chosen, "a default that is given is a choice, too"
    assert call("a.xml", "--snapshot", str(tmp_path / "none.exr")) != 0
