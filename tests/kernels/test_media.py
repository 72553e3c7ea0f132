"""Phase functions, distances and flights in media against their formulas."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit
from scipy.integrate import quad
from scipy.stats import chi2

from pmviewer.kernels.media.kinds import RAYLEIGH
from pmviewer.kernels.media.phase import phase, sample_phase
from pmviewer.render.media.distance import (
    equiangular_distance,
    equiangular_pdf,
    transmittance_distance,
    transmittance_pdf,
)

f4 = np.float32
D = (f4(0.6), f4(0.0), f4(0.8))


def lobe(g, cos):
    """Henyey and Greenstein's phase function in float64, and Rayleigh's."""
    if g == RAYLEIGH:
        return 3 / (16 * math.pi) * (1 + cos**2)
    return (1 - g * g) / (4 * math.pi * (1 + g * g - 2 * g * cos) ** 1.5)


def lobe_cdf(g, cos):
    """Share of directions whose cosine is below."""
    if g == RAYLEIGH:
        return (cos**3 + 3 * cos + 4) / 8
    if abs(g) < 1e-9:
        return (1 + cos) / 2
    return (1 - g * g) / (2 * g) * (1 / np.sqrt(1 + g * g - 2 * g * cos) - 1 / (1 + g))


@njit
def sampled(numbers, d, u, out, values):
    for i in range(len(u)):
        wi = sample_phase(numbers, d, u[i, 0], u[i, 1], u[i, 2])
        out[i, 0], out[i, 1], out[i, 2] = wi
        values[i] = phase(numbers, d, wi)


def directions(numbers, n=200_000):
    u = np.random.default_rng(7).random((n, 3), np.float32)
    out, values = np.empty((n, 3), np.float32), np.empty(n, np.float32)
    sampled(tuple(f4(x) for x in numbers), D, u, out, values)
    return out.astype(float), values


@pytest.mark.parametrize(
    "numbers",
    [
        (0, 0, 0),
        (0.0005, 0, 0),
        (0.5, 0, 0),
        (-0.7, 0, 0),
        (0.95, 0, 0),
        (0.8, -0.4, 0.3),
        (RAYLEIGH, 0, 0),
        (0.6, RAYLEIGH, 0.5),
    ],
)
def test_directions_follow_the_phase_function(numbers):
    """χ² over 64 bins of equal probability in the cosine, and over the angle around."""
    wi, values = directions(numbers)
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1, atol=1e-5)
    cos = np.clip(wi @ np.array(D, float), -1, 1)
    g, g2, w = numbers
    cdf = (1 - w) * lobe_cdf(g, cos) + w * lobe_cdf(g2, cos)
    azimuth = np.arctan2(wi[:, 1], wi @ np.array([0.8, 0.0, -0.6])) / (2 * math.pi) + 0.5
    for uniform in (cdf, azimuth):
        counts = np.histogram(uniform, 64, (0, 1))[0]
        expected = len(cos) / 64
        assert ((counts - expected) ** 2 / expected).sum() < chi2.ppf(1 - 1e-4, 63)
    np.testing.assert_allclose(values, (1 - w) * lobe(g, cos) + w * lobe(g2, cos), rtol=2e-3)


@pytest.mark.parametrize("g", [0.999, -0.999])
def test_extreme_lobes_keep_their_mean_cosine_and_their_value(g):
    wi, values = directions((g, 0, 0))
    travel = np.array(D, float) * math.copysign(1, g)
    lift = ((wi - travel) ** 2).sum(axis=1) / 2
    assert 1 - lift.mean() == pytest.approx(abs(g), abs=3e-4)
    rest = 1 - abs(g)
    expected = rest * (1 + abs(g)) / (4 * math.pi * (rest**2 + 2 * abs(g) * lift) ** 1.5)
    np.testing.assert_allclose(values, expected, rtol=0.02)


@njit
def distances(around, sigma, o, d, length, pivot, u, t, pdf):
    for i in range(len(u)):
        if around:
            t[i] = equiangular_distance(o, d, length, pivot, u[i])
            pdf[i] = equiangular_pdf(o, d, length, pivot, t[i])
        else:
            t[i] = transmittance_distance(sigma, length, u[i])
            pdf[i] = transmittance_pdf(sigma, length, t[i])


@njit
def density(around, sigma, o, d, length, pivot, t):
    if around:
        return equiangular_pdf(o, d, length, pivot, t)
    return transmittance_pdf(sigma, length, t)


@pytest.mark.parametrize("around", [False, True])
@pytest.mark.parametrize("sigma", [(0.5, 1.0, 2.0), (0.0, 1e-6, 3.0), (20.0, 20.0, 20.0)])
def test_distances_have_their_density(around, sigma):
    length = f4(3.0)
    o, pivot = (f4(0), f4(0), f4(0)), (f4(1.0), f4(0.7), f4(1.2))
    sigma = tuple(f4(s) for s in sigma)
    n = 100_000
    u = ((np.arange(n) + 0.5) / n).astype(np.float32)
    t, pdf = np.empty(n, np.float32), np.empty(n, np.float32)
    distances(around, sigma, o, D, length, pivot, u, t, pdf)
    assert t.min() >= 0
    assert t.max() <= length
    total = quad(lambda s: density(around, sigma, o, D, length, pivot, f4(s)), 0, 3.0, limit=200)[0]
    assert total == pytest.approx(1, abs=2e-3)
    for end in (0.3, 1.0, 2.5):
        share = quad(lambda s: density(around, sigma, o, D, length, pivot, f4(s)), 0, end, limit=200)[0]
        assert (t < end).mean() == pytest.approx(share, abs=3e-3)
