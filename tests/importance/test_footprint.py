"""Footprints against finite differences: the same importon with its place in the image moved a little."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from pmviewer.importance.importons import IMPORTON_COLUMNS, IMPORTON_PASS_DTYPE, N_COUNTS
from pmviewer.importance.trace import trace_importons
from pmviewer.kernels.dimensions import IMPORTON_SALT
from pmviewer.scene.description import Camera, Cylinder, Group, Instance, Mesh, Scene, Shape, Sphere
from tests.support.importon_paths import GATHER, SHOWN, traced
from tests.support.scenes import GLASS, MIRROR, box_walls, diffuse, diffuse_box

STEP = 0.05
"""Pixels that the place in the image is moved."""


def smooth_ball(radius, center):
    ball = trimesh.creation.icosphere(4, radius)
    vertices = np.asarray(ball.vertices, float)
    return Mesh(vertices + center, np.asarray(ball.faces, np.int32), normals=vertices / radius)


def around(shape, material):
    """A box with one thing in its middle that the camera looks at."""
    camera = Camera((0.1, 0.2, 0.95), (0.05, 0, 0), (0, 1, 0), 32.0, near=0.0, far=np.inf)
    shapes = (*box_walls(), Shape("thing", shape, 1))
    return Scene("thing", None, shapes, (diffuse(), material), (), camera, 64, 64)


def rows_of(opened, eye, rule, i, dx=0.0, dy=0.0):
    """What importon i stores in both maps, with its place in the image moved by (dx, dy) pixels."""
    moved = eye.copy()
    for axis in "xyz":
        moved[f"{axis}_corner"] += np.float32(dx) * eye[f"{axis}_right"] + np.float32(dy) * eye[f"{axis}_down"]
    whole = 0, 0, eye["width"][0], eye["height"][0]
    record = np.zeros(1, IMPORTON_PASS_DTYPE)
    stored = rule.caustic, rule.global_, rule.gather
    record[0] = (1 ^ IMPORTON_SALT, rule.max_depth, 0.2, *stored, False, 0.0, False, *whole)
    out = np.zeros((2, 80, IMPORTON_COLUMNS), np.float32)
    counts = np.zeros(N_COUNTS, np.int64)
    trace_importons(opened.flat.record, moved, record, i, i + 1, out[0], out[1], counts)
    return out[0, : counts[0]], out[1, : counts[1]]


THINGS = {
    "mirror ball": (Sphere((0, 0, 0), 0.3), MIRROR),
    "glass ball": (Sphere((0, 0, 0), 0.3), GLASS),
    "mirror cylinder": (Cylinder((-0.3, -0.4, 0), (0.3, 0.4, 0.1), 0.25), MIRROR),
    "smooth mirror mesh": (smooth_ball(0.3, 0.0), MIRROR),
    "smooth glass mesh": (smooth_ball(0.3, 0.0), GLASS),
}


@pytest.mark.parametrize("name", list(THINGS))
def test_reflection_and_refraction(name):
    compare(around(*THINGS[name]))


def wall_of(rows):
    return rows.view(np.uint32)[0, 3]


def compare(scene):
    _, eye, opened = traced(scene, SHOWN, 1)
    ratios = []
    for i in range(500):
        base = rows_of(opened, eye, SHOWN, i)[1]
        ends = [rows_of(opened, eye, SHOWN, i, *step)[1] for step in ((STEP, 0), (-STEP, 0), (0, STEP), (0, -STEP))]
        if len(base) != 1 or any(len(end) != 1 or wall_of(end) != wall_of(base) for end in ends):
            continue  # reflected here and refracted there, or on another wall
        places = [end[0, :3].astype(float) for end in ends]
        across, down = (places[0] - places[1]) / (2 * STEP), (places[2] - places[3]) / (2 * STEP)
        ratios.append(np.linalg.norm(np.cross(across, down)) * base[0, 5])
    ratios = np.array(ratios)
    assert len(ratios) > 350
    assert np.median(ratios) == pytest.approx(1, abs=0.002)
    assert np.mean(np.abs(ratios - 1) < 0.03) > 0.9


@pytest.mark.parametrize("shape", [Sphere((5, 1, 2), 2.0), smooth_ball(2.0, np.array([5.0, 1.0, 2.0]))])
def test_curvature_of_instances(shape):
    """A stretched and turned copy of a ball."""
    turn = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3))
    to_world = turn @ np.diag([0.13, 0.11, 0.14, 1.0]) @ trimesh.transformations.translation_matrix((-5, -1, -2))
    scene = around(Sphere((0, 0, 0), 0.3), MIRROR)
    group = Group("ball", (Shape("ball", shape, 1),))
    compare(replace(scene, shapes=scene.shapes[:6], instances=(Instance("copy", group, to_world),)))


def diffuse_paths(size, N):
    """Points x and x' with the normals of a box's walls, and the importance stored at x', of importons with both."""
    scene = replace(diffuse_box(size=size), shapes=diffuse_box().shapes[:6])
    _, eye, opened = traced(scene, GATHER, 1)
    found = [rows_of(opened, eye, GATHER, i) for i in range(N)]
    both = np.array([np.concatenate([c[0], g[0]]) for c, g in found if len(c) == 1 and len(g) == 1], float)
    return both[:, :3], both[:, 6:9], both[:, 11]


