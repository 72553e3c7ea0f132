"""Increments on the wire: every bit comes back, and less travels than there is."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.cluster.packed import pack, unpack
from pmviewer.render.film import Film, Increment


def bits(values):
    return np.ascontiguousarray(values).view(np.uint64)


def awkward(rng, n):
    """Columns of every kind: float32, float64, zeros, negative zeros, NaN and infinities, beyond float32."""
    single = rng.normal(size=n).astype(np.float32).astype(np.float64)
    special = single.copy()
    special[:5] = np.nan, np.inf, -np.inf, -0.0, 1e-45
    payload = np.full(n, np.nan).view(np.uint64) | np.uint64(1)
    return np.stack(
        [single, rng.normal(size=n), np.zeros(n), -np.zeros(n), special, 1e300 * single, payload.view(np.float64)],
        axis=1,
    )


@pytest.mark.parametrize("spans", [[(0, 60)], [(12, 15), (22, 25)], [(0, 0)]], ids=["all", "region", "nothing"])
def test_every_bit_comes_back(spans):
    rng = np.random.default_rng(1)
    blank = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0])
    sums = np.tile(blank, (60, 1))
    for first, last in spans:
        sums[first:last] = awkward(rng, 60)[first:last]
    back = unpack(pack(Increment(sums), spans), blank)
    np.testing.assert_array_equal(bits(back.sums), bits(sums))


@pytest.mark.parametrize("region", [None, (2, 1, 5, 4)])
def test_it_is_added_as_the_increment_is(region):
    rng = np.random.default_rng(3)
    films = Film(10, 6), Film(10, 6)
    for film in films:
        film.region = region
    for index in range(3):
        sums = np.zeros_like(films[0].sums)
        spans = films[0].spans(index)
        for first, last in spans:
            sums[first:last, 4:8] = rng.normal(size=(last - first, 4))
            sums[first:last, :4] = rng.normal(size=(last - first, 4)).astype(np.float32)
        whole = Increment(sums)
        whole.add_to(films[0])
        pack(whole, spans).add_to(films[1])
    assert films[0].sums.any()
    np.testing.assert_array_equal(bits(films[1].sums), bits(films[0].sums))


def test_less_travels_than_there_is():
    rng = np.random.default_rng(2)
    sums = np.zeros((1000, 22))
    sums[:, :4] = rng.normal(size=(1000, 4)).astype(np.float32)
    assert pack(Increment(sums), [(0, 1000)]).bytes < 1000 * 4 * 4.2, "float32 of the columns that aren't empty"
    assert pack(Increment(sums), [(10, 20)]).bytes < 10 * 4 * 4 + 100, "of a region its pixels"
