"""The commands of the documentation are commands of this program."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from pmviewer.commands.job import load_job
from pmviewer.scene.load import bundled_scenes

DOCS = Path(__file__).resolve().parents[1] / "docs"
_MAKER = runpy.run_path(str(DOCS / "figures.py"))
FIGURES = [figure for text in _MAKER["TEXTS"] for figure in _MAKER["figures"]((DOCS / text).read_text("utf-8"))]


@pytest.mark.parametrize("figure", FIGURES, ids=lambda figure: figure.name)
def test_commands_of_figures_name_scenes_and_settings_that_there_are(figure):
    assert (DOCS / "images" / f"{figure.name}.png").is_file()
    assert len(set(figure.panels)) == len(figure.commands) >= 1
    for words in figure.commands:
        assert words[:2] in (("pmviewer", "shot"), ("pmviewer", "render"))
        assert words[2] in {scene.name for scene in bundled_scenes()}
        load_job(words[2], [words[i + 1] for i, word in enumerate(words) if word == "--set"], [])


def test_every_picture_is_shown_and_every_shown_picture_is_there():
    text = "\n".join(path.read_text("utf-8") for path in [*DOCS.glob("*.md"), DOCS.parent / "README.md"])
    for picture in sorted((DOCS / "images").iterdir()):
        assert f"images/{picture.name})" in text, f"{picture.name} is not shown anywhere"
