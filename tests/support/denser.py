"""Photons that aim at what is small against those that start anywhere."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.settings.access import Photons


def at_once(tasks):
    """What a pool does, one after the other."""
    return [task() for task in tasks]


def same_power_less_variance(flat, made, power_of, stored, times):
    """z-test of the power that photons bring, of a million that start anywhere and of a million by the projection
    `made`, and how much less it varies, more than so many times; the energy balances. power_of: luminance (n,) of the
    photons of a pass that count, each stored some `stored` times on its way."""
    sums, squares, counts, energy = [], [], [], []
    for projection, seed in ((None, 1), (made, 2)):
        settings = Photons(q=1.0, sequence="independent")
        maps = trace_pass(flat, settings, seed, 0, 1_000_000, False, at_once, projection=projection)
        power = power_of(maps)
        sums.append(power.sum())
        squares.append((power**2).sum())
        counts.append(len(power))
        energy.append(maps.energy)
    z = (sums[0] - sums[1]) / math.sqrt(stored * sum(squares))
    saved = squares[0] / squares[1]
    print(f"{sums[0]:.4f} and {sums[1]:.4f} W of {counts} photons, z {z:+.2f}, {saved:.0f} times less variance")
    assert abs(z) < 4
    assert saved > times
    assert energy[1][0] == pytest.approx(flat.total_luminance, rel=1e-6)
    assert energy[1][1:].sum() == pytest.approx(energy[1][0], rel=1e-5)
    np.testing.assert_allclose(energy[0], energy[1], rtol=0.05, atol=0.01 * flat.total_luminance)
