"""Irradiance and its gradients from a stratified hemisphere, against Lambert's formula for polygons."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.hemisphere import cell_direction, irradiance_and_gradients, strata

RADIANCE = np.array([1.0, 0.5, 2.0])


@kernel
def seen_from(x, normal, corner, u_edge, v_edge, up, numbers, rings, sectors, cells, E, rotation, translation):
    """Cells of a hemisphere under a rectangle in black space, and what they say; returns the harmonic mean distance."""
    n = (normal[0], normal[1], normal[2])
    for k in range(sectors):
        for j in range(rings):
            here = j + rings * k
            d = cell_direction(n, rings, sectors, j, k, numbers[here, 0], numbers[here, 1])
            direction = np.array([d[0], d[1], d[2]])
            cos = d[0] * n[0] + d[1] * n[1] + d[2] * n[2]
            cells[here, :3] = np.float32(0.0)
            cells[here, 3], cells[here, 4] = np.float32(np.inf), np.float32(1.0) - cos * cos
            height = np.float32(np.sum((corner - x) * up))
            slope = np.float32(np.sum(direction * up))
            if slope > 0:
                hit = x + direction * (height / slope) - corner
                a, b = np.sum(hit * u_edge) / np.sum(u_edge * u_edge), np.sum(hit * v_edge) / np.sum(v_edge * v_edge)
                if 0 <= a <= 1 and 0 <= b <= 1:
                    cells[here, 0], cells[here, 1], cells[here, 2] = np.float32(1.0), np.float32(0.5), np.float32(2.0)
                    cells[here, 3] = height / slope
    return irradiance_and_gradients(cells, rings, sectors, n, E, rotation, translation)


def gathered(x, n, rectangle, rings, sectors, seed=1):
    corner, u, v = (np.asarray(part, np.float32) for part in rectangle)
    up = np.cross(u, v)
    up = (up / np.linalg.norm(up)).astype(np.float32)
    numbers = np.random.default_rng(seed).random((rings * sectors, 2)).astype(np.float32)
    cells = np.empty((rings * sectors, 5), np.float32)
    E, rotation, translation = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    x, n = np.asarray(x, np.float32), np.asarray(n, np.float32)
    R = seen_from(x, n, corner, u, v, up, numbers, rings, sectors, cells, E, rotation, translation)
    return E, rotation, translation, R


def lambert(x, n, rectangle):
    """Irradiance of a rectangle of radiance 1 that is wholly above the horizon: ½ Σ Γ_i·n (Lambert 1760)."""
    corner, u, v = (np.asarray(part, float) for part in rectangle)
    vertices = np.array([corner, corner + u, corner + u + v, corner + v]) - x
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    total = 0.0
    for a, b in zip(vertices, np.roll(vertices, -1, axis=0), strict=True):
        across = np.cross(a, b)
        total += np.arccos(np.clip(a @ b, -1, 1)) * (across / np.linalg.norm(across)) @ n
    return abs(total) / 2


def slope(function, at, directions, step=1e-4):
    return np.array([(function(at + step * d) - function(at - step * d)) / (2 * step) for d in directions])


TILTED = np.array([0.3, -0.2, 0.9]) / np.linalg.norm([0.3, -0.2, 0.9])
CASES = {
    "straight above": ((-0.5, -0.4, 1.0), (1.0, 0, 0), (0, 0.8, 0), (0.1, 0.2, 0.0), (0.0, 0.0, 1.0)),
    "to the side": ((0.3, -0.4, 0.8), (0.9, 0, 0), (0, 0.9, 0), (-0.2, 0.1, 0.0), (0.0, 0.0, 1.0)),
    "tilted normal": ((0.2, -0.5, 0.9), (1.0, 0, 0), (0, 1.1, 0), (0.0, 0.0, 0.0), TILTED),
}


@pytest.mark.parametrize("name", CASES)
def test_irradiance_and_both_gradients_agree_with_lamberts_formula(name):
    corner, u, v, x, n = CASES[name]
    rectangle, x, n = (corner, u, v), np.asarray(x, float), np.asarray(n, float)
    E, rotation, translation, _ = gathered(x, n, rectangle, 120, 377)
    expected = lambert(x, n, rectangle)
    a = np.cross(n, (1.0, 0.0, 0.0))
    a /= np.linalg.norm(a)
    plane = np.array([a, np.cross(n, a)])
    moved = slope(lambda y: lambert(y, n, rectangle), x, plane)

    def turned(axis, angle):
        m = n * np.cos(angle) + np.cross(axis, n) * np.sin(angle)
        return lambert(x, m, rectangle)

    # Turned by a small angle around `axis`, n × m is the axis times the angle.
    spun = np.array([(turned(axis, 1e-4) - turned(axis, -1e-4)) / 2e-4 for axis in plane])
    print(name, E / RADIANCE, expected, translation @ plane.T, moved, rotation @ plane.T, spun)
    for c, L in enumerate(RADIANCE):
        assert E[c] / L == pytest.approx(expected, rel=5e-3)
        assert np.abs(plane @ translation[c] / L - moved).max() < 0.03 * np.linalg.norm(moved) + 0.003
        assert np.abs(plane @ rotation[c] / L - spun).max() < 0.02 * np.linalg.norm(spun)
        assert abs(n @ translation[c]) < 1e-6 * max(1, np.abs(translation[c]).max())


def test_few_rays_give_the_gradient_in_the_mean():
    """64 rays as in a picture, over many seeds: right in direction, somewhat small for a patch of few cells."""
    corner, u, v, x, n = CASES["to the side"]
    rings, sectors = strata(64)
    mean = np.mean([gathered(x, n, (corner, u, v), rings, sectors, seed)[2][0] for seed in range(400)], axis=0)
    expected = slope(lambda y: lambert(y, np.asarray(n), (corner, u, v)), np.asarray(x, float), np.eye(3)[:2])
    print(mean, expected)
    assert np.linalg.norm(mean[:2] - expected) < 0.25 * np.linalg.norm(expected)
    assert mean[:2] @ expected > 0.995 * np.linalg.norm(mean) * np.linalg.norm(expected)


def test_harmonic_distance_and_a_uniform_surrounding():
    """Under an endless ceiling of radiance 1 irradiance is π everywhere, and the gradients vanish."""
    ceiling = ((-1e4, -1e4, 2.0), (2e4, 0, 0), (0, 2e4, 0))
    E, rotation, translation, R = gathered((0, 0, 0), (0, 0, 1), ceiling, 16, 50)
    assert E[0] == pytest.approx(np.pi, rel=1e-3)
    assert np.abs(translation[0]).max() < 0.02
    assert np.abs(rotation[0]).max() < 0.2
    # 1/r = cos θ/2, whose cosine-weighted mean is 1/3.
    assert pytest.approx(3.0, rel=0.01) == R


@pytest.mark.parametrize("samples", [8, 32, 64, 256, 4096])
def test_cells_are_about_as_many_as_asked_for(samples):
    rings, sectors = strata(samples)
    assert rings * sectors == pytest.approx(samples, rel=0.13)
    assert sectors >= 2 * rings
