"""Projectors (T1): photons, light samples and power against integrals of the picture that are done here."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.lights.start import spread_over
from pmviewer.kernels.random import INDEPENDENT
from pmviewer.scene.arrays.flatten import FlatScene, flatten
from pmviewer.scene.description import LUMINANCE, PointLight, ProjectorLight, Scene
from pmviewer.scene.emission import emitted_power
from tests.support.kinds import EVERY_SURFACE
from tests.support.light_probe import MORE, TURN, emit, sample
from tests.support.scenes import light_scene

MANY = 250_000
SIDE = 12
"""Fields across and down that photons are counted in."""
MIRROR = np.diag([-1.0, 1.0, 1.0])


def picture(height: int = 5, width: int = 7, seed: int = 2) -> np.ndarray:
    """Uneven and coloured, with a bright pixel, a black row and a black pixel."""
    pixels = np.random.default_rng(seed).uniform(0, 1, (height, width, 3)) ** 3
    pixels[1, 2] = 8.0, 3.0, 1.0
    pixels[3] = 0.0
    return pixels.astype(np.float32)


def projector(name: str = "projector", turn: np.ndarray = TURN) -> ProjectorLight:
    """Lines that are not evenly spaced; at the third column the picture jumps."""
    columns, rows = np.array([0.0, 0.1, 0.35, 0.35, 0.6, 0.9, 1.0]), np.array([0.0, 0.3, 0.5, 0.8, 1.0])
    return ProjectorLight(name, (0.2, 0.9, -0.1), turn, (0.8, 0.5), picture(), columns, rows)


LIGHTS = {"turned": projector(), "mirrored": projector("mirrored", TURN @ MIRROR)}


def scene_of(*lights: object) -> Scene:
    return replace(light_scene(floor=True), lights=lights)


def flat_of(*lights: object) -> FlatScene:
    """With the kernels of other tests of lights."""
    return flatten(scene_of(*lights), features_at_least=EVERY_SURFACE)


def irradiance(light: ProjectorLight, u: float, v: float) -> np.ndarray:
    """The picture at shares of its width and height, cell by cell; the slow twin of the kernel."""
    i = max(k for k in range(len(light.columns) - 1) if light.columns[k] <= u)
    j = max(k for k in range(len(light.rows) - 1) if light.rows[k] <= v)
    s = (u - light.columns[i]) / (light.columns[i + 1] - light.columns[i])
    t = (v - light.rows[j]) / (light.rows[j + 1] - light.rows[j])
    E = light.pixels.astype(float)
    upper, lower = (1 - s) * E[j, i] + s * E[j, i + 1], (1 - s) * E[j + 1, i] + s * E[j + 1, i + 1]
    return (1 - t) * upper + t * lower


def fine(light: ProjectorLight, n: int) -> np.ndarray:
    """The picture at the middles of n × n fields, (n, n, 3)."""
    at = (np.arange(n) + 0.5) / n
    return np.array([[irradiance(light, u, v) for u in at] for v in at])


def places(light: ProjectorLight, d: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shares of the picture's width and height that directions (n, 3) go to, and the cosine to its axis."""
    x, y, z = (d @ light.to_world).T
    return (1 - x / z / light.half[0]) / 2, (1 - y / z / light.half[1]) / 2, z


@pytest.mark.parametrize("name", LIGHTS)
def test_power_is_the_integral_over_the_plane(name: str) -> None:
    light = LIGHTS[name]
    expected = fine(light, 100).mean(axis=(0, 1)) * 4 * light.half[0] * light.half[1]  # lines lie between fields
    power = emitted_power(light, 1.0)
    print(f"{power} W, by fields {expected} W")
    assert power == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("name", LIGHTS)
def test_photons_have_the_density_of_the_intensity(name: str) -> None:
    """Chi-square over fields of the plane at distance 1, where the intensity's density is the irradiance's."""
    light = LIGHTS[name]
    position, direction, beta, _ = emit(flat_of(light), MANY, INDEPENDENT)
    assert np.abs(position - light.position).max() < 1e-6
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, rtol=1e-5)
    np.testing.assert_allclose(beta @ LUMINANCE, 1, rtol=1e-5)
    u, v, z = places(light, direction)
    assert z.min() > 0
    assert -1e-5 < min(u.min(), v.min()) < max(u.max(), v.max()) < 1 + 1e-5
    field = np.clip(v * SIDE, 0, SIDE - 1).astype(int) * SIDE + np.clip(u * SIDE, 0, SIDE - 1).astype(int)
    counted = np.bincount(field, minlength=SIDE**2)
    n = 10 * SIDE
    share = (fine(light, n) @ LUMINANCE).reshape(SIDE, 10, SIDE, 10).mean(axis=(1, 3)).ravel()
    keep = share / share.sum() * MANY > 10
    assert keep.sum() > SIDE**2 / 2
    expected = share[keep] / share[keep].sum() * counted[keep].sum()
    p = stats.chisquare(counted[keep], expected).pvalue
    mean = beta.mean(0) * (emitted_power(light, 1.0) @ LUMINANCE)
    print(f"chi-square p {p:.3f} over {keep.sum()} fields; power by photons {mean} W of {emitted_power(light, 1.0)}")
    assert p > 1e-3
    assert mean == pytest.approx(emitted_power(light, 1.0), rel=1e-2)


