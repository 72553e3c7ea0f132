"""Photons through dispersive glass: where each wavelength goes, and what is stored of it (T10)."""

from __future__ import annotations

import numpy as np
import pytest

import pmviewer
from pmviewer.bench.measures.dispersion import prism_scene
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.memory import row_of
from pmviewer.maps.photon_words import write_banded
from pmviewer.maps.record import bands, unpack
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.light_pass.roulette import RULES
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.dispersion import GLASSES
from pmviewer.settings.access import Photons
from tests.support.dispersive import SCHOTT, lit_sphere

pytestmark = pytest.mark.usefixtures("any_bsdf_and_light")

INCIDENCE = 60.0
"""Of the light on the prism's first face, in degrees; its angle is 60°."""


def snell(name, nm):
    """Angle in degrees at which light leaves the prism's second face, by Schott's numbers and Snell's law twice."""
    (b1, b2, b3), (c1, c2, c3) = SCHOTT[name]
    x = (nm / 1000) ** 2
    n = np.sqrt(1 + b1 * x / (x - c1) + b2 * x / (x - c2) + b3 * x / (x - c3))
    inside = np.arcsin(np.sin(np.radians(INCIDENCE)) / n)
    return np.degrees(np.arcsin(n * np.sin(np.radians(60) - inside)))


@pytest.mark.parametrize("name", ["F2", "SF11"])
def test_each_wavelength_leaves_a_prism_at_snells_angle(name):
    """Within 1 % of its deviation, which is the angle on the second face here; so do the edges of the spectrum."""
    with pmviewer.open(prism_scene(GLASSES[name.lower()])) as s:
        s.set({"photons.N": 30_000})
        photons = s.photons("caustic")
    through = (photons.bounces == 2) & (photons.positions[:, 0] > 0.5)
    assert through.sum() > 2000
    nm, d = photons.wavelengths[through], -photons.directions[through]
    assert not np.isnan(nm).any()
    angle = np.degrees(np.arctan2(d[:, 2], d[:, 0]))
    seen = (nm > 435) & (nm < 660)
    expected = snell(name, nm.astype(np.float64))
    assert np.abs(angle[seen] / expected[seen] - 1).max() < 0.01
    assert angle[seen].min() == pytest.approx(snell(name, nm[seen].max()), rel=0.01)
    assert angle[seen].max() == pytest.approx(snell(name, nm[seen].min()), rel=0.01)
    assert angle[seen].max() - angle[seen].min() > 2.0


def serially(tasks):
    return [task() for task in tasks]


@pytest.mark.parametrize("roulette", RULES)
def test_the_ledger_balances_and_photons_tell_their_wavelengths(roulette):
    """Those that went through the glass have one, others none; their colours are theirs: red ones are red."""
    flat = flatten(lit_sphere(GLASSES["sf11"]))
    maps = trace_pass(flat, Photons(sequence="independent", roulette=roulette), 3, 0, 20_000, True, serially)
    assert maps.energy[1:].sum() == pytest.approx(maps.energy[0], rel=1e-5)
    assert maps.dropped == 0
    band, photons = bands(maps.caustic), unpack(maps.caustic, 1.0)
    split = photons["bounces"] >= 2
    assert (band[split] > 0).mean() > 0.95  # all but those that the sphere reflects twice: there are none
    assert (bands(maps.global_)[unpack(maps.global_, 1.0)["bounces"] == 0] == 0).all()
    red, blue = photons["Phi"][band > 55].sum(axis=0), photons["Phi"][(band > 0) & (band < 12)].sum(axis=0)
    assert red[0] > 20 * max(red[1], red[2])
    assert blue[2] > 5 * blue[1]


@kernel
def _write(rows, powers, band):
    for i in range(len(rows)):
        p = (np.float32(0.001 * i), np.float32(0.3), np.float32(-1.7))
        wi = (np.float32(0.0), np.float32(1.0), np.float32(0.0))
        power = (powers[i, 0], powers[i, 1], powers[i, 2])
        write_banded(row_of(rows, 0), i, p, wi, wi, power, np.uint32(2), 7, np.uint32(band))


def test_a_band_costs_no_power():
    """Each power is off by 2⁻⁸ at most, their sum by the error that random rounding leaves; the band comes back."""
    rng = np.random.default_rng(8)
    for band in (0, 1, 22, 63):
        for powers in (rng.uniform(0.1, 4.0, (20_000, 3)), np.full((20_000, 3), 1.2345)):
            rows = np.zeros((len(powers), 6), np.float32)
            _write(rows, powers.astype(np.float32), band)
            assert (bands(rows) == band).all()
            back = unpack(rows, 1.0)
            assert (back["light"] == 7).all()
            assert (back["bounces"] == 2).all()
            assert np.abs(back["Phi"] / powers - 1).max() < 2**-8
            assert np.abs(back["Phi"].sum(axis=0, dtype=float) / powers.sum(axis=0) - 1).max() < 5e-5
    rows = np.zeros((1, 6), np.float32)
    _write(rows, np.zeros((1, 3), np.float32), 63)
    assert unpack(rows, 1.0)["Phi"].max() < 1e-13
