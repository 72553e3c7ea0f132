"""The code of docs/python.md runs as it stands there and prints what stands there."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from pmviewer.settings.access import SETTINGS

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "python.md").read_text("utf-8")
BLOCKS = [
    (language, text)
    for language, text in re.findall(r"^```(python|py|)\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    if language != "py"  # what needs a window
]


def numbers(text: str) -> list[float]:
    return [float(word.replace(",", "")) for word in re.findall(r"\d[\d,]*(?:\.\d+)?(?:e-?\d+)?", text)]


def test_the_code_runs_and_prints_what_the_page_says(tmp_path, monkeypatch, capsys):
    """Numbers within 5 %: another processor rounds differently."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    printed = []
    for language, text in BLOCKS:
        if language:
            exec(compile(text, "docs/python.md", "exec"), names)
            printed.append(capsys.readouterr().out)
        else:
            assert numbers(printed[-1]) == pytest.approx(numbers(text), rel=0.05)
            assert re.findall(r"[a-zA-Z]+", printed[-1]) == re.findall(r"[a-zA-Z]+", text)
    first, table, passes, settings, edited, photons = printed
    assert "float32" in first
    errors = np.array([numbers(line)[2] for line in table.splitlines()[1:]])
    assert (errors[:-1] / errors[1:] > 5).all(), "the error falls with N"
    by_passes = [float(line.split()[1]) for line in passes.splitlines()]
    assert by_passes == sorted(by_passes, reverse=True)
    assert settings == "20000 gather 8\n"
    assert not edited
    assert int(photons.split()[0]) > 100
    assert {path.name for path in tmp_path.iterdir()} == {"caustic.png", "caustic.ply"}


def test_the_page_tells_the_default_number_of_passes():
    assert f"{SETTINGS['render.passes'].default:,} passes" in PAGE
