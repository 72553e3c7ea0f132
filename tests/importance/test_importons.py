"""Importons: how much importance arrives, where they are stored, and what becomes of it in impossible scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.importance.importons import joined
from pmviewer.maps.importance.build import build_importance
from pmviewer.render.camera import resolve_camera
from pmviewer.scene.description import Camera, Material, Parallelogram, Scene, Shape, Sphere
from pmviewer.settings.access import Settings
from tests.support.importon_paths import (
    GATHER,
    SHOWN,
    area_of,
    cosine_directions,
    importons_of,
    in_turn,
    inside_polygon,
    integral,
    to_cube,
    traced,
)
from tests.support.scenes import GLASS, GREY, MIRROR, box_camera, box_walls, cornell_box, diffuse, diffuse_box

STAR = np.array(
    [(-1.5, -0.5), (-0.3, -0.4), (0.0, -1.6), (0.5, -0.3), (1.7, -0.2), (0.4, 0.4), (0.1, 1.8), (-0.5, 0.2)]
)
ELL = np.array([(-0.7, -0.6), (0.8, -0.6), (0.8, 0.1), (-0.1, 0.1), (-0.1, 0.7), (-0.7, 0.7)])
WATER = Material("water", "dielectric", (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), eta=1.33)


def uniform(polygon, n, seed=0):
    rng = np.random.default_rng(seed)
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    points = low + (high - low) * rng.random((n, 2))
    return points[inside_polygon(points, polygon)]


def floor_scene(camera=None, extra=(), materials=(), size=64):
    floor = Shape("floor", Parallelogram((-10, 0, -10), (0, 0, 20), (20, 0, 0)), 0)
    camera = camera or Camera((0.5, 3.0, 4.0), (0, 0, 0), (0, 1, 0), 60.0, near=0.0, far=np.inf)
    return Scene("floor", None, (floor, *extra), (diffuse(), *materials), (), camera, size, size)


@pytest.mark.parametrize("kind", ["screen", "footprint", "average"])
def test_patch_seen_directly(kind):
    """∫Γ dA over a star on the floor is the number of pixels that its picture covers."""
    scene = floor_scene()
    importons = importons_of(scene, SHOWN, 100_000)[1]
    inner = uniform(STAR, 60_000)
    points = np.stack([inner[:, 0], np.zeros(len(inner)), inner[:, 1]], axis=1)
    corners = np.stack([STAR[:, 0], np.zeros(len(STAR)), STAR[:, 1]], axis=1)
    exact = area_of(resolve_camera(scene, Settings().camera).project(corners)[:, :2])
    found = integral(importons, 10.0, points, (0, 1, 0), area_of(STAR), True, kind)
    assert found == pytest.approx(exact, rel=0.02)


def test_patch_seen_over_a_diffuse_bounce():
    """The same of an L on the ceiling as gather rays see it, against a million random paths."""
    scene = diffuse_box(size=32)
    scene = replace(scene, shapes=scene.shapes[:6])  # no panel
    importons = importons_of(scene, GATHER, 200_000)[1]
    inner = uniform(ELL, 60_000)
    points = np.stack([inner[:, 0], np.ones(len(inner)), inner[:, 1]], axis=1)
    found = integral(importons, 1.8, points, (0, -1, 0), area_of(ELL), False)

    rng, n = np.random.default_rng(5), 1_000_000
    frame = resolve_camera(scene, Settings().camera).ray_frame()
    d = frame[1] + 32 * rng.random((n, 1)) * frame[2] + 32 * rng.random((n, 1)) * frame[3]
    first, normals = to_cube(np.tile(frame[0], (n, 1)), d)
    second, facing = to_cube(first + 1e-9 * normals, cosine_directions(n, normals, rng))
    hit = (facing[:, 1] < -0.5) & inside_polygon(second[:, [0, 2]], ELL)
    exact = GREY * 32 * 32 * hit.mean()
    assert found == pytest.approx(exact, rel=0.02)


def test_weights_are_those_of_eye_paths():
    """What the camera sees through the surface of water counts (1 − F)/η²; glass that is left again counts fully."""
    surface = Shape("surface", Parallelogram((-10, 1, -10), (0, 0, 20), (20, 0, 0)), 1)
    above = Camera((0, 3, 0), (0, 0, 0), (0, 0, 1), 20.0, near=0.0, far=np.inf)
    scene = floor_scene(above, (surface,), (WATER,), size=16)
    weights = importons_of(scene, SHOWN, 50_000)[1].weights
    fresnel = ((1.33 - 1) / (1.33 + 1)) ** 2  # nearly the same for all angles up to 14°
    assert weights.sum() / 256 == pytest.approx((1 - fresnel) / 1.33**2, rel=0.01)

    ball = Shape("ball", Sphere((0, 1.5, 0), 0.5), 1)
    found, _, _ = traced(floor_scene(above, (ball,), (GLASS,)), SHOWN, 5000)
    np.testing.assert_allclose(found.global_.weights, 1.0, rtol=1e-5)


def test_where_importons_are_stored():
    scene = cornell_box()
    shown, _, _ = traced(scene, SHOWN, 20_000)
    gather, _, _ = traced(scene, GATHER, 20_000)
    np.testing.assert_array_equal(np.sort(shown.global_.positions[:, 0]), np.sort(gather.caustic.positions[:, 0]))
    assert shown.caustic.n == 0
    assert 0 < gather.global_.n < gather.caustic.n
    # With a corner distance larger than the box every gather ray looks caustics up and goes on once.
    again, _, _ = traced(scene, replace(GATHER, corner=100.0), 20_000)
    first = gather.caustic.weights.sum() + gather.global_.weights.sum()
    assert again.caustic.weights.sum() == pytest.approx(first, rel=1e-6)
    assert 0 < again.global_.n < gather.global_.n
    # Gather rays end at mirrors and glass, unless their caustics are in the global map.
    behind, _, _ = traced(scene, replace(GATHER, gather_specular=True), 20_000)
    assert behind.global_.weights.sum() > 1.05 * gather.global_.weights.sum()


def test_importance_of_one_pixel():
    """Its importons are those that start through it; all weigh as the picture's: together they are one pixel."""
    scene = cornell_box()
    rule = replace(SHOWN, pixel=(40, 90))
    found, eye, _ = traced(scene, rule, 500)
    width, height = int(eye[0]["width"]), int(eye[0]["height"])
    camera = resolve_camera(open_scene(scene).scene, Settings().camera)
    right = np.cross(camera.target - np.asarray(camera.origin), camera.up)
    right /= np.linalg.norm(right)
    forward = np.asarray(camera.target) - camera.origin
    forward = forward / np.linalg.norm(forward)
    down = np.cross(forward, right)
    to = found.global_.positions - np.asarray(camera.origin)
    half = np.tan(np.radians(camera.fov) / 2)
    x = (1 + to @ right / (to @ forward) / half) / 2 * width
    y = (height + to @ down / (to @ forward) / half * width) / 2
    assert found.global_.n == 500
    assert (np.floor(x) == 40).all()
    assert (np.floor(y) == 90).all()
    assert joined([found], 1)[1].weights.sum() == pytest.approx(1.0, rel=1e-5)


