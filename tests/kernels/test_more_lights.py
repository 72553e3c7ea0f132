"""Spots, directional lights and image environments (T1): power, chi-square tests, sampling against evaluation."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.lights.light import emit_photon, environment_radiance, one_light_pdf, sample_one_light
from pmviewer.kernels.random import INDEPENDENT
from pmviewer.kernels.vector import largest
from pmviewer.scene.arrays.flatten import LUMINANCE, flatten
from pmviewer.scene.description import ImageEnvironment
from pmviewer.scene.emission import emitted_power
from tests.support.kinds import EVERY_SURFACE
from tests.support.light_probe import MORE, TURN, axes_of, emit, p_uniform, sample, turn
from tests.support.scenes import LIGHTS, light_scene

MANY = 250_000


def scene_of(*lights, floor=True):
    return replace(light_scene(floor=True), lights=lights)


def flat_of(*lights):
    """Flattened as if there were every kind of light: the kernels of other tests, too."""
    return flatten(scene_of(*lights), features_at_least=EVERY_SURFACE)


@kernel
def _sky(scenes, directions, radiance, pdf):
    scene = scenes[0]
    for i in range(len(directions)):
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        radiance[i] = environment_radiance(scene, d)
        pdf[i] = one_light_pdf(scene, scene.environment, (0.0, 0.0, 0.0), d, d, d)


def sky(flat, directions):
    directions = np.ascontiguousarray(directions, np.float32)
    radiance, pdf = np.empty_like(directions), np.empty(len(directions), np.float32)
    _sky(flat.record, directions, radiance, pdf)
    return radiance.astype(float), pdf.astype(float)


def test_emitted_power_of_all_lights_together():
    """2^19 photons: each light's power within 0.1 % of the analytic value, of each kind that is not an area light."""
    lights = (*MORE.values(), LIGHTS["point"])
    flat = flat_of(*lights)
    n = 2**19
    _, _, beta, light = emit(flat, n)
    for index, described in enumerate(lights):
        expected = emitted_power(described, flat.radius)
        power = beta[light == index].sum(0) * flat.total_luminance / n
        print(f"{described.name}: {power} W, {np.abs(power / expected - 1).max():.1e} off")
        assert power @ LUMINANCE == pytest.approx(expected @ LUMINANCE, rel=1e-3)
        assert flat.light_power[index] == pytest.approx(expected, rel=1e-9)
        # An image is sampled by its luminance: colours are right in the mean, and here it has few of the photons.
        assert power == pytest.approx(expected, rel=3e-2 if described.name == "image" else 1e-3)
    flat = flat_of(MORE["image"])
    power = emit(flat, n)[2].mean(0) * flat.total_luminance
    print(f"image alone: {power} W, {np.abs(power / flat.light_power[0] - 1).max():.1e} off")
    assert power == pytest.approx(flat.light_power[0], rel=1e-3)


def test_power_in_closed_form_is_the_integral_of_what_is_seen():
    """A spot's solid angle against a fine sum over angles; the sky's integral against uniform directions."""
    for name in ("spot", "sharp spot", "soft spot"):
        light = MORE[name]
        theta = (np.arange(200_000) + 0.5) / 200_000 * math.pi
        cutoff, beam = math.radians(light.cutoff), math.radians(light.beam)
        f = np.clip((cutoff - theta) / max(cutoff - beam, 1e-12), 0, 1)
        total = (f * np.sin(theta)).sum() * 2 * math.pi * math.pi / 200_000
        assert emitted_power(light, 1.0) == pytest.approx(total * np.array(light.intensity), rel=1e-4)
    flat = flat_of(MORE["image"])
    z = (np.arange(1000) + 0.5) / 500 - 1
    phi = (np.arange(1000) + 0.5) / 1000 * 2 * math.pi
    z, phi = (a.ravel() for a in np.meshgrid(z, phi))
    r = np.sqrt(1 - z * z)
    radiance, pdf = sky(flat, np.stack([r * np.cos(phi), r * np.sin(phi), z], 1))
    expected = radiance.mean(0) * 4 * math.pi * math.pi * flat.radius**2
    print(f"power {flat.light_power[0]} W, by uniform directions {expected} W; density {pdf.mean() * 4 * math.pi:.6f}")
    assert flat.light_power[0] == pytest.approx(expected, rel=1e-3)
    assert pdf.mean() * 4 * math.pi == pytest.approx(1, rel=1e-3)


