"""Irradiance estimates: against the obvious version, and against what is known of an evenly lit square."""

import numpy as np
import pytest

from pmviewer.maps.estimate.estimate import RIM_HALF, RIM_LEFT_OUT, irradiance_at_knn, irradiance_at_radius
from pmviewer.maps.estimate.filters import FILTERS, Filter, filter_disc_mean, filter_weight
from pmviewer.maps.estimate.nearest import Neighbours
from pmviewer.maps.search.grid import build_grid
from pmviewer.maps.search.kdtree import build_kdtree
from pmviewer.maps.search.stored import ALL_CLASSES
from tests.support import naive_maps as naive
from tests.support.device import from_python

f4, i4 = np.float32, np.int32


def by_radius(grid, points, normals, radius, flatness=1.0, classes=ALL_CLASSES, kind="constant", cone_k=1.1):
    m = len(points)
    E, counts = np.full((m, 3), np.nan, f4), np.full(m, -1, i4)
    arguments = f4(radius), f4(flatness), i4(classes), Filter(i4(FILTERS.index(kind)), f4(cone_k))
    irradiance_at_radius(grid.record, points, normals, *arguments, 0, m, E, counts)
    return E, counts


def by_knn(
    tree, points, normals, k, max_radius, flatness=1.0, classes=ALL_CLASSES, kind="constant", cone_k=1.1, rim=0, share=1
):
    m = len(points)
    E, counts, radii = np.full((m, 3), np.nan, f4), np.full(m, -1, i4), np.full(m, np.nan, f4)
    neighbours = Neighbours(i4(k), f4(max_radius), i4(rim), f4(share))
    arguments = neighbours, f4(flatness), i4(classes), Filter(i4(FILTERS.index(kind)), f4(cone_k))
    irradiance_at_knn(tree.record, points, normals, *arguments, 0, m, E, counts, radii)
    return E, counts, radii


