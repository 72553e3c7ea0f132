"""Pixels on the outlines of lights: against rays through every part of every pixel, and what they do to the noise."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from pmviewer.kernels.accel.raycast import cast_closest
from pmviewer.render.camera import resolve_camera
from pmviewer.render.direct.outline import outline_pixels
from pmviewer.render.planes import PLANES
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Camera, Cylinder, Disk, Mesh, Parallelogram, Scene, Shape, Sphere
from pmviewer.settings.access import CameraSettings
from tests.support.scenes import diffuse, diffuse_box, rendered, settings_of

f4 = np.float32
BALL = trimesh.creation.icosphere(subdivisions=2, radius=0.6)
SHAPES = {
    "parallelogram": Parallelogram((-0.7, -0.5, 0.2), (1.3, 0.2, 0.1), (0.2, 0.9, 0.3)),
    "disk": Disk((0.1, 0.2, 0.0), (0.0, 0.6, 0.8), 0.7),
    "sphere": Sphere((0.3, -0.2, 0.5), 0.5),
    "cylinder": Cylinder((-0.6, -0.3, 0.0), (0.7, 0.4, 0.5), 0.25),
    "mesh": Mesh(np.array(BALL.vertices), np.array(BALL.faces, np.int32)),
    "half out of the picture": Parallelogram((0.5, -2.0, 1.0), (2.0, 0.0, 0.5), (0.0, 3.0, 0.2)),
    "past the eye": Parallelogram((-0.5, -0.6, 5.0), (1.0, 0.0, 0.0), (0.0, 0.0, -6.0)),
}


def lamp(geometry, size=40):
    camera = Camera((0.2, 0.3, 3.0), (0, 0, 0), (0, 1, 0), 50.0)
    return Scene("lamp", None, (Shape("lamp", geometry, 0, (1.0,) * 3),), (diffuse(),), (), camera, size, size)


def partly_covered(scene, n=12):
    """(pixels,) whether some but not all of n × n rays through a pixel meet the light's front."""
    pose = resolve_camera(scene, CameraSettings())
    flat = flatten(scene)
    eye, corner, right, down = pose.ray_frame()
    place = (np.arange(n) + 0.5) / n
    x = (np.arange(pose.width)[:, None] + place).ravel()
    y = (np.arange(pose.height)[:, None] + place).ravel()
    d = corner + x[None, :, None] * right + y[:, None, None] * down
    d = (d / np.linalg.norm(d, axis=-1, keepdims=True)).reshape(-1, 3).astype(f4)
    m = len(d)
    t, prim, uv = np.empty(m, f4), np.empty(m, np.int32), np.empty((m, 2), f4)
    origins = np.tile(eye.astype(f4), (m, 1))
    cast_closest(flat.record[0], origins, d, np.zeros(m, f4), np.full(m, np.inf, f4), t, prim, uv)
    hit = (prim >= 0).reshape(pose.height, n, pose.width, n).mean(axis=(1, 3))
    return ((hit > 0) & (hit < 1)).ravel()


@pytest.mark.parametrize("name", SHAPES)
def test_every_partly_covered_pixel_is_marked_and_few_others(name):
    scene = lamp(SHAPES[name])
    marked = outline_pixels(scene, resolve_camera(scene, CameraSettings())).astype(bool)
    partly = partly_covered(scene)
    missed, spare = int((partly & ~marked).sum()), int((marked & ~partly).sum())
    print(f"{name}: {partly.sum()} pixels covered in part, {missed} of them not marked, {spare} others marked")
    assert partly.sum() > 20
    assert missed <= 0.01 * partly.sum()
    assert spare <= 1.2 * partly.sum()


def test_a_light_out_of_sight_marks_nothing():
    scene = lamp(Sphere((0.0, 0.0, 9.0), 0.5))
    assert outline_pixels(scene, resolve_camera(scene, CameraSettings())).size == 0


def test_outline_rays_keep_the_mean_and_take_the_noise_of_the_lights_edge():
    """The squared error of the emission term falls to less than a tenth; its mean stays."""
    size, passes = 32, 4
    reference = emission(size, 128, 16)
    with_rays, without = emission(size, passes, 16), emission(size, passes, 0)
    error, plain = ((with_rays - reference) ** 2).mean(), ((without - reference) ** 2).mean()
    means = with_rays.mean(), without.mean(), reference.mean()
    print(f"squared error of emission {error:.2e} with outline rays, {plain:.2e} without; means {means}")
    assert error < 0.1 * plain
    assert with_rays.mean() == pytest.approx(reference.mean(), rel=0.003)
    assert emission(size, 256, 0).mean() == pytest.approx(reference.mean(), rel=0.002)


def emission(size, passes, rays):
    values = {"photons": {"N": 100}, "render": {"method": "progressive", "outline_rays": rays}}
    renderer = rendered(diffuse_box(size=size), settings_of(**values), passes)
    return renderer.film.planes()[..., PLANES["emission"]].astype(np.float64)
