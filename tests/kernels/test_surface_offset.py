"""Rays that leave a surface do not meet it again, at any scale and wherever the surface lies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.surface import leave, surface_at
from pmviewer.kernels.vector import dot
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Disk, Mesh, Parallelogram, Scene, Shape, Sphere
from tests.support.scenes import ball_mesh, box_camera, diffuse

SCALES = (1e-4, 1.0, 1e5)


@kernel
def _bounce(scenes, origins, directions, next_directions, side, first, second, distance, points):
    """From each ray's hit, leave in the given direction turned to the normal's side (1) or the other (-1)."""
    scene = scenes[0]
    inf = np.float32(np.inf)
    zero = np.float32(0.0)
    for i in range(len(origins)):
        o = (origins[i, 0], origins[i, 1], origins[i, 2])
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        t, first[i], u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], zero, inf)
        second[i] = -2
        if first[i] < 0:
            continue
        p, ng, _, gap = surface_at(scene, first[i], u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
        w = (next_directions[i, 0], next_directions[i, 1], next_directions[i, 2])
        if dot(w, ng) * side < zero:
            w = (-w[0], -w[1], -w[2])
        points[i] = p
        q = leave(p, ng, gap, w[0], w[1], w[2])
        distance[i], second[i], _, _ = closest_hit(scene, q[0], q[1], q[2], w[0], w[1], w[2], zero, inf)


def bounce(shapes, origins, directions, side, seed=5):
    scene = Scene("surface", None, shapes, (diffuse(),), (), box_camera(), 8, 8)
    lit = replace(scene, shapes=tuple(replace(s, radiance=(1.0,) * 3) for s in shapes))
    flat = flatten(lit)
    n = len(origins)
    turn = np.random.default_rng(seed).normal(size=(n, 3))
    turn = (turn / np.linalg.norm(turn, axis=1, keepdims=True)).astype(np.float32)
    first, second = np.empty(n, np.int32), np.empty(n, np.int32)
    distance, points = np.empty(n, np.float32), np.zeros((n, 3), np.float32)
    origins, directions = (np.ascontiguousarray(a, np.float32) for a in (origins, directions))
    _bounce(flat.record, origins, directions, turn, np.float32(side), first, second, distance, points)
    return first, second, distance, points


def inward_rays(n, distance, radius, seed=1):
    """Rays from a sphere of that size towards points within `radius` of the origin."""
    generator = np.random.default_rng(seed)
    origins = generator.normal(size=(n, 3))
    origins *= distance / np.linalg.norm(origins, axis=1, keepdims=True)
    targets = generator.normal(size=(n, 3))
    targets *= radius * generator.random((n, 1)) ** (1 / 3) / np.linalg.norm(targets, axis=1, keepdims=True)
    d = targets - origins
    return origins, d / np.linalg.norm(d, axis=1, keepdims=True)


N = 100_000


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("shape", ["sphere", "mesh"])
def test_rays_that_leave_a_ball_outwards_never_come_back(shape, scale):
    ball = Sphere((0, 0, 0), scale) if shape == "sphere" else ball_mesh(scale)
    origins, directions = inward_rays(N, 3 * scale, 0.95 * scale)
    first, second, _, _ = bounce((Shape("ball", ball, 0),), origins, directions, side=1)
    again = int((second[first >= 0] >= 0).sum())
    print(f"{shape} of radius {scale:g}: {again} of {(first >= 0).sum()} rays hit their own surface")
    assert (first >= 0).all()
    assert again == 0


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("shape", ["sphere", "mesh"])
def test_rays_that_enter_a_ball_cross_it(shape, scale):
    """None escapes through the surface it has just left, and none ends there."""
    ball = Sphere((0, 0, 0), scale) if shape == "sphere" else ball_mesh(scale)
    origins, directions = inward_rays(N, 3 * scale, 0.95 * scale)
    first, second, distance, _ = bounce((Shape("ball", ball, 0),), origins, directions, side=-1)
    assert (first >= 0).all()
    escaped = int((second < 0).sum())
    if shape == "sphere":
        same = int((distance < 1e-4 * scale).sum())  # a chord shorter than that is a ray within 3e-5 of the tangent
    else:
        same = int((second == first).sum())
    print(f"{shape} of radius {scale:g}: {escaped} escaped, {same} ended where they began")
    assert escaped == 0
    assert same <= (1e-4 * N if shape == "sphere" else 0)


def tilted(scale):
    """A plane of that half-width through the origin, in general position: a square, a mesh, a disk."""
    generator = np.random.default_rng(4)
    axes = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    u, v = scale * axes[0], scale * axes[1]
    grid = np.linspace(-1, 1, 8)
    s, t = (g.ravel() for g in np.meshgrid(grid, grid))
    i, j = (g.ravel() for g in np.meshgrid(np.arange(7), np.arange(7)))
    a = j * 8 + i
    faces = np.concatenate([np.stack([a, a + 1, a + 9], 1), np.stack([a, a + 9, a + 8], 1)]).astype(np.int32)
    return {
        "square": Parallelogram(tuple(-u - v), tuple(2 * u), tuple(2 * v)),
        "mesh": Mesh(s[:, None] * u + t[:, None] * v, faces),
        "disk": Disk((0.0, 0.0, 0.0), tuple(axes[2]), scale),
    }


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("shape", ["square", "mesh", "disk"])
@pytest.mark.parametrize("spot", [1.0, 1e-2, 1e-4])
def test_a_large_tilted_plane_near_the_origin_is_not_met_again(shape, scale, spot):
    """Where coordinates vanish, the rounding errors of a large primitive do not: the offset may not follow the point's
    own coordinates alone."""
    origins, directions = inward_rays(50_000, 2 * scale, 0.3 * spot * scale)
    for side in (1, -1):
        first, second, _, _ = bounce((Shape("plane", tilted(scale)[shape], 0),), origins, directions, side)
        again = int((second[first >= 0] >= 0).sum())
        print(f"{shape} {scale:g}, spot {spot:g}: {again} of {(first >= 0).sum()} rays hit the plane again")
        assert (first >= 0).sum() > 10_000
        assert again == 0