@pytest.fixture(scope="module")
def mixture():
    """Photons of all classes from all sides, with points and normals among them."""
    rng = np.random.default_rng(1)
    n = 6000
    wi = rng.normal(size=(n, 3))
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    photons = naive.pack(naive.clustered(n, 2), wi, rng.uniform(0, 1, (n, 3)), rng.integers(0, 256, n))
    points = naive.clustered(24, 3)
    normals = rng.normal(size=(24, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return photons, points, normals.astype(f4)


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize(
    ("flatness", "classes"), [(1.0, ALL_CLASSES), (0.2, ALL_CLASSES), (0.5, 0b0100), (1.0, 0b1010)]
)
def test_fixed_radius_equals_the_obvious_version(mixture, kind, flatness, classes):
    photons, points, normals = mixture
    grid = build_grid(photons, 0.15, power_unit=2.5)
    E, counts = by_radius(grid, points, normals, 0.15, flatness, classes, kind)
    assert counts.sum() > 20
    for i, (point, normal) in enumerate(zip(points, normals)):
        expected, count = naive.irradiance_radius(
            photons, 2.5, point.astype(float), normal.astype(float), 0.15, flatness, classes, kind, 1.1
        )
        assert counts[i] == count
        np.testing.assert_allclose(E[i], expected, rtol=2e-4)


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize(("flatness", "classes"), [(1.0, ALL_CLASSES), (0.2, ALL_CLASSES), (0.5, 0b0100)])
@pytest.mark.parametrize(("k", "max_radius", "rim"), [(10, 5.0, 0), (40, 5.0, 1), (40, 0.2, 2)])
def test_nearest_equal_the_obvious_version(mixture, kind, flatness, classes, k, max_radius, rim):
    photons, points, normals = mixture
    tree = build_kdtree(photons, power_unit=2.5)
    E, counts, radii = by_knn(tree, points, normals, k, max_radius, flatness, classes, kind, rim=rim)
    for i, (point, normal) in enumerate(zip(points, normals)):
        expected, count, radius = naive.irradiance_knn(
            photons, 2.5, point.astype(float), normal.astype(float), k, max_radius, flatness, classes, kind, 1.1, rim
        )
        assert counts[i] == count
        assert radii[i] == pytest.approx(radius, rel=1e-5)
        np.testing.assert_allclose(E[i], expected, rtol=2e-3, atol=1e-6)


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("cone_k", [1.0, 1.1, 3.0])
def test_filters(kind, cone_k):
    kernel = i4(FILTERS.index(kind))
    x = np.linspace(0, 1, 21)
    weight, disc_mean = from_python(filter_weight), from_python(filter_disc_mean)
    found = [weight(kernel, f4(cone_k), f4(v * v)) for v in x]
    np.testing.assert_allclose(found, naive.WEIGHTS[kind](x, cone_k), atol=1e-6)
    assert disc_mean(kernel, f4(cone_k)) == pytest.approx(naive.disc_mean(kind, cone_k), rel=1e-5)


# --- Christensen's lit square: 40 000 photons of 1 W in all on a unit square ------------------------------------------

SIDE = 200
UP = np.array([0, 0, 1], f4)


def lit_square(seed, stratified):
    rng = np.random.default_rng(seed)
    place = rng.random((SIDE * SIDE, 2))
    if stratified:
        cell = np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 2)
        place = (cell + place) / SIDE
    return naive.pack(np.c_[place, np.zeros(len(place))])


def points_on_square(seed, m):
    rng = np.random.default_rng(seed)
    points = np.zeros((m, 3), f4)
    points[:, :2] = rng.uniform(0.1, 0.9, (m, 2))
    return points, np.tile(UP, (m, 1))


@pytest.fixture(scope="module")
def squares():
    maps = {}
    for stratified in (False, True):
        photons = [lit_square(seed, stratified) for seed in range(8)]
        trees = [build_kdtree(p, 1 / SIDE**2) for p in photons]
        grids = [build_grid(p, 0.06, 1 / SIDE**2) for p in photons]
        maps[stratified] = trees, grids
    return maps


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("stratified", [False, True], ids=["independent", "stratified"])
@pytest.mark.parametrize("k", [25, 100])  # 50 and 500: test_lit_square.py
def test_lit_square_by_nearest(squares, kind, stratified, k):
    rim = RIM_HALF if stratified else RIM_LEFT_OUT
    means = [
        by_knn(tree, *points_on_square(seed, 1000), k, 1.0, kind=kind, rim=rim)[0].mean()
        for seed, tree in enumerate(squares[stratified][0])
    ]
    # Kernels that vanish at the rim can't weigh the rim photon: of order k^(-3/2) is left for stratified photons.
    bound = 0.008 if stratified and k == 25 and kind != "constant" else 0.005
    assert np.mean(means) == pytest.approx(1, abs=bound)


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("stratified", [False, True], ids=["independent", "stratified"])
def test_lit_square_by_fixed_radius(squares, kind, stratified):
    for radius in (0.015, 0.06):
        means = [
            by_radius(grid, *points_on_square(seed, 1000), radius, kind=kind)[0].mean()
            for seed, grid in enumerate(squares[stratified][1])
        ]
        assert np.mean(means) == pytest.approx(1, abs=0.005)


def test_the_rim_rule_matters(squares):
    """Counting the rim photon whole is 4 % too bright at k = 25: the tests above would see a wrong rule."""
    whole = [
        by_knn(tree, *points_on_square(seed, 1000), 25, 1.0, rim=2)[0].mean()
        for seed, tree in enumerate(squares[False][0])
    ]
    assert np.mean(whole) == pytest.approx(1 + 1 / 24, abs=0.006)


def test_fewer_than_k_use_the_largest_radius_without_correction(squares):
    trees, grids = squares[False]
    points, normals = points_on_square(1, 500)
    E, counts, radii = by_knn(trees[0], points, normals, 500, 0.02, rim=RIM_LEFT_OUT)
    expected, expected_counts = by_radius(grids[0], points, normals, 0.02)
    assert (counts < 500).all()
    np.testing.assert_array_equal(counts, expected_counts)
    np.testing.assert_allclose(E, expected, rtol=1e-5)
    np.testing.assert_array_equal(radii, f4(0.02))


# --- sides, numbers, determinism --------------------------------------------------------------------------------------


def test_photons_from_behind_do_not_count_towards_k():
    rng = np.random.default_rng(4)
    place = np.c_[rng.random((20_000, 2)), np.zeros(20_000)]
    behind = naive.pack(place[:15_000], (0, 0, -1))
    front = naive.pack(place[15_000:], (0, 0, 1))
    points, normals = points_on_square(5, 300)
    both = by_knn(build_kdtree(np.vstack([behind, front])), points, normals, 50, 1.0)
    alone = by_knn(build_kdtree(front), points, normals, 50, 1.0)
    for a, b in zip(both, alone):
        np.testing.assert_allclose(a, b, rtol=1e-5)


def test_a_million_photons_in_one_disc():
    n = 1_000_000
    rng = np.random.default_rng(6)
    angle, radius = rng.uniform(0, 2 * np.pi, n), 0.99 * np.sqrt(rng.random(n))
    photons = naive.pack(np.c_[radius * np.cos(angle), radius * np.sin(angle), np.zeros(n)], power=[1.0, 0.3, 1e-3])
    E, counts = by_radius(build_grid(photons, 1.0), np.zeros((1, 3), f4), UP[None], 1.0)
    assert counts[0] == n
    np.testing.assert_allclose(E[0], np.array([1, 0.3, 1e-3]) * n / np.pi, rtol=2.0**-11)
    assert E[0, 0] == pytest.approx(n / np.pi, rel=3e-7)


def test_no_photons():
    points, normals = points_on_square(7, 5)
    E, counts = by_radius(build_grid(np.empty((0, 6), f4), 0.1), points, normals, 0.1)
    assert not E.any()
    assert not counts.any()
    E, counts, radii = by_knn(build_kdtree(np.empty((0, 6), f4)), points, normals, 50, 0.1)
    assert not E.any()
    assert not counts.any()
    np.testing.assert_array_equal(radii, f4(0.1))


@pytest.mark.parametrize("place", [0.0, 3.0])
def test_all_photons_at_one_point_stay_finite(place):
    photons = naive.pack(np.full((1000, 3), place))
    points, normals = np.full((1, 3), place, f4), UP[None]
    E, counts, _ = by_knn(build_kdtree(photons), points, normals, 50, 1.0)
    assert counts[0] == 50
    assert np.isfinite(E).all()
    E, counts = by_radius(build_grid(photons, 0.5), points, normals, 0.5)
    assert counts[0] == 1000
    np.testing.assert_allclose(E, 1000 / (np.pi * 0.25), rtol=1e-6)


@pytest.mark.parametrize("scale", [1e-4, 1e5])
def test_any_scale(mixture, scale):
    photons, points, normals = mixture
    scaled = photons.copy()
    scaled[:, :3] *= f4(scale)
    for kind in ("constant", "cone"):
        a, _ = by_radius(build_grid(photons, 0.2), points, normals, 0.2, kind=kind)
        b, _ = by_radius(build_grid(scaled, 0.2 * scale), points * f4(scale), normals, 0.2 * scale, kind=kind)
        np.testing.assert_allclose(b * scale**2, a, rtol=1e-3)
        a, _, _ = by_knn(build_kdtree(photons), points, normals, 30, 1.0, kind=kind)
        b, _, _ = by_knn(build_kdtree(scaled), points * f4(scale), normals, 30, scale, kind=kind)
        np.testing.assert_allclose(b * scale**2, a, rtol=1e-3)


def test_the_same_bits_again_whole_or_in_pieces(mixture):
    photons, points, normals = mixture
    grid, tree = build_grid(photons, 0.2), build_kdtree(photons)
    whole, _ = by_radius(grid, points, normals, 0.2, kind="gaussian")
    pieces = np.vstack(
        [by_radius(grid, points[i : i + 7], normals[i : i + 7], 0.2, kind="gaussian")[0] for i in range(0, 24, 7)]
    )
    np.testing.assert_array_equal(whole, pieces)
    again, _ = by_radius(build_grid(photons, 0.2), points, normals, 0.2, kind="gaussian")
    np.testing.assert_array_equal(whole, again)
    whole, _, _ = by_knn(tree, points, normals, 30, 1.0)
    pieces = np.vstack([by_knn(tree, points[i : i + 7], normals[i : i + 7], 30, 1.0)[0] for i in range(0, 24, 7)])
    np.testing.assert_array_equal(whole, pieces)


@pytest.mark.parametrize("how", ["radius", "knn"])
def test_the_inside_of_a_housing_is_not_seen_on_its_outside(how):
    """Photons on both sides of a thin tube, those inside a thousand times as bright, as in a lamp: light from all over
    the hemisphere of either side. Outside next to none of the inside's counts, with discs nearly as wide as the tube,
    and what belongs there is left."""
    rng = np.random.default_rng(6)
    n, tube = 200_000, 0.1
    angle = rng.uniform(0, 2 * np.pi, n)
    out = np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=1)
    position = tube * out + [0, 0, 1] * rng.uniform(-1, 1, (n, 1))
    wi = rng.normal(size=(n, 3))
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    inside = np.arange(n) % 2 == 0
    side = np.where(inside, -1, 1) * np.sign(np.einsum("ij,ij->i", wi, out))
    power, normal = np.where(inside, 1000.0, 1.0)[:, None].repeat(3, axis=1), np.where(inside, -1, 1)[:, None] * out
    photons = naive.pack(position, wi * side[:, None], power, normal=normal)
    points, normals = (np.ascontiguousarray(a[1:200:2], f4) for a in (position, out))
    if how == "radius":
        radius = 0.08
        E, counts = by_radius(build_grid(photons, radius), points, normals, radius, 0.2)
        area = np.pi * radius**2
    else:
        E, counts, radii = by_knn(build_kdtree(photons), points, normals, 500, 0.08, 0.2)
        area = np.pi * radii[:, None] ** 2
    expected = n / 2 / (2 * np.pi * tube * 2)  # photons to an area
    print(f"{how}: {E.mean() / expected:.3f} of what is there")
    assert (E * area).sum() < 1.1 * 3 * counts.sum()
    assert (E[np.abs(points[:, 2]) < 0.9] > 0.7 * expected).all()


