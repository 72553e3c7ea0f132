"""Cameras for files that have none: from outside at things, from inside at rooms, never from the wrong side."""

from __future__ import annotations

import time

import numpy as np
import pytest

from pmviewer.render.camera import resolve_camera
from pmviewer.scene.arrays import primitives
from pmviewer.scene.arrays.primitives import transformed
from pmviewer.scene.defaults.completion import completed, upright
from pmviewer.scene.defaults.framing import direction, fitted
from pmviewer.scene.defaults.proxy import proxy_of
from pmviewer.scene.defaults.viewpoint import chosen_viewpoint
from pmviewer.scene.description import Camera, Material, Mesh, Scene, Shape
from pmviewer.scene.formats.mitsuba.transform import scaling, translation
from pmviewer.settings.access import CameraSettings

GREY = Material("grey", "diffuse", two_sided=True)


def scene_of(*meshes: Mesh) -> Scene:
    shapes = tuple(Shape(f"mesh {i}", mesh, 0) for i, mesh in enumerate(meshes))
    camera = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 40.0)
    return Scene("test", None, shapes, (GREY,), (), camera, 64, 64)


def viewpoint(*meshes: Mesh, up="y"):
    proxy = proxy_of(scene_of(*meshes))
    assert proxy is not None
    return chosen_viewpoint(proxy, up)


def turned(mesh: Mesh) -> Mesh:
    """Inside out."""
    normals = None if mesh.normals is None else -mesh.normals
    return Mesh(mesh.vertices, np.ascontiguousarray(mesh.faces[:, ::-1]), normals)


def ball(at=(0.0, 0.0, 0.0), radius=1.0) -> Mesh:
    mesh = primitives.sphere(24, 48)
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return transformed(Mesh(mesh.vertices, mesh.faces[area > 1e-9]), translation(*at) @ scaling(*(radius,) * 3))


def walls(without: int | None = None, inwards: bool = True) -> Mesh:
    """The cube [-1, 1]³, perhaps without a face: 0 for −x, 1 for +x, 2 −y, 3 +y, 4 −z, 5 +z."""
    mesh = primitives.cube()
    center = mesh.vertices[mesh.faces].mean(axis=1)
    faces = mesh.faces
    if without is not None:
        axis, side = without // 2, (-1, 1)[without % 2]
        faces = faces[center[:, axis] * side < 0.9]
    return turned(Mesh(mesh.vertices, faces)) if inwards else Mesh(mesh.vertices, faces)


@pytest.mark.parametrize("inwards", [True, False])
@pytest.mark.parametrize("face", [0, 1, 4, 5])
def test_an_open_box_is_looked_into_through_its_opening(face, inwards):
    view = viewpoint(walls(face, inwards), ball((0, -0.6, 0), 0.35))
    axis, side = face // 2, (-1, 1)[face % 2]
    eye, ball_center = np.array(view.camera.origin), np.array([0, -0.6, 0])
    if np.abs(eye).max() < 1:
        return  # it stands in the box
    assert eye[axis] * side > 1
    through = ball_center + (eye - ball_center) * (1 - ball_center[axis] * side) / ((eye - ball_center)[axis] * side)
    assert np.abs(through).max() < 1 + 1e-9


def test_a_closed_room_is_looked_at_from_inside():
    furniture = [ball((x, -0.75, z), 0.2) for x in (-0.6, 0.5) for z in (-0.5, 0.6)]
    view = viewpoint(walls(), *furniture)
    assert view.inside
    assert np.abs(view.camera.origin).max() < 1


def test_an_empty_room_is_looked_at_from_inside_and_a_crate_from_outside():
    assert viewpoint(walls()).inside
    assert not viewpoint(walls(inwards=False)).inside


def test_thick_walls_make_no_difference():
    outer = transformed(walls(inwards=False), scaling(1.1, 1.1, 1.1))
    view = viewpoint(walls(), outer, *[ball((x, -0.75, 0.3), 0.2) for x in (-0.6, 0, 0.6)])
    assert view.inside
    assert np.abs(view.camera.origin).max() < 1


@pytest.mark.parametrize("inside_out", [False, True])
def test_a_closed_thing_is_looked_at_from_outside_and_all_of_it(inside_out):
    mesh = turned(ball()) if inside_out else ball()
    view = viewpoint(mesh)
    assert not view.inside
    scene = completed(scene_of(mesh), "headlight")
    x, y, depth = resolve_camera(scene, CameraSettings()).project(mesh.vertices).T
    assert depth.min() > 0
    assert 0 < x.min() < 8
    assert 56 < x.max() < 64
    assert y.min() > 0
    assert y.max() < 64


def test_one_sided_surfaces_are_seen_from_their_front():
    square = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    assert viewpoint(square).camera.origin[2] > 0
    assert viewpoint(turned(square)).camera.origin[2] < 0


