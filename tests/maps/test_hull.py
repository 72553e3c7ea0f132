"""The convex hull of a look-up's photons, against scipy's and against what is left when there are too few."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from pmviewer.maps.estimate.hull import DIRECTIONS, FEWEST
from pmviewer.maps.search.grid import build_grid
from pmviewer.maps.search.kdtree import build_kdtree
from tests.maps.lookups import UP, estimate
from tests.support import naive_maps as naive

CENTRE = np.zeros((1, 3))


def flat_photons(n, seed, power=1.0, flags=0):
    rng = np.random.default_rng(seed)
    angle, radius = rng.uniform(0, 2 * np.pi, n), np.sqrt(rng.random(n))
    place = np.c_[radius * np.cos(angle), radius * np.sin(angle), np.zeros(n)].astype(np.float32)
    return naive.pack(place, power=power, flags=flags)


def hull_of(photons, boundary, radius=1.5):
    """Power inside and `boundary` of that at the corners, by the area; corners are those farthest in DIRECTIONS."""
    uv = photons[:, :2].astype(float)
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    farthest = np.argmax(uv @ np.array([np.cos(angle), np.sin(angle)]), axis=0)
    corners = farthest[np.r_[True, np.diff(farthest) != 0]]
    corners = corners[:-1] if len(corners) > 1 and corners[0] == corners[-1] else corners
    a, b = uv[corners], np.roll(uv[corners], -1, axis=0)
    area = 0.5 * float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
    way = b - a
    margin = 1e-5 * radius * np.abs(way).sum(axis=1)
    inside = np.array([(way[:, 0] * (p - a)[:, 1] - way[:, 1] * (p - a)[:, 0] > margin).all() for p in uv])
    power = naive.unpack(photons, 1.0)["Phi"].astype(float)
    share = np.where(inside, 1.0, 0.0)
    share[corners] = boundary
    return share @ power / area, corners, area


@pytest.mark.parametrize("n", [8, 30, 200, 5000])
@pytest.mark.parametrize("boundary", [0.0, 0.2, 1.0])
def test_equals_the_obvious_version(n, boundary):
    power = np.random.default_rng(n).uniform(0.1, 1, (n, 3))
    photons = flat_photons(n, n, power)
    expected, _, _ = hull_of(photons, boundary)
    found = estimate(build_grid(photons, 1.5), CENTRE, 1.5, "hull", boundary=boundary)
    np.testing.assert_allclose(found[0], expected, rtol=1e-3)


@pytest.mark.parametrize("n", [30, 200, 2000])
def test_its_corners_are_corners_of_the_convex_hull(n):
    photons = flat_photons(n, n + 1)
    exact = ConvexHull(photons[:, :2])
    _, corners, area = hull_of(photons, 0.0)
    assert set(corners) <= set(exact.vertices)
    assert 0.96 * exact.volume < area <= exact.volume * (1 + 1e-6)


def test_nearest_leave_the_last_photon_out_of_the_hull():
    photons = flat_photons(200, 3)
    order = np.argsort(np.linalg.norm(photons[:, :3], axis=1))
    expected, _, _ = hull_of(photons[order[:59]], 0.2)
    found = estimate(build_kdtree(photons), CENTRE, 5.0, "hull", k=60, boundary=0.2)
    np.testing.assert_allclose(found[0], expected, rtol=1e-3)


def test_few_photons_use_the_disc():
    photons = flat_photons(FEWEST - 1, 4)
    found = estimate(build_grid(photons, 1.5), CENTRE, 1.5, "hull")
    np.testing.assert_allclose(found[0], (FEWEST - 1) / (np.pi * 1.5**2), rtol=1e-3)


@pytest.mark.parametrize("place", ["point", "line"])
def test_photons_that_span_nothing_use_the_disc(place):
    photons = flat_photons(40, 5)
    photons[:, 1] = 0
    if place == "point":
        photons[:, 0] = 0
    found = estimate(build_grid(photons, 1.5), CENTRE, 1.5, "hull")
    np.testing.assert_allclose(found[0], 40 / (np.pi * 1.5**2), rtol=1e-3)


@pytest.mark.parametrize("estimator", ["hull", "differential"])
def test_no_photons_and_photons_from_behind(estimator):
    behind = naive.pack(flat_photons(100, 6)[:, :3], -UP)
    for photons in (np.empty((0, 6), np.float32), behind):
        assert not estimate(build_grid(photons, 1.5), CENTRE, 1.5, estimator).any()
        assert not estimate(build_kdtree(photons), CENTRE, 1.5, estimator).any()


@pytest.mark.parametrize("estimator", ["hull", "differential"])
@pytest.mark.parametrize("scale", [1e-4, 1e5])
def test_any_scale(estimator, scale):
    photons = flat_photons(400, 7)
    scaled = photons.copy()
    scaled[:, :3] *= np.float32(scale)
    for build in (lambda p, r: build_grid(p, r), lambda p, r: build_kdtree(p)):
        a = estimate(build(photons, 0.5), CENTRE, 0.5, estimator, k=90)
        b = estimate(build(scaled, 0.5 * scale), CENTRE, 0.5 * scale, estimator, k=90)
        # A fold of differential checking hangs on the bits of a position: other scale, other folds.
        np.testing.assert_allclose(b * scale**2, a, rtol=1e-3 if estimator == "hull" else 0.5)


def test_photons_of_a_wall_do_not_brighten_the_corner():
    """A lit wall stands on the edge of a lit floor; its photons arrive from the floor's front too."""
    rng = np.random.default_rng(8)
    n = 40_000
    floor = naive.pack(np.c_[rng.random((n, 2)), np.zeros(n)], power=1 / n)
    slanted = np.array([1, 0, 1]) / np.sqrt(2)
    wall = naive.pack(np.c_[np.zeros(n), rng.random((n, 2))], slanted, power=1 / n)
    both = np.vstack([floor, wall])
    points = np.c_[rng.uniform(0, 0.05, 2000), rng.uniform(0.2, 0.8, 2000), np.zeros(2000)]
    E = estimate(build_grid(both, 0.05), points, 0.05, "hull", flatness=0.2)
    assert E.mean() == pytest.approx(1, abs=0.02)
