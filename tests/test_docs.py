"""The commands of the documentation are commands of this program."""

from __future__ import annotations

import re
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
    assert len(set(figure.files)) == len(figure.commands)
    assert figure.panels
    for words in figure.commands:
        assert words[:2] in (
            ("pmviewer", "shot"),
            ("pmviewer", "render"),
            ("pmviewer", "series"),
            ("pmviewer", "sweep"),
        )
        assert words[2] in {scene.name for scene in bundled_scenes()}
        load_job(words[2], [words[i + 1] for i, word in enumerate(words) if word == "--set"], [])


def test_every_picture_is_shown_and_every_shown_picture_is_there():
    text = "\n".join(path.read_text("utf-8") for path in [*DOCS.glob("*.md"), DOCS.parent / "README.md"])
    for picture in sorted((DOCS / "images").rglob("*.png")):
        assert f"{picture.relative_to(DOCS).as_posix()})" in text, f"{picture.name} is not shown anywhere"


def test_every_panel_is_shown_at_every_size():
    """Those of the window, not of the list that made the pictures."""
    from pmviewer.viewer.layout import PANELS

    text = (DOCS / "panels.md").read_text("utf-8")
    for panel in PANELS:
        for size in ("small", "usual", "large"):
            assert f"(images/panels/{panel.lower()}-{size}.png)" in text
            assert (DOCS / "images" / "panels" / f"{panel.lower()}-{size}.png").is_file()


def test_the_site_has_every_page_and_no_other():
    """Links and anchors are checked by the site's generator (`.ci/run`)."""
    listed = re.findall(r"(\w[\w-]*\.md)$", (DOCS.parent / "mkdocs.yml").read_text("utf-8"), re.MULTILINE)
    assert sorted(listed) == sorted(path.name for path in DOCS.glob("*.md"))


NAMED = [*DOCS.glob("*.md"), DOCS.parent / "README.md"]


@pytest.mark.parametrize("document", NAMED, ids=lambda path: path.name)
def test_files_that_the_documentation_names_are_there(document):
    """By their path from the repository, the package or the folder that the sentence names before."""
    there = [f"/{p.relative_to(DOCS.parent)}" for top in ("pmviewer", "tests", "docs", "scenes") for p in
             (DOCS.parent / top).rglob("*.py")]  # fmt: skip
    named = set(re.findall(r"`([\w/]+\.py)\b[^`]*`", document.read_text("utf-8")))
    assert {name for name in named if not any(path.endswith(f"/{name}") for path in there)} == set()