@pytest.mark.parametrize("name", ["spot", "sharp spot", "soft spot", "thin spot"])
def test_photons_of_spots_have_the_density_of_the_intensity(name):
    light = MORE[name]
    position, direction, beta, _ = emit(flat_of(light), MANY, INDEPENDENT)
    assert np.abs(position - light.position).max() < 1e-6
    np.testing.assert_allclose(beta, np.broadcast_to(beta[0], beta.shape), rtol=1e-6)
    axis = np.array([light.axis])
    s, t = axes_of(axis)
    across = np.stack([direction @ s[0], direction @ t[0]], 1)
    theta = np.arctan2(np.linalg.norm(across, axis=1), direction @ axis[0])
    edges = np.linspace(0, math.radians(light.cutoff), 41)
    fine = (edges[:-1, None] + (edges[1] * (np.arange(500) + 0.5) / 500)[None]).ravel()
    cutoff, beam = math.radians(light.cutoff), math.radians(light.beam)
    f = np.where(fine <= beam, 1.0, (cutoff - fine) / max(cutoff - beam, 1e-12)) * np.sin(fine)
    expected = f.reshape(40, 500).sum(1)
    counted, _ = np.histogram(theta, edges)
    assert counted.sum() >= MANY * (1 - 1e-4)  # directions are rounded to float32
    keep = expected > 1e-4 * expected.sum()
    expected = expected[keep] * counted[keep].sum() / expected[keep].sum()
    p = stats.chisquare(counted[keep], expected).pvalue
    print(f"{name}: chi-square p {p:.3f} over {keep.sum()} rings")
    assert p > 1e-3
    assert p_uniform(turn(across[:, 0], across[:, 1])) > 1e-3


def test_photons_of_a_directional_light_fill_a_disc_before_the_scene():
    light = MORE["directional"]
    flat = flat_of(light)
    position, direction, _, _ = emit(flat, MANY, INDEPENDENT)
    assert np.abs(direction - light.direction).max() < 1e-6
    offset = (position - flat.center) / flat.radius
    np.testing.assert_allclose(offset @ light.direction, -1, atol=1e-5)
    s, t = axes_of(np.array([light.direction]))
    x, y = offset @ s[0], offset @ t[0]
    assert p_uniform(x * x + y * y) > 1e-3
    assert p_uniform(turn(x, y)) > 1e-3


def cells_of(directions):
    """Cell of each direction in a grid of 12 × 24 over z and azimuth."""
    row = np.clip((directions[:, 2] + 1) / 2 * 12, 0, 11).astype(int)
    return row * 24 + np.clip(turn(directions[:, 0], directions[:, 1]) * 24, 0, 23).astype(int)


def sky_expected(flat):
    """Share of each cell by the density that evaluation names, 100 × 100 places a cell."""
    n = 100
    z = (np.arange(12 * n) + 0.5) / (12 * n) * 2 - 1
    phi = (np.arange(24 * n) + 0.5) / (24 * n) * 2 * math.pi
    shares = []
    for row in range(12):
        zz, pp = np.meshgrid(z[row * n : row * n + n], phi, indexing="ij")
        r = np.sqrt(1 - zz * zz)
        d = np.stack([r * np.cos(pp), r * np.sin(pp), zz], 2).reshape(-1, 3)
        pdf = sky(flat, d)[1].reshape(n, 24, n)
        shares.append(pdf.mean(axis=(0, 2)) * 4 * math.pi / (12 * 24))
    return np.concatenate(shares)


def test_directions_of_an_image_have_its_luminance_as_density():
    """Chi-square with MANY samples: towards a point, and of photons; every photon's power has luminance 1."""
    flat = flat_of(MORE["image"])
    expected = sky_expected(flat)
    assert expected.sum() == pytest.approx(1, rel=1e-4)
    wi, end, radiance, pdf, _, _ = sample(flat, (0.02, 0.01, 0.03), MANY)
    position, direction, beta, _ = emit(flat, MANY, INDEPENDENT)
    for what, d in (("light samples", wi), ("photons", -direction)):
        counted = np.bincount(cells_of(d), minlength=12 * 24)
        keep = expected * MANY > 10
        share = expected[keep] / expected[keep].sum() * counted[keep].sum()
        p = stats.chisquare(counted[keep], share).pvalue
        print(f"{what}: chi-square p {p:.3f} over {keep.sum()} cells")
        assert p > 1e-3
    seen, density = sky(flat, wi)
    brightest, thickest = seen.max(), density.max()  # next to which a place's last digits show in what is dark
    np.testing.assert_allclose(radiance, seen, rtol=1e-5, atol=1e-6 * brightest)
    np.testing.assert_allclose(pdf, density, rtol=1e-5, atol=1e-6 * thickest)
    by_radiance = radiance @ LUMINANCE / (flat.light_power[0] @ LUMINANCE) * math.pi * flat.radius**2
    np.testing.assert_allclose(pdf, by_radiance, rtol=1e-4)
    np.testing.assert_allclose(beta @ LUMINANCE, 1, rtol=1e-5)
    offset = (position - flat.center) / flat.radius
    depth = (offset * direction).sum(1)
    np.testing.assert_allclose(depth, -1, atol=1e-5)
    assert p_uniform(((offset - depth[:, None] * direction) ** 2).sum(1)) > 1e-3
    distance = np.linalg.norm(end - flat.center, axis=1)
    assert distance.min() > flat.radius


