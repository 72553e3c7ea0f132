"""From descriptions to arrays: primitives, lights, traits, and the triangles that the window draws."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.kernels.accel.raycast import cast_closest
from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.flatten import bounding_sphere, flatten
from pmviewer.scene.arrays.tessellate import tessellate
from pmviewer.scene.description import (
    ConstantEnvironment,
    Cylinder,
    Disk,
    Mesh,
    Parallelogram,
    PointLight,
    Shape,
    Sphere,
)
from tests.support.scenes import (
    GLASS,
    LIGHTS,
    MIRROR,
    ball_in_environment,
    ball_mesh,
    cornell_box,
    cube_mesh,
    diffuse,
    diffuse_box,
    light_scene,
)

SHAPES = {
    "square": (Parallelogram((1, 2, 3), (2, 0, 0.5), (0, 1, 1)), math.hypot(1 * 0.5, 2, 2)),
    "disk": (Disk((1, 0, 0), (0.6, 0.8, 0), 0.7), math.pi * 0.49),
    "sphere": (Sphere((0, 1, 0), 1.5), 4 * math.pi * 2.25),
    "sphere inside": (Sphere((0, 1, 0), 1.5, True), 4 * math.pi * 2.25),
    "cylinder": (Cylinder((0, 0, 0), (1, 2, 2), 0.4), 2 * math.pi * 0.4 * 3),
    "cylinder inside": (Cylinder((0, 0, 0), (1, 2, 2), 0.4, True), 2 * math.pi * 0.4 * 3),
    "mesh": (cube_mesh((0, 0, 1), 0.5), 6.0),
}


def alone(geometry, **changes):
    return replace(diffuse_box(), shapes=(Shape("it", geometry, 0, (1.0, 2.0, 3.0)),), **changes)


@pytest.mark.parametrize("name", SHAPES)
def test_area_and_power(name):
    geometry, area = SHAPES[name]
    flat = flatten(alone(geometry))
    assert flat.light_power[0] == pytest.approx(math.pi * area * np.array([1.0, 2.0, 3.0]), rel=1e-6)
    assert flat.total_luminance == pytest.approx(math.pi * area * (0.2126 + 2 * 0.7152 + 3 * 0.0722), rel=1e-6)


@pytest.mark.parametrize("name", SHAPES)
def test_drawn_triangles_are_the_traced_surface(name):
    """Same area up to the fineness of the cut, normals on the front, and rays meet them where they meet the shape."""
    geometry, area = SHAPES[name]
    scene = alone(geometry)
    drawn = tessellate(scene)
    corners = drawn.vertices.reshape(-1, 3, 3).astype(float)
    normals = drawn.normals.reshape(-1, 3, 3).astype(float)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(cross, axis=1) / 2
    assert sizes.sum() == pytest.approx(area, rel=3e-3)
    assert np.abs(np.linalg.norm(normals, axis=2) - 1).max() < 1e-5
    assert drawn.albedo[0] == pytest.approx((1 / 3, 2 / 3, 1))
    assert all(a.dtype == np.float32 and a.flags.c_contiguous for a in (drawn.vertices, drawn.normals, drawn.albedo))

    flat = flatten(scene)
    chosen = np.flatnonzero(sizes > 1e-3 * sizes.max())
    centre, front = corners[chosen].mean(1), normals[chosen].mean(1)
    front /= np.linalg.norm(front, axis=1, keepdims=True)
    reach = 0.05
    n = len(chosen)
    origins, directions = (np.ascontiguousarray(a, np.float32) for a in (centre + reach * front, -front))
    t, prim, uv = np.empty(n, np.float32), np.empty(n, np.int32), np.empty((n, 2), np.float32)
    cast_closest(
        flat.record[0], origins, directions, np.zeros(n, np.float32), np.full(n, np.inf, np.float32), t, prim, uv
    )
    assert np.all(prim >= 0)
    assert np.abs(t - reach).max() < 0.01


@pytest.mark.parametrize("name", SHAPES)
def test_bounding_sphere_holds_everything(name):
    scene = alone(SHAPES[name][0])
    center, radius = bounding_sphere(scene)
    distance = np.linalg.norm(tessellate(scene).vertices - center, axis=1)
    assert distance.max() <= radius * (1 + 1e-5)
    assert distance.max() > 0.3 * radius


def test_unused_vertices_do_not_count():
    cube = cube_mesh()
    stray = Mesh(np.vstack([cube.vertices, [[1000.0, 0, 0]]]), cube.faces)
    assert bounding_sphere(alone(stray))[1] == pytest.approx(math.sqrt(3))


def test_a_scene_needs_a_surface_and_a_light():
    with pytest.raises(SceneError, match="no surface"):
        flatten(replace(diffuse_box(), shapes=()))
    with pytest.raises(SceneError, match="no light"):
        flatten(replace(diffuse_box(), shapes=diffuse_box().shapes[:-1]))
    black = tuple(replace(s, radiance=(0.0, 0.0, 0.0)) for s in diffuse_box().shapes)
    with pytest.raises(SceneError, match="no light"):
        flatten(replace(diffuse_box(), shapes=black))
    off = replace(diffuse_box(), shapes=diffuse_box().shapes[:-1], lights=(PointLight("off", (0, 0, 0), (0, 0, 0)),))
    with pytest.raises(SceneError, match="no light"):
        flatten(off)


def test_names_and_order_of_lights():
    flat = flatten(light_scene(*LIGHTS))
    assert flat.light_names == tuple(LIGHTS)
    assert flat.n_quadrics == 5
    assert flat.n_triangles == 2 + 2 + 12


def test_smooth_normals_are_kept_beside_flat_faces():
    ball = ball_mesh(1.0, 1)
    smooth = replace(ball, normals=ball.vertices / np.linalg.norm(ball.vertices, axis=1, keepdims=True))
    scene = replace(diffuse_box(), shapes=(*diffuse_box().shapes, Shape("ball", smooth, 0)))
    assert analyse(scene).has_smooth_normals
    assert not analyse(diffuse_box()).has_smooth_normals
    assert flatten(scene).record[0]["normals"] != 0
    assert flatten(diffuse_box()).record[0]["normals"] == 0


def test_traits_are_of_what_is_used():
    traits = analyse(cornell_box())
    assert (traits.has_specular, traits.has_diffuse, traits.has_environment) == (True, True, False)
    assert (traits.n_lights, traits.many_lights) == (1, False)
    plain = analyse(replace(diffuse_box(), materials=(diffuse(), MIRROR, GLASS)))  # no shape uses them
    assert not plain.has_specular
    sky = analyse(ball_in_environment(MIRROR))
    assert (sky.has_specular, sky.has_diffuse, sky.has_environment) == (True, False, True)
    black = analyse(ball_in_environment(replace(MIRROR, reflectance=(0.0, 0.0, 0.0))))
    assert not black.has_specular
    two = replace(diffuse_box(), lights=(ConstantEnvironment("sky", (1.0,) * 3),))
    assert analyse(two).many_lights


def test_scenes_without_colours_used_store_none():
    """Those of a mesh whose material asks for none."""
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]], np.int32), colours=np.ones((3, 3)))
    box = diffuse_box()
    assert "colours" not in flatten(replace(box, shapes=(*box.shapes, Shape("m", mesh, 0)))).record.dtype.names
