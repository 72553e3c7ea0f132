"""Scenes with instances against the same scenes written out: rays, surfaces, pictures, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.kernels.accel.occlusion import cast_occluded
from pmviewer.kernels.accel.raycast import cast_closest, closest_hit
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.scene import light_of, material_of, scene_dtype
from pmviewer.kernels.surface import leave, surface_at
from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.flatten import bounding_sphere, flatten
from pmviewer.scene.arrays.primitives import transformed, with_smooth_normals
from pmviewer.scene.description import Disk, Group, Instance, Parallelogram, Scene, Shape, Sphere
from tests.support.scenes import GLASS, MIRROR, ball_mesh, cube_mesh, diffuse, diffuse_box, rendered, settings_of

SCALES = (1e-4, 1.0, 1e5)


def matrix(linear, offset=(0.0, 0.0, 0.0)):
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = linear, offset
    return m


def some_transforms(n, scale, seed=1):
    """Rotated, unevenly scaled, sheared and every second time mirrored."""
    generator = np.random.default_rng(seed)
    found = []
    for i in range(n):
        turn, _ = np.linalg.qr(generator.normal(size=(3, 3)))
        stretch = np.diag(generator.uniform(0.1, 0.4, 3))
        stretch[0, 1] = generator.uniform(-0.2, 0.2)
        turn *= np.sign(np.linalg.det(turn)) * (-1 if i % 2 else 1)
        found.append(matrix(scale * turn @ stretch, scale * generator.uniform(-1, 1, 3)))
    return found


def expanded(scene: Scene) -> Scene:
    """The naive twin: every instance written out as meshes of its own, in the order of the instances."""
    copies = [
        replace(shape, geometry=transformed(shape.geometry, instance.to_world))
        for instance in scene.instances
        for shape in instance.group.shapes
    ]
    return replace(scene, shapes=(*scene.shapes, *copies), instances=())


def scene_of_instances(scale, n=30, unit=1.0):
    """A box of light around copies of two groups, whose own coordinates are `unit` large and off centre."""
    away = np.array([3.0, -2.0, 1.0]) * unit
    ball = with_smooth_normals(ball_mesh(unit, 2))
    ball = replace(ball, vertices=ball.vertices + away)
    cube = cube_mesh(tuple(away), 0.7 * unit)
    one = Group("both", (Shape("ball", ball, 0), Shape("cube", cube, 1)))
    two = Group("cube", (Shape("cube", cube_mesh((0, 0, 0), unit), 2),))
    back = matrix(np.eye(3) / unit, -away / unit)
    instances = tuple(
        Instance(f"copy {i}", one if i % 3 else two, m @ back) for i, m in enumerate(some_transforms(n, scale))
    )
    light = Parallelogram((-2 * scale, 3 * scale, -2 * scale), (4 * scale, 0, 0), (0, 0, 4 * scale))
    shapes = (Shape("light", light, 0, (1.0, 1.0, 1.0)), Shape("floor", cube_mesh((0, -2 * scale, 0), 0.2 * scale), 1))
    camera = diffuse_box().camera
    return Scene("copies", None, shapes, (diffuse(), diffuse("b", (0.2, 0.3, 0.4)), MIRROR), (), camera, 8, 8,
                 instances=instances)  # fmt: skip


@kernel
def _surfaces(scene, origins, directions, t, prims, points, normals, shading, gaps, materials, lights):
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        t[i], prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], np.float32(0), np.float32(np.inf))
        prims[i] = prim
        if prim < 0:
            continue
        p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t[i])
        for k in range(3):
            points[i, k], normals[i, k], shading[i, k] = p[k], ng[k], ns[k]
        gaps[i], materials[i], lights[i] = gap, material_of(scene, prim), light_of(scene, prim)


def surfaces(flat, origins, directions):
    n = len(origins)
    out = [np.empty(n, np.float32), np.empty(n, np.int32), *(np.zeros((n, 3), np.float32) for _ in range(3))]
    out += [np.zeros(n, np.float32), np.zeros(n, np.int64), np.zeros(n, np.int64)]
    _surfaces(flat.record[0], origins, directions, *out)
    return out


def some_rays(n, scale, seed=2):
    generator = np.random.default_rng(seed)
    origins = (scale * generator.uniform(-1.5, 1.5, (n, 3))).astype(np.float32)
    directions = generator.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return origins, directions.astype(np.float32)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e6])
@pytest.mark.parametrize("scale", SCALES)
def test_same_hits_as_the_scene_written_out(scale, unit):
    scene = scene_of_instances(scale, unit=unit)
    ours, twin = flatten(scene), flatten(expanded(scene))
    assert ours.n_elements == twin.n_elements == twin.n_triangles
    assert ours.n_triangles < 0.2 * twin.n_triangles
    origins, directions = some_rays(20_000, scale)
    t, prim, p, ng, ns, gap, material, light = surfaces(ours, origins, directions)
    t2, prim2, p2, ng2, ns2, _, material2, light2 = surfaces(twin, origins, directions)
    assert (prim2 >= 0).mean() > 0.2
    # The twin numbers its own triangles first and those of the instances in order, as ours does behind the stored ones.
    n_own = len(scene.shapes[1].geometry.faces) + 2
    same = np.where(prim >= ours.n_triangles, prim - ours.n_triangles + n_own, prim) == prim2
    assert (~same).sum() <= 4  # a ray within rounding of an edge may go either way
    hit = same & (prim >= 0)
    np.testing.assert_allclose(t[hit], t2[hit], rtol=1e-4, atol=2e-5 * scale)
    np.testing.assert_allclose(p[hit], p2[hit], atol=1e-5 * scale)
    np.testing.assert_allclose(ng[hit], ng2[hit], atol=1e-4)
    # Normals are interpolated in the group and then turned; uneven scaling makes that a little different.
    np.testing.assert_allclose(ns[hit], ns2[hit], atol=0.15)
    np.testing.assert_array_equal(material[hit], material2[hit])
    np.testing.assert_array_equal(light[hit], light2[hit])
    assert gap[hit].min() > 0
    assert gap[hit].max() < 1e-3 * scale
    blocked = np.empty(len(origins), np.bool_)
    limits = np.zeros(len(origins), np.float32), np.full(len(origins), np.inf, np.float32)
    cast_occluded(ours.record[0], origins, directions, *limits, blocked)
    np.testing.assert_array_equal(blocked, prim >= 0)
    limits = np.zeros(len(origins), np.float32), (t * np.float32(0.999)).astype(np.float32)
    cast_occluded(ours.record[0], origins, directions, *limits, blocked)
    assert not blocked[hit].any()
    cast_occluded(ours.record[0], origins, directions, limits[0], (t * np.float32(1.001)).astype(np.float32), blocked)
    assert blocked[hit].all()


def test_shading_normals_turn_with_the_copy():
    scene = scene_of_instances(1.0)
    turned = []
    for i, m in enumerate(some_transforms(30, 1.0)):
        turn, _ = np.linalg.qr(m[:3, :3])
        turned.append(replace(scene.instances[1], to_world=matrix(0.2 * turn, m[:3, 3] * (1 + i % 2))))
    scene = replace(scene, instances=tuple(turned))
    origins, directions = some_rays(5000, 1.0)
    _, prim, _, ng, ns, *_ = surfaces(flatten(scene), origins, directions)
    _, prim2, _, _, ns2, *_ = surfaces(flatten(expanded(scene)), origins, directions)
    hit = (prim >= 0) & (prim2 >= 0)
    assert (np.abs(ns - ng).max(axis=1) > 1e-3).sum() > 100
    assert (np.abs(ns[hit] - ns2[hit]).max(axis=1) > 1e-4).sum() <= 4


@kernel
def _returns(scene, origins, directions, again):
    """Rays from each hit along both sides of the surface: does the same primitive stop them at once?"""
    far = np.float32(np.inf)
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], np.float32(0), far)
        again[i] = 0
        if prim < 0:
            continue
        p, ng, _, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
        for side in range(2):
            s = np.float32(1 - 2 * side)
            a = leave(p, ng, gap, s * ng[0], s * ng[1], s * ng[2])
            w = directions[(i + 1) % len(origins)]
            if (w[0] * ng[0] + w[1] * ng[1] + w[2] * ng[2]) * s < np.float32(0):
                w = -w
            _, second, _, _ = closest_hit(scene, a[0], a[1], a[2], w[0], w[1], w[2], np.float32(0), far)
            if second == prim:
                again[i] = 1


@pytest.mark.parametrize("far", [0.0, 30.0])
@pytest.mark.parametrize("scale", SCALES)
def test_rays_leave_the_triangle_that_they_start_on(scale, far):
    """A plane can't be met twice, whatever the copy's shear and distance from the origin."""
    scene = scene_of_instances(scale)
    shift = matrix(np.eye(3), (far * scale, -0.7 * far * scale, 0.2 * far * scale))
    moved = replace(scene, instances=tuple(replace(i, to_world=shift @ i.to_world) for i in scene.instances))
    origins, directions = some_rays(20_000, scale)
    again = np.zeros(len(origins), np.int32)
    flat = flatten(moved)
    _returns(flat.record[0], (origins + shift[:3, 3]).astype(np.float32), directions, again)
    assert again.sum() == 0


def test_round_shapes_become_ellipsoids():
    """Analytic shapes in groups stay exact under any transformation: hits obey the equation, normals its gradient."""
    ball, disk = Sphere((1.0, 2.0, 3.0), 0.5), Disk((1, 2, 4), (0, 0, 1), 0.3)
    group = Group("round", (Shape("ball", ball, 0), Shape("disk", disk, 1)))
    m = some_transforms(2, 1.0)[1]
    m[:3, 3] -= m[:3, :3] @ (1.0, 2.0, 3.0)
    box = diffuse_box()
    scene = replace(box, shapes=box.shapes[-1:], materials=(diffuse(), MIRROR), instances=(Instance("egg", group, m),))
    flat = flatten(scene)
    assert (flat.n_quadrics, flat.n_instances, flat.n_elements) == (2, 1, 2 + 2)
    origins, _ = some_rays(4000, 1.0)
    center = m[:3, :3] @ (1.0, 2.0, 3.0) + m[:3, 3]
    directions = (center + 0.05 * np.random.default_rng(4).normal(size=origins.shape) - origins).astype(np.float32)
    _, prim, p, ng, _, _, material, light = surfaces(flat, origins, directions)
    ball = prim == flat.n_triangles + flat.n_quadrics
    assert ball.sum() > 1000
    local = (p[ball] - m[:3, 3]) @ np.linalg.inv(m[:3, :3]).T - (1.0, 2.0, 3.0)
    np.testing.assert_allclose(np.linalg.norm(local, axis=1), 0.5, atol=1e-5)
    gradient = local @ np.linalg.inv(m[:3, :3])
    np.testing.assert_allclose(ng[ball], gradient / np.linalg.norm(gradient, axis=1, keepdims=True), atol=1e-4)
    assert set(material[ball]) == {0}
    assert set(light[ball]) == {-1}


def tiles(n, size=1.0):
    """A closed box [-1, 1]³ of 6 n² square instances of one square."""
    square = Group("tile", (Shape("tile", Parallelogram((0, 0, 0), (1, 0, 0), (0, 1, 0)), 0),))
    found = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            for i in range(n):
                for j in range(n):
                    linear = np.zeros((3, 3))
                    u, v = (axis + 1) % 3, (axis + 2) % 3
                    linear[u, 0] = linear[v, 1] = 2 * size / n
                    linear[axis, 2] = -side * size
                    offset = np.zeros(3)
                    offset[u], offset[v], offset[axis] = (2 * i / n - 1) * size, (2 * j / n - 1) * size, side * size
                    found.append(Instance(f"tile {len(found)}", square, matrix(linear, offset)))
    return tuple(found)


@pytest.mark.parametrize("scale", SCALES)
def test_no_ray_slips_between_neighbouring_instances(scale):
    scene = replace(diffuse_box(), shapes=(), instances=tiles(24, scale))
    light = Shape("lamp", Sphere((0.9 * scale, 0.9 * scale, 0.9 * scale), 0.01 * scale), 0, (1.0, 1.0, 1.0))
    flat = flatten(replace(scene, shapes=(light,)))
    origins, directions = some_rays(200_000, 0.5 * scale)
    t, prim = np.empty(len(origins), np.float32), np.empty(len(origins), np.int32)
    limits = np.zeros(len(origins), np.float32), np.full(len(origins), np.inf, np.float32)
    cast_closest(flat.record[0], origins, directions, *limits, t, prim, np.empty((len(origins), 2), np.float32))
    assert (prim >= 0).all()


def test_bounds_are_those_of_the_scene_written_out():
    scene = scene_of_instances(1.0, n=60)
    center, radius = bounding_sphere(scene)
    expected_center, expected_radius = bounding_sphere(expanded(scene))
    np.testing.assert_allclose(center, expected_center, atol=1e-9)
    assert radius == pytest.approx(expected_radius, rel=1e-9)


def test_traits_look_into_groups():
    scene = scene_of_instances(1.0)
    assert analyse(scene) == analyse(expanded(scene))
    assert analyse(scene).has_specular
    glass = replace(scene, materials=(diffuse(), diffuse(), GLASS))
    assert analyse(glass).has_specular


def test_a_light_in_a_group_and_flat_transformations_are_refused():
    box = diffuse_box()
    lamp = Group("lamp", (Shape("bulb", cube_mesh(), 0, (1.0, 1.0, 1.0)),))
    with pytest.raises(SceneError, match="'bulb' in the group 'lamp' is a light"):
        flatten(replace(box, instances=(Instance("a", lamp, np.eye(4)),)))
    cube = Group("cube", (Shape("cube", cube_mesh(), 0),))
    for bad in (np.diag([1.0, 0, 1, 1]), np.diag([1.0, np.nan, 1, 1]), np.zeros((4, 4))):
        with pytest.raises(SceneError, match="instance 'b' is singular"):
            flatten(replace(box, instances=(Instance("a", cube, np.eye(4)), Instance("b", cube, bad))))
    with pytest.raises(SceneError, match="no surface"):
        flatten(replace(box, instances=(Instance("a", Group("none", ()), np.eye(4)),)))


def test_more_elements_than_ids_are_refused():
    big = Group("big", (Shape("ball", ball_mesh(1.0, 5), 0),))  # 20 480 triangles
    many = tuple(Instance("copy", big, np.eye(4)) for _ in range(105_000))
    with pytest.raises(SceneError, match="can be told apart"):
        flatten(replace(diffuse_box(), instances=many))


@pytest.mark.extensive
@pytest.mark.parametrize("method", ["progressive", "path"])
def test_same_picture_as_the_scene_written_out(method):
    """Copies in a closed box under a lamp: the means of the pictures agree within their noise, and all energy stays."""
    box = diffuse_box()
    cube = Group("cube", (Shape("cube", cube_mesh((0, 0, 0), 0.2), 0),))
    low, high = (box.shapes[0].geometry, box.shapes[-1].geometry)
    assert low is not high
    instances = tuple(Instance(f"{i}", cube, matrix(np.diag([1, s, 1.5]), (x, -0.4, 0.1)))
                      for i, (x, s) in enumerate([(-0.5, 1.0), (0.4, -2.0)]))  # fmt: skip
    scene = replace(box, instances=instances)
    settings = settings_of(render={"method": method}, photons={"N": 20_000})
    ours, twin = (rendered(s, settings, 8).film.planes().sum(0) for s in (scene, expanded(scene)))
    assert ours.mean() == pytest.approx(twin.mean(), rel=0.02)
    assert np.abs(ours - twin).mean() < 0.2 * twin.mean()


def test_records_of_different_scenes_are_never_taken_for_each_other():
    """Numba runs code compiled for a record on any record that begins with the same fields."""
    dtypes = [scene_dtype(b, lt, i) for b in (False, True) for lt in (False, True) for i in (False, True)]
    for a in dtypes:
        for b in dtypes:
            if a is not b:
                shared = min(len(a.names), len(b.names))
                assert [(n, a.fields[n]) for n in a.names[:shared]] != [(n, b.fields[n]) for n in b.names[:shared]]
