"""Lights for files that bring none or next to none, and lights to choose from."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.scene.arrays import primitives
from pmviewer.scene.arrays.primitives import transformed
from pmviewer.scene.defaults.completion import completed
from pmviewer.scene.description import (
    RGB,
    Camera,
    DirectionalLight,
    ImageEnvironment,
    NamedCamera,
    Parallelogram,
    PointLight,
    Scene,
    Shape,
)
from pmviewer.scene.formats.mitsuba.transform import scaling, translation
from pmviewer.scene.texture import Bitmap
from tests.scene.test_viewpoint import GREY, ball, scene_of, turned, walls


def names(scene: Scene) -> list[str]:
    return [shape.name for shape in scene.shapes]


def glowing(scene: Scene, number: int, radiance: float | RGB, emission: Bitmap | None = None) -> Scene:
    shapes = list(scene.shapes)
    colour = radiance if isinstance(radiance, tuple) else (radiance,) * 3
    shapes[number] = replace(shapes[number], radiance=colour, emission=emission)
    return replace(scene, shapes=tuple(shapes))


def test_a_thing_without_light_gets_a_studio():
    scene = completed(scene_of(ball()))
    assert names(scene)[1:] == ["light above", "floor"]
    assert scene.warnings == ("The file has no light: a soft light above it, a dim sky and a floor were added.",)


def test_what_stands_on_its_own_ground_gets_no_floor():
    ground = transformed(primitives.cube(), translation(0, -1.05, 0) @ scaling(1.5, 0.05, 1.5))
    assert names(completed(scene_of(ball(), ground)))[2:] == ["light above"]


def test_the_bottom_of_a_thing_is_no_ground():
    """Of a crate, of one that stands askew, of a tray with thick walls; a board on which things stand is one."""
    crate, board = transformed(primitives.cube(), translation(0, 1, 0)), transformed(walls(), scaling(3, 0.01, 3))
    tray = [
        transformed(primitives.cube(), translation(x, 0, z) @ scaling(*size))
        for x, z, size in ((0, 0, (1, 0.05, 1)), (0.9, 0, (0.1, 0.4, 1)), (-0.9, 0, (0.1, 0.4, 1)),
                           (0, 0.9, (1, 0.4, 0.1)), (0, -0.9, (1, 0.4, 0.1)))
    ]  # fmt: skip
    for meshes, floor in (([crate], True), (tray, True), ([crate, board], False), ([walls(None, False)], True)):
        assert ("floor" in names(completed(scene_of(*meshes), "studio"))) == floor


def test_a_hole_in_a_block_is_no_room():
    """A block with a hollow that opens in a small hole towards the camera is lit from outside."""
    hollow = transformed(walls(5), translation(0, 0, 0.45) @ scaling(0.5, 0.5, 0.5))
    front = [
        transformed(primitives.cube(), translation(x, y, 0.96) @ scaling(*size))
        for x, y, size in ((0.6, 0, (0.4, 1, 0.04)), (-0.6, 0, (0.4, 1, 0.04)), (0, 0.6, (0.2, 0.4, 0.04)),
                           (0, -0.6, (0.2, 0.4, 0.04)))
    ]  # fmt: skip
    block = scene_of(walls(5, False), hollow, *front)
    camera = Camera((0.4, 0.3, 6), (0, 0, 0), (0, 1, 0), 40.0)
    scene = completed(replace(block, camera=camera, cameras=(NamedCamera("", camera, 64, 64),)))
    assert "light above" in names(scene)


@pytest.mark.parametrize("without", [None, 5])
def test_a_room_is_lit_from_below_its_ceiling(without):
    scene = completed(scene_of(walls(without), *[ball((x, -0.75, 0.3), 0.2) for x in (-0.6, 0, 0.6)]))
    lamp = scene.shapes[-1]
    assert lamp.name == "light under the ceiling"
    assert isinstance(lamp.geometry, Parallelogram)
    g = lamp.geometry
    corners = np.array(g.corner) + [[0, 0, 0], g.edge_u, g.edge_v, np.add(g.edge_u, g.edge_v)]
    assert np.abs(corners).max() < 1
    assert corners[:, 1].min() > 0.5
    assert np.cross(g.edge_u, g.edge_v)[1] < 0
    assert bool(scene.lights) == (without is not None)  # a sky where there is an opening


def test_an_indicator_is_no_light():
    """As on a helmet with a small screen: a few bright texels on a surface that is else black."""
    pixels = np.zeros((16, 16, 3), np.float32)
    pixels[3, 4:7] = 1.0
    scene = glowing(scene_of(ball()), 0, float(pixels.mean()), Bitmap(pixels))
    lit = completed(scene)
    assert names(lit)[1:] == ["light above", "floor"]
    assert lit.shapes[0].radiance == scene.shapes[0].radiance
    assert lit.warnings[0].startswith("The file's lights bring next to nothing")


def test_surfaces_that_glow_by_themselves_need_no_light():
    scene = glowing(scene_of(ball()), 0, 0.7)
    assert names(completed(scene)) == names(scene)


def test_a_tint_of_emission_is_no_light():
    """Exporters leave a trace of emission on things that want light; on a black surface the same is all there is."""
    grey = glowing(scene_of(ball()), 0, (0.0, 0.0, 0.1))
    assert names(completed(grey))[1:] == ["light above", "floor"]
    black = replace(grey, materials=(replace(grey.materials[0], reflectance=(0.0,) * 3), *grey.materials[1:]))
    assert names(completed(black)) == names(black)


def test_what_nobody_can_see_is_no_light():
    scene = glowing(scene_of(ball()), 0, 0.7)
    clear = replace(scene, materials=(replace(scene.materials[0], opacity=0.0), *scene.materials[1:]))
    assert "light above" in names(completed(clear))


def test_a_lamp_in_a_room_is_light_enough():
    lamp = transformed(turned(primitives.cube()), translation(0, 0.95, 0) @ scaling(0.2, 0.01, 0.2))
    room = scene_of(lamp, walls(5), ball((0, -0.6, 0), 0.35))
    assert names(completed(glowing(room, 0, 15.0))) == names(room)
    assert len(completed(glowing(room, 0, 0.05)).shapes) > len(room.shapes)


def test_a_light_must_reach_what_is_seen():
    above = replace(scene_of(ball()), lights=(PointLight("lamp", (3.0, 4.0, 5.0), (1e-3,) * 3),))
    assert completed(above).shapes == above.shapes  # however dim: exposure is automatic
    buried = replace(above, lights=(PointLight("lamp", (0.0, 0.0, 0.0), (1e3,) * 3),))
    assert "light above" in names(completed(buried))
    assert completed(buried).lights[0] == buried.lights[0]


def test_a_renderers_file_is_taken_at_its_word():
    buried = replace(scene_of(ball()), lights=(PointLight("lamp", (0.0, 0.0, 0.0), (1e3,) * 3),), path=Path("a.xml"))
    assert completed(buried).shapes == buried.shapes


def test_the_files_lights_alone():
    with pytest.raises(SceneError, match=r"light\.rig asks for the file's alone"):
        completed(scene_of(ball()), "file")
    buried = replace(scene_of(ball()), lights=(PointLight("lamp", (0.0, 0.0, 0.0), (1e3,) * 3),))
    assert completed(buried, "file").shapes == buried.shapes


@pytest.mark.parametrize("rig", ["studio", "overcast", "sun", "headlight"])
def test_a_rig_takes_the_place_of_the_files_lights_but_not_of_what_glows(rig):
    scene = glowing(scene_of(ball(), ball((2, 0, 0), 0.1)), 1, 3.0)
    scene = replace(scene, lights=(PointLight("lamp", (3.0, 4.0, 5.0), (1.0,) * 3),))
    lit = completed(scene, rig)
    assert not any(light.name == "lamp" for light in lit.lights)
    assert lit.shapes[1].radiance == (3.0, 3.0, 3.0)
    assert lit.warnings == ()


@pytest.mark.parametrize(("up", "axis"), [("y", 1), ("z", 2)])
def test_the_overcast_sky_lights_level_ground_by_its_formula(up, axis):
    """∫ L cos θ dω over the upper half, by the picture's own pixels, is 0.8 π; the zenith is thrice the horizon."""
    lit = completed(replace(scene_of(ball()), up=up), "overcast")
    (sky,) = lit.lights
    assert isinstance(sky, ImageEnvironment)
    height = len(sky.pixels)
    theta = (np.arange(height) + 0.5) / height * math.pi
    row = sky.pixels[:, 0, 1].astype(float)
    upper = theta < math.pi / 2
    ring = 2 * math.pi * np.sin(theta) * math.pi / height
    assert (row * ring * np.cos(theta))[upper].sum() == pytest.approx(0.8 * math.pi, rel=2e-3)
    assert row[0] / row[upper][-1] == pytest.approx(3.0, rel=0.1)
    np.testing.assert_allclose(sky.to_world @ (0, 1, 0), np.eye(3)[axis])


