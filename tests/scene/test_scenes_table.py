"""docs/scenes.md names what the Mitsuba reader knows, and nothing that it doesn't."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pmviewer.scene.formats.mitsuba import bsdf, emitter, shape
from pmviewer.scene.load import read_scene

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "scenes.md").read_text(encoding="utf-8")
OTHER_NAMES = {"bump", "roughdiffuse"}
"""Of version 0.6, for what the table has under another name."""
SCENE = """<scene version="3.0.0"><shape type="sphere"><bsdf type="diffuse"/></shape><emitter type="constant"/>
<sensor type="perspective"/>{}</scene>"""


def documented(element: str) -> set[str]:
    """Names of the plugins in the rows of that element of the table."""
    found: set[str] = set()
    here = False
    for line in TEXT.splitlines():
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) < 4:
            here = False
            continue
        here = cells[1] == f"`<{element}>`" or (here and cells[1] == "")
        if here and not cells[2].startswith("…"):
            found |= set(re.findall(r"`(\w+)`", re.sub(r"\([^)]*\)|:.*", "", cells[2])))
    return found


KNOWN = {
    "bsdf": set(bsdf.SIMPLE) | set(bsdf._COMPOUND),
    "emitter": {"area"} | set(emitter._READERS),
    "shape": set(shape.SUPPORTED) | {"shapegroup", "instance", "merge"},
}


@pytest.mark.parametrize("element", sorted(KNOWN))
def test_the_table_is_what_the_reader_knows(element):
    names = documented(element)
    assert names - KNOWN[element] == set()
    assert KNOWN[element] - names - OTHER_NAMES == set()


@pytest.mark.parametrize("kind", sorted(documented("bsdf")))
def test_a_documented_bsdf_is_read_as_one(kind, tmp_path):
    inside = '<bsdf type="diffuse"/>' * (2 if kind in ("blendbsdf", "mixturebsdf") else 1)
    weights = '<string name="weights" value="0.5, 0.5"/>' * (kind == "mixturebsdf")
    element = f'<shape type="rectangle"><bsdf type="{kind}">{weights}{inside * (kind in bsdf._COMPOUND)}</bsdf></shape>'
    (tmp_path / "scene.xml").write_text(SCENE.format(element))
    scene = read_scene(tmp_path / "scene.xml")
    assert not [w for w in scene.warnings if "a grey diffuse surface" in w]
    assert any(material.name == kind for material in scene.materials)


@pytest.mark.parametrize("kind", sorted(documented("emitter") - {"area", "envmap"}))
def test_a_documented_emitter_is_a_light(kind, tmp_path):
    (tmp_path / "scene.xml").write_text(SCENE.replace('<emitter type="constant"/>', f'<emitter type="{kind}"/>'))
    scene = read_scene(tmp_path / "scene.xml")
    assert scene.lights
    assert not [w for w in scene.warnings if "is not supported" in w]
