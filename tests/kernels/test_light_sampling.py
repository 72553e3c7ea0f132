"""Lights (T1): emitted power, where and in which directions photons start, and sampling towards a point."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from pmviewer.kernels.random import INDEPENDENT
from pmviewer.scene.arrays.flatten import LUMINANCE, flatten
from tests.support.light_probe import axes_of, emit, look, p_uniform, sample, turn, uniform_sphere
from tests.support.scenes import LIGHTS, light_scene

MANY = 250_000
"""Samples of the chi-square tests: over 256 cells they find densities that are wrong by 2 % (2 %² · MANY = 100, five
times the standard deviation 23 of χ²)."""
RADIANCE = np.array([2.0, 1.5, 1.0])
AREA_LIGHTS = [name for name in LIGHTS if name not in ("point", "environment")]


def analytic_power(name, radius):
    """Watts per channel, by hand; `radius` of the scene's bounding sphere."""
    g = LIGHTS[name]
    if name == "point":
        return 4 * math.pi * np.array(g.intensity)
    if name == "environment":
        return 4 * math.pi**2 * radius**2 * np.array(g.radiance)
    area = {
        "parallelogram": lambda: float(np.linalg.norm(np.cross(g.edge_u, g.edge_v))),
        "disk": lambda: math.pi * g.radius**2,
        "sphere": lambda: 4 * math.pi * g.radius**2,
        "cylinder": lambda: 2 * math.pi * g.radius * math.dist(g.p0, g.p1),
        "mesh": lambda: 6 * 0.8**2,
    }[name.split()[0]]()
    return math.pi * area * RADIANCE


def test_emitted_power_of_all_lights_together():
    """2^19 photons over nine lights: each light's power within 0.1 % of the analytic value, the weakest's too, which
    gets 0.3 % of them."""
    flat = flatten(light_scene(*LIGHTS))
    n = 2**19
    _, _, beta, light = emit(flat, n)
    for index, name in enumerate(flat.light_names):
        expected = analytic_power(name, flat.radius)
        power = beta[light == index].sum(0) * flat.total_luminance / n
        print(f"{name}: {power} W, {np.abs(power / expected - 1).max():.1e} off")
        assert power == pytest.approx(expected, rel=1e-3)
        assert flat.light_power[index] == pytest.approx(expected, rel=1e-6)


def test_light_choice_follows_power_with_independent_numbers():
    flat = flatten(light_scene(*LIGHTS))
    *_, light = emit(flat, 100_000, INDEPENDENT)
    share = flat.light_power @ LUMINANCE / flat.total_luminance
    assert stats.chisquare(np.bincount(light, minlength=len(share)), 100_000 * share).pvalue > 1e-3


