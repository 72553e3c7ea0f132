"""Benches are found by name and their results reach the screen and the files."""

from __future__ import annotations

import importlib.util
import sys
from types import ModuleType

import pytest

from pmviewer.bench import registry
from pmviewer.bench.report import BenchResult, Target, to_csv, to_markdown
from pmviewer.errors import OutputError, SettingError

RESULT = BenchResult("Bench", ["a"], [[1.5]], [Target("P9", 87, 100, "ms", False)])


@pytest.fixture
def calls(monkeypatch) -> list[bool]:
    """Registers a bench `sample` and records with which `quick` it was called."""
    seen: list[bool] = []

    def run(quick: bool = False) -> BenchResult:
        seen.append(quick)
        return RESULT

    module = ModuleType("sample_bench")
    module.run = run  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "sample_bench", module)
    monkeypatch.setitem(registry.BENCHES, "sample", ("a sample", "sample_bench:run"))
    return seen


def test_every_bench_exists():
    for description, place in registry.BENCHES.values():
        assert description
        assert importlib.util.find_spec(place.partition(":")[0]) is not None, place


def test_result_is_printed_and_written(tmp_path, calls, capsys):
    csv_path, markdown_path = tmp_path / "a.csv", tmp_path / "a.md"
    assert registry.run_bench("sample", True, csv_path, markdown_path) is RESULT
    assert calls == [True]
    assert "TARGET P9 87 ms <= 100 ms ok" in capsys.readouterr().out
    assert csv_path.read_bytes().decode() == to_csv(RESULT)
    assert markdown_path.read_text("utf-8") == to_markdown(RESULT)


def test_unknown_bench_is_answered_with_the_known_ones():
    with pytest.raises(SettingError, match=r"There is no bench 'speed'\. There are rays, instances, lookup"):
        registry.run_bench("speed")


def test_wrong_file_name_is_found_before_the_bench_runs(tmp_path, calls):
    with pytest.raises(OutputError, match=r"Use \.csv"):
        registry.run_bench("sample", csv_path=tmp_path / "a.txt")
    with pytest.raises(OutputError, match="does not exist"):
        registry.run_bench("sample", markdown_path=tmp_path / "none" / "a.md")
    assert calls == []
