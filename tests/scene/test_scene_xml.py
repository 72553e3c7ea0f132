"""Lines, parameters and references of scene files."""

from pathlib import Path

import pytest

from pmviewer.errors import SceneError
from pmviewer.scene.description import Sphere
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.mitsuba.expand import Expansion
from pmviewer.scene.formats.mitsuba.folders import Folders
from pmviewer.scene.formats.mitsuba.xml import Element, parse_xml
from pmviewer.scene.load import read_scene
from tests.scene.helpers import load


def expanded(root: Element, **parameters: str) -> tuple[str, ...]:
    """Put the parameters into the tree; the warnings."""
    diagnostics = Diagnostics()
    Expansion(parameters, Folders(Path()), diagnostics).expand(root, None)
    return diagnostics.warnings()


def test_elements_know_their_line() -> None:
    root = parse_xml(b"<scene>\n  <shape\n    type='cube'/>\n\n<bsdf/></scene>")
    assert [(c.tag, c.line) for c in root.children] == [("shape", 2), ("bsdf", 5)]


def test_parameters_replace_defaults_and_the_longest_name_wins(tmp_path: Path) -> None:
    lines = (
        '<default name="r" value="1"/>',
        '<default name="radius" value="2"/>',
        '<shape type="sphere"><float name="radius" value="$radius"/><point name="center" value="$r 0 0"/></shape>',
    )
    shape = load(tmp_path, *lines).shapes[0].geometry
    assert isinstance(shape, Sphere)
    assert (shape.center, shape.radius) == ((1, 0, 0), 2)
    larger = load(tmp_path, *lines, radius="5").shapes[0].geometry
    assert isinstance(larger, Sphere)
    assert (larger.center, larger.radius) == ((1, 0, 0), 5)
    unused = load(tmp_path, *lines, colour="red")
    assert unused.warnings == ("Parameter 'colour' was given, but the scene has no such <default>.",)


def test_substituted_text_is_not_substituted_again() -> None:
    root = parse_xml(rb'<scene version="3.0.0" a="$x"><default name="y" value="1"/></scene>')
    assert "Parameter $y in <scene> is not defined" in expanded(root, x="$y")[0]
    assert root.attributes["a"] == "$y"


def test_what_uses_an_undefined_parameter_counts_as_not_given(tmp_path: Path) -> None:
    film = '<film type="hdrfilm"><integer name="width" value="$w"/><integer name="height" value="32"/></film>'
    camera = '<sensor type="perspective"><transform name="to_world"><translate z="5"/></transform>' + film + "</sensor>"
    scene = load(tmp_path, '<shape type="cube"/>', camera=camera)
    assert (scene.width, scene.height) == (768, 32)
    assert (
        "Parameter $w in <integer> is not defined: the value counts as not given. Give it with -D w=…"
        in scene.warnings[0]
    )


def test_escaped_dollar_stays() -> None:
    root = parse_xml(rb'<scene version="3.0.0" b="\$x costs $x"/>')
    assert expanded(root, x="5") == ()
    assert root.attributes["b"] == "$x costs 5"


def test_elements_of_a_file_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pmviewer.scene.formats.mitsuba.xml.MAX_ELEMENTS", 3)
    parse_xml(b"<scene><a/><b/></scene>")
    with pytest.raises(SceneError, match="more than 3 elements"):
        parse_xml(b"<scene><a/><b/><c/></scene>")


def test_references_work_before_their_definition_and_by_alias(tmp_path: Path) -> None:
    scene = load(
        tmp_path,
        '<shape type="sphere"><ref id="b"/></shape>',
        '<bsdf type="twosided" id="a"><ref id="inner"/></bsdf>',
        '<bsdf type="diffuse" id="inner"><rgb name="reflectance" value="0.25"/></bsdf>',
        '<alias id="a" as="b"/>',
    )
    material = scene.materials[scene.shapes[0].material]
    assert material.reflectance == (0.25, 0.25, 0.25)
    assert material.two_sided


def test_shared_material_is_one_material(tmp_path: Path) -> None:
    shape = '<shape type="sphere"><ref id="m"/></shape>'
    scene = load(tmp_path, '<bsdf type="diffuse" id="m"/>', shape, shape)
    assert [s.material for s in scene.shapes] == [0, 0]
    assert [m.name for m in scene.materials] == ["m"]


def test_circles_are_said_only_of_circles(tmp_path: Path) -> None:
    texture = '<texture type="checkerboard" id="t" name="x"><ref id="t" name="color0"/></texture>'
    bsdf = '<bsdf type="diffuse"><ref id="t" name="reflectance"/></bsdf>'
    scene = load(tmp_path, texture, f'<shape type="sphere">{bsdf}</shape>')
    assert any('<texture type="checkerboard"> contains itself' in w for w in scene.warnings)
    deep = '<bsdf type="twosided">' * 40 + '<bsdf type="diffuse"/>' + "</bsdf>" * 40
    scene = load(tmp_path, f'<shape type="sphere">{deep}</shape>')
    assert scene.warnings == (
        'line 2: <bsdf type="twosided"> lies within more than 32 objects. A grey diffuse surface replaces it.',
    )


def test_each_kind_of_unknown_thing_is_named_once_with_its_lines(tmp_path: Path) -> None:
    aov = '<aov type="depth"/>'
    scene = load(tmp_path, aov, '<shape type="sphere"><float name="glow" value="1"/></shape>', aov)
    assert scene.warnings == (
        'lines 2, 4: <aov type="depth"> is not supported and was ignored.',
        "line 3: 'glow' of <shape type=\"sphere\"> is not supported and was ignored.",
    )


def test_integrators_samplers_and_filters_are_silent(tmp_path: Path) -> None:
    sensor = (
        '<sensor type="perspective"><float name="fov" value="40"/><sampler type="independent"/>'
        '<film type="hdrfilm"><rfilter type="box"/><string name="pixel_format" value="rgb"/></film></sensor>'
    )
    lines = ('<integrator type="path"><integer name="max_depth" value="3"/></integrator>', '<shape type="cube"/>')
    assert load(tmp_path, *lines, camera=sensor).warnings == ()


def test_the_first_of_two_values_counts(tmp_path: Path) -> None:
    lines = '<float name="radius" value="2"/><float name="radius" value="3"/>'
    scene = load(tmp_path, f'<shape type="sphere">{lines}</shape>')
    assert scene.shapes[0].geometry.radius == 2
    assert scene.warnings == ("line 2: <shape type=\"sphere\"> has two values for 'radius': the first one counts.",)


def test_merged_shapes_are_shapes_of_the_scene(tmp_path: Path) -> None:
    inner = '<shape type="merge"><shape type="cube"/></shape>'
    scene = load(tmp_path, f'<shape type="merge"><shape type="sphere"/>{inner}</shape>')
    assert [shape.name for shape in scene.shapes] == ["sphere (line 2)", "cube (line 2)"]
    assert scene.warnings == ()
    with pytest.raises(SceneError, match="contains itself"):
        load(tmp_path, '<shape type="merge" id="m"><ref id="m"/></shape>')


def test_endless_names_of_types_are_shortened(tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    path.write_text(
        '<scene version="3.0.0"><sensor type="perspective"><film type="' + "x" * 5000 + '"/></sensor>'
        '<emitter type="constant"/><shape type="sphere"/></scene>'
    )
    warnings = read_scene(path).warnings
    assert any("is read as an hdrfilm" in text for text in warnings)
    assert all(len(text) < 400 for text in warnings)