@pytest.mark.parametrize("name", AREA_LIGHTS)
def test_photons_leave_area_lights_uniformly_by_the_cosine_law(name):
    g = LIGHTS[name]
    position, direction, _, _ = emit(flatten(light_scene(name)), MANY, INDEPENDENT)
    on_surface = 2e-4  # photons start a little off the light
    if name == "parallelogram":
        u, v = np.array(g.edge_u), np.array(g.edge_v)
        normal = np.broadcast_to(np.cross(u, v) / np.linalg.norm(np.cross(u, v)), position.shape)
        local = np.linalg.lstsq(np.stack([u, v], 1), (position - g.corner).T, rcond=None)[0]
        places = [local[0], local[1]]
        distance = (position - g.corner) @ normal[0]
    elif name == "disk":
        normal = np.broadcast_to(np.array(g.normal), position.shape)
        offset = position - g.center
        s, t = axes_of(normal)
        places = [(offset**2).sum(1) / g.radius**2, turn((offset * s).sum(1), (offset * t).sum(1))]
        distance = (offset * normal).sum(1)
    elif name.startswith("sphere"):
        offset = position - g.center
        radial = offset / np.linalg.norm(offset, axis=1, keepdims=True)
        normal = -radial if g.flip_normals else radial
        places = [(radial[:, 2] + 1) / 2, turn(radial[:, 0], radial[:, 1])]
        distance = (np.linalg.norm(offset, axis=1) - g.radius) * (-1 if g.flip_normals else 1)
    elif name.startswith("cylinder"):
        axis = np.subtract(g.p1, g.p0)
        length = np.linalg.norm(axis)
        axis /= length
        offset = position - g.p0
        along = offset @ axis
        across = offset - along[:, None] * axis
        radial = across / np.linalg.norm(across, axis=1, keepdims=True)
        normal = -radial if g.flip_normals else radial
        s, t = axes_of(axis[None])
        places = [along / length, turn(across @ s[0], across @ t[0])]
        distance = (np.linalg.norm(across, axis=1) - g.radius) * (-1 if g.flip_normals else 1)
    else:
        offset = (position - (0.1, 1.8, 0.2)) / 0.4  # on the cube [-1, 1]³
        face = np.abs(offset).argmax(1)
        sign = np.sign(offset[np.arange(len(offset)), face])
        normal = np.zeros_like(offset)
        normal[np.arange(len(offset)), face] = sign
        sides = np.bincount(2 * face + (sign > 0), minlength=6)
        assert stats.chisquare(sides).pvalue > 1e-3
        others = np.array([[1, 2], [0, 2], [0, 1]])[face]
        places = [(offset[np.arange(len(offset)), others[:, k]] + 1) / 2 for k in (0, 1)]
        distance = (np.abs(offset).max(1) - 1) * 0.4
    cos = (direction * normal).sum(1)
    assert cos.min() > 0
    assert np.all(distance > 0)
    assert distance.max() < on_surface
    s, t = axes_of(normal)
    for values in (*places, cos**2, turn((direction * s).sum(1), (direction * t).sum(1))):
        assert values.min() > -1e-4
        assert values.max() < 1 + 1e-3
        assert p_uniform(values) > 1e-3
    # Place and direction are independent: 4 × 4 × 4 cells of them.
    cells = sum((np.clip(x, 0, 0.999) * 4).astype(int) * 4**k for k, x in enumerate([places[0], places[1], cos**2]))
    assert stats.chisquare(np.bincount(cells, minlength=64)).pvalue > 1e-3


def test_photons_of_point_light_and_environment():
    position, direction, _, _ = emit(flatten(light_scene("point")), MANY, INDEPENDENT)
    assert np.abs(position - LIGHTS["point"].position).max() < 1e-6
    assert p_uniform((direction[:, 2] + 1) / 2) > 1e-3
    assert p_uniform(turn(direction[:, 0], direction[:, 1])) > 1e-3

    flat = flatten(light_scene("environment"))
    position, direction, _, _ = emit(flat, MANY, INDEPENDENT)
    assert p_uniform((direction[:, 2] + 1) / 2) > 1e-3
    assert p_uniform(turn(direction[:, 0], direction[:, 1])) > 1e-3
    offset = (position - flat.center) / flat.radius
    depth = (offset * direction).sum(1)
    np.testing.assert_allclose(depth, -1, atol=1e-5)  # on a disc outside the bounding sphere
    across = offset - depth[:, None] * direction
    assert p_uniform((across**2).sum(1)) > 1e-3


RECEIVERS = {
    "origin": ((0.0, 0.01, 0.0), (0.0, 1.0, 0.0)),
    "oblique": ((0.9, 0.3, -0.6), (-0.5, 0.8, 0.33)),
}


