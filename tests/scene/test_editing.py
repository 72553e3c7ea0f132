"""Edits of a scene against the same change made in the file, or worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmviewer.engine.opened import Arrangement, open_scene, rearranged
from pmviewer.errors import SceneError, SettingError
from pmviewer.scene.description import (
    LUMINANCE,
    ConstantEnvironment,
    Cylinder,
    DirectionalLight,
    Disk,
    Group,
    ImageEnvironment,
    Instance,
    Material,
    Mesh,
    Parallelogram,
    PointLight,
    Shape,
    Sphere,
    SpotLight,
)
from pmviewer.scene.editing.apply import edited
from pmviewer.scene.editing.catalogue import catalogue_of
from pmviewer.scene.editing.transform import angles_of, rotation_of, similarity, transformed
from pmviewer.scene.load import load_scene
from pmviewer.scene.texture import Bitmap, Checkerboard, evaluate
from pmviewer.settings.access import Settings, parse_edits, with_values
from tests.support.scenes import diffuse, diffuse_box

angles = st.floats(-179.0, 179.0)
numbers = st.floats(-5.0, 5.0)


def edit(scene, *texts):
    return edited(scene, parse_edits(texts))


@given(angles, st.floats(-89.0, 89.0), angles)
def test_angles_come_back(x, y, z):
    assert np.allclose(angles_of(rotation_of((x, y, z))), (x, y, z), atol=1e-6)


def test_rotations_are_right_handed_about_x_then_y_then_z():
    e = np.eye(3)
    assert np.allclose(rotation_of((90, 0, 0)) @ e[1], e[2])
    assert np.allclose(rotation_of((0, 90, 0)) @ e[2], e[0])
    assert np.allclose(rotation_of((0, 0, 90)) @ e[0], e[1])
    assert np.allclose(rotation_of((90, 90, 0)) @ e[1], e[0]), "x first: y goes to z, then z to x"


@given(st.tuples(angles, angles, angles), st.floats(0.2, 4.0), st.tuples(numbers, numbers, numbers))
def test_points_of_every_shape_go_where_the_matrix_says(turn, size, move):
    """A place on each shape, by its own definition, before and after."""
    by = similarity(np.array([1.0, -2.0, 0.5]), move, turn, size)
    matrix = by.matrix()

    def there(p):
        return (matrix @ np.append(p, 1.0))[:3]

    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0]], float)
    mesh = Mesh(corner, np.array([[0, 1, 2]], np.int32), np.tile([0.0, 0.6, 0.8], (3, 1)))
    moved = transformed(mesh, by)
    assert np.allclose(moved.vertices, [there(p) for p in corner])
    assert np.allclose(moved.normals, mesh.normals @ rotation_of(turn).T)
    flat = transformed(Parallelogram((1, 2, 3), (1, 0, 0), (0, 1, 1)), by)
    assert np.allclose(np.add(flat.corner, flat.edge_u), there((2, 2, 3)))
    assert np.allclose(np.add(flat.corner, flat.edge_v), there((1, 3, 4)))
    ball = transformed(Sphere((1, 0, 0), 0.5), by)
    pole = np.asarray(ball.center) + ball.radius * np.asarray(ball.frame[2])
    assert np.allclose(pole, there((1, 0, 0.5))), "what its texture shows turns with it"
    tube = transformed(Cylinder((0, 0, 0), (0, 0, 2), 0.25), by)
    assert np.allclose((tube.p0, tube.p1), (there((0, 0, 0)), there((0, 0, 2))))
    assert np.isclose(tube.radius, 0.25 * size)
    disk = transformed(Disk((0, 1, 0), (0, 0, 1), 2.0), by)
    assert np.allclose(np.asarray(disk.center) + size * np.asarray(disk.normal), there((0, 1, 1)))


def test_a_moved_object_is_what_the_file_makes_of_the_other_place():
    """`three_glasses` has a parameter for it."""
    still, other = load_scene("three_glasses"), load_scene("three_glasses", {"x": "0.02"})
    differing = [
        i
        for i, (a, b) in enumerate(zip(still.shapes, other.shapes))
        if isinstance(a.geometry, Mesh) and not np.array_equal(a.geometry.vertices, b.geometry.vertices)
    ]
    assert differing
    moved = edit(still, *(f"object.{i + 1}.move=0.02,0,0" for i in differing))
    for a, b in zip(moved.shapes, other.shapes):
        if isinstance(a.geometry, Mesh):
            assert np.allclose(a.geometry.vertices, b.geometry.vertices, atol=1e-12)


def test_turning_and_growing_keep_the_middle():
    box = diffuse_box(size=8)
    ball = Shape("ball", Sphere((0.2, 0.1, -0.3), 0.2), 0)
    scene = replace(box, shapes=(*box.shapes, ball))
    grown = edit(scene, "object.ball.size=2", "object.ball.turn=10,20,30").shapes[-1].geometry
    assert np.allclose(grown.center, ball.geometry.center)
    assert np.isclose(grown.radius, 0.4)


def test_instances_move_without_their_group():
    box = diffuse_box(size=8)
    group = Group("g", (Shape("ball", Sphere((0, 0, 0), 0.2), 0),))
    at = np.eye(4)
    at[:3, 3] = 0.1, 0.2, 0.3
    scene = replace(box, instances=(Instance("one", group, at), Instance("two", group, np.eye(4))))
    moved = edit(scene, "object.one.move=1,0,0", "object.one.size=3")
    assert np.allclose(moved.instances[0].to_world @ (0, 0, 0, 1), (1.1, 0.2, 0.3, 1))
    assert np.allclose(moved.instances[0].to_world[:3, :3], 3 * np.eye(3))
    assert moved.instances[1] is scene.instances[1]


LIGHTS = (
    PointLight("bulb", (0, 1, 0), (1.0, 2.0, 3.0)),
    SpotLight("spot", (0, 1, 0), (0, -1, 0), (4.0, 4.0, 4.0), 30.0, 20.0),
    DirectionalLight("sun", (0, -1, 0), (1.0, 1.0, 0.5)),
    ImageEnvironment("sky", np.arange(36, dtype=np.float32).reshape(3, 4, 3), np.eye(3)),
)


def emitted(light):
    """By whichever name, a colour (…, 3)."""
    for name in ("intensity", "irradiance", "radiance", "pixels"):
        if hasattr(light, name):
            return np.asarray(getattr(light, name), float)
    raise AssertionError(light)


@pytest.mark.parametrize("light", LIGHTS, ids=lambda light: light.name)
def test_power_scales_and_colour_keeps_the_luminance(light):
    scene = replace(diffuse_box(size=8), lights=(light,))
    bright = edit(scene, f"light.{light.name}.power=2.5").lights[0]
    assert np.allclose(emitted(bright), 2.5 * emitted(light))
    red = edit(scene, f"light.{light.name}.colour=1, 0, 0").lights[0]
    assert np.allclose(emitted(red)[..., 1:], 0)
    assert np.allclose(emitted(red) @ LUMINANCE, emitted(light) @ LUMINANCE, rtol=1e-5)


def test_a_glowing_surface_and_its_texture():
    texture = Checkerboard((2.0, 1.0, 0.0), (0.0, 1.0, 0.0))
    glowing = Shape("lamp", Parallelogram((0, 0, 0), (1, 0, 0), (0, 1, 0)), 0, texture.mean, texture)
    scene = replace(diffuse_box(size=8), shapes=(glowing,), lights=())
    bright = edit(scene, "light.lamp.power=3").shapes[0]
    assert np.allclose(bright.radiance, (3.0, 3.0, 0.0))
    assert np.allclose(bright.emission.color0, (6.0, 3.0, 0.0))
    blue = edit(scene, "light.lamp.colour=0,0,1").shapes[0]
    assert np.allclose(blue.emission.mean, blue.radiance), "a channel that was empty comes from the others"
    assert np.isclose(np.dot(blue.radiance, LUMINANCE), np.dot(texture.mean, LUMINANCE))


def test_lights_move_and_turn():
    scene = replace(diffuse_box(size=8), lights=LIGHTS)
    moved = edit(
        scene, "light.bulb.move=1,2,3", "light.spot.turn=0,0,90", "light.sun.turn=90,0,0", "light.sky.turn=0,90,0"
    )
    names = {light.name: light for light in moved.lights}
    assert np.allclose(names["bulb"].position, (1, 3, 3))
    assert np.allclose(names["spot"].axis, (1, 0, 0))
    assert np.allclose(names["spot"].position, (0, 1, 0)), "around itself"
    assert np.allclose(names["sun"].direction, (0, 0, -1))
    assert np.allclose(names["sky"].to_world @ (0, 0, 1), (1, 0, 0))


def material(scene, *texts):
    return edit(scene, *texts).materials[0]


def with_material(m):
    return replace(diffuse_box(size=8), materials=(m, *diffuse_box(size=8).materials[1:]))


def test_materials():
    wall = with_material(diffuse("wall", (0.5, 0.4, 0.3)))
    assert material(wall, "material.wall.colour=0.1,0.2,0.3").reflectance == (0.1, 0.2, 0.3)
    glass = with_material(Material("glass", "dielectric"))
    tinted = material(glass, "material.glass.colour=0.5,1,1", "material.glass.index=1.33")
    assert (tinted.transmittance, tinted.eta, tinted.kind) == ((0.5, 1, 1), 1.33, "dielectric")
    assert material(glass, "material.glass.roughness=0.2").kind == "rough dielectric"
    metal = with_material(Material("metal", "rough conductor", alpha=(0.3, 0.1)))
    assert material(metal, "material.metal.roughness=0.4").alpha == (0.4, 0.4)
    assert material(metal, "material.metal.roughness=0").kind == "conductor"


def test_textures_are_tinted_to_the_colour_that_is_asked_for():
    pixels = np.random.default_rng(1).random((8, 8, 3)).astype(np.float32) * 0.5
    m = replace(diffuse("wall"), textures={"reflectance": Bitmap(pixels)}, reflectance=Bitmap(pixels).mean)
    other = material(with_material(m), "material.wall.colour=0.1,0.2,0.3").textures["reflectance"]
    uv = np.random.default_rng(2).random((4000, 2))
    assert np.allclose(evaluate(other, uv).mean(axis=0), (0.1, 0.2, 0.3), rtol=0.05)
    assert evaluate(other, uv)[:, 0].std() > 0.01, "it is still a picture"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("light.moon.power=2", r"no light 'moon' to edit.*It has lamp"),
        ("light.9.power=2", r"no light '9' to edit"),
        ("material.glass.roughness=0.5", r"no material 'glass'"),
        ("material.grey.roughness=0.5", r"can't be changed. It has no gloss"),
        ("material.grey.index=1.5", r"can't be changed. It has no index"),
        ("light.sky.move=0,0,1", r"can't be changed. It shines from infinitely far away"),
        ("light.sky.turn=0,0,1", r"can't be changed. It is the same from all sides"),
        ("object.twin.size=2", r"Several objects are called 'twin'.*by its number: 2, 3"),
    ],
)
def test_what_a_scene_has_not_is_said(text, said):
    box = diffuse_box(size=8)
    lamp = Shape("lamp", Sphere((0, 0.5, 0), 0.1), 0, (1.0, 1.0, 1.0))
    twins = tuple(Shape("twin", Sphere((0, y, 0), 0.1), 0) for y in (0.0, -0.5))
    scene = replace(
        box, shapes=(lamp, *twins), lights=(ConstantEnvironment("sky", (1.0, 1.0, 1.0)),), materials=(diffuse(),)
    )
    with pytest.raises(SceneError, match=said):
        edit(scene, text)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("light.1.power", "write NAME=VALUE"),
        ("light.power=2", "write KIND.NAME.PROPERTY"),
        ("lamp.1.power=2", "KIND is one of light, material, object"),
        ("light.1.size=2", "no property 'size' of a light"),
        ("light.1.power=-1", "expected numbers from 0"),
        ("light.1.power=nan", "expected numbers from 0"),
        ("light.1.power=2,3", "expected a number"),
        ("material.a.colour=red", "expected 3 numbers"),
        ("object.1.size=0", "expected numbers from 1e-06"),
    ],
)
def test_what_is_no_edit_is_said(text, said):
    with pytest.raises(SettingError, match=said):
        parse_edits([text])
    name, _, value = text.partition("=")
    with pytest.raises(SettingError):
        with_values(Settings(), {"edit.changes": {name: value.split(",")}})


def test_names_are_the_files_or_numbers():
    scene = load_scene("cornell_caustic")
    catalogue = catalogue_of(scene)
    assert [t.key for t in catalogue.targets["material"]] == ["white", "green", "red", "chrome", "glass", "black"]
    assert catalogue.find("material", "5").name == "glass"
    assert [t.place for t in catalogue.targets["light"]] == [5]


def test_without_edits_nothing_is_touched():
    scene = load_scene("cornell_caustic")
    assert edited(scene, {}) is scene
    opened = open_scene("cornell_caustic")
    assert rearranged(opened, opened.arrangement) is opened
    once = rearranged(opened, Arrangement(edits=parse_edits(["light.1.power=2"])))
    assert np.allclose(once.flat.light_power, 2 * opened.flat.light_power)
    back = rearranged(once, Arrangement())
    assert np.array_equal(back.flat.light_power, opened.flat.light_power), "edits are of the file, not of edits"
