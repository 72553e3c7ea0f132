"""Rays per second on one core against Embree's single-ray calls (P6)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from pmviewer.bench.embree import EmbreeScene, embree_closest, embree_occluded
from pmviewer.bench.report import BenchResult, Target
from pmviewer.kernels.accel import bvh, occlusion, raycast
from pmviewer.kernels.accel.quadric import QUADRIC_FLOATS

BOUND = 1.2
F4 = NDArray[np.float32]


@dataclass(frozen=True)
class Rays:
    """Origins and directions (n, 3), lower and upper limits of t (n,)."""

    origins: F4
    directions: F4
    tmin: F4
    tmax: F4

    def __len__(self) -> int:
        return len(self.origins)


def _quad(a: tuple, b: tuple, c: tuple, d: tuple) -> NDArray[np.float64]:
    return np.array([[a, b, c], [a, c, d]], np.float64)


def _room() -> NDArray[np.float64]:
    """Five walls of [-1, 1] × [0, 2] × [-1, 1] and a lamp below the ceiling."""
    return np.concatenate(
        [
            _quad((-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)),
            _quad((-1, 2, -1), (1, 2, -1), (1, 2, 1), (-1, 2, 1)),
            _quad((-1, 0, -1), (1, 0, -1), (1, 2, -1), (-1, 2, -1)),
            _quad((-1, 0, -1), (-1, 2, -1), (-1, 2, 1), (-1, 0, 1)),
            _quad((1, 0, -1), (1, 0, 1), (1, 2, 1), (1, 2, -1)),
            _quad((-0.25, 1.99, -0.25), (0.25, 1.99, -0.25), (0.25, 1.99, 0.25), (-0.25, 1.99, 0.25)),
        ]
    )


def _sphere(center: tuple[float, float, float], radius: float) -> NDArray[np.float64]:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return mesh.triangles + np.array(center)


def small_scene() -> F4:
    """A Cornell box with two tessellated spheres and a block, 10 k triangles, (n, 3, 3)."""
    block = trimesh.creation.box((0.6, 1.1, 0.6), trimesh.transformations.rotation_matrix(0.3, (0, 1, 0)))
    parts = [_room(), block.triangles + np.array((-0.35, 0.55, -0.4))]
    parts += [_sphere((0.4, 0.35, 0.3), 0.35), _sphere((-0.4, 0.3, 0.5), 0.3)]
    return np.ascontiguousarray(np.concatenate(parts), np.float32)


def large_scene(n: int = 500) -> F4:
    """The same room with a floor of 2n² triangles displaced by a sum of waves, and a sphere above it."""
    x = np.linspace(-1.0, 1.0, n + 1)
    X, Z = np.meshgrid(x, x, indexing="ij")
    generator = np.random.default_rng(1)
    Y = np.full_like(X, 0.35)
    for k in range(1, 40):
        frequency = 1.5 * 1.17**k
        heading, phase = generator.uniform(0.0, 2.0 * np.pi, 2)
        Y += 0.25 / frequency**0.8 * np.sin(frequency * (np.cos(heading) * X + np.sin(heading) * Z) + phase)
    P = np.stack([X, Y, Z], -1)
    a, b, c, d = P[:-1, :-1], P[:-1, 1:], P[1:, 1:], P[1:, :-1]
    floor = [np.stack(corners, 2).reshape(-1, 3, 3) for corners in ((a, b, c), (a, c, d))]
    return np.ascontiguousarray(np.concatenate([_room(), *floor, _sphere((0.3, 1.1, 0.2), 0.3)]), np.float32)


def _normalize(v: NDArray[np.float64]) -> NDArray[np.float64]:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def rays_from(origins: NDArray, directions: NDArray, tmax: NDArray | float) -> Rays:
    """As a record of contiguous float32 arrays, from 1e-5 on; what is given once is the same for all."""
    n = len(directions)
    limit = np.broadcast_to(np.asarray(tmax, np.float32), n)
    contiguous = [np.ascontiguousarray(x, np.float32) for x in (origins, directions, np.full(n, 1e-5), limit)]
    return Rays(*contiguous)


def camera_rays(size: int) -> Rays:
    """One jittered ray per pixel of a size × size image, in scanline order."""
    generator = np.random.default_rng(0)
    y, x = (np.indices((size, size)) + generator.random((2, size, size))) / size * 2.0 - 1.0
    directions = np.stack([0.38 * x.ravel(), -0.38 * y.ravel() - 0.02, np.full(size * size, -1.0)], 1)
    return rays_from(np.broadcast_to((0.0, 1.05, 3.6), directions.shape), _normalize(directions), np.inf)


def secondary_rays(triangles: F4, rays: Rays, t: F4, primitive: NDArray[np.int32]) -> tuple[Rays, Rays]:
    """From the hits of `rays`: diffuse bounces (cosine-distributed) and shadow rays to the lamp."""
    hit = primitive >= 0
    corners = triangles[primitive[hit]].astype(np.float64)
    directions = rays.directions[hit].astype(np.float64)
    normals = _normalize(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    normals *= -np.sign((normals * directions).sum(1, keepdims=True))
    points = rays.origins[hit] + directions * t[hit, None] + 1e-4 * normals
    generator = np.random.default_rng(1)
    bounce = _normalize(normals + 0.9999 * _normalize(generator.normal(size=points.shape)))
    lamp = np.stack([*generator.uniform(-0.25, 0.25, (2, len(points))), np.full(len(points), 1.985)], 1)[:, [0, 2, 1]]
    distance = np.linalg.norm(lamp - points, axis=1)
    return rays_from(points, bounce, np.inf), rays_from(points, (lamp - points) / distance[:, None], 0.999 * distance)


def race(contestants: list[Callable[[], None]], rounds: int) -> list[float]:
    """Shortest time of each contestant in seconds; they take turns, so that a busy moment disturbs all alike."""
    times = np.full((rounds + 1, len(contestants)), np.inf)
    for i in range(rounds + 1):
        for j, contestant in enumerate(contestants):
            start = time.perf_counter()
            contestant()
            times[i, j] = time.perf_counter() - start
    return [float(x) for x in times[1:].min(0)]  # the first round compiled and filled the caches


def _measure(name: str, triangles: F4, size: int, rounds: int) -> tuple[list[list[str | float | int]], list[Target]]:
    start = time.perf_counter()
    tree = bvh.build(triangles, np.empty((0, QUADRIC_FLOATS), np.float32))
    build_time = time.perf_counter() - start
    scene = np.zeros(1, np.dtype(bvh.BVH_FIELDS))
    tree.store(scene[0])
    embree = EmbreeScene(triangles)
    camera = camera_rays(size)
    n = len(camera)
    t, primitive, uv = np.empty(n, np.float32), np.empty(n, np.int32), np.empty((n, 2), np.float32)
    theirs = np.empty(n, np.int32)
    blocked, theirs_blocked = np.empty(n, np.bool_), np.empty(n, np.bool_)

    def closest(rays: Rays) -> list[Callable[[], None]]:
        data, m = (rays.origins, rays.directions, rays.tmin, rays.tmax), len(rays)
        return [
            lambda: raycast.cast_closest(scene[0], *data, t[:m], primitive[:m], uv[:m]),
            lambda: embree_closest(embree.intersect1, embree.scene, *data, t[:m], theirs[:m], uv[:m]),
        ]

    def shadow(rays: Rays) -> list[Callable[[], None]]:
        data, m = (rays.origins, rays.directions, rays.tmin, rays.tmax), len(rays)
        return [
            lambda: occlusion.cast_occluded(scene[0], *data, blocked[:m]),
            lambda: embree_occluded(embree.occluded1, embree.scene, *data, theirs_blocked[:m]),
        ]

    closest(camera)[0]()
    bounce, to_lamp = secondary_rays(triangles, camera, t, primitive)
    rows: list[list[str | float | int]] = []
    targets = []
    for kind, rays, contestants in (
        ("camera", camera, closest(camera)),
        ("diffuse bounce", bounce, closest(bounce)),
        ("shadow", to_lamp, shadow(to_lamp)),
    ):
        ours, embrees = race(contestants, rounds)
        m = len(rays)
        unequal = (blocked[:m] != theirs_blocked[:m]) if kind == "shadow" else (primitive[:m] < 0) != (theirs[:m] < 0)
        ratio = embrees / ours
        rows.append([name, len(triangles), kind, m / ours / 1e6, m / embrees / 1e6, ratio, int(unequal.sum())])
        note = f"{name}, {kind}; tree built in {build_time:.2f} s"
        targets.append(Target("P6", ratio, BOUND, "× Embree", True, note))
    embree.close()
    return rows, targets


def run(quick: bool = False) -> BenchResult:
    """Compare ray casting with Embree on both scenes; `quick` takes fewer rounds."""
    size, rounds = 512, 7 if quick else 30  # short turns: a quiet moment of both contestants is then likely
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    EmbreeScene(small_scene()[:1]).close()  # complain about a missing Embree before the work
    bvh.build(small_scene()[:1], np.empty((0, QUADRIC_FLOATS), np.float32))  # compile outside the timed build
    for name, triangles in (("small", small_scene()), ("large", large_scene())):
        more_rows, more_targets = _measure(name, triangles, size, rounds)
        rows += more_rows
        targets += more_targets
    columns = ["scene", "triangles", "rays", "Mrays/s", "Embree Mrays/s", "ratio", "hit/miss differs"]
    return BenchResult("Ray casting on one core against Embree 4 (rtcIntersect1, rtcOccluded1)", columns, rows, targets)
