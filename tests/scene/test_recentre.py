"""Scenes far from the origin are moved to it; lights in the place of another surface are told of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.scene.arrays.flatten import bounding_sphere
from pmviewer.scene.description import (
    Cylinder,
    Disk,
    Group,
    Instance,
    Parallelogram,
    PointLight,
    Shape,
    Sphere,
    SpotLight,
)
from pmviewer.scene.meshes.recentre import FAR, recentred
from tests.support.scenes import LIGHTS, box_camera, cornell_box, cube_mesh, light_scene, panel

OFFSET = np.array([3e5, -2e6, 4e4])


def moved(scene, by):
    """The scene with everything by hand elsewhere."""

    def plus(p):
        return tuple(np.add(p, by))

    def geometry(g):
        if isinstance(g, Sphere | Disk):
            return replace(g, center=plus(g.center))
        if isinstance(g, Cylinder):
            return replace(g, p0=plus(g.p0), p1=plus(g.p1))
        if isinstance(g, Parallelogram):
            return replace(g, corner=plus(g.corner))
        return replace(g, vertices=g.vertices + by)

    camera = scene.camera
    return replace(
        scene,
        shapes=tuple(replace(s, geometry=geometry(s.geometry)) for s in scene.shapes),
        lights=tuple(
            replace(light, position=plus(light.position)) if isinstance(light, PointLight | SpotLight) else light
            for light in scene.lights
        ),
        camera=replace(camera, origin=plus(camera.origin), target=plus(camera.target)),
    )


def test_a_scene_far_away_is_the_one_at_the_origin():
    scene = light_scene(*LIGHTS)
    group = Group("group", (Shape("cube", cube_mesh(half=0.1), 0),))
    to_world = np.diag([1.0, 2.0, 1.0, 1.0])
    to_world[:3, 3] = (0.5, 0.1, 0.2)
    scene = replace(scene, instances=(Instance("copy", group, to_world),))
    far = moved(scene, OFFSET)
    shifted = to_world.copy()
    shifted[:3, 3] += OFFSET
    far = replace(far, instances=(Instance("copy", group, shifted),))
    back = recentred(far)
    assert "moved there" in back.warnings[-1]
    center = bounding_sphere(scene)[0]
    assert bounding_sphere(back)[0] == pytest.approx([0, 0, 0], abs=1e-6)
    expected = moved(scene, -center)
    for mine, theirs in zip(back.shapes, expected.shapes, strict=True):
        for a, b in zip(_numbers(mine.geometry), _numbers(theirs.geometry), strict=True):
            assert np.asarray(a) == pytest.approx(np.asarray(b), abs=1e-8)
    assert back.lights[0].position == pytest.approx(expected.lights[0].position, abs=1e-8)
    assert back.camera.origin == pytest.approx(expected.camera.origin, abs=1e-8)
    assert back.instances[0].to_world[:3, 3] == pytest.approx(to_world[:3, 3] - center, abs=1e-8)
    assert far.instances[0].to_world[0, 3] == shifted[0, 3]  # the description that came in is as it was


def _numbers(g):
    return [value for value in vars(g).values() if isinstance(value, tuple | np.ndarray) and len(value)]


def test_a_scene_at_hand_stays():
    scene = cornell_box()
    assert recentred(scene) is scene
    _, radius = bounding_sphere(scene)
    near = moved(scene, np.array([0.9 * FAR * radius, 0, 0]))
    assert recentred(near) is near


def test_a_camera_far_away_is_told_of():
    scene = replace(cornell_box(), camera=replace(box_camera(), origin=(0.0, 0.0, 1e6)))
    assert "scene radii away" in recentred(scene).warnings[-1]


@pytest.mark.parametrize("name", [n for n in LIGHTS if n not in ("point", "environment")])
def test_a_light_in_the_place_of_a_surface_is_told_of(name):
    scene = light_scene(name)
    assert not any("in the place" in sentence for sentence in open_scene(scene).scene.warnings)
    twin = Shape("twin", LIGHTS[name], 0)
    twice = replace(scene, shapes=(twin, *scene.shapes))
    later = replace(scene, shapes=(*scene.shapes, twin))
    said = [any("in the place" in sentence for sentence in open_scene(both).scene.warnings) for both in (twice, later)]
    assert any(said)


def test_lights_that_merely_touch_are_not():
    """A lamp that stands on the floor, one that a wall cuts, a panel a hair below the ceiling."""
    for light in (
        Shape("lamp", Sphere((0, -0.9, 0), 0.1), 0, (1.0,) * 3),
        Shape("lamp", Sphere((1.0, 0, 0), 0.3), 0, (1.0,) * 3),
        panel(y=0.9999),
    ):
        scene = replace(cornell_box(), shapes=(*cornell_box().shapes, light))
        assert not any("in the place" in s for s in open_scene(scene).scene.warnings)
