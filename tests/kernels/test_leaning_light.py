"""A mesh light whose vertex normals lean over: it emits on their side, with the surface's own cosine."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.kernels.random import INDEPENDENT
from pmviewer.scene.arrays.flatten import LUMINANCE, flatten
from pmviewer.scene.description import Shape
from tests.support.kinds import EVERY_SURFACE
from tests.support.light_probe import AREA, CORNERS, LEANING, NG, NORMALS, emit, look, sample, uniform_sphere
from tests.support.scenes import light_scene

RADIANCE = (2.0, 1.5, 1.0)
POINTS = {"below": (0.1, 0.2, 0.1), "beside": (1.6, 1.2, 0.3), "above": (0.2, 2.0, 0.9)}


@pytest.fixture(scope="module")
def flat():
    scene = light_scene(floor=False)
    return flatten(replace(scene, shapes=(Shape("light", LEANING, 1, RADIANCE),)), features_at_least=EVERY_SURFACE)


def on_the_light(n, seed=7):
    """Places spread uniformly over the light, and its vertex normals there."""
    rng = np.random.default_rng(seed)
    root, t = np.sqrt(rng.random(n)), rng.random(n)
    b = np.stack([1 - root, root * (1 - t), root * t], axis=1)
    return b @ CORNERS, b @ NORMALS


def test_photons_carry_the_light_that_the_definition_says(flat):
    """Radiance L in all directions d with ns·d > 0 is the power L |ng·d| per area and solid angle.

    Shares of the octants by brute force.
    """
    n = 400_000
    _, direction, beta, _ = emit(flat, n)
    np.testing.assert_allclose(beta @ LUMINANCE, 1, rtol=1e-5)
    _, normal = on_the_light(n)
    d = uniform_sphere(n)
    weight = np.where((normal * d).sum(1) > 0, np.abs(d @ NG), 0.0)
    octant = (d > 0) @ np.array([1, 2, 4])
    expected = np.bincount(octant, weight, 8) * (4 * math.pi / n)
    assert expected.sum() == pytest.approx(math.pi, rel=0.01)  # whatever the normals are
    error = np.sqrt(np.bincount(octant, weight**2, 8)) * (4 * math.pi / n)
    found = np.bincount((direction > 0) @ np.array([1, 2, 4]), minlength=8) / n
    assert (np.abs(found * math.pi - expected) < 4 * (error + math.pi * np.sqrt(found / n))).all()
    assert found.min() > 0.001


def test_power_is_that_of_a_flat_light(flat):
    assert flat.light_power[0] == pytest.approx(math.pi * AREA * np.array(RADIANCE), rel=1e-5)


@pytest.mark.parametrize("where", list(POINTS))
def test_samples_and_rays_find_the_irradiance_by_definition(flat, where):
    """∫ L |ng·w|/r² over the part of the light that emits towards x, by brute force."""
    x, n = np.array(POINTS[where]), 200_000
    place, normal = on_the_light(n)
    offset = x - place
    r2 = (offset**2).sum(1)
    w = offset / np.sqrt(r2)[:, None]
    value = np.where((normal * w).sum(1) > 0, np.abs(w @ NG) / r2, 0.0) * (AREA * RADIANCE[0])
    expected, error = value.mean(), value.std() / math.sqrt(n)
    _, _, radiance, pdf, other, _ = sample(flat, x, n)
    lit = pdf > 0
    taken = np.where(lit, radiance[:, 0] / np.where(lit, pdf, 1.0), 0.0)
    assert abs(taken.mean() - expected) < 4 * math.hypot(error, taken.std() / math.sqrt(n))
    np.testing.assert_allclose(other[lit], pdf[lit], rtol=1e-3)
    seen, _ = look(flat, x, uniform_sphere(4 * n))
    looked = seen[:, 0] * (4 * math.pi)
    assert abs(looked.mean() - expected) < 4 * math.hypot(error, looked.std() / math.sqrt(4 * n))
    assert 0.05 < lit.mean() < 0.999


def test_photons_start_on_the_side_that_they_fly_to(flat):
    position, direction, _, _ = emit(flat, 10_000, INDEPENDENT)
    assert (((position - CORNERS[0]) @ NG) * (direction @ NG) >= 0).mean() > 0.999
    assert 0.05 < (direction @ NG < 0).mean() < 0.95
