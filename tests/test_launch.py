"""What the launcher runs, without running it."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from pmviewer import installing, launch


@pytest.fixture
def ran(monkeypatch):
    """The commands that would run."""
    commands: list[list[str]] = []

    def run(command, **options):
        commands.append(command)
        return SimpleNamespace(returncode=0)

    monkeypatch.setattr(launch.subprocess, "run", run)
    monkeypatch.setattr(launch, "missing_packages", lambda testing: [])
    monkeypatch.setattr(launch, "environment_python", lambda: Path("python"))
    monkeypatch.setattr(launch, "install", lambda python, extras: None)
    return commands


def test_setup_compiles_ahead_unless_it_is_told_not_to(ran):
    assert launch.main(["setup"]) == 0
    assert ran == [["python", "-m", "pmviewer", "compile"]]
    assert launch.main(["setup", "--without-kernels"]) == 0
    assert len(ran) == 1


def test_test_runs_slow_tests_too_and_passes_options_on(ran):
    launch.main(["test", "-m", "window", "tests/viewer"])
    command = ran[0]
    assert command[:5] == ["python", "-m", "pytest", "-m", "not extensive"]
    assert command[-3:] == ["-m", "window", "tests/viewer"]
    assert "-n" in command
    launch.main(["test", "--pdb"])
    assert "-n" not in ran[1]
    launch.main(["test", "--all", "tests/maps"])
    assert ran[2][:5] == ["python", "-m", "pytest", "-m", ""]
    assert "--all" not in ran[2]


def test_tests_translate_sources_once_where_no_bytecode_is_wanted_beside_them():
    assert launch.with_bytecode({"A": "1"}) == {"A": "1"}
    kept = {"PYTHONPYCACHEPREFIX": str(launch.ENVIRONMENT / "bytecode")}
    assert launch.with_bytecode({"PYTHONDONTWRITEBYTECODE": "1"}) == kept
    own = {"PYTHONPYCACHEPREFIX": "elsewhere"}
    assert launch.with_bytecode({"PYTHONDONTWRITEBYTECODE": "1", **own}) == own


def test_sources_are_translated_even_where_python_is_told_to_write_no_bytecode(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.delenv("PYTHONPYCACHEPREFIX", raising=False)
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "module.py").write_text("x = 1\n")
    (tmp_path / "broken.py").write_text("x = \n")
    installing.to_bytecode(Path(sys.executable), tmp_path)
    assert [path.name.split(".")[0] for path in tmp_path.rglob("*.pyc")] == ["module"]


def test_everything_else_opens_the_window(ran):
    launch.main([])
    launch.main(["office", "--set", "photons.N=1000"])
    assert ran == [
        ["python", "-m", "pmviewer", "cornell_caustic"],
        ["python", "-m", "pmviewer", "office", "--set", "photons.N=1000"],
    ]


LISTED = """:env:.find-links='elsewhere'
global.cert='/certificates/all.crt'
global.constraint='bounds.txt'
global.extra-index-url='file:///one/simple file:///two/simple'
global.find-links='wheels'
list.format='columns'
install.index-url='https://packages.example/simple'
"""


def test_uv_is_told_what_pip_would_do():
    """What is set by the environment counts instead of what files say, wherever it stands."""
    options, environment = installing.as_pip_is_set(LISTED)
    assert environment == {"SSL_CERT_FILE": "/certificates/all.crt"}
    assert options == [
        *("--index-strategy", "unsafe-best-match"),
        *("--default-index", "https://packages.example/simple"),
        *("--index", "file:///one/simple", "--index", "file:///two/simple"),
        *("--find-links", "elsewhere"),
        *("--constraints", "bounds.txt"),
    ]
    assert installing.as_pip_is_set("nonsense\nglobal.cert=unquoted") == (installing.AS_PIP, {})
    assert installing.as_pip_is_set("global.no-index='true'")[0][-1] == "--no-index"


@pytest.mark.parametrize("fails", ["", "uv", "config", "--editable", "all"])
def test_where_uv_cannot_pip_installs(fails, monkeypatch, tmp_path):
    """`fails`: the command with that word does, or every one."""
    ran = []

    def run(command, **options):
        ran.append(command)
        return SimpleNamespace(returncode=int(fails == "all" or fails == command[-1] or fails in command), stdout="")

    monkeypatch.setattr(installing.subprocess, "run", run)
    translated = []
    monkeypatch.setattr(launch, "to_bytecode", lambda python, package: translated.append(package.name))
    monkeypatch.setattr(launch, "ENVIRONMENT", tmp_path)
    if fails == "all":
        with pytest.raises(SystemExit, match="pip could not install"):
            launch.install(Path("python"), "test")
    else:
        launch.install(Path("python"), "test")
        launch.install(Path("python"), "test")
    by_pip = ran[-1][1:3] == ["-m", "pip"]
    assert by_pip == (fails in ("uv", "--editable", "all"))
    assert len(ran) == {"": 3, "uv": 2, "config": 3, "--editable": 4, "all": 2}[fails]
    assert len(list(tmp_path.iterdir())) == (fails != "all")
    assert translated == ["pmviewer"] * (fails != "all")
