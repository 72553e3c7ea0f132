"""Files of versions before 2, and of no version that there is."""

from pathlib import Path

import numpy as np
import pytest

from pmviewer.scene.description import Cylinder, Sphere
from pmviewer.scene.formats.mitsuba.versions import snake_case
from pmviewer.scene.load import load_scene
from tests.scene.helpers import CAMERA, SKY, xml_file


def old(folder: Path, *lines: str, version: str = "0.6.0", camera: str = CAMERA, sky: str = SKY):
    return load_scene(xml_file(folder, *lines, camera, sky, version=version))


def material(scene):
    return scene.materials[scene.shapes[0].material]


def test_names_in_camel_case() -> None:
    # As Mitsuba 3.9.1 renames them (upgrade_from_v1 of src/core/parser.cpp).
    names = {
        "toWorld": "to_world",
        "intIOR": "int_ior",
        "alphaU": "alpha_u",
        "specularReflectance": "specular_reflectance",
    }
    assert {name: snake_case(name) for name in names} == names


def test_reflectance_of_a_diffuse_surface(tmp_path: Path) -> None:
    bsdf = '<bsdf type="diffuse"><rgb name="diffuseReflectance" value="0.1 0.2 0.3"/></bsdf>'
    scene = old(tmp_path, f'<shape type="cube">{bsdf}</shape>')
    assert material(scene).reflectance == (0.1, 0.2, 0.3)
    assert scene.warnings == ()


def test_scale_and_offset_of_textures(tmp_path: Path) -> None:
    """Mitsuba 3 makes scale · translate of them: u' = 4 (u + 0.5)."""
    inside = '<float name="uscale" value="4"/><float name="voffset" value="0.25"/><float name="uoffset" value="0.5"/>'
    texture = f'<texture type="checkerboard" name="reflectance">{inside}</texture>'
    scene = old(tmp_path, f'<shape type="cube"><bsdf type="diffuse">{texture}</bsdf></shape>')
    assert material(scene).textures["reflectance"].to_uv == (4, 0, 2, 0, 1, 0.25)
    assert scene.warnings == ()


@pytest.mark.parametrize(
    ("version", "inside", "kind"),
    [
        ("0.5.0", "", "null"),
        ("0.6.0", '<bsdf type="diffuse"/>', "diffuse"),
        ("0.6.0", '<ref id="grey"/>', "diffuse"),
        ("2.0.0", "", "diffuse"),
    ],
)
def test_light_passes_a_mediums_boundary_without_a_bsdf(tmp_path: Path, version: str, inside: str, kind: str) -> None:
    """Shape::configure of Mitsuba 0.5 and 0.6 gives it "null"; Mitsuba 3 gives every shape without one "diffuse"."""
    medium = '<medium type="homogeneous" id="fog"/><bsdf type="diffuse" id="grey"/>'
    shape = f'<shape type="cube"><ref name="interior" id="fog"/>{inside}</shape>'
    scene = old(tmp_path, medium, shape, version=version)
    assert material(scene).kind == kind
    assert any("light passes it" in said for said in scene.warnings) == (kind == "null")


@pytest.mark.parametrize("version", ["", "new", "3.x"])
def test_odd_versions_are_said(tmp_path: Path, version: str) -> None:
    path = xml_file(tmp_path, '<shape type="cube"/>', CAMERA, SKY, version=version)
    (warning,) = load_scene(path).warnings
    assert repr(version) in warning
    path.write_text(path.read_text("utf-8").replace(f' version="{version}"', ""), "utf-8")
    assert load_scene(path).warnings == (
        "line 1: <scene> says nothing of Mitsuba's version: the file is read as one of version 3.",
    )


def test_version_0_3_calls_things_otherwise(tmp_path: Path) -> None:
    camera = (
        '<camera type="perspective"><float name="fov" value="40"/><transform name="toWorld">'
        '<lookAt origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform></camera>'
    )
    light = '<luminaire type="constant"><rgb name="intensity" value="2"/></luminaire>'
    lamp = '<shape type="sphere"><luminaire type="area"><rgb name="intensity" value="3"/></luminaire></shape>'
    scene = old(tmp_path, lamp, version="0.3.0", camera=camera, sky=light)
    assert scene.shapes[0].radiance == (3, 3, 3)
    assert scene.lights[0].radiance == (2, 2, 2)
    assert scene.camera.origin == (0, 0, 5)
    assert scene.camera.fov_axis == "smaller"
    assert scene.camera.mirrored  # its toWorld starts with <scale x="-1"/>, says upgrade_0.4.0.xsl
    assert scene.warnings == ()


def test_version_0_2(tmp_path: Path) -> None:
    ball = '<shape type="sphere"><boolean name="inverted" value="true"/><bsdf type="lambertian"/></shape>'
    tube = (
        '<shape type="cylinder"><point name="p1" x="0" y="0" z="1"/><point name="p2" x="0" y="0" z="4"/>'
        '<bsdf type="mirror"/></shape>'
    )
    camera = (
        '<camera type="perspective"><float name="fov" value="40"/><transform name="toWorld">'
        '<lookAt ox="0" oy="0" oz="5" tx="0" ty="0" tz="0" ux="0" uy="1" uz="0"/></transform></camera>'
    )
    scene = old(tmp_path, ball, tube, version="0.2.1", camera=camera)
    sphere, cylinder = (shape.geometry for shape in scene.shapes)
    assert isinstance(sphere, Sphere)
    assert sphere.flip_normals
    assert isinstance(cylinder, Cylinder)
    np.testing.assert_allclose((cylinder.p0, cylinder.p1), [(0, 0, 1), (0, 0, 4)])
    assert [scene.materials[shape.material].kind for shape in scene.shapes] == ["diffuse", "conductor"]
    assert not scene.camera.mirrored  # mirrored twice: by both upgrades
    assert scene.warnings == ()


def test_moving_objects_stand_where_they_start(tmp_path: Path) -> None:
    place = '<transform time="{}"><translate x="{}"/></transform>'
    path = f'<animation name="toWorld">{place.format(0, 2)}{place.format(1, 9)}</animation>'
    scene = old(tmp_path, f'<shape type="sphere">{path}</shape>')
    assert scene.shapes[0].geometry.center == (2, 0, 0)
    assert scene.warnings == ("line 2: 'to_world' of <shape type=\"sphere\"> moves: its first place is shown.",)


def test_values_of_another_type_are_converted(tmp_path: Path) -> None:
    inside = (
        '<integer name="radius" value="2"/><vector name="center" x="1" y="2" z="3"/>'
        '<string name="flip_normals" value="true"/>'
    )
    scene = old(tmp_path, f'<shape type="sphere">{inside}</shape>', version="3.0.0")
    ball = scene.shapes[0].geometry
    assert (ball.center, ball.radius, ball.flip_normals) == ((1, 2, 3), 2, True)
    film = '<film type="hdrfilm"><float name="width" value="64.0"/><string name="height" value="48"/></film>'
    camera = CAMERA.replace("</sensor>", film + "</sensor>")
    scene = old(tmp_path, '<shape type="cube"/>', version="3.0.0", camera=camera)
    assert (scene.width, scene.height) == (64, 48)
    assert scene.warnings == ()
