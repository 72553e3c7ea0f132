"""Instances against the same scene written out: rays per second on one core, time to open, memory (X3)."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.measures.rays import Rays, race, rays_from
from pmviewer.bench.report import BenchResult, Target
from pmviewer.kernels.accel.occlusion import cast_occluded
from pmviewer.kernels.accel.raycast import cast_closest
from pmviewer.scene.arrays.flatten import FlatScene, flatten
from pmviewer.scene.arrays.primitives import transformed
from pmviewer.scene.description import Mesh, Scene
from pmviewer.scene.load import load_scene

SCENE = "cornell_fractal"
ELEMENTS = 1_600_000
BUILD_SECONDS, MANY = 2.0, 100_000


def written_out(scene: Scene) -> Scene:
    """The scene without instances: each of their shapes, which must be meshes, a mesh of its own."""
    copies = []
    for instance in scene.instances:
        for shape in instance.group.shapes:
            assert isinstance(shape.geometry, Mesh)
            copies.append(replace(shape, geometry=transformed(shape.geometry, instance.to_world)))
    return replace(scene, shapes=(*scene.shapes, *copies), instances=())


def megabytes(flat: FlatScene) -> float:
    """Of the arrays that kernels read."""
    trees = (flat.bvh, *flat.trees)
    return (sum(a.nbytes for a in flat.arrays.values()) + sum(tree.bytes for tree in trees)) / 1e6


def many(scene: Scene, count: int) -> Scene:
    """`count` copies of a tile of the scene at random places in its box."""
    generator = np.random.default_rng(0)
    first = scene.instances[0]
    copies = []
    for place in generator.uniform(0.0, 1.0, (count, 3)):
        m = np.eye(4)
        m[:3, :3] = 0.02 * np.linalg.qr(generator.normal(size=(3, 3)))[0]
        m[:3, 3] = place
        copies.append(replace(first, to_world=m))
    return replace(scene, instances=tuple(copies))


def camera_rays(scene: Scene, size: int) -> Rays:
    """From the scene's eye over its opening, the unit square in z = 0, in scanline order."""
    y, x = (np.indices((size, size)) + 0.5) / size
    eye = np.array(scene.camera.origin)
    towards = np.stack([x.ravel(), 1.0 - y.ravel(), np.zeros(size * size)], 1) - eye
    return _unit_rays(np.broadcast_to(eye, towards.shape), towards)


def random_rays(n: int) -> Rays:
    """From places in the box in all directions: as incoherent as rays get."""
    generator = np.random.default_rng(1)
    return _unit_rays(generator.uniform(0.1, 0.9, (n, 3)), generator.normal(size=(n, 3)))


def _unit_rays(origins: NDArray, towards: NDArray) -> Rays:
    return rays_from(origins, towards / np.linalg.norm(towards, axis=1, keepdims=True), np.inf)


def run(quick: bool = False) -> BenchResult:
    """Race both versions of the fractal box; `quick` takes fewer rounds."""
    size, rounds = 256, 5 if quick else 20
    start = time.perf_counter()
    scene = load_scene(SCENE)
    loaded = time.perf_counter() - start
    flatten(replace(scene, instances=scene.instances[:1]))  # compile outside the timed build
    start = time.perf_counter()
    ours = flatten(scene)
    build = time.perf_counter() - start
    start = time.perf_counter()
    theirs = flatten(written_out(scene))
    their_build = time.perf_counter() - start
    crowd = many(scene, MANY)
    start = time.perf_counter()
    flatten(crowd)
    crowd_build = time.perf_counter() - start

    rows: list[list[str | float | int]] = []
    for kind, rays in (("camera", camera_rays(scene, size)), ("random", random_rays(size * size))):
        n = len(rays)
        data = (rays.origins, rays.directions, rays.tmin, rays.tmax)
        limited = (*data[:3], np.full(n, 0.3, np.float32))
        t, prim, uv = np.empty((2, n), np.float32), np.empty((2, n), np.int32), np.empty((n, 2), np.float32)
        blocked = np.empty((2, n), np.bool_)

        def closest(k: int, flat: FlatScene, data=data, t=t, prim=prim, uv=uv):
            return lambda: cast_closest(flat.record[0], *data, t[k], prim[k], uv)

        def shadow(k: int, flat: FlatScene, limited=limited, blocked=blocked):
            return lambda: cast_occluded(flat.record[0], *limited, blocked[k])

        times = race([closest(0, ours), closest(1, theirs)], rounds)
        either = np.isfinite(t).any(axis=0)
        differs = int(np.logical_not(np.abs(t[0, either] - t[1, either]) <= 1e-3 * t[1, either]).sum())
        rows.append([kind, n / times[0] / 1e6, n / times[1] / 1e6, times[1] / times[0], differs])
        if kind == "camera":
            continue
        times = race([shadow(0, ours), shadow(1, theirs)], rounds)
        differs = int((blocked[0] != blocked[1]).sum())
        rows.append([f"{kind}, shadow", n / times[0] / 1e6, n / times[1] / 1e6, times[1] / times[0], differs])
    targets = [
        Target("X3", ours.n_elements, ELEMENTS, "elements", True, f"{SCENE}, {ours.n_triangles:,} triangles stored"),
        Target("X3", crowd_build, BUILD_SECONDS, "s", False, f"building the tree over {MANY:,} instances"),
    ]
    notes = [
        f"read in {loaded:.2f} s; arrays and trees made in {build:.2f} s, {their_build:.2f} s written out",
        f"memory of arrays and trees: {megabytes(ours):.1f} MB, {megabytes(theirs):.1f} MB written out",
        f"{ours.n_instances:,} instances; written out {theirs.n_triangles:,} triangles",
    ]
    columns = ["rays", "instances Mrays/s", "written out Mrays/s", "ratio", "hits differ"]
    return BenchResult("Instances against the same scene written out, one core", columns, rows, targets, notes)
