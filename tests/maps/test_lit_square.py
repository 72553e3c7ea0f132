"""Christensen's lit square (course notes 2004, §5.5): a unit square under 1 W of parallel light, 40 000 photons.

The true irradiance is 1 everywhere. Run with `-rP` to see the figures.
"""

import numpy as np
import pytest

from pmviewer.maps.estimate.estimate import RIM_HALF, RIM_LEFT_OUT
from pmviewer.maps.estimate.filters import FILTERS
from pmviewer.maps.search.grid import build_grid
from pmviewer.maps.search.kdtree import build_kdtree
from tests.maps.lookups import estimate
from tests.support import naive_maps as naive

SIDE = 200
N = SIDE * SIDE
SQUARES = {"independent": 8, "stratified": 4}
"""How many there are: the noise of stratified photons is small."""
DISTRIBUTIONS = tuple(SQUARES)
SPHERE, FLAT = 1.0, 0.2
BOUNDARY = {"independent": 0.0, "stratified": 0.2}
WIDEST = 0.0631
"""Radius of a disc of 500 photons."""
COVERED = 100_000
"""Photons in all discs together: they cover the square twice. More discs of as many photons tell little more."""

TILT = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
NORMAL = TILT[:, 2].astype(np.float32)


def on_square(u, v):
    """Points of the square, which lies askew, so that heights above the tangent plane are not exactly 0."""
    return np.c_[u, v, np.zeros(len(u))] @ TILT.T


def photons(seed, distribution):
    rng = np.random.default_rng(seed)
    place = rng.random((N, 2))
    if distribution == "stratified":
        cells = np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 2)
        place = (cells + place) / SIDE
    return naive.pack(on_square(*place.T), NORMAL)


@pytest.fixture(scope="module")
def squares():
    clouds = {d: [photons(seed, d) for seed in range(SQUARES[d])] for d in DISTRIBUTIONS}
    trees = {d: [build_kdtree(cloud, 1 / N) for cloud in clouds[d]] for d in DISTRIBUTIONS}
    grids = {d: [build_grid(cloud, WIDEST, 1 / N) for cloud in clouds[d]] for d in DISTRIBUTIONS}
    return {"nearest": trees, "radius": grids}


def radius_of(n):
    """Of a disc with n photons on average."""
    return float(np.sqrt(n / (np.pi * N)))


