"""Records of the irradiance cache: look-ups against a search of all, who serves whom, how radii limit each other."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.maps import irradiance_cache
from pmviewer.maps.irradiance_cache import (
    FOOTPRINT,
    HARMONIC,
    IRRADIANCE,
    OFF_PLANE,
    REACH,
    RECORD,
    ROTATION,
    ROW,
    TRANSLATION,
    build_cache,
    encode_records,
    interpolate_all,
)
from pmviewer.maps.irradiance_limits import limit_by_neighbours
from pmviewer.maps.record import unpack


def recipe(error=0.4, least=1e-6, most=1e6):
    record = np.zeros(1, RECORD)
    record["error"], record["least"], record["most"] = error, least, most
    record["rings"], record["sectors"] = 4, 16
    return record


def rows_at(points, normals, reach, E=1.0, error=0.4):
    rows = np.zeros((len(points), ROW), np.float32)
    rows[:, :3], rows[:, 3:6] = points, normals
    rows[:, REACH], rows[:, IRRADIANCE : IRRADIANCE + 3] = reach, E
    rows[:, HARMONIC], rows[:, FOOTPRINT] = np.asarray(reach) / error, 1.0
    return rows


def looked_up(cache, points, normals):
    points = np.ascontiguousarray(np.atleast_2d(points), np.float32)
    normals = np.array(np.broadcast_to(normals, points.shape), np.float32, order="C")
    E, weights = np.empty((len(points), 3), np.float32), np.empty(len(points), np.float32)
    interpolate_all(cache.record, points, normals, E, weights)
    return E, weights


def unit(rng, n):
    v = rng.normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def all_records(rows, a, x, n):
    """The definition, in float64, of one point."""
    rows = rows.astype(float)
    d = x - rows[:, :3]
    error = np.linalg.norm(d, axis=1) / rows[:, REACH]
    error += np.sqrt(np.maximum(1 - rows[:, 3:6] @ n, 0)) / a
    off = np.abs((d * (rows[:, 3:6] + n)).sum(1)) / 2
    used = (error < 1) & (off <= OFF_PLANE * rows[:, REACH]) & (np.linalg.norm(d, axis=1) < rows[:, REACH])
    if not used.any():
        return np.zeros(3), 0.0
    w = 1 / error[used] - 1
    turned = np.cross(rows[used, 3:6], n)
    E = np.empty((used.sum(), 3))
    for c in range(3):
        E[:, c] = rows[used, IRRADIANCE + c]
        E[:, c] += (turned * rows[used, ROTATION + 3 * c : ROTATION + 3 * c + 3]).sum(1)
        E[:, c] += (d[used] * rows[used, TRANSLATION + 3 * c : TRANSLATION + 3 * c + 3]).sum(1)
    return (np.maximum(E, 0) * w[:, None]).sum(0) / w.sum(), w.sum()


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_look_ups_find_what_a_search_of_all_records_finds(scale):
    """Reaches over three decades, normals near each other, points on both sides of the origin."""
    rng = np.random.default_rng(3)
    n = 1500
    points = rng.uniform(-1, 1, (n, 3)) * (1, 1, 0.01)
    normals = np.array([0, 0, 1.0]) + 0.2 * rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    rows = rows_at(points * scale, normals, scale * 10 ** rng.uniform(-3, -0.3, n))
    rows[:, IRRADIANCE : IRRADIANCE + 3] = rng.uniform(0, 2, (n, 3))
    rows[:, ROTATION : ROTATION + 9] = rng.normal(size=(n, 9))
    rows[:, TRANSLATION : TRANSLATION + 9] = rng.normal(size=(n, 9)) / scale
    cache = build_cache(rows, recipe())
    x = (rng.uniform(-1.2, 1.2, (300, 3)) * (1, 1, 0.01) * scale).astype(np.float32)
    m = np.array([0, 0, 1.0]) + 0.1 * rng.normal(size=(300, 3))
    m = (m / np.linalg.norm(m, axis=1, keepdims=True)).astype(np.float32)
    E, weights = looked_up(cache, x, m)
    expected = [all_records(cache.rows, 0.4, p.astype(float), k.astype(float)) for p, k in zip(x, m, strict=True)]
    assert (np.array([w for _, w in expected]) > 0).mean() > 0.5
    for i, (value, weight) in enumerate(expected):
        assert weights[i] == pytest.approx(weight, rel=2e-3, abs=2e-3)
        if weight > 0.05:
            assert E[i] == pytest.approx(value, rel=5e-3, abs=5e-3)


def test_an_empty_cache_knows_nothing():
    cache = build_cache(np.empty((0, ROW), np.float32), recipe())
    E, weights = looked_up(cache, [(0, 0, 0), (1, 2, 3)], (0, 0, 1))
    assert not weights.any()
    assert not E.any()


@pytest.mark.parametrize(
    ("x", "n", "served"),
    [
        ((0.3, 0, 0), (0, 0, 1), True),
        ((0.3, 0, 0.2), (0, 0, 1), False),  # above a step
        ((0.3, 0, -0.2), (0, 0, 1), False),  # below a step
        ((0.3, 0, 0), (0, 0, -1), False),  # the other side of a sheet
        ((0.01, 0, 0.01), (1, 0, 0), False),  # the wall beside the floor
        ((1.01, 0, 0), (0, 0, 1), False),  # out of reach
    ],
)
def test_records_serve_their_own_surface_alone(x, n, served):
    cache = build_cache(rows_at([(0, 0, 0)], [(0, 0, 1)], [1.0]), recipe())
    assert (looked_up(cache, x, n)[1][0] > 0) == served


def test_records_serve_a_curved_surface():
    """On a ball the chord is at right angles to the mean of the normals: nothing is off the plane."""
    angle = 0.2
    cache = build_cache(rows_at([(0, 0, 1)], [(0, 0, 1)], [0.5]), recipe())
    x = (np.sin(angle), 0, np.cos(angle))
    assert looked_up(cache, x, x)[1][0] > 0


def test_a_linear_field_is_interpolated_exactly():
    rng = np.random.default_rng(4)
    points = np.column_stack([rng.uniform(0, 1, (200, 2)), np.zeros(200)])
    rows = rows_at(points, [(0, 0, 1)] * 200, np.full(200, 0.3))
    rows[:, IRRADIANCE] = 1 + 2 * points[:, 0] - 0.5 * points[:, 1]
    rows[:, TRANSLATION], rows[:, TRANSLATION + 1] = 2, -0.5
    x = np.column_stack([rng.uniform(0.1, 0.9, (50, 2)), np.zeros(50)])
    E, weights = looked_up(build_cache(rows, recipe()), x, (0, 0, 1))
    assert (weights > 0).all()
    assert E[:, 0] == pytest.approx(1 + 2 * x[:, 0] - 0.5 * x[:, 1], rel=1e-5)


def test_irradiance_is_never_negative():
    rows = rows_at([(0, 0, 0)], [(0, 0, 1)], [1.0], E=0.1)
    rows[:, TRANSLATION] = -1.0
    E, _ = looked_up(build_cache(rows, recipe()), (0.5, 0, 0), (0, 0, 1))
    assert E[0, 0] == 0
    assert E[0, 1] == pytest.approx(0.1)


def test_neighbours_limit_each_others_radii():
    """After it, no record within another's reach sees so much less than that one: R_i ≤ R_j + |x_i − x_j|."""
    rng = np.random.default_rng(5)
    n = 300
    points = np.column_stack([rng.uniform(0, 1, (n, 2)), np.zeros(n)])
    rows = rows_at(points, [(0, 0, 1)] * n, 10 ** rng.uniform(-1.5, -0.5, n))
    cache = build_cache(rows, recipe())
    before = cache.rows.copy()
    limit_by_neighbours(cache)
    R, reach = cache.rows[:, HARMONIC], cache.rows[:, REACH]
    assert (before[:, HARMONIC] >= R).all()
    assert (before[:, HARMONIC] > R).any()
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    i, j = np.nonzero(distance < reach[:, None])
    assert (R[i] <= R[j] + distance[i, j] + 1e-6).all()
    assert reach == pytest.approx(np.minimum(before[:, REACH], 0.4 * R), rel=1e-5)