@pytest.mark.parametrize("where", RECEIVERS)
@pytest.mark.parametrize("name", [*AREA_LIGHTS, "environment"])
def test_light_sampling_agrees_with_looking_around(name, where):
    """Irradiance by light samples equals that by uniform directions, within four standard errors of both."""
    flat = flatten(light_scene(name))
    x, n = np.array(RECEIVERS[where][0]), np.array(RECEIVERS[where][1])
    n /= np.linalg.norm(n)
    wi, _, radiance, pdf, other, found = sample(flat, x, 60_000)
    cos = np.maximum(wi @ n, 0)
    useful = pdf > 0
    visible = found == 1
    if name in AREA_LIGHTS:  # what samples leave behind other parts of the same light does not arrive
        visible &= np.abs(other - pdf) <= 2e-3 * np.maximum(other, pdf)
    value = np.where(useful & visible, radiance[:, 0] * cos / np.where(useful, pdf, 1), 0.0)
    ours, error = value.mean(), value.std() / math.sqrt(len(value))
    if name == "environment":
        expected, expected_error = math.pi * LIGHTS[name].radiance[0], 0.0
        if where == "oblique":  # the floor hides a little of the sky
            expected_error = 0.02
    else:
        directions = uniform_sphere(400_000)
        brute, _ = look(flat, x, directions)
        arriving = brute[:, 0] * np.maximum(directions @ n, 0) * 4 * math.pi
        expected, expected_error = arriving.mean(), arriving.std() / math.sqrt(len(arriving))
    print(f"{name} from {where}: E {ours:.5f} ± {error:.5f}, looking around {expected:.5f} ± {expected_error:.5f}")
    assert abs(ours - expected) < 4 * math.hypot(error, expected_error) + 1e-6


def test_irradiance_of_light_samples_is_analytic():
    """Closed forms: a disk above the receiver π L R²/(R² + D²), a sphere π L (R/D)², the sky π L, a point I cos/d²."""
    x = np.array([0.2, 0.5, 0.1])
    n = np.array([0.0, 1.0, 0.0])

    def irradiance(name, x):
        wi, _, radiance, pdf, _, _ = sample(flatten(light_scene(name)), x, 200_000)
        return float((radiance[:, 0] * np.maximum(wi @ n, 0) / np.where(pdf > 0, pdf, np.inf)).mean())

    R, D = 0.6, 1.5
    assert irradiance("disk", x) == pytest.approx(math.pi * 2 * R**2 / (R**2 + D**2), rel=3e-3)
    ball = LIGHTS["sphere"]
    below = np.array([ball.center[0], 0.2, ball.center[2]])
    assert irradiance("sphere", below) == pytest.approx(math.pi * 2 * (0.5 / 1.3) ** 2, rel=5e-4)
    assert irradiance("sphere inside", x) == pytest.approx(math.pi * 2, rel=1e-2)
    assert irradiance("environment", x) == pytest.approx(math.pi * 0.8, rel=5e-3)
    offset = np.subtract(LIGHTS["point"].position, x)
    expected = 2.0 * offset[1] / np.linalg.norm(offset) ** 3
    assert irradiance("point", x) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("name", AREA_LIGHTS)
def test_density_is_the_samplers(name):
    """`light_pdf` of what a sampled ray finds is the sample's pdf, and it integrates to 1 where every sample counts."""
    flat = flatten(light_scene(name, floor=False))
    x = np.array([0.3, 0.4, -0.2])
    _, _, _, pdf, other, found = sample(flat, x, 20_000)
    checked = (pdf > 0) & (found == 1)
    same = np.abs(other[checked] / pdf[checked] - 1) < 2e-3
    hidden_by_itself = 0.0 if name not in ("cylinder", "mesh") else 0.5
    print(f"{name}: {same.mean():.4f} of {checked.sum()} samples have the density that light_pdf names")
    assert checked.sum() > 1000
    assert same.mean() >= 1 - hidden_by_itself - 1e-3
    if name in ("parallelogram", "disk", "sphere", "sphere inside"):
        _, density = look(flat, x, uniform_sphere(400_000))
        total = density.mean() * 4 * math.pi
        error = density.std() * 4 * math.pi / math.sqrt(len(density))
        print(f"{name}: density integrates to {total:.4f} ± {error:.4f}")
        assert abs(total - 1) < 4 * error + 1e-4