def test_a_flat_thing_is_not_seen_from_its_edge():
    plate = transformed(primitives.cube(), scaling(1, 0.01, 1))
    eye = np.array(viewpoint(plate).camera.origin)
    assert eye[1] > 0.3 * np.linalg.norm(eye)


def test_what_lies_far_outside_does_not_shrink_the_picture():
    far = Mesh(np.array([[900.0, 0, 0], [900.1, 0, 0], [900, 0.1, 0]]), np.array([[0, 1, 2]], np.int32))
    view = viewpoint(ball(), far)
    assert np.linalg.norm(view.camera.origin) < 6


def test_a_thing_on_a_wide_ground_is_what_is_looked_at():
    ground = transformed(primitives.cube(), translation(0, -1.1, 0) @ scaling(300, 0.1, 300))
    eye = np.array(viewpoint(ball(), ground).camera.origin)
    assert np.linalg.norm(eye) < 12
    assert eye[1] > -1


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("up", ["y", "z"])
def test_size_does_not_matter(scale, up):
    meshes = walls(5), ball((0, -0.6, 0), 0.35)
    view = viewpoint(*(transformed(mesh, scaling(scale, scale, scale)) for mesh in meshes), up=up)
    same = viewpoint(*meshes, up=up)
    np.testing.assert_allclose(np.array(view.camera.origin) / scale, same.camera.origin, rtol=1e-3, atol=1e-3)
    assert view.camera == viewpoint(*(transformed(m, scaling(scale, scale, scale)) for m in meshes), up=up).camera


def test_a_camera_is_as_near_as_it_can():
    """Of two points at right angles to the view, x = ±1, at distance D: 1 / D = tan(fov / 2) / margin."""
    points = np.array([[-1.0, 0, 0], [1, 0, 0]])
    camera = fitted(points, direction(0, 0, "y"), "y", 90.0)
    np.testing.assert_allclose(camera.origin, (0, 0, 1.06), atol=1e-12)


@pytest.mark.parametrize("azimuth", [-60, 36, 75])
def test_what_reaches_into_the_distance_is_in_the_middle_of_the_picture(azimuth):
    """As far to the left as to the right, and up as down, in the picture and not in the world."""
    row = np.array([[x, y, z] for x in range(0, 20, 2) for y in (0, 1) for z in (0, 1)], float)
    camera = fitted(row, direction(azimuth, 23, "y"), "y", 40.0)
    towards = np.subtract(camera.target, camera.origin)
    towards /= np.linalg.norm(towards)
    right = np.cross(towards, (0, 1, 0))
    right /= np.linalg.norm(right)
    depth = (row - camera.origin) @ towards
    reach = []
    for axis in (right, np.cross(right, towards)):
        seen = (row - camera.origin) @ axis / depth
        assert seen.max() == pytest.approx(-seen.min(), rel=1e-6)
        reach.append(seen.max())
    assert max(reach) == pytest.approx(np.tan(np.radians(20)) / 1.06, rel=1e-6)


def test_z_is_up_where_the_ground_lies_across_it():
    ground = transformed(primitives.cube(), scaling(4, 4, 0.05))
    tower = transformed(primitives.cube(), translation(0, 0, 0.8) @ scaling(0.5, 0.5, 0.7))
    standing = transformed(primitives.cube(), scaling(1, 2, 1))
    for meshes, expected in (((ground, tower), "z"), ((standing,), "y"), ((ball(),), "y")):
        scene = scene_of(*meshes)
        proxy = proxy_of(scene)
        assert proxy is not None
        assert upright(scene, proxy) == expected


def test_a_million_triangles_are_no_reason_to_wait():
    n = 720
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, n, endpoint=False), np.linspace(0, 2 * np.pi, n, endpoint=False))
    r = 1 + 0.3 * np.cos(v)
    vertices = np.stack([r * np.cos(u), 0.3 * np.sin(v), r * np.sin(u)], axis=-1).reshape(-1, 3)
    a = np.arange(n * n).reshape(n, n)
    b, c, d = np.roll(a, -1, 1), np.roll(np.roll(a, -1, 0), -1, 1), np.roll(a, -1, 0)
    faces = np.concatenate([np.stack([a, d, c], -1), np.stack([a, c, b], -1)]).reshape(-1, 3).astype(np.int32)
    assert len(faces) > 1_000_000
    viewpoint(ball())  # compiled
    scene = scene_of(Mesh(vertices, faces))
    start = time.process_time()
    proxy = proxy_of(scene)
    assert proxy is not None
    assert not chosen_viewpoint(proxy, "y").inside
    assert time.process_time() - start < 2.0
    assert len(proxy.areas) < 130_000
