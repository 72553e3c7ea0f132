"""Importance maps from importons whose density is known."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.importance.rules import density_beyond, density_of
from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.importance.build import build_importance
from pmviewer.maps.importance.importance_map import NO_IMPORTANCE, Importons, required_density
from pmviewer.maps.importance.look_up import importance_sums, importances
from pmviewer.maps.importance.reached import reached_boxes
from pmviewer.maps.photon_words import encode_direction
from pmviewer.maps.record import unpack

UP, EAST = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
N, WEIGHT = 20_000, 2.0


@kernel
def _codes(normals, out):
    for i in range(len(normals)):
        out[i] = encode_direction(normals[i, 0], normals[i, 1], normals[i, 2])


def importons(positions, normal=UP, weight=WEIGHT, footprint=7.0):
    positions = np.ascontiguousarray(positions, np.float32)
    n = len(positions)
    codes = np.zeros(n, np.uint32)
    _codes(np.tile(np.array([normal], np.float32), (n, 1)), codes)
    return Importons(positions, codes, np.full(n, weight, np.float32), np.full(n, footprint, np.float32))


def on_square(n=N, seed=0):
    """Uniform on the unit square in the plane z = 0."""
    positions = np.zeros((n, 3), np.float32)
    positions[:, :2] = np.random.default_rng(seed).random((n, 2))
    return positions


def looked_up(built, points, normal=UP):
    points = np.ascontiguousarray(points, np.float32)
    out = np.full(len(points), -1, np.float32)
    record = NO_IMPORTANCE if built is None else built.record
    importances(record, points, np.tile(np.array([normal], np.float32), (len(points), 1)), out, 0, len(points))
    return out


def test_density_on_a_square_up_to_its_edges():
    built = build_importance(importons(on_square()), "screen", 1.0)
    found = looked_up(built, on_square(50_000, 1))
    assert found.mean() == pytest.approx(N * WEIGHT, rel=0.01)
    x, y, _ = on_square(50_000, 1).T
    at_edge = np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y)) < 0.02
    assert found[at_edge].mean() == pytest.approx(N * WEIGHT, rel=0.03)
    assert found.std() < 0.12 * found.mean()  # 200 importons scatter by 7 %
    assert (built.spikes, built.n) == (0, N)


def test_other_side_and_empty_places():
    built = build_importance(importons(on_square()), "screen", 1.0)
    inside = on_square(1000, 1)
    assert not looked_up(built, inside, (0.0, 0.0, -1.0)).any()
    assert not looked_up(built, inside, EAST).any()
    assert not looked_up(built, inside + [2.0, 0.0, 0.0]).any()
    assert not looked_up(built, inside + [0.0, 0.0, 0.5]).any()


def test_walls_that_meet_keep_their_importance_apart():
    floor, wall = on_square(), on_square(4 * N, 1)
    wall = np.stack([np.zeros(len(wall)), wall[:, 0], wall[:, 1]], axis=1)
    built = build_importance(Importons.joined([importons(floor), importons(wall, EAST)]), "screen", 1.0)
    y = np.linspace(0.1, 0.9, 500)
    on_floor = np.stack([np.full(500, 1e-3), y, np.zeros(500)], axis=1)
    on_wall = np.stack([np.zeros(500), y, np.full(500, 1e-3)], axis=1)
    assert looked_up(built, on_floor).mean() == pytest.approx(N * WEIGHT, rel=0.06)
    assert looked_up(built, on_wall, EAST).mean() == pytest.approx(4 * N * WEIGHT, rel=0.06)


def test_kinds():
    positions = on_square()
    given = importons(positions)
    given.footprints[:] = np.where(positions[:, 0] < 0.5, 1.0, 3.0)
    screen, footprint, average = (
        build_importance(given, kind, 1.0).gamma for kind in ("screen", "footprint", "average")
    )
    x = build_importance(given, "screen", 1.0).positions[:, 0]
    low, high = x < 0.4, x > 0.6
    assert footprint[high].mean() == pytest.approx(3 * footprint[low].mean(), rel=1e-5)
    assert footprint.mean() == pytest.approx(screen.mean(), rel=0.01)
    np.testing.assert_allclose(average, 0.5 * (screen + footprint), rtol=1e-5)


def test_spikes_are_left_out():
    given = importons(on_square())
    plain = build_importance(given, "footprint", 1.0)
    given.footprints[::500] = 1e9
    given.footprints[1::500] = 7000.0  # hidden by the others in the first mean
    given.footprints[7] = np.nan
    cleaned = build_importance(given, "footprint", 1.0)
    assert cleaned.spikes == 80
    assert cleaned.gamma.max() < 1.01 * plain.gamma.max()


def test_sums_count_importons_near():
    built = build_importance(importons(on_square()), "screen", 1.0)
    points = np.array([[0.5, 0.5, 0.0], [3.0, 0.0, 0.0]], np.float32)
    out = np.zeros(2, np.float32)
    importance_sums(built.record, points, np.array([UP, UP], np.float32), np.int32(50), out, 0, 2)
    assert out.tolist() == [50 * WEIGHT, 0.0]
    importance_sums(NO_IMPORTANCE, points, np.array([UP, UP], np.float32), np.int32(50), out, 0, 2)
    assert out.tolist() == [1.0, 1.0]
    assert looked_up(None, points).tolist() == [1.0, 1.0]


@pytest.mark.parametrize("kind", ["screen", "footprint", "average"])
@pytest.mark.parametrize("n", [0, 1, 2, 3, 7, 50, 1000])
def test_few_importons_all_in_one_place(kind, n):
    """None, fewer than are asked for, all on one point, or on a line: finite, and found again."""
    for spread in ([0, 0, 0], [1e-3, 0, 0], [1e-3, 1e-3, 0]):
        positions = np.random.default_rng(n).random((n, 3)) * spread + [5.0, 2.0, -1.0]
        built = build_importance(importons(positions), kind, 1.0)
        assert built.gamma.shape == (n,)
        assert np.isfinite(built.gamma).all()
        assert (built.gamma >= 0).all()
        found = looked_up(built, positions) if n else looked_up(built, [[5.0, 2.0, -1.0]])
        assert np.isfinite(found).all()
        assert (found > 0).any() == (n > 1)
    without = importons(on_square(100), footprint=0.0)
    assert np.isfinite(build_importance(without, kind, 1.0).gamma).all()


def test_cloud_and_required_density():
    built = build_importance(importons(on_square()), "screen", 1.0)
    rows, unit = built.cloud()
    photons = unpack(rows, unit)
    np.testing.assert_allclose(photons["Phi"][:, 0], built.gamma, rtol=1e-3)
    np.testing.assert_allclose(photons["wi"], built.normals, atol=2e-3)
    assert required_density(40.0, 25.0) == 1000.0
    assert required_density(40.0, 2.0, pixel_area=4.0) == 20.0


def test_density_beyond_keeps_power_from_important_places():
    """Brute force: M photons within `reach` of the way to the nearest importon, or what is required there, if less."""
    rng = np.random.default_rng(31)
    places = rng.random((500, 3)).astype(np.float32)
    made = build_importance(importons(places), "screen", 2.0, neighbours=50)
    points = (3 * rng.random((300, 3)) - 1).astype(np.float32)
    distances = np.linalg.norm(points[:, None] - made.positions, axis=2)
    nearest = distances.argmin(axis=1)
    far = 20 / (np.pi * (0.5 * distances.min(axis=1)) ** 2)
    expected = np.minimum(7 * made.gamma[nearest], far)
    np.testing.assert_allclose(density_beyond(made, 7.0, 0.5)(points), expected, rtol=1e-3)
    assert 0 < np.count_nonzero(expected < far) < 300
    none = build_importance(importons(places[:0]), "screen", 2.0)
    assert np.all(density_beyond(none, 7.0, 0.5)(points) == 0)


def test_boxes_hold_every_place_that_an_importon_reaches():
    """By brute force, for reaches from next to nothing to most of the scene; and far places are told apart."""
    rng = np.random.default_rng(8)
    positions = (rng.random((300, 3)) * [10, 1, 4]).astype(np.float32)
    reach = (10 ** rng.uniform(-3, -0.1, 300)).astype(np.float32)
    boxes = reached_boxes(positions, reach)
    places = (rng.random((4000, 3)) * [14, 3, 8] - [2, 1, 2]).astype(np.float32)
    distance = np.linalg.norm(places[:, None].astype(float) - positions, axis=2)
    touched = np.where(distance <= reach, reach, 0).max(axis=1)
    within = touched > 0
    assert 0.02 < within.mean() < 0.5
    assert (boxes.at(places) >= touched).all()
    assert (boxes.at(places) > 0).mean() < 0.6
    assert not boxes.at(np.full((1, 3), np.nan, np.float32)).any()
    assert not reached_boxes(positions[:0], reach[:0]).at(places).any()


def test_importance_is_the_same_by_boxes():
    """What rules ask for is what the look-up says, on both sides and far away."""
    built = build_importance(importons(on_square()), "screen", 1.0)
    rng = np.random.default_rng(3)
    places = rng.uniform(-2, 2, (3000, 3)).astype(np.float32)
    places[::2, 2] *= np.float32(0.01)
    for normal in (UP, tuple(-x for x in UP)):
        codes = np.empty(len(places), np.uint32)
        _codes(np.tile(np.array([normal], np.float32), (len(places), 1)), codes)
        plain = looked_up(built, places, normal)
        np.testing.assert_array_equal(density_of(built, 3.0)(places, codes), required_density(plain, 3.0))
        assert (plain > 0).any() == (normal == UP)