@pytest.mark.parametrize("name", AREA_LIGHTS)
def test_directions_to_a_light_have_the_density_of_light_pdf(name):
    """Chi-square of many directions in 16 × 16 cells of the cone that holds the light. A cell expects the integral
    of `light_pdf` over the directions in it that find the light; samples of parts that other parts of the light hide,
    that face away or are seen edge-on are a cell of their own."""
    flat = flatten(light_scene(name, floor=False))
    x = np.array([0.3, 0.4, -0.2])
    wi, _, _, pdf, other, found = sample(flat, x, MANY)
    counted = (pdf > 0) & (found == 1) & (np.abs(other / np.where(pdf > 0, pdf, 1) - 1) < 2e-3)
    most = 8 * pdf[pdf > 0].min()  # along a silhouette the density has a pole, which no quadrature would get right
    counted &= pdf < most
    axis = np.array([0.0, 0.0, 1.0]) if name.endswith("inside") else wi.mean(0) / np.linalg.norm(wi.mean(0))
    s, t = (a[0] for a in axes_of(axis[None]))
    lowest = float((wi @ axis).min()) - 1e-4
    n, fine = 16, 50
    cos = lowest + (1 - lowest) * (np.arange(n * fine) + 0.5) / (n * fine)
    phi = 2 * math.pi * (np.arange(n * fine) + 0.5) / (n * fine)
    expected = np.zeros((n, n))
    for k in range(n):  # a ring of cells at a time
        c = cos[k * fine : (k + 1) * fine, None]
        sin = np.sqrt(np.maximum(1 - c**2, 0))
        d = c[..., None] * axis + sin[..., None] * (np.cos(phi)[:, None] * s + np.sin(phi)[:, None] * t)
        _, density = look(flat, x, d.reshape(-1, 3))
        density[density >= most] = 0
        expected[k] = density.reshape(fine, n, fine).mean(axis=(0, 2))
    expected *= MANY * 2 * math.pi * (1 - lowest) / n**2
    ring = np.clip(((wi @ axis - lowest) / (1 - lowest) * n).astype(int), 0, n - 1)
    sector = np.clip((turn(wi @ s, wi @ t) * n).astype(int), 0, n - 1)
    counts = np.bincount((ring * n + sector)[counted], minlength=n * n).astype(float)
    expected = expected.ravel()
    kept = expected > 50
    counts = np.append(counts[kept], MANY - counts[kept].sum())
    expected = np.append(expected[kept], MANY - expected[kept].sum())
    if expected[-1] < 50:
        counts, expected = counts[:-1], expected[:-1] * counts[:-1].sum() / expected[:-1].sum()
    p = stats.chisquare(counts, expected).pvalue
    print(f"{name}: p = {p:.3f} over {len(counts)} cells, {1 - counted.mean():.3f} hidden or facing away")
    assert len(counts) > 20
    assert p > 0.01 / len(AREA_LIGHTS)


def test_receiver_on_and_inside_the_sphere_light():
    """From inside, and from a point on it, nothing of an outward sphere arrives; and no number is broken."""
    ball = LIGHTS["sphere"]
    flat = flatten(light_scene("sphere"))
    for x in (ball.center, np.add(ball.center, (0.2, 0.1, 0)), np.add(ball.center, (0, -ball.radius, 0))):
        wi, end, _, pdf, _, _ = sample(flat, x, 5000)
        assert np.isfinite(wi).all()
        assert np.isfinite(end).all()
        assert np.isfinite(pdf).all()
        assert (pdf >= 0).all()
    inside = sample(flat, ball.center, 5000)[3]
    assert np.all(inside == 0)
    near = np.add(ball.center, (0, -ball.radius * 1.001, 0))
    wi, _, radiance, pdf, _, _ = sample(flat, near, 100_000)
    E = float((radiance[:, 0] * np.maximum(wi[:, 1], 0) / pdf).mean())
    print(f"just below the sphere light: E {E:.3f}, analytic {2 * math.pi / 1.001**2:.3f}")
    assert pdf.min() > 0
    assert pytest.approx(2 * math.pi / 1.001**2, rel=0.01) == E


def test_shadow_ray_ends_on_the_light():
    for name in ("parallelogram", "disk", "sphere", "cylinder", "mesh", "point"):
        flat = flatten(light_scene(name))
        x = np.array([0.3, 0.4, -0.2])
        wi, end, _, pdf, _, found = sample(flat, x, 2000)
        useful = pdf > 0
        offset = end - x
        distance = np.linalg.norm(offset, axis=1, keepdims=True)
        assert np.abs(offset / distance - wi)[useful].max() < 1e-3
        if name != "point":
            assert found[useful].mean() > 0.99
