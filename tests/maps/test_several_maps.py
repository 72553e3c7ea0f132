"""Look-ups in several maps (M4): against NumPy, and their bias and noise against what the gamma law says."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from pmviewer.maps.estimate.estimate import RIM_LEFT_OUT, RIM_WHOLE
from pmviewer.maps.search.kdtree import build_kdtree
from pmviewer.maps.search.parts import COMBINATIONS, parts_of
from tests.maps.lookups import estimate
from tests.support import naive_maps as naive

UP = np.array([0.0, 0.0, 1.0])


class Combined:
    """A map of parts as `tests.maps.lookups.estimate` takes it."""

    def __init__(self, parts, unit, combine):
        self.parts = parts_of([build_kdtree(part, unit) for part in parts])
        self.record = self.parts.combined_by(combine)


def clustered_parts(rng, sizes):
    """Photons of random powers and directions on a bumpy floor, some of them from below."""
    parts = []
    for n in sizes:
        place = np.c_[rng.normal(0, 0.3, (n, 2)), rng.normal(0, 0.005, n)]
        wi = rng.normal(size=(n, 3))
        wi[:, 2] += 1
        wi /= np.linalg.norm(wi, axis=1, keepdims=True)
        parts.append(naive.pack(place, wi, rng.uniform(0.2, 2, (n, 3))))
    return parts


@pytest.mark.parametrize("combine", COMBINATIONS)
@pytest.mark.parametrize("kind", ["constant", "cone", "simpson"])
def test_as_in_numpy(combine, kind):
    """Dense and sparse parts, an empty one and one with fewer than k; whole discs and a part of them."""
    rng = np.random.default_rng(3)
    parts = clustered_parts(rng, (300, 280, 5, 0))
    several = Combined(parts, 0.01, combine)
    points = np.c_[rng.normal(0, 0.2, (40, 2)), np.zeros(40)].astype(np.float32)
    for rim, share in ((0, 1.0), (1, 1.0), (2, 1.0), (0, 0.3)):
        found = estimate(several, points, 0.4, k=7, rim=rim, share=share, kind=kind, flatness=0.3)
        for point, E in zip(points, found, strict=True):
            expected = naive.combined_knn(
                parts, 0.01, point.astype(float), UP, 7, 0.4, 0.3, kind, rim, np.float64(np.float32(share)), combine
            )
            np.testing.assert_allclose(E, expected, rtol=2e-3, atol=1e-5)


def test_one_part_is_the_map_itself():
    """Whatever the combination, the rim and the share."""
    rng = np.random.default_rng(4)
    (photons,) = clustered_parts(rng, (500,))
    points = np.c_[rng.normal(0, 0.3, (50, 2)), np.zeros(50)]
    tree = build_kdtree(photons, 0.1)
    for combine in COMBINATIONS:
        for fields in ({"rim": 0}, {"rim": 1}, {"rim": 2}, {"share": 0.2}, {"rim": 1, "kind": "cone"}):
            one = estimate(Combined([photons], 0.1, combine), points, 0.3, k=20, **fields)
            np.testing.assert_allclose(one, estimate(tree, points, 0.3, k=20, **fields), rtol=1e-6)


def unit_square(rng, n):
    """Photons of 1/n watt scattered independently over a unit square: the irradiance is 1."""
    return naive.pack(np.c_[rng.random((n, 2)), np.zeros(n)])


@functools.cache
def square_maps(M, n, trial, combine, places):
    """Maps of a square, and where they are looked up in its middle."""
    rng = np.random.default_rng([M, trial])
    parts = [unit_square(rng, n) for _ in range(M)]
    points = np.c_[rng.uniform(0.2, 0.8, (places, 2)), np.zeros(places)]
    return Combined(parts, 1 / (M * n), combine), points


def moments(M, in_each, rim, combine, share=1.0, trials=30, places=400, n=1600, **fields):
    """Mean, its standard error, and relative variance of look-ups in the middle of squares of M·n photons."""
    means, variances = [], []
    for trial in range(trials):
        several, points = square_maps(M, n, trial, combine, places)
        E = estimate(several, points, 1.0, k=in_each, rim=rim, share=share, **fields)[:, 0].astype(float)
        means.append(E.mean())
        variances.append(E.var())
    return np.mean(means), np.std(means) / np.sqrt(trials), np.mean(variances) / np.mean(means) ** 2


@pytest.mark.parametrize(("M", "in_each"), [(4, 5), (8, 3)])
def test_bias_and_noise_are_those_of_the_gamma_law(M, in_each):
    """As the source counts (the k-th photons whole) sums of irradiances are too bright by 1/(κ − 1), the combination
    by 1/(Mκ − 1). With one photon left out both are exact, and the noise is that of κ or of Mκ photons; that of sums by
    very few photons hardly settles."""
    k = M * in_each
    for combine, rim, bias in (
        ("irradiances", RIM_WHOLE, 1 / (in_each - 1)),
        ("powers and areas", RIM_WHOLE, 1 / (k - 1)),
        ("irradiances", RIM_LEFT_OUT, 0),
        ("powers and areas", RIM_LEFT_OUT, 0),
    ):
        mean, error, variance = moments(M, in_each, rim, combine)
        print(
            f"M {M}, {in_each} each, {combine}, rim {rim}: {mean - 1:+.4f} ± {error:.4f}, {bias:+.4f}; {variance:.4f}"
        )
        assert abs(mean - 1 - bias) < 4 * error + 0.002
        if combine == "powers and areas":
            assert variance == pytest.approx(1 / (k - 2), rel=0.08)
        elif in_each > 4:
            assert variance == pytest.approx(1 / (M * (in_each - 2)), rel=0.2)


@pytest.mark.parametrize("fields", [{"share": 0.4}, {"kind": "epanechnikov"}, {"share": 0.4, "kind": "cone"}])
def test_parts_of_discs_and_kernels_have_the_same_mean(fields):
    mean, error, _ = moments(6, 4, RIM_LEFT_OUT, "powers and areas", **fields)
    print(f"{fields}: {mean - 1:+.4f} ± {error:.4f}")
    assert abs(mean - 1) < 4 * error


def test_at_an_edge_it_is_as_dark_as_one_map():
    """What half a disc off the surface takes is the same: of k/M photons of an M-th of them, or of k of all."""
    M, in_each, n, trials = 5, 4, 1000, 40
    several, single = [], []
    for trial in range(trials):
        rng = np.random.default_rng(trial)
        parts = [unit_square(rng, n) for _ in range(M)]
        points = np.c_[np.zeros(200), rng.uniform(0.2, 0.8, 200), np.zeros(200)]
        of_parts = Combined(parts, 1 / (M * n), "powers and areas")
        several.append(estimate(of_parts, points, 1.0, k=in_each).mean())
        single.append(estimate(build_kdtree(np.concatenate(parts), 1 / (M * n)), points, 1.0, k=M * in_each).mean())
    error = np.std(np.subtract(several, single)) / np.sqrt(trials)
    print(f"edge: {np.mean(several):.4f} of parts, {np.mean(single):.4f} of one map, ± {error:.4f}")
    assert np.mean(single) == pytest.approx(0.5, abs=0.02)
    assert abs(np.mean(several) - np.mean(single)) < 4 * error


def test_few_photons_within_the_largest_radius():
    """Where the search ends before k photons the mean stays: in all parts exactly, in some within half a percent."""
    for radius, in_each in ((0.03, 6), (0.02, 12)):  # 4.5 photons of 6; 2 of 12
        means = []
        for trial in range(30):
            rng = np.random.default_rng(trial)
            parts = [unit_square(rng, 1600) for _ in range(4)]
            points = np.c_[rng.uniform(0.2, 0.8, (400, 2)), np.zeros(400)]
            several = Combined(parts, 1 / 6400, "powers and areas")
            means.append(estimate(several, points, radius, k=in_each)[:, 0].mean())
        error = np.std(means) / np.sqrt(len(means))
        print(f"radius {radius}, {in_each} each: {np.mean(means) - 1:+.4f} ± {error:.4f}")
        assert abs(np.mean(means) - 1) < 3 * error + (0.005 if in_each == 6 else 0)
