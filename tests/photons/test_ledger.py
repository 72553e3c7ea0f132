"""The energy ledger: every watt that leaves the lights is absorbed, escapes, is cut off or dropped, and each entry is
what analysis says, by the standard error over independent seeds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.energy import ENTRIES, Energy, EnergyLedger
from pmviewer.photons.light_pass.ledger import E_DROPPED, E_EMITTED, E_STORED
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.light_pass.roulette import RULES
from pmviewer.photons.projection.projection import projection_of
from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Parallelogram, PointLight, Scene, Shape, Sphere
from pmviewer.settings.access import Photons
from tests.support.scenes import (
    GLASS,
    MIRROR,
    ball_in_environment,
    box_camera,
    cornell_box,
    diffuse,
    diffuse_box,
    rendered,
    settings_of,
)

SEEDS = range(1, 9)
EMITTED, ABSORBED, ESCAPED, TERMINATED, DROPPED = range(len(ENTRIES))


def serially(tasks):
    return [task() for task in tasks]


def trace(flat, scene, seed, N=8000, projection=None, **settings):
    chosen = Photons(sequence="independent", **settings)
    caustics = analyse(scene).follows(chosen.glossy)
    return trace_pass(flat, chosen, seed, 0, N, caustics, serially, projection=projection)


def shares(scene, N=8000, projected=False, **settings):
    """Means and standard errors (5,) of the entries relative to the lights' power, over independent seeds; the ledgers
    of each pass balance to rounding."""
    flat = flatten(scene)
    projection = projection_of(flat) if projected else None
    rows = []
    for seed in SEEDS:
        maps = trace(flat, scene, seed, N, projection, **settings)
        row = maps.energy / flat.total_luminance
        assert row[1:].sum() == pytest.approx(row[0], rel=1e-5)
        assert maps.ledgers.sum() > 0
        rows.append(row)
    rows = np.array(rows)
    return rows.mean(axis=0), rows.std(axis=0, ddof=1) / math.sqrt(len(rows))


def agrees(value, error, expected):
    """Within 4.5 standard errors of eight seeds, which is one chance in 400 (t-distribution, 7 degrees of freedom),
    and within rounding where nothing varies."""
    print(f"{value:.6f} ± {error:.6f}, expected {expected:.6f}")
    return abs(value - expected) <= 4.5 * error + 1e-5


@pytest.mark.usefixtures("every_surface")
@pytest.mark.parametrize("albedo", [0.0, 0.6])
def test_light_within_a_ball_that_lets_it_pass(albedo):
    """Of opacity a and albedo ρ: each flight to the ball ends with a, and ρ of those go on, all of them inside."""
    veil = replace(diffuse(albedo=(albedo,) * 3), opacity=0.3)
    ball = (Shape("ball", Sphere((0, 0, 0), 0.5), 0),)
    lamp = (PointLight("lamp", (0, 0, 0), (1.0, 1.0, 1.0)),)
    mean, error = shares(Scene("ball", None, ball, (veil,), lamp, box_camera(), 8, 8), max_bounces=100)
    assert agrees(mean[ABSORBED], error[ABSORBED], 0.3 * (1 - albedo) / (1 - 0.3 * albedo))
    assert agrees(mean[ESCAPED], error[ESCAPED], 0.7 / (1 - 0.3 * albedo))


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("albedo", [0.0, 0.3, 0.9])
def test_closed_box_after_b_scatterings(rule, albedo):
    """In a closed room of one albedo ρ the share ρᵇ is on its way after b scatterings, whatever the room's form."""
    bounces = 6
    mean, error = shares(diffuse_box(albedo=albedo), roulette=rule, max_bounces=bounces)
    assert agrees(mean[TERMINATED], error[TERMINATED], albedo**bounces)
    assert agrees(mean[ABSORBED], error[ABSORBED], 1 - albedo**bounces)
    assert mean[ESCAPED] == mean[DROPPED] == 0


@pytest.mark.parametrize("rule", RULES)
def test_nothing_is_absorbed_at_albedo_one(rule):
    mean, _ = shares(diffuse_box(albedo=1.0), N=1000, roulette=rule, max_bounces=12)
    assert mean[TERMINATED] == pytest.approx(1, abs=1e-5)
    assert mean[ABSORBED] == pytest.approx(0, abs=1e-5)


def disc_view(height, half):
    """Share of a point's light that meets a square of side 2·half, `height` below its middle: solid angle / 4π."""
    return 4 * math.asin(half**2 / (half**2 + height**2)) / (4 * math.pi)


def lit_square(material, height=0.7, half=1.0):
    square = Parallelogram((-half, 0, -half), (0, 0, 2 * half), (2 * half, 0, 0))
    light = PointLight("point", (0.0, height, 0.0), (1.0, 1.0, 1.0))
    return Scene("square", None, (Shape("square", square, 0),), (material,), (light,), box_camera(), 8, 8)


@pytest.mark.parametrize("projected", [False, True])
@pytest.mark.parametrize("rule", RULES)
def test_open_scene_lets_its_share_escape(rule, projected):
    """A point over a square of albedo 0.4: what misses the square escapes, and of the rest the reflected part. With
    projection maps no photon starts where it misses everything, and the ledger says the same."""
    albedo = 0.4
    mean, error = shares(lit_square(diffuse(albedo=(albedo,) * 3)), projected=projected, roulette=rule)
    met = disc_view(0.7, 1.0)
    assert agrees(mean[ABSORBED], error[ABSORBED], met * (1 - albedo))
    assert agrees(mean[ESCAPED], error[ESCAPED], 1 - met * (1 - albedo))


