"""docs/scenes.md names what the readers know, and nothing that they don't."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pmviewer.scene.formats import mtl, mtl_maps
from pmviewer.scene.formats.gltf.extensions import HONOURED
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


FILM = "<film type='hdrfilm'>{}</film>"
WARNED = {"perspective_rdist", "spherical", "radiancemeter", "batch"}
"""Sensors that the table says are shown as another one."""


def warnings_of(tmp_path, inside, sensor="perspective", in_sensor=""):
    """What is said of a scene with a shape that holds `inside`."""
    whole = SCENE.replace('<sensor type="perspective"/>', f'<sensor type="{sensor}">{in_sensor}</sensor>')
    (tmp_path / "scene.xml").write_text(whole.format(f'<shape type="cube">{inside}</shape>'))
    return read_scene(tmp_path / "scene.xml").warnings


def names_in(row, column=2):
    """Backticked names of a column of the rows that begin with the element."""
    cells = [line.split("|") for line in TEXT.splitlines() if line.startswith(f"| `<{row}>`")]
    return {name for cell in cells for name in re.findall(r"`(\w+)`", re.sub(r"\([^)]*\)|:.*", "", cell[column]))}


@pytest.mark.parametrize("kind", sorted({"box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"}))
def test_a_documented_filter_is_read_as_one(kind, tmp_path):
    assert kind in names_in("rfilter")
    assert warnings_of(tmp_path, "", in_sensor=FILM.format(f"<rfilter type='{kind}'/>")) == ()
    assert warnings_of(tmp_path, "", in_sensor=FILM.format("<rfilter type='wide'/>"))


@pytest.mark.parametrize("kind", ["perspective", "orthographic", "thinlens", "telecentric"])
def test_a_documented_sensor_is_one(kind, tmp_path):
    row = next(line for line in TEXT.splitlines() if line.startswith("| `<sensor>`"))
    assert f"`{kind}`" in row
    lens = '<float name="aperture_radius" value="0.1"/>' if kind in ("thinlens", "telecentric") else ""
    assert warnings_of(tmp_path, "", kind, lens) == ()
    assert all(f"`{name}`" in row for name in WARNED)
    assert warnings_of(tmp_path, "", "fisheye")


@pytest.mark.parametrize("kind", ["isotropic", "hg", "rayleigh"])
def test_a_documented_phase_function_is_one(kind, tmp_path):
    assert kind in names_in("phase")
    medium = '<medium type="homogeneous" name="interior"><phase type="{}"/></medium><bsdf type="null"/>'
    assert not [w for w in warnings_of(tmp_path, medium.format(kind)) if "phase" in w]
    assert [w for w in warnings_of(tmp_path, medium.format("sggx")) if "phase" in w]


@pytest.mark.parametrize("kind", ["regular", "irregular", "uniform", "d65"])
def test_a_documented_spectrum_is_one(kind, tmp_path):
    assert f"`{kind}`" in next(line for line in TEXT.splitlines() if '`<spectrum type="…">`' in line)
    values = {
        "regular": '<float name="wavelength_min" value="400"/><float name="wavelength_max" value="700"/>'
        '<string name="values" value="0.2, 0.3"/>',
        "irregular": '<string name="wavelengths" value="400, 700"/><string name="values" value="0.2, 0.3"/>',
    }.get(kind, "")
    spectrum = '<bsdf type="diffuse"><spectrum type="{}" name="reflectance">{}</spectrum></bsdf>'
    assert warnings_of(tmp_path, spectrum.format(kind, values)) == ()
    assert warnings_of(tmp_path, spectrum.format("measured", ""))


@pytest.mark.parametrize("kind", ["checkerboard", "gridtexture", "mesh_attribute"])
def test_a_documented_texture_is_one(kind, tmp_path):
    table = "".join(line for line in TEXT.splitlines() if line.startswith(("| `<texture>`", "| | ")))
    assert f"`{kind}`" in table
    texture = '<bsdf type="diffuse"><texture type="{}" name="reflectance">{}</texture></bsdf>'
    name = '<string name="name" value="vertex_color"/>' if kind == "mesh_attribute" else ""
    assert not [w for w in warnings_of(tmp_path, texture.format(kind, name)) if "not supported" in w]
    assert [w for w in warnings_of(tmp_path, texture.format("marble", "")) if "not supported" in w]


def test_the_extensions_of_gltf_are_named():
    """Each one that is honoured, and none that isn't as if it were."""
    section = TEXT.split("## glTF")[1].split("## OBJ")[0]
    named = set(re.findall(r"`((?:KHR|EXT|MSFT)_\w+)`", section))
    assert HONOURED - named == set()
    assert named - HONOURED == {"KHR_animation_pointer"}  # said not to be read


def test_the_statements_of_mtl_are_named():
    section = TEXT.split("## OBJ and MTL")[1].split("## PLY")[0]
    named = {word.lower() for text in re.findall(r"`([^`]+)`", section) for word in text.split()}
    assert set(mtl._KNOWN) - named == set()
    assert set(mtl_maps._USES) - named == set()