def mean(squares, how, distribution, n, points, **settings):
    """Mean of the red irradiance over points and squares; points(rng) gives u, v."""
    if how == "nearest" and settings.get("estimator") != "hull":
        settings["rim"] = RIM_HALF if distribution == "stratified" else RIM_LEFT_OUT
    radius = radius_of(n) if how == "radius" else 1.0
    found = []
    for i, m in enumerate(squares[how][distribution]):
        u, v = np.asarray(points(np.random.default_rng(i)))[:, : COVERED // n]
        found.append(estimate(m, on_square(u, v), radius, normals=NORMAL, k=n, **settings)[:, 0])
    return np.mean(found)


def spread(rng, n):
    """(2, n) places in the unit square: a lattice shifted at random. Its noise is that of the photons, which random
    places only reach where they are many more."""
    return (np.outer((0.7548776662466927, 0.5698402909980532), np.arange(n)) + rng.random((2, 1))) % 1


def middle(rng, n=800):
    return 0.1 + 0.8 * spread(rng, n)


def anywhere(rng, n):
    """In the middle, independently."""
    return rng.uniform(0.1, 0.9, (2, n))


def along_edge(distance, n=800):
    """Points at distances from 0 … `distance` (a pair: from … to) of one edge of the square."""
    low, high = distance if isinstance(distance, tuple) else (0.0, distance)

    def points(rng):
        across, along = spread(rng, n)
        return low + (high - low) * across, 0.1 + 0.8 * along

    return points


@pytest.mark.parametrize("flatness", [SPHERE, FLAT], ids=["sphere", "flattened"])
@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_E1_the_disc_is_unbiased(squares, distribution, flatness):
    for n in (25, 50, 100, 250, 500):
        for how in ("nearest", "radius"):
            found = mean(squares, how, distribution, n, middle, flatness=flatness)
            print(f"E1 {distribution} {how} n = {n} flatness {flatness}: mean {found:.4f}")
            assert found == pytest.approx(1, abs=0.005)


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_E2_all_kernels_have_the_same_mean(squares, distribution):
    for how, n in (("radius", 25), ("radius", 500), ("nearest", 50), ("nearest", 500)):
        means = {kind: mean(squares, how, distribution, n, middle, kind=kind) for kind in FILTERS}
        print(f"E2 {distribution} {how} n = {n}:", {kind: round(float(m), 4) for kind, m in means.items()})
        assert all(m == pytest.approx(1, abs=0.005) for m in means.values())


@pytest.mark.parametrize("estimator", ["disc", "hull", "differential"])
def test_E6_any_part_of_the_disc_of_the_nearest_has_the_same_mean(squares, estimator):
    """Independent photons, so exactly, whatever the kernel; a third of the photons or a fiftieth. Of that a look-up
    sees a third of a photon, so that it takes many and one kernel is enough; of the others' discs 5000 cover a square
    twice or more."""
    kinds = FILTERS if estimator == "disc" else ("constant",)
    for k, share, places in ((100, 0.3, 5000), (16, 0.3, 5000), (16, 0.02, 20_000)):
        look = middle if places < 10_000 else anywhere
        for kind in kinds if share > 0.1 else kinds[:1]:
            chosen = {"share": share, "kind": kind, "estimator": estimator, "rim": RIM_LEFT_OUT}
            found = np.mean(
                [
                    estimate(m, on_square(*look(np.random.default_rng(i), places)), 1.0, normals=NORMAL, k=k, **chosen)
                    for i, m in enumerate(squares["nearest"]["independent"])
                ]
            )
            print(f"E6 {estimator} {kind} k = {k}, share {share}: mean {found:.4f}")
            assert found == pytest.approx(1, abs=0.008 if share < 0.1 else 0.005)


def test_E6_the_bias_of_a_part_is_that_of_its_size():
    """Photons that get denser with the square of the distance from a place, c times by x = r²: a disc holds Λ = D·(x +
    c·x²/2) on average and is too bright by c·x/2. With Λ of the 16th a gamma variate, the part s of its disc is too
    bright by the mean of 15/Λ · s·c·x/2: the sixteen nearest much, a small part of their disc little."""
    rng = np.random.default_rng(5)
    D, c, k, trials = 20.0, 10.0, 16, 4000
    shares = (1.0, 0.25, 0.05)

    def area(mass):
        return (np.sqrt(1 + 2 * c * mass / D) - 1) / c

    of_disc = rng.gamma(k, size=200_000)
    expected = np.mean((k - 1) / of_disc * c * area(of_disc) / 2)
    found = np.empty((trials, len(shares)))
    for i in range(trials):
        n = rng.poisson(D * (1 + c / 2))
        r, angle = np.sqrt(area(rng.uniform(0, D * (1 + c / 2), n))), rng.uniform(0, 2 * np.pi, n)
        tree = build_kdtree(naive.pack(np.c_[r * np.cos(angle), r * np.sin(angle), np.zeros(n)]), np.pi / D)
        found[i] = [estimate(tree, np.zeros((1, 3)), 1.0, k=k, share=share)[0, 0] - 1 for share in shares]
    mean, error = found.mean(axis=0), found.std(axis=0) / np.sqrt(trials)
    print(f"E6 too bright by {mean} ± {error}, expected {expected * np.array(shares)}")
    assert expected > 1
    np.testing.assert_array_less(np.abs(mean - expected * np.array(shares)), 4 * error)


@pytest.mark.parametrize("how", ["nearest", "radius"])
@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_E3_differential_checking_has_no_dark_edge(squares, distribution, how):
    """From the very edge to the middle, with the boundary's share that suits the photons (E4)."""
    r = radius_of(500)
    settings = {"estimator": "differential", "boundary": BOUNDARY[distribution]}
    assert mean(squares, how, distribution, 500, middle, **settings) == pytest.approx(1, abs=0.005)
    for low, high, dark in ((0, 0.05, 0.55), (0.05, 0.2, 0.62), (0.2, 0.6, 0.78), (0.6, 1, 0.97)):
        rim = along_edge((low * r, high * r), 400)
        plain = mean(squares, how, distribution, 500, rim)
        checked = mean(squares, how, distribution, 500, rim, **settings)
        print(f"E3 {distribution} {how}: rim ({low} … {high}) r {checked:.4f}, without {plain:.4f}")
        assert plain < dark
        assert checked == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("how", ["nearest", "radius"])
def test_E3_light_ends_at_the_edge(squares, how):
    """Beyond the square nothing is lit: what spans the photons does not span the place."""
    r = radius_of(500)
    beyond = along_edge((-0.5 * r, -0.25 * r))
    plain = mean(squares, how, "independent", 500, beyond)
    checked = mean(squares, how, "independent", 500, beyond, estimator="differential")
    print(f"E3 {how}: beyond the edge {checked:.3f}, without {plain:.3f}")
    assert checked < 0.1 < 0.25 < plain


def test_E3_nothing_happens_without_a_trend(squares):
    """In the middle of the square nearly all estimates are those of the whole disc."""
    points = on_square(*middle(np.random.default_rng(3)))
    for how, radius in (("nearest", 1.0), ("radius", WIDEST)):
        m = squares[how]["independent"][0]
        plain = estimate(m, points, radius, normals=NORMAL, k=500)
        checked = estimate(m, points, radius, "differential", normals=NORMAL, k=500)
        same = np.isclose(plain, checked, rtol=1e-5).all(axis=1).mean()
        assert 0.9 < same < 1


@pytest.mark.parametrize("kind", FILTERS)
def test_E3_with_any_kernel(squares, kind):
    found = mean(squares, "radius", "independent", 100, middle, estimator="differential", kind=kind)
    assert found == pytest.approx(1, abs=0.005)


@pytest.mark.parametrize("how", ["nearest", "radius"])
@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_E4_the_convex_hull_has_no_dark_edge(squares, distribution, how):
    for n in (50, 500):
        settings = {"estimator": "hull", "boundary": BOUNDARY[distribution]}
        r = radius_of(n)
        inside = mean(squares, how, distribution, n, middle, **settings)
        edge = mean(squares, how, distribution, n, along_edge(r, 800), **settings)
        disc = mean(squares, how, distribution, n, along_edge(r, 800))
        print(f"E4 {distribution} {how} n = {n}: middle {inside:.4f}, edge {edge:.4f}, of a disc {disc:.4f}")
        assert inside == pytest.approx(1, abs=0.005)
        assert edge == pytest.approx(inside, rel=0.02)
        assert disc < 0.82


def test_E4_the_boundary_share_matters(squares):
    """What is right for stratified photons is too bright for independent ones, and the other way round."""
    bright = mean(squares, "nearest", "independent", 50, middle, estimator="hull", boundary=0.2)
    dark = mean(squares, "nearest", "stratified", 50, middle, estimator="hull", boundary=0.0)
    print(f"E4 boundary share 0.2 of independent photons {bright:.4f}, 0 of stratified ones {dark:.4f}")
    assert bright > 1.03
    assert dark < 0.97