@kernel
def _at_corners(scenes, numbers, picks, found):
    """What lights do with the numbers u, v: found (lights, numbers, 15) of a light sample, then of a photon."""
    scene = scenes[0]
    for i in range(len(numbers)):
        u, v = numbers[i, 0], numbers[i, 1]
        for light in range(scene.n_lights):
            row = found[light, i]
            wi, _, L, pdf, _ = sample_one_light(
                scene, light, (np.float32(0.0), np.float32(0.01), np.float32(0.0)), u, v
            )
            for axis in range(3):
                row[axis], row[3 + axis] = wi[axis], L[axis]
            row[6] = pdf
            p, d, beta, emitted = emit_photon(scene, picks[light], (u, v), (u, v))
            for axis in range(3):
                row[7 + axis], row[10 + axis] = p[axis], d[axis]
            row[13], row[14] = np.float32(emitted), largest(beta)


def test_the_first_and_the_last_numbers_that_there_are_give_directions():
    """A photon in 2²⁴ has the number 0, which was no direction from a sky's pole."""
    lights = (*MORE.values(), LIGHTS["point"])
    flat = flat_of(*lights)
    ends = np.array([0.0, 2.0**-24, 0.5, 1 - 2.0**-24], np.float32)
    numbers = np.ascontiguousarray(np.stack(np.meshgrid(ends, ends), axis=-1).reshape(-1, 2))
    cdf = flat.arrays["light_cdf"].astype(np.float64)
    picks = ((cdf[1:] + cdf[:-1]) / 2).astype(np.float32)
    found = np.full((len(lights), len(numbers), 15), np.nan, np.float32)
    _at_corners(flat.record, numbers, picks, found)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(np.linalg.norm(found[..., 10:13], axis=-1), 1, rtol=1e-5)
    np.testing.assert_array_equal(found[..., 13], np.broadcast_to(np.arange(len(lights))[:, None], found.shape[:2]))


def test_an_even_image_is_a_constant_sky():
    image = ImageEnvironment("even", np.full((5, 4, 3), 0.8, np.float32), TURN)
    flat = flat_of(image)
    assert flat.light_power[0] == pytest.approx(4 * math.pi**2 * flat.radius**2 * 0.8, rel=1e-6)
    wi, _, radiance, pdf, _, _ = sample(flat, (0.0, 0.01, 0.0), 100_000)
    np.testing.assert_allclose(pdf, 1 / (4 * math.pi), rtol=1e-5)
    np.testing.assert_allclose(radiance, 0.8, rtol=1e-6)
    assert p_uniform((wi[:, 2] + 1) / 2) > 1e-3


def test_image_is_laid_out_as_documented():
    """The middle of the picture is (0, 0, 1), its top (0, 1, 0), the middle of its left half (1, 0, 0)."""
    pixels = np.zeros((9, 16, 3), np.float32)
    pixels[:, :, 0] = np.arange(16)[None]
    pixels[:, :, 1] = np.arange(9)[:, None]
    flat = flat_of(ImageEnvironment("layout", pixels, np.eye(3)))
    seen, _ = sky(flat, [(0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 0, -1), (0, 1, 0), (0, -1, 0)])
    assert seen[:, 0][:4] == pytest.approx([7.5, 3.5, 11.5, 7.5])
    assert seen[:, 1] == pytest.approx([4, 4, 4, 4, 0, 8], abs=1e-4)


@pytest.mark.parametrize("name", ["spot", "soft spot", "directional"])
def test_irradiance_of_lights_without_size_is_analytic(name):
    light = MORE[name]
    x, n = np.array([0.05, 0.0, 0.04]), np.array([0.0, 1.0, 0.0])
    wi, _, radiance, pdf, _, _ = sample(flat_of(light), x, 8)
    E = radiance[0] * (wi[0] @ n) / pdf[0]
    if name == "directional":
        expected = np.array(light.irradiance) * -light.direction[1]
    else:
        offset = np.subtract(light.position, x)
        distance = np.linalg.norm(offset)
        angle = math.degrees(math.acos(-(offset / distance) @ light.axis))
        f = min(1.0, (light.cutoff - angle) / (light.cutoff - light.beam))
        expected = np.array(light.intensity) * f * offset[1] / distance**3
    assert pytest.approx(expected, rel=1e-5) == E


def test_behind_a_spot_it_is_dark():
    light = MORE["spot"]
    _, _, _, pdf, _, _ = sample(flat_of(light), np.array(light.position) + (0, 1.0, 0), 8)
    assert np.all(pdf == 0)


def test_scenes_without_such_lights_keep_their_record():
    plain, more = flatten(light_scene("point", "disk")), flatten(scene_of(MORE["spot"]))
    assert "more_lights" not in plain.record.dtype.names
    assert "more_lights" in more.record.dtype.names
