"""Lines, parameters and references of scene files."""

from pathlib import Path

import pytest

from pmviewer.errors import SceneError
from pmviewer.scene.description import Sphere
from pmviewer.scene.formats.mitsuba.xml import parse_xml, substitute
from tests.scene.helpers import load


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
    root = parse_xml(rb'<scene a="$x" b="\$x"><default name="y" value="1"/></scene>')
    with pytest.raises(SceneError, match="not defined"):
        substitute(root, {"x": "$y"})


def test_escaped_dollar_stays() -> None:
    root = parse_xml(rb'<scene b="\$x costs $x"/>')
    assert substitute(root, {"x": "5"}) == ()
    assert root.attributes["b"] == "$x costs 5"


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


def test_circular_textures_are_refused(tmp_path: Path) -> None:
    texture = '<texture type="checkerboard" id="t" name="x"><ref id="t" name="color0"/></texture>'
    bsdf = '<bsdf type="diffuse"><ref id="t" name="reflectance"/></bsdf>'
    with pytest.raises(SceneError, match="contains itself"):
        load(tmp_path, texture, f'<shape type="sphere">{bsdf}</shape>')


def test_each_kind_of_unknown_thing_is_named_once_with_its_lines(tmp_path: Path) -> None:
    medium = '<medium type="homogeneous"/>'
    scene = load(tmp_path, medium, '<shape type="sphere"><float name="glow" value="1"/></shape>', medium)
    assert scene.warnings == (
        'lines 2, 4: <medium type="homogeneous"> is not supported and was ignored.',
        "line 3: 'glow' of <shape type=\"sphere\"> is not supported and was ignored.",
    )


def test_integrators_samplers_and_filters_are_silent(tmp_path: Path) -> None:
    sensor = (
        '<sensor type="perspective"><float name="fov" value="40"/><sampler type="independent"/>'
        '<film type="hdrfilm"><rfilter type="box"/><string name="pixel_format" value="rgb"/></film></sensor>'
    )
    lines = ('<integrator type="path"><integer name="max_depth" value="3"/></integrator>', '<shape type="cube"/>')
    assert load(tmp_path, *lines, camera=sensor).warnings == ()


def test_two_values_of_one_name_are_an_error(tmp_path: Path) -> None:
    radius = '<float name="radius" value="1"/>'
    with pytest.raises(SceneError, match="two values for 'radius'"):
        load(tmp_path, f'<shape type="sphere">{radius}{radius}</shape>')