def test_same_importons_for_any_threads_and_batches():
    scene, results = cornell_box(), []
    for threads in (1, 3):
        pool = WorkPool(threads)
        found, _, opened = traced(scene, GATHER, 10_000, pool.run)
        built = build_importance(found.global_, "average", opened.flat.radius, run=pool.run)
        pool.close()
        results.append((found, built))
    (a, map_a), (b, map_b) = results
    for name in ("positions", "normals", "weights", "footprints"):
        np.testing.assert_array_equal(getattr(a.caustic, name), getattr(b.caustic, name))
        np.testing.assert_array_equal(getattr(a.global_, name), getattr(b.global_, name))
    np.testing.assert_array_equal(map_a.gamma, map_b.gamma)
    parts = [traced(scene, GATHER, n, in_turn, first=first)[0] for first, n in ((0, 3000), (3000, 7000))]
    np.testing.assert_array_equal(np.concatenate([p.global_.weights for p in parts]), a.global_.weights)


def impossible_scenes():
    ball = Shape("ball", Sphere((0, 0, 0), 0.5), 1)
    in_ball = Camera((0.1, 0, 0), (1, 0, 0), (0, 1, 0), 75.0, near=0.0, far=np.inf)
    mirrors = Scene("m", None, box_walls(), (MIRROR,), (), box_camera(), 16, 16)
    away = Camera((0, 3, 0), (0, 9, 0), (0, 0, 1), 40.0, near=0.0, far=np.inf)
    black = Scene("b", None, box_walls(), (diffuse(albedo=(0.0,) * 3),), (), box_camera(), 16, 16)
    return {
        "inside glass": (Scene("g", None, (*box_walls(), ball), (diffuse(), GLASS), (), in_ball, 16, 16), True),
        "inside a wall": (Scene("d", None, (*box_walls(), ball), (diffuse(), diffuse()), (), in_ball, 16, 16), True),
        "mirrors alone": (mirrors, False),
        "nothing seen": (floor_scene(away, size=16), False),
        "black": (black, False),
    }


@pytest.mark.parametrize("name", list(impossible_scenes()))
@pytest.mark.parametrize("rule", [SHOWN, GATHER], ids=["shown", "gather"])
def test_impossible_cameras(name, rule):
    scene, some = impossible_scenes()[name]
    found, _, opened = traced(scene, rule, 3000)
    assert found.dropped == 0
    for importons in (found.caustic, found.global_):
        assert np.isfinite(importons.positions).all()
        assert np.isfinite(importons.weights).all()
        assert np.isfinite(importons.footprints).all()
        for kind in ("screen", "footprint", "average"):
            built = build_importance(importons, kind, opened.flat.radius)
            assert np.isfinite(built.gamma).all()
            assert (built.gamma >= 0).all()
    assert (found.global_.n > 0) == some
