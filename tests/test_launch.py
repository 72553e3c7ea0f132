"""What the launcher runs, without running it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from pmviewer import launch


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


def test_everything_else_opens_the_window(ran):
    launch.main([])
    launch.main(["office", "--set", "photons.N=1000"])
    assert ran == [
        ["python", "-m", "pmviewer", "cornell_caustic"],
        ["python", "-m", "pmviewer", "office", "--set", "photons.N=1000"],
    ]