def test_the_inside_of_a_box_does_not_count_on_its_top():
    """Photons on both sides of a thin bevel below a place, near the edge of a box's top: those of its outside count as
    far down as the disc reaches, those of its inside do not. Nor do those of an upright wall."""
    rng = np.random.default_rng(7)
    n, radius = 200_000, 0.056
    position = np.stack([np.full(n, 0.05), rng.uniform(-1, 1, n), rng.uniform(-0.03, 0.0, n)], axis=1)
    outside = np.arange(n) % 2 == 0
    normal = np.where(outside, 1, -1)[:, None] * np.array([0.6, 0, 0.8])
    photons = naive.pack(position, np.tile([0, 0, 1.0], (n, 1)), 1.0, normal=normal)
    points = np.stack([np.zeros(50), rng.uniform(-0.8, 0.8, 50), np.zeros(50)], axis=1).astype(f4)
    up = np.tile(np.array([0, 0, 1], f4), (50, 1))
    _, counts = by_radius(build_grid(photons, radius), points, up, radius, 0.2)
    low = outside & (position[:, 2] >= -0.2 * radius)
    expected = [(low & (np.linalg.norm(position - p, axis=1) < radius)).sum() for p in points]
    assert min(expected) > 100
    np.testing.assert_allclose(counts, expected, atol=3)
    upright = naive.pack(position, np.tile([0.6, 0, 0.8], (n, 1)), 1.0, normal=np.tile([1.0, 0, 0], (n, 1)))
    _, counts = by_radius(build_grid(upright, radius), points, up, radius, 0.2)
    assert counts.max() <= 3  # within rounding of the plane
