"""The light pass: reproducible, evenly weighted, power where it belongs, energy accounted for (T2, T3, T4, T6)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.pool import WorkPool
from pmviewer.errors import SettingError
from pmviewer.maps.record import BYTES_PER_PHOTON, unpack
from pmviewer.photons.light_pass import batch as batch_module
from pmviewer.photons.light_pass import light_pass as lightpass
from pmviewer.photons.light_pass.ledger import E_ABSORBED, E_EMITTED, E_ESCAPED, E_STORED, E_TERMINATED
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.light_pass.plan import trajectories
from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.flatten import LUMINANCE, flatten
from pmviewer.settings.access import Photons
from tests.support.scenes import (
    GLASS,
    LIGHTS,
    ball_in_environment,
    closed_sphere,
    cornell_box,
    diffuse,
    diffuse_box,
    light_scene,
)


def serially(tasks):
    return [task() for task in tasks]


def trace(scene, N=50_000, seed=1, first=0, run=serially, **settings):
    flat = flatten(scene)
    return trace_pass(flat, Photons(**settings), seed, first, N, analyse(scene).has_specular, run)


def luminance_of(maps, name):
    photons, unit = (maps.caustic, maps.caustic_unit) if name == "caustic" else (maps.global_, maps.global_unit)
    return unpack(photons, unit)["Phi"] @ LUMINANCE


def bits(photons):
    """Photons (n, 6) as uint32: directions and powers are no floats, and may look like NaN."""
    return photons.view(np.uint32)


def same(a, b):
    return (
        np.array_equal(bits(a.caustic), bits(b.caustic))
        and np.array_equal(bits(a.global_), bits(b.global_))
        and (a.rays, a.emitted, a.dropped) == (b.rays, b.emitted, b.dropped)
    )


@pytest.mark.parametrize("sequence", ["sobol", "independent"])
def test_same_photons_for_any_threads_and_batches(sequence, monkeypatch):
    expected = trace(cornell_box(), sequence=sequence)
    pool = WorkPool(2)
    try:
        assert same(trace(cornell_box(), sequence=sequence, run=pool.run), expected)
    finally:
        pool.close()
    for batch in (1000, 50_000):
        monkeypatch.setattr(lightpass, "TASK", batch)
        assert same(trace(cornell_box(), sequence=sequence), expected)
    assert not same(trace(cornell_box(), sequence=sequence, seed=2), expected)


def test_full_buffers_change_nothing(monkeypatch):
    """An albedo of 0.99 stores far more photons a trajectory than a buffer is made for: batches are resumed."""
    scene = diffuse_box(albedo=0.97)
    whole = trace(scene, N=4000)
    monkeypatch.setattr(lightpass, "TASK", 37)
    print(f"{len(whole.global_) / 2000:.1f} photons stored a trajectory")
    assert len(whole.global_) > 20 * 2000
    assert same(trace(scene, N=4000), whole)


def test_passes_are_pieces_of_one_stream():
    """Photon i of the second pass is photon N + i of the first: a value depends on seed and index alone (T2)."""
    whole = trace(diffuse_box(), N=6000, q=1.0)
    halves = [trace(diffuse_box(), N=3000, q=1.0, first=first) for first in (0, 3000)]
    assert np.array_equal(bits(np.concatenate([h.global_ for h in halves])), bits(whole.global_))


def test_photons_do_not_repeat_after_2_to_the_32():
    first = trace(diffuse_box(), N=2000, q=1.0)
    later = trace(diffuse_box(), N=2000, q=1.0, first=2**32)
    places = {tuple(p) for p in bits(first.global_)[:, :3]}
    assert not places & {tuple(p) for p in bits(later.global_)[:, :3]}
    across = trace(diffuse_box(), N=2000, q=1.0, first=2**32 - 1000)
    begin = trace(diffuse_box(), N=1000, q=1.0, first=2**32)
    assert np.array_equal(bits(across.global_[-len(begin.global_) :]), bits(begin.global_))


def test_weights_are_nearly_equal():
    """T3: the 99th percentile of photon power at most 1.5 times the first, one light in a grey diffuse box."""
    power = luminance_of(trace(diffuse_box(), N=100_000, q=1.0), "global")
    ratio = np.percentile(power, 99) / np.percentile(power, 1)
    print(f"99th / 1st percentile of photon power {ratio:.4f}")
    assert ratio <= 1.5
    coloured = luminance_of(trace(cornell_box(), N=100_000), "global")
    print(f"coloured box with glass and mirror: {np.percentile(coloured, 99) / np.percentile(coloured, 1):.4f}")
    assert np.percentile(coloured, 99) / np.percentile(coloured, 1) <= 1.5


def test_a_photon_takes_24_bytes():
    maps = trace(cornell_box(), N=5000)
    assert maps.global_.itemsize * maps.global_.shape[1] == BYTES_PER_PHOTON == 24
    assert maps.bytes == 24 * (len(maps.caustic) + len(maps.global_))


@pytest.mark.parametrize("albedo", [0.2, 0.5, 0.8])
def test_stored_power_of_the_closed_box(albedo):
    """T4: everything has one albedo, so the flux that arrives is Φ·(1 + ρ + ρ² + …) = Φ/(1 − ρ).

    200 000 trajectories: the standard error of the number of hits is √ρ/√N = 0.2 % of the mean at most.
    """
    scene = diffuse_box(albedo=albedo)
    light = flatten(scene).light_power[0]
    maps = trace(scene, N=200_000, q=1.0)
    stored = unpack(maps.global_, maps.global_unit)["Phi"].sum(0, dtype=np.float64)
    expected = light / (1 - albedo)
    print(
        f"albedo {albedo}: stored {stored[0]:.4f} W, analytic {expected[0]:.4f} W ({stored[0] / expected[0] - 1:+.2%})"
    )
    assert light == pytest.approx(math.pi * 0.8**2 * 5 * np.ones(3), rel=1e-6)
    assert stored == pytest.approx(expected, rel=0.01)


def test_stored_power_of_the_closed_sphere():
    """Radiance 1 everywhere: irradiance π on an area of 4π."""
    maps = trace(closed_sphere(), N=200_000, q=1.0)
    stored = unpack(maps.global_, maps.global_unit)["Phi"].sum(0, dtype=np.float64)
    print(f"closed sphere: stored {stored[0]:.4f} W, analytic {4 * math.pi**2:.4f} W")
    assert stored == pytest.approx(4 * math.pi**2 * np.ones(3), rel=0.01)


OPEN = {
    "lights over a floor": lambda: light_scene(*LIGHTS),
    "glass ball under the sky": lambda: ball_in_environment(GLASS),
    "grey ball under the sky": lambda: ball_in_environment(diffuse(two_sided=False)),
}
CLOSED = {"diffuse box": diffuse_box, "cornell box": cornell_box, "closed sphere": closed_sphere}


@pytest.mark.parametrize("name", [*OPEN, *CLOSED])
def test_energy_is_accounted_for(name):
    """Emitted = absorbed + escaped + terminated. Roulette keeps a survivor's luminance and a victim's is all absorbed,
    so that the ledger balances to the last photon, not in the mean alone."""
    maps = trace((OPEN | CLOSED)[name](), N=40_000, max_bounces=12)
    ledger = maps.ledger
    ended = ledger[E_ABSORBED] + ledger[E_ESCAPED] + ledger[E_TERMINATED]
    print(f"{name}: absorbed, escaped, terminated {ledger[2:] / ledger[E_EMITTED]}")
    assert ended == pytest.approx(ledger[E_EMITTED], rel=1e-6)
    assert ledger[E_EMITTED] == pytest.approx(maps.emitted, rel=1e-6)
    assert maps.dropped == 0
    assert (ledger[E_ESCAPED] == 0) == (name in CLOSED)


def test_absorbed_share_is_the_albedos():
    """Of what arrives in the box of albedo ½, half is absorbed: a ledger entry that is an expectation, within 4 σ."""
    maps = trace(diffuse_box(), N=100_000, q=1.0)
    arrivals = maps.ledger[E_STORED]
    assert maps.ledger[E_ABSORBED] / arrivals == pytest.approx(0.5, abs=4 * 0.5 / math.sqrt(arrivals))


def test_flux_through_open_scene_is_geometric():
    """A ball of radius R in a sky of radiance L receives π L · 4πR²; what misses it escapes."""
    scene = ball_in_environment(diffuse(two_sided=False))
    maps = trace(scene, N=100_000, q=1.0)
    direct = unpack(maps.global_, maps.global_unit)["Phi"].sum(0, dtype=np.float64)
    assert direct == pytest.approx(4 * math.pi**2 * np.ones(3), rel=0.01)


@pytest.mark.parametrize("rule", ["trajectories", "photons"])
def test_q_trades_global_for_caustic_photons(rule):
    """T6: N = N₀/q keeps the global count within 2 % while the caustic map grows as 1/q; powers stay what they were."""
    N0 = 20_000
    scene = cornell_box()
    reference = trace(scene, N=400_000, q=1.0)
    global_power = luminance_of(reference, "global").sum(dtype=np.float64)
    caustic_power = luminance_of(reference, "caustic").sum(dtype=np.float64)
    counts = []
    for q in (1.0, 0.5, 0.2, 0.05):
        maps = trace(scene, N=round(N0 / q), q=q, q_rule=rule)
        counts.append((q, len(maps.global_), len(maps.caustic)))
        assert maps.emitted == round(N0 / q)
        assert luminance_of(maps, "global").sum(dtype=np.float64) == pytest.approx(global_power, rel=0.03)
        # The relative error of a caustic power is about 1/√n of its n photons, some 6 000 at q = 1.
        allowed = 5 / math.sqrt(len(maps.caustic))
        assert luminance_of(maps, "caustic").sum(dtype=np.float64) == pytest.approx(caustic_power, rel=allowed)
    print(rule, counts)
    for q, global_count, caustic_count in counts:
        assert global_count == pytest.approx(counts[0][1], rel=0.02)
        assert caustic_count * q == pytest.approx(counts[0][2], rel=4 / math.sqrt(counts[0][2]))


def test_both_q_rules_have_the_same_power():
    """Two estimates of the same flux from 100 000 stored photons each."""
    power = {
        rule: [luminance_of(trace(cornell_box(), N=150_000, q=0.25, q_rule=rule), name).sum(dtype=np.float64)
               for name in ("global", "caustic")]
        for rule in ("trajectories", "photons")
    }  # fmt: skip
    print(power)
    assert power["photons"][0] == pytest.approx(power["trajectories"][0], rel=0.015)
    assert power["photons"][1] == pytest.approx(power["trajectories"][1], rel=0.01)


def test_no_caustic_trajectories_without_specular_surfaces():
    assert trajectories(Photons(q=0.25), 1000, True) == (1000, 250, 1.0)
    assert trajectories(Photons(q=0.25), 1000, False) == (250, 250, 1.0)
    assert trajectories(Photons(q=0.25, q_rule="photons"), 1000, True) == (1000, 1000, 0.25)
    maps = trace(diffuse_box(), N=4000, q=0.25)
    assert maps.emitted == 1000
    assert len(maps.caustic) == 0


def test_caustic_map_can_be_left_out():
    """Who shows the global map alone gets no caustic photons, and the same global ones."""
    scene = cornell_box()
    flat = flatten(scene)
    both = trace_pass(flat, Photons(q=1.0), 1, 0, 5000, True, serially)
    one = trace_pass(flat, Photons(q=1.0), 1, 0, 5000, False, serially)
    assert len(both.caustic) > 500
    assert len(one.caustic) == 0
    assert np.array_equal(bits(one.global_), bits(both.global_))


def test_bounces_end_at_the_limit():
    maps = trace(diffuse_box(albedo=0.97), N=2000, q=1.0, max_bounces=5)
    assert unpack(maps.global_, 1.0)["bounces"].max() == 4
    assert maps.ledger[E_TERMINATED] > 0


def test_one_sided_surfaces_hold_no_photons_on_their_back():
    scene = diffuse_box()
    scene = replace(scene, materials=(diffuse(two_sided=False),))
    maps = trace(scene, N=20_000, q=1.0)
    photons = unpack(maps.global_, 1.0)
    p, wi = photons["position"], photons["wi"]
    above_panel = (np.abs(p[:, 1] - 0.9) < 1e-3) & (np.abs(p[:, :2:2]).max(1) < 0.39) & (np.abs(p[:, 2]) < 0.39)
    assert above_panel.sum() > 0
    assert np.all(wi[above_panel, 1] < 0)


def test_photons_that_do_not_fit_are_refused_before_they_are_traced(monkeypatch):
    """Albedo 1 stores 64 photons a trajectory, 60 bytes each by the time they are in their map: 400 000 trajectories
    need 1.5 GB."""
    asked = []

    def counted(tasks):
        asked.append(len(tasks))
        return serially(tasks)

    monkeypatch.setattr(batch_module, "PROBED", 1)
    monkeypatch.setattr(lightpass, "TASK", 1000)
    monkeypatch.setattr(batch_module, "available_memory", lambda: 10**9)
    with pytest.raises(SettingError, match=r"about 25,600,000 photons .* need 1\.5 GB .* 1\.0 GB are free"):
        trace(diffuse_box(albedo=1.0), N=400_000, run=counted)
    assert asked == [1]
    monkeypatch.setattr(batch_module, "available_memory", lambda: 10**7)
    part = trace(diffuse_box(albedo=0.2), N=20_000, run=counted)
    assert asked[1:] == [1, 19]
    monkeypatch.setattr(batch_module, "available_memory", lambda: None)
    assert same(trace(diffuse_box(albedo=0.2), N=20_000), part)
