"""What objects have received: photons are told apart by the surfaces that they lie on."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.frame import PhotonCloud
from pmviewer.engine.inspector.received import objects_at, received, surface_of
from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.maps.record import unpack
from pmviewer.scene.description import Group, Instance, Mesh, Parallelogram, PointLight, Scene, Shape, Sphere
from tests.support.scenes import box_camera, cornell_box, cube_mesh, diffuse, settings_of

LIGHT = PointLight("point", (0.0, 6.0, 0.0), (1.0, 1.0, 1.0))


def distance_to(geometry, points):
    """Of points (n, 3) from the plane of a flat shape or the surface of a sphere, by hand."""
    if isinstance(geometry, Sphere):
        return np.abs(np.linalg.norm(points - geometry.center, axis=1) - geometry.radius)
    if isinstance(geometry, Parallelogram):
        corner, normal = geometry.corner, np.cross(geometry.edge_u, geometry.edge_v)
    else:
        a, b, c = geometry.vertices[geometry.faces[0]]
        corner, normal = a, np.cross(b - a, c - a)
    return np.abs((points - corner) @ (normal / np.linalg.norm(normal)))


def test_every_photon_lies_on_the_wall_whose_plane_it_is_in(pool):
    opened = open_scene(cornell_box(size=24))
    settings = settings_of(photons={"N": 20_000}, render={"method": "progressive", "outline_rays": 0})
    renderer = Renderer(opened, settings, pool, StageStore(0))
    renderer.step()
    cloud = renderer.frame(1).clouds["global"]
    fields = unpack(cloud.photons, cloud.power_unit)
    points = fields["position"].astype(float)
    away = np.stack([distance_to(shape.geometry, points) for shape in opened.scene.shapes])
    nearest, clear = away.argmin(axis=0), np.sort(away, axis=0)[1] > 1e-3
    found = received(opened, cloud)
    told = objects_at(opened, fields["position"], fields["wi"])
    assert len(points) > 10_000
    assert clear.mean() > 0.98
    assert np.array_equal(told[clear], nearest[clear])
    assert found.unknown < 0.002 * len(points)
    for number in range(len(opened.scene.shapes)):
        on_it = told == number
        assert found.photons[number] == on_it.sum()
        assert found.power[number] == pytest.approx(fields["Phi"][on_it].sum(axis=0, dtype=float), rel=1e-5)
    assert np.count_nonzero(found.photons) >= 5


def test_instances_are_told_apart_and_from_the_shapes():
    """Two cubes of one group and a floor; photons are put where their tops are."""
    shift = np.eye(4)
    shift[:3, 3] = (3.0, 0.0, 0.0)
    shift[:3, :3] *= 2.0
    floor = Shape("floor", Parallelogram((-9, -2, -9), (0, 0, 18), (18, 0, 0)), 0)
    group = Group("cubes", (Shape("cube", cube_mesh(half=0.5), 0),))
    instances = (Instance("small", group, np.eye(4)), Instance("large", group, shift))
    scene = Scene("cubes", None, (floor,), (diffuse(),), (LIGHT,), box_camera(), 8, 8, instances=instances)
    opened = open_scene(scene)
    moved = np.subtract(opened.scene.camera.origin, scene.camera.origin)
    places = np.array([(0.2, 0.5, 0.1), (3.3, 1.0, -0.6), (-5.0, -2.0, 4.0), (0.0, 4.0, 0.0)]) + moved
    up = np.tile(np.array([0.6, 0.8, 0.0], np.float32), (4, 1))
    assert objects_at(opened, places.astype(np.float32), up).tolist() == [1, 2, 0, -1]
    assert [surface_of(opened.scene, n) for n in range(3)] == pytest.approx([18.0**2, 6.0, 24.0])


def test_areas_by_their_formulas():
    camera, stretched = box_camera(), np.diag([1.0, 2.0, 3.0, 1.0])
    ball = Shape("ball", Sphere((0, 0, 0), 2.0), 0)
    flat = Shape("flat", Mesh(np.array([(0, 0, 0), (3, 0, 0), (0, 4, 0)], float), np.array([[0, 1, 2]], np.int32)), 0)
    instances = (
        Instance("twice", Group("one", (ball, flat)), np.diag([2.0, 2.0, 2.0, 1.0])),
        Instance("stretched", Group("two", (flat,)), stretched),
        Instance("egg", Group("three", (ball,)), stretched),
    )
    scene = Scene("areas", None, (ball, flat), (diffuse(),), (), camera, 8, 8, instances=instances)
    sphere = 4 * np.pi * 2.0**2
    areas = [surface_of(scene, n) for n in range(5)]
    assert areas[:4] == pytest.approx([sphere, 6.0, 4 * (sphere + 6.0), 12.0])
    assert areas[4] is None, "an egg's area has no formula"


def test_nothing_is_counted_of_an_empty_map():
    opened = open_scene(cornell_box(size=24))
    found = received(opened, PhotonCloud(np.zeros((0, 6), np.float32), 1.0))
    assert (int(found.photons.sum()), found.unknown, float(found.power.sum())) == (0, 0, 0.0)