def test_the_sun_shines_from_above_past_the_cameras_left():
    lit = completed(scene_of(ball()), "sun")
    sun = lit.lights[0]
    assert isinstance(sun, DirectionalLight)
    towards = -np.array(sun.direction)
    view = np.subtract(lit.camera.target, lit.camera.origin)
    right = np.cross(view, lit.camera.up)
    assert towards[1] == pytest.approx(math.sin(math.radians(45)))
    assert towards @ right < 0  # from the left
    assert towards @ view < 0  # and from behind the camera


def test_the_headlight_is_at_the_camera_and_as_bright_as_its_distance_asks():
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 10.0)
    scene = replace(scene_of(ball()), camera=camera, cameras=(NamedCamera("own", camera, 64, 64),))
    lit = completed(scene, "headlight")
    (lamp,) = lit.lights
    assert isinstance(lamp, PointLight)
    assert lit.camera == camera
    np.testing.assert_allclose(lamp.position, (0, 0.05 * 4, 5), atol=0.02)  # the ball's front is 4 away
    assert lamp.intensity[1] / 4**2 / math.pi == pytest.approx(0.8, rel=0.05)


def test_shapes_of_the_file_are_untouched():
    scene = scene_of(ball(), walls(5))
    assert completed(scene).shapes[:2] == scene.shapes
    assert isinstance(scene.shapes[0], Shape)
    assert completed(scene).materials[0] == GREY