def inwards(points):
    normals = np.zeros_like(points)
    rows, axis = np.arange(len(points)), np.abs(points).argmax(axis=1)
    normals[rows, axis] = -np.sign(points[rows, axis])
    return normals


def test_diffuse_bounce():
    """With tiny pixels, the area over which x' moves with the two random numbers of the diffuse direction."""
    x, y, found = diffuse_paths(4096, 800)
    n, m = inwards(x), inwards(y)
    assert len(x) > 200
    helper = np.where(np.abs(n[:, :1]) > 0.5, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    s = np.cross(n, helper)
    t = np.cross(n, s)
    d = (y - x) / np.linalg.norm(y - x, axis=1, keepdims=True)
    local = np.stack([(d * s).sum(1), (d * t).sum(1)])
    u, phi = (local**2).sum(axis=0), np.arctan2(local[1], local[0])  # a warp of the square: sin²θ, φ/2π

    def moved(du, dv):
        """Where the plane of y is met by the direction of the random numbers moved by du and dv."""
        r, a = np.sqrt(u + du), phi + 2 * np.pi * dv
        wi = (r * np.cos(a))[:, None] * s + (r * np.sin(a))[:, None] * t + np.sqrt(1 - u - du)[:, None] * n
        return x + wi * (((y - x) * m).sum(1) / (wi * m).sum(1))[:, None]

    h = 1e-5
    keep = (u > 2 * h) & (u < 0.99)
    across = (moved(h, 0) - moved(-h, 0)) / (2 * h)
    down = (moved(0, h) - moved(0, -h)) / (2 * h)
    ratio = (np.linalg.norm(np.cross(across, down), axis=1) * found)[keep]
    assert np.median(ratio) == pytest.approx(1, abs=0.002)
    assert np.mean(np.abs(ratio - 1) < 0.02) > 0.95


def test_large_pixels_widen_the_footprint_of_a_bounce():
    """A footprint after a diffuse bounce is at least that of the bounce, and near a corner that of the pixel."""
    x, y, found = diffuse_paths(8, 400)
    d = y - x
    r2 = (d**2).sum(axis=1)
    cosines = np.abs((d * inwards(x)).sum(1) * (d * inwards(y)).sum(1)) / r2
    bounce = cosines / (np.pi * r2)
    assert (found <= bounce * 1.001).all()
    assert (found < 0.5 * bounce).any()
    assert np.median(found / bounce) > 0.9


def test_refracted_pixels_ask_for_more():
    """A lens magnifies: fewer pixels look at a place behind it in the glass ball's rim, more in its focus."""
    scene = around(*THINGS["glass ball"])
    found = traced(scene, SHOWN, 5000)[0].global_.footprints
    plain = traced(replace(scene, shapes=scene.shapes[:6]), SHOWN, 5000)[0].global_.footprints
    assert found.max() > 3 * plain.max()
    assert found.min() < 0.5 * plain.min()