def test_limits_do_not_depend_on_how_the_work_is_shared(monkeypatch):
    rng = np.random.default_rng(6)
    n = 3000
    points = np.column_stack([rng.uniform(0, 1, (n, 2)), np.zeros(n)])
    rows = rows_at(points, [(0, 0, 1)] * n, 10 ** rng.uniform(-2, -0.5, n))
    found = []
    for most in (1, 3, 32):
        monkeypatch.setattr(irradiance_cache, "MOST_PARTS", most)
        cache = build_cache(rows.copy(), recipe())
        limit_by_neighbours(cache, lambda tasks: [task() for task in reversed(tasks)][::-1])
        found.append(cache.rows)
    assert (found[0] < rows[:, : found[0].shape[1]]).any()
    for other in found[1:]:
        np.testing.assert_array_equal(other, found[0])


def test_limits_keep_to_the_least_reach():
    rows = rows_at([(0, 0, 0), (0.1, 0, 0)], [(0, 0, 1)] * 2, [1.0, 0.001])
    cache = build_cache(rows, recipe(least=0.25))
    limit_by_neighbours(cache)
    assert cache.rows[0, REACH] == pytest.approx(0.25)


def test_records_as_photon_records():
    rng = np.random.default_rng(6)
    normals = unit(rng, 20)
    rows = rows_at(rng.normal(size=(20, 3)), normals, np.ones(20))
    rows[:, IRRADIANCE : IRRADIANCE + 3] = rng.uniform(0.1, 5, (20, 3))
    photons = np.zeros((20, 6), np.float32)
    encode_records(rows, np.float32(0.5), photons, photons.view(np.uint32))
    named = unpack(photons, 2.0)
    assert np.array_equal(named["position"], rows[:, :3])
    assert (named["wi"] * normals).sum(1).min() > 0.9999
    assert named["Phi"] == pytest.approx(rows[:, IRRADIANCE : IRRADIANCE + 3], rel=1e-3)
    assert not named["light"].any()
