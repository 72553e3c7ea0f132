"""Importance and importons of many places: by facets, and from afar, as by looking at every importon."""

import numpy as np
import pytest

from pmviewer.importance.rules import important_weight, probability_of
from pmviewer.maps.importance.build import build_importance
from pmviewer.maps.importance.facets import MOST, facets_of
from pmviewer.maps.importance.importance_map import Importons
from pmviewer.maps.importance.look_up import FLATNESS, importances
from pmviewer.maps.importance.nearest_of_all import nearest_importances, node_boxes
from pmviewer.maps.importance.together import importances_on
from pmviewer.maps.record import decode_directions
from tests.maps.test_importance import EAST, UP, _codes, importons

f4 = np.float32
DOWN, SLANTED = (0.0, 0.0, -1.0), (0.6, 0.0, 0.8)


def codes_of(normals):
    codes = np.empty(len(normals), np.uint32)
    _codes(np.ascontiguousarray(normals, f4), codes)
    return codes


def ball(n, rng):
    """Importons all around a small ball above the floor."""
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    positions = ([0.5, 0.5, 0.3] + 0.1 * normals).astype(f4)
    return Importons(positions, codes_of(normals), np.full(n, 2.0, f4), np.full(n, 7.0, f4))


@pytest.fixture(scope="module")
def room():
    """A floor that is seen in part, with a few importons elsewhere, a table, a wall, a slope and a ball."""
    rng = np.random.default_rng(5)

    def flat(n, origin, s, t):
        return np.array(origin) + rng.random((n, 1)) * s + rng.random((n, 1)) * t

    x, y, z = np.eye(3)
    return build_importance(
        Importons.joined([
            importons(flat(6000, (0, 0, 0), 0.5 * x, y)),
            importons(flat(40, (0, 0, 0), x, y)),
            importons(flat(3000, (0.2, 0.2, 0.2), 0.2 * x, 0.3 * y)),
            importons(flat(2000, (0.2, 0.2, 0.19), 0.2 * x, 0.3 * y), DOWN),
            importons(flat(2000, (0, 0, 0), y, z), EAST),
            importons(flat(1000, (1, 0, 0), 0.3 * z - 0.4 * x, y), SLANTED),
            ball(1500, rng),
        ]),
        "screen",
        1.0,
    )  # fmt: skip


def places(rng, n=1500):
    """On all of the surfaces and between them, with the normals there, and in all directions."""
    at = np.concatenate([
        rng.random((n, 3)) * [1, 1, 0], rng.random((n, 3)) * [0, 1, 1], rng.uniform(-0.5, 1.5, (n, 3)),
        [0.2, 0.2, 0.2] + rng.random((n, 3)) * [0.2, 0.3, 0], ball(n, rng).positions,
    ]).astype(f4)  # fmt: skip
    normals = rng.normal(size=at.shape)
    normals[:n], normals[n : 2 * n], normals[3 * n : 4 * n] = UP, EAST, UP
    normals[4 * n :] = at[4 * n :] - [0.5, 0.5, 0.3]
    normals[3 * n :: 5] = SLANTED
    codes = codes_of(normals / np.linalg.norm(normals, axis=1, keepdims=True))
    return at, decode_directions(codes), codes


def counted(positions, normals, p, n):
    """Squared distances (importons,) by which importons count at p, infinite for those of other sides."""
    d = positions - p
    squared = np.maximum((d**2).sum(axis=1), (d @ n / FLATNESS) ** 2)
    return np.where(normals @ n > 0.5, squared, np.inf)


def test_importance_on_facets_is_that_of_the_nearest_importon(room):
    facets = facets_of(room)
    assert 6 <= len(facets.maps) <= MOST
    assert facets.maps["n"].sum() == room.n
    at, normals, codes = places(np.random.default_rng(6))
    found = np.full(len(at), -1, f4)
    importances_on(facets.maps, facets.shapes, facets.boxes, facets.reached, at, codes, found, 0, len(at))
    some = np.random.default_rng(7).choice(len(at), 1500, replace=False)
    wrong, of_importons = 0, (room.positions.astype(float), room.normals)
    for i in some:
        squared = counted(*of_importons, at[i], normals[i])
        nearest = squared <= squared.min() * (1 + 1e-5)  # equally far, but for rounding
        expected = np.where(squared[nearest] <= room.reach[nearest].astype(float) ** 2, room.gamma[nearest], 0)
        wrong += found[i] not in expected
    assert 0.2 < (found[some] > 0).mean() < 0.9
    assert wrong <= 2  # at the rim of a reach, by rounding


@pytest.mark.parametrize("side", [0.002, 0.02, 0.2])
def test_importance_of_places_that_follow_one_another_is_that_of_each_alone(room, side):
    """Photons of one leaf: near one another, with one normal; the first as close as importons lie, the last so far
    apart that they have more of them around than are looked at together. On all surfaces and a little off them."""
    rng = np.random.default_rng(9)
    at, normals, codes = places(rng, 60)
    spread = rng.uniform(-side, side, (len(at), 40, 3))
    spread -= (spread * normals[:, None]).sum(axis=2, keepdims=True) * normals[:, None] * rng.random((len(at), 40, 1))
    many = (at[:, None] + spread).reshape(-1, 3).astype(f4)
    found, alone = np.full(len(many), -1, f4), np.empty(len(many), f4)
    facets, of_many = facets_of(room), np.repeat(codes, 40)
    importances_on(facets.maps, facets.shapes, facets.boxes, facets.reached, many, of_many, found, 0, len(many))
    importances(room.record, many, np.repeat(normals, 40, axis=0), alone, 0, len(many))
    assert 0.05 < (alone > 0).mean() < 0.95
    assert np.count_nonzero(found != alone) <= 1e-3 * len(many)  # equally far, but for rounding


def test_no_importance_at_no_place(room):
    facets, out = facets_of(room), np.ones(2, f4)
    nowhere = np.array([[np.nan, 0, 0], [np.inf, 0, 0]], f4)
    up = codes_of(np.array([UP, UP], f4))
    importances_on(facets.maps, facets.shapes, facets.boxes, facets.reached, nowhere, up, out, 0, 2)
    assert not out.any()


@pytest.mark.parametrize("share", [0.05, 0.2, 0.9])
def test_photons_are_certain_where_the_sum_says_so(room, share):
    """Searched for only as far as it decides: below 1 the same number, above 1 above."""
    at, _, codes = places(np.random.default_rng(8))
    sums = important_weight(room, at, codes)
    f = 1 / (share * float(sums.max()))
    p = probability_of(room, f)(at, codes)
    certain = f * sums >= 1
    np.testing.assert_allclose(p[~certain], f * sums[~certain], rtol=1e-5)
    assert (p[certain] >= 1).all()
    assert 0.02 < certain.mean() < 0.9
    assert (p[~certain] > 0).any()


def test_nearest_importon_from_afar(room):
    at = (np.random.default_rng(9).normal(size=(300, 3)) * [1, 5, 30]).astype(f4)
    gamma, distances = np.zeros(len(at), f4), np.zeros(len(at), f4)
    nearest_importances(room.record, node_boxes(room), at, gamma, distances, 0, len(at))
    between = np.linalg.norm(at[:, None].astype(float) - room.positions, axis=2)
    np.testing.assert_allclose(distances, between.min(axis=1), rtol=1e-5)
    rows, columns = np.nonzero(between <= between.min(axis=1, keepdims=True) * (1 + 1e-5))
    for i in range(len(at)):
        assert gamma[i] in room.gamma[columns[rows == i]]
