"""Random streams: stratification of the Sobol sets, uniformity of the independent ones, independence of both."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.random import INDEPENDENT, SOBOL, draw1, draw4, hash3, owen
from pmviewer.kernels.sobol import (
    SEED_BITS,
    SEED_FACTORS,
    SOBOL_TABLE,
    bit_reversed_points,
    reversed_bits,
    scrambled_point,
)

SEQUENCES = {"independent": INDEPENDENT, "sobol": SOBOL}


@kernel
def _draw4_many(sequence, seed, first, dimension_set, out):
    for i in range(len(out)):
        out[i] = draw4(sequence, seed, np.uint32(first + np.uint32(i)), dimension_set)


@kernel
def _draw4_of_seeds(sequence, index, dimension_set, out):
    for i in range(len(out)):
        out[i] = draw4(sequence, hash3(np.uint32(1), np.uint32(i), np.uint32(3)), index, dimension_set)


@kernel
def _draw1_many(sequence, seed, first, dimension_set, out):
    for i in range(len(out)):
        out[i] = draw1(sequence, seed, np.uint32(first + np.uint32(i)), dimension_set)


@kernel
def _scrambled_points(indices, keys, out):
    for i in range(len(out)):
        out[i] = scrambled_point(SOBOL_TABLE, indices[i], keys[i])


@kernel
def _owen_many(values, seed, out):
    for i in range(len(out)):
        out[i] = owen(values[i], seed)


def four(sequence, seed, first, n, dimension_set):
    out = np.empty((n, 4), np.float32)
    _draw4_many(sequence, np.uint32(seed), np.uint32(first), dimension_set, out)
    return out


def one(sequence, seed, first, n, dimension_set):
    out = np.empty(n, np.float32)
    _draw1_many(sequence, np.uint32(seed), np.uint32(first), dimension_set, out)
    return out


def test_unscrambled_points_are_joe_and_kuos():
    points = reversed_bits(bit_reversed_points(reversed_bits(np.arange(4096, dtype=np.uint32))))
    expected = qmc.Sobol(4, scramble=False, bits=32).random(4096)  # in Gray code order: the same set
    ours = points.astype(np.float64) / 2**32
    assert np.array_equal(np.sort(ours, axis=0), np.sort(expected, axis=0))
    assert {tuple(p) for p in ours} == {tuple(p) for p in expected}


def test_four_lanes_scramble_as_four_numbers_do():
    """`owen`, which the tests below show to be a nested scramble, of one coordinate after the other."""
    rng = np.random.default_rng(5)
    indices, keys = rng.integers(0, 2**32, (2, 500), dtype=np.uint32)
    out = np.empty((500, 4), np.float32)
    _scrambled_points(indices, keys, out)
    points = bit_reversed_points(indices)
    with np.errstate(over="ignore"):
        seeds = keys[:, None] * np.array(SEED_FACTORS, np.uint32) ^ np.array(SEED_BITS, np.uint32)
    for lane in range(4):
        expected = np.empty(500, np.uint32)
        for i in range(500):
            _owen_many(reversed_bits(points[i : i + 1, lane]), seeds[i, lane], expected[i : i + 1])
        assert np.array_equal(out[:, lane], (expected >> 8) * np.float32(2.0**-24))


@pytest.mark.parametrize(("seed", "dimension_set"), [(1, 0), (7, 3), (12345, 2000)])
def test_every_aligned_block_of_a_set_is_stratified(seed, dimension_set):
    """Each coordinate of 2^k points falls into each of 2^k intervals once, and the first two are a (0, 2)-net: one
    point in every elementary rectangle of area 2^-k."""
    for k in (4, 8, 11):
        n = 2**k
        for first in (0, 5 * n):
            points = four(SOBOL, seed, first, n, dimension_set)
            for d in range(4):
                assert np.array_equal(np.sort((points[:, d] * n).astype(int)), np.arange(n))
            for a in range(k + 1):
                cells = (points[:, 0] * 2**a).astype(int) * 2 ** (k - a) + (points[:, 1] * 2 ** (k - a)).astype(int)
                assert np.array_equal(np.sort(cells), np.arange(n))
            single = one(SOBOL, seed, first, n, dimension_set)
            assert np.array_equal(np.sort((single * n).astype(int)), np.arange(n))


def test_all_pairs_of_coordinates_are_better_than_random():
    """Counts in 16 × 16 cells of 4 096 points scatter far less than a random set's (χ² per degree of freedom of 1)."""
    worst = 0.0
    for seed in range(8):
        points = four(SOBOL, seed, 0, 4096, 5)
        for a in range(4):
            for b in range(a):
                counts = np.histogram2d(points[:, a], points[:, b], 16, [[0, 1], [0, 1]])[0]
                worst = max(worst, float(((counts - 16) ** 2).sum() / 16 / 255))
    print(f"largest χ² per degree of freedom of a pair: {worst:.3f}")
    assert worst < 0.2


