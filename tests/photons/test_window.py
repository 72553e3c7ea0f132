"""Photons that are split where they come to important places (I6): boxes, numbers of pieces, and nothing gained or lost
by it."""

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.pool import WorkPool
from pmviewer.maps.record import unpack
from pmviewer.photons.deposition.rules import Deposition
from pmviewer.photons.emission.guided import Guidance
from pmviewer.photons.emission.tested import Sought
from pmviewer.photons.emission.window import MOST_AT_ONCE, MOST_PIECES, window_of
from pmviewer.photons.light_pass.ledger import E_STORED
from pmviewer.photons.light_pass.light_pass import guided_emission_of, trace_pass
from pmviewer.scene.arrays.flatten import LUMINANCE
from pmviewer.settings.access import Photons
from tests.photons.test_guided import ALL, corner, in_order, power_in_cells, two_lights

N = 4000
f4, u4 = np.float32, np.uint32


def steep_window():
    """A hundred times as important on the lower half of the box as on the upper, on all sides."""
    rng = np.random.default_rng(5)
    positions = rng.uniform(-1, 1, (1_000_000, 3)).astype(f4)
    normals = np.eye(3, dtype=f4)[rng.integers(3, size=1_000_000)] * rng.choice([-1, 1], 1_000_000)[:, None].astype(f4)
    return window_of(positions, normals, np.where(positions[:, 1] < 0, 1.0, 0.01).astype(f4))


def light_pass(seed, window, flat, n=N, run=in_order, roulette="luminance"):
    how = Guidance("Peter-Pietrek", (Sought("global", corner, ALL, ALL),), 2, 0.05, window)
    settings = Photons(roulette=roulette)
    guided = guided_emission_of(flat, settings, seed, 0, n, False, how, run)
    return trace_pass(flat, settings, seed, 0, n, False, run, deposition=Deposition(None, None, 0, ALL), guided=guided)


def test_boxes():
    """The root of the mean of what lies in a box and faces the same way; nothing where nothing lies."""
    positions = np.array([[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [1, 2, 4]], f4)
    normals = np.array([[0, 1, 0], [0.1, 0.9, 0], [0, -1, 0], [0, 0, 1]], f4)
    window = window_of(positions, normals, np.array([4, 16, 9, 1], f4))
    assert window.values[0, 0, 0, 2] == pytest.approx(10**0.5)
    assert window.values[0, 0, 0, 3] == 3
    assert window.values[-1, -1, -1, 4] == 1
    assert np.count_nonzero(window.values) == 3
    cells = np.array(window.values.shape[:3]) - 1
    np.testing.assert_allclose(cells / window.per_length, [1, 2, 4], atol=1.01 / window.per_length)


@pytest.mark.parametrize("roulette", ["luminance", "equal"])
def test_pieces_bring_as_much_as_the_whole(roulette):
    """z-test over 32 seeds by place, with pieces against without; more photons come, none has more power."""
    flat, window = two_lights(), steep_window()
    split = [light_pass(seed, window, flat, roulette=roulette) for seed in range(32)]
    whole = [light_pass(500 + seed, None, flat, roulette=roulette) for seed in range(32)]
    assert min(maps.pieces for maps in split) > N / 10
    assert max(maps.pieces for maps in split) <= (MOST_PIECES - 1) * N
    assert all(maps.pieces == 0 for maps in whole)
    assert sum(len(maps.global_) for maps in split) > 1.1 * sum(len(maps.global_) for maps in whole)
    a, b = (np.array([power_in_cells(maps) for maps in many]) for many in (split, whole))
    z = (a.mean(axis=0) - b.mean(axis=0)) / np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / 32)
    print(np.round(z, 2))
    assert np.all(np.abs(z) < 3.5)


def test_the_energy_of_pieces_is_that_of_the_whole():
    """Emitted light is absorbed, escapes, ends or is dropped, whether or not photons go on in pieces; and what the
    ledger says was stored is what lies in the map."""
    maps = light_pass(3, steep_window(), two_lights())
    assert maps.pieces > 0
    assert maps.energy[1:].sum() == pytest.approx(maps.energy[0], rel=1e-5)
    power = unpack(maps.global_, 1.0)["Phi"].astype(float) @ LUMINANCE
    assert power.sum() == pytest.approx(maps.ledgers[0, E_STORED], rel=2e-3)


def test_threads_and_buffers_do_not_matter():
    """The same photons for any number of threads, and where a trajectory ends as the most pieces there may be."""
    flat, window = two_lights(), steep_window()
    one = light_pass(1, window, flat, 20_000)
    pool = WorkPool(3)
    try:
        many = light_pass(1, window, flat, 20_000, pool.run)
    finally:
        pool.close()
    np.testing.assert_array_equal(many.global_.view(u4), one.global_.view(u4))
    assert many.pieces == one.pieces
    everywhere = replace(window, values=np.full_like(window.values, 1e3))
    crowded = light_pass(1, everywhere, flat)
    assert 0.95 * (MOST_AT_ONCE - 1) * crowded.guided.n < crowded.pieces <= (MOST_PIECES - 1) * crowded.guided.n