def test_a_mirror_absorbs_what_it_does_not_reflect():
    mean, error = shares(lit_square(replace(MIRROR, reflectance=(0.8, 0.8, 0.8))))
    assert agrees(mean[ABSORBED], error[ABSORBED], 0.2 * disc_view(0.7, 1.0))


def test_clear_glass_absorbs_nothing():
    mean, _ = shares(ball_in_environment(GLASS), max_bounces=200)
    assert mean[ABSORBED] == pytest.approx(0, abs=1e-5)
    assert mean[ESCAPED] == pytest.approx(1, abs=1e-5)


@pytest.mark.usefixtures("every_surface")
def test_absorption_in_glass_is_in_the_books():
    """A point in the middle of a matched (ior 1) ball of radius R: everything crosses R of it once, exp(−aR) is left.
    Before, what glass absorbed was in no entry."""
    absorption, radius = 1.3, 0.6
    glass = replace(GLASS, eta=1.0, absorption=(absorption,) * 3)
    ball = Shape("ball", Sphere((0, 0, 0), radius), 0)
    light = PointLight("point", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    scene = Scene("matched ball", None, (ball,), (glass,), (light,), box_camera(), 8, 8)
    mean, error = shares(scene, N=500)
    assert agrees(mean[ESCAPED], error[ESCAPED], math.exp(-absorption * radius))
    assert agrees(mean[ABSORBED], error[ABSORBED], 1 - math.exp(-absorption * radius))


@pytest.mark.parametrize("q", [1.0, 0.1])
@pytest.mark.parametrize("rule", RULES)
def test_trajectories_for_the_caustic_map_do_not_change_the_books(rule, q):
    """They end where they meet the first diffuse surface, by design: their own ledger balances, and the light's says
    what the others met."""
    scene = cornell_box()
    flat = flatten(scene)
    expected, expected_error = shares(scene, N=20_000, roulette="luminance", indirect_caustics=False)
    mean, error = shares(scene, N=round(4000 / q), roulette=rule, q=q, indirect_caustics=False)
    assert (
        abs(mean[ABSORBED] - expected[ABSORBED]) <= 4.5 * math.hypot(error[ABSORBED], expected_error[ABSORBED]) + 1e-5
    )
    ledgers = trace(flat, scene, 1, round(4000 / q), q=q, indirect_caustics=False).ledgers
    assert ledgers[:, E_EMITTED] == pytest.approx([4000, round(4000 / q) - 4000], abs=1)
    ended = np.delete(ledgers, [E_EMITTED, E_STORED], axis=1).sum(axis=1)
    assert ended == pytest.approx(ledgers[:, E_EMITTED], rel=1e-6)


def test_what_becomes_infinite_is_dropped_with_what_it_had():
    """A reflectance beyond float32's range is what no loader lets through; the ledger holds even then."""
    scene = diffuse_box(albedo=0.5)
    flat = flatten(scene)
    row = flat.arrays["materials"][0]
    row[4:7] = 3e38  # M_REFLECTANCE
    maps = trace(flat, scene, 1, 2000)
    assert maps.dropped > 0
    assert np.isfinite(maps.ledgers).all()
    ledger = maps.ledger
    assert ledger[E_DROPPED] != 0
    ended = ledger.sum() - ledger[E_EMITTED] - ledger[E_STORED]
    assert ended == pytest.approx(ledger[E_EMITTED], abs=1e-5 * np.abs(ledger).max())


@pytest.mark.parametrize("emission", ["off", "Peter-Pietrek", "Christensen discard", "Christensen keep"])
def test_frames_tell_the_energy(emission):
    """Over passes, in watts: emission by power is exact; guided emission is so in the mean, less what test photons
    carry."""
    settings = settings_of(
        photons={"N": 4000}, importance={"emission": emission, "map": "screen", "N": 1000}, estimate={"radius": 0.1}
    )
    renderer = rendered(diffuse_box(size=8), settings, 4)
    energy, power = renderer.frame(1).statistics.energy, renderer.scene.flat.total_luminance
    assert isinstance(energy, Energy)
    assert energy.passes == 4
    print(energy, power)
    assert energy.missing == pytest.approx(0, abs=1e-5 * power)
    if emission == "off":
        assert energy.watts[0] == pytest.approx(power, rel=1e-6)
        assert energy.uncounted == 0
    else:
        assert energy.watts[0] + energy.uncounted == pytest.approx(power, abs=4.5 * energy.errors[0] + 1e-5 * power)
    assert energy.share("absorbed") == pytest.approx(1, abs=1e-5)


def test_books_are_means_with_standard_errors():
    ledger = EnergyLedger()
    assert ledger.close(False) is None
    rows = np.random.default_rng(1).uniform(0.1, 1.0, (5, 5))
    for row in rows:
        ledger.add(row, 2.0)
    energy = ledger.close(False)
    assert energy.watts == pytest.approx(rows.mean(axis=0))
    assert energy.errors == pytest.approx(rows.std(axis=0, ddof=1) / math.sqrt(5))
    assert energy.share("escaped") == pytest.approx(rows[:, 2].mean() / rows[:, 0].mean())


def test_light_that_is_cut_off_is_said():
    """Albedo 1 in a closed box: after the last scattering allowed all light is on its way."""
    settings = settings_of(photons={"N": 500, "max_bounces": 8}, estimate={"radius": 0.1})
    said = rendered(diffuse_box(albedo=1.0, size=8), settings, 1).frame(1).statistics.warnings
    assert any("100% of the light is still on its way after 8 scatterings" in sentence for sentence in said)
    said = rendered(diffuse_box(albedo=0.5, size=8), settings_of(photons={"N": 500}), 1).frame(1).statistics.warnings
    assert not any("on its way" in sentence for sentence in said)