@pytest.mark.parametrize("name", LIGHTS)
def test_direct_light_at_points_by_hand(name: str) -> None:
    """L/pdf is E(x, y)/(cos³θ·distance²) towards 40 places; 0 beside the picture and behind the projector."""
    light = LIGHTS[name]
    flat = flat_of(light)
    rng = np.random.default_rng(4)
    for u, v, depth in zip(rng.uniform(0.01, 0.99, 40), rng.uniform(0.01, 0.99, 40), rng.uniform(0.3, 2, 40)):
        local = depth * np.array([light.half[0] * (1 - 2 * u), light.half[1] * (1 - 2 * v), 1.0])
        x = light.position + light.to_world @ local
        wi, end, radiance, pdf, _, found = sample(flat, x, 2)
        distance = np.linalg.norm(local)
        expected = irradiance(light, u, v) / (local[2] / distance) ** 3 / distance**2
        if expected @ LUMINANCE > 0:
            np.testing.assert_allclose(radiance[0] / pdf[0], expected, rtol=1e-3, atol=1e-5)
        else:
            assert pdf[0] == 0
        np.testing.assert_allclose(wi[0], -(light.to_world @ local) / distance, atol=1e-5)
        np.testing.assert_allclose(end[0], light.position, atol=1e-6)
        assert not found.any()
    for local in ((0.81, 0, 1), (-0.81, 0, 1), (0, 0.51, 1), (0, -0.51, 1), (0, 0, -1), (0.1, 0, 0)):
        assert np.all(sample(flat, light.position + light.to_world @ np.array(local), 2)[3] == 0)


@kernel
def _spreads(scenes, directions, out):
    for i in range(len(directions)):
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        out[i] = spread_over(scenes[0], 0, (np.float32(0.5), np.float32(0.5)), d, np.float32(4.0))


def test_photons_spread_as_their_density_says() -> None:
    """1/p of a direction; the mean of it over photons that have the density p is the pyramid's solid angle where it
    is lit."""
    light = replace(projector(), pixels=picture() + np.float32(0.1))
    flat = flat_of(light)
    _, direction, _, _ = emit(flat, MANY, INDEPENDENT)
    out = np.zeros(MANY, np.float32)
    _spreads(flat.record, np.ascontiguousarray(direction, np.float32), out)
    a, b = light.half
    solid = 4 * math.asin(a * b / math.sqrt((1 + a * a) * (1 + b * b)))
    error = float(out.std()) / 4 / math.sqrt(MANY)
    print(f"{out.mean() / 4:.4f} sr, {solid:.4f} sr expected, standard error {error:.4f}")
    assert out.mean() / 4 == pytest.approx(solid, abs=4 * error)
    assert error < 0.01 * solid
    back = np.ascontiguousarray(-direction[:10], np.float32)
    _spreads(flat.record, back, out[:10])
    assert np.all(out[:10] == 0)


def test_several_projectors_and_other_lights_keep_their_own_pictures() -> None:
    small = replace(projector("small"), pixels=np.ones((2, 2, 3), np.float32), columns=np.array([0.0, 1.0]),
                    rows=np.array([0.0, 1.0]), position=(0.0, 1.5, 0.0), to_world=np.eye(3))  # fmt: skip
    last = replace(projector("last"), pixels=3 * picture(seed=9), half=(0.3, 0.6))
    lights = (small, MORE["spot"], LIGHTS["turned"], MORE["directional"], PointLight("p", (0, 1, 0), (1, 1, 1)), last)
    flat = flat_of(*lights)
    n = 2**19
    _, _, beta, light = emit(flat, n)
    for index, described in enumerate(lights):
        expected = emitted_power(described, flat.radius)
        power = beta[light == index].sum(0) * flat.total_luminance / n
        assert power @ LUMINANCE == pytest.approx(expected @ LUMINANCE, rel=1e-3), described.name
        assert power == pytest.approx(expected, rel=1e-2), described.name
    assert flat.delta_lights


def test_only_scenes_with_projectors_have_their_record() -> None:
    spot, with_projector = flatten(scene_of(MORE["spot"])), flatten(scene_of(projector()))
    names, more = spot.record.dtype.names, with_projector.record.dtype.names
    assert "more_lights" in names
    assert set(more) - set(names) == {"projectors", "projector_numbers"}
    assert [name for name in more if name in names] == list(names)


def test_a_black_projector_beside_a_lamp_sends_nothing() -> None:
    black = replace(projector(), pixels=np.zeros((5, 7, 3), np.float32))
    flat = flat_of(black, PointLight("lamp", (0.0, 1.0, 0.0), (1.0, 1.0, 1.0)))
    _, _, beta, light = emit(flat, 1000)
    assert set(light) == {1}
    assert np.isfinite(beta).all()