@pytest.mark.parametrize("name", SEQUENCES)
def test_uniform(name):
    """χ² over 256 intervals and over 16 × 16 cells of each pair, 2^17 numbers. Between sets, Sobol points come in pairs
    that are opposites in both (their first bits differ), so only pairs within a set are tested."""
    n = 2**17
    points = four(SEQUENCES[name], 3, 1000, n, 9)
    points = np.column_stack([points, one(SEQUENCES[name], 3, 1000, n, 9)])
    assert points.min() >= 0
    assert points.max() < 1
    smallest = 1.0
    for d in range(5):
        counts = np.bincount((points[:, d] * 256).astype(int), minlength=256)
        smallest = min(smallest, stats.chisquare(counts).pvalue)
    for a in range(5 if name == "independent" else 4):
        for b in range(a):
            cells = (points[:, a] * 16).astype(int) * 16 + (points[:, b] * 16).astype(int)
            smallest = min(smallest, stats.chisquare(np.bincount(cells, minlength=256)).pvalue)
    print(f"{name}: smallest p value of the χ² tests {smallest:.4f}")
    assert smallest > 1e-4


@pytest.mark.parametrize("name", SEQUENCES)
def test_seeds_and_sets_are_uncorrelated(name):
    """16 384 numbers of each of 40 streams: no correlation coefficient beyond five standard errors: 1/√n each, √2 more
    for Sobol points, of which every second one is its neighbour's opposite."""
    n = 2**14
    streams = [four(SEQUENCES[name], seed, 0, n, s) for seed in (0, 1, 2) for s in (0, 1, 2)]
    streams += [one(SEQUENCES[name], seed, 0, n, s)[:, None] for seed in (0, 1) for s in (0, 1)]
    correlation = np.corrcoef(np.column_stack(streams), rowvar=False)
    largest = float(np.abs(correlation - np.eye(len(correlation))).max())
    limit = 5 / np.sqrt(n) * (np.sqrt(2) if name == "sobol" else 1.0)
    print(f"{name}: largest correlation {largest:.4f}, five standard errors {limit:.4f}")
    assert largest < limit


@pytest.mark.parametrize("name", SEQUENCES)
def test_points_of_one_index_are_uniform_over_seeds(name):
    """Pixels have seeds of their own and see few indices each: over the seeds, every single point has to be uniform in
    four dimensions, and the points of two indices must not repeat each other. χ² over 2^16 seeds, 16 × 16 cells of each
    pair of coordinates, 6^4 cells of all four."""
    smallest, largest = 1.0, 0.0
    n = 2**16
    previous = None
    for index in (0, 1, 2, 3, 1000):
        points = np.empty((n, 4), np.float32)
        _draw4_of_seeds(SEQUENCES[name], np.uint32(index), 1, points)
        for a in range(4):
            for b in range(a):
                cells = (points[:, a] * 16).astype(int) * 16 + (points[:, b] * 16).astype(int)
                smallest = min(smallest, stats.chisquare(np.bincount(cells, minlength=256)).pvalue)
        cells = (points * 6).astype(int) @ [216, 36, 6, 1]
        smallest = min(smallest, stats.chisquare(np.bincount(cells, minlength=1296)).pvalue)
        if previous is not None and name == "independent":
            largest = max(largest, float(np.abs(np.corrcoef(points, previous, rowvar=False)[:4, 4:]).max()))
        previous = points
    print(f"{name}: smallest p value of 35 χ² tests {smallest:.5f}, largest correlation {largest:.4f}")
    assert smallest > 1e-4
    assert largest < 5 / np.sqrt(n)


def test_neighbouring_independent_numbers_are_uncorrelated():
    n = 2**16
    points = four(INDEPENDENT, 1, 0, n, 0).astype(float) - 0.5
    for lag in (1, 2, 64):
        assert abs((points[lag:] * points[:-lag]).mean() * 12) < 5 / np.sqrt(4 * n)


@pytest.mark.parametrize("name", SEQUENCES)
def test_a_number_depends_on_seed_index_and_set_alone(name):
    sequence = SEQUENCES[name]
    whole = four(sequence, 5, 0, 300, 4)
    assert np.array_equal(four(sequence, 5, 120, 100, 4), whole[120:220])
    assert not np.any(four(sequence, 6, 0, 300, 4) == whole)
    assert not np.any(four(sequence, 5, 0, 300, 5) == whole)


def test_owen_scramble_permutes_and_keeps_prefixes():
    """Numbers that share their first k bits share them afterwards, and no two become one (Owen 1995)."""
    values = (np.arange(2**16, dtype=np.uint64) << 16).astype(np.uint32)
    out = np.empty_like(values)
    _owen_many(values, np.uint32(77), out)
    assert len(np.unique(out)) == len(out)
    for k in range(1, 17):
        prefix = (out >> np.uint32(32 - k)).reshape(2**k, -1)
        assert np.all(prefix == prefix[:, :1])
        assert len(np.unique(prefix[:, 0])) == 2**k
