"""The rough coat's diffuse reflectance from inside, against a sum in NumPy over normals by their own density (Walter et
al. 2007): another choice of normals than the kernel's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import erf

from pmviewer.kernels.scene import BECKMANN, BSDF_TABLE_SIZE, GGX
from pmviewer.scene.arrays.material_row import _coat

ACROSS, AROUND = 400, 200


def visible(cos, alpha, distribution):
    """G1 as the choice of visible normals has it: exactly."""
    if distribution == GGX:
        return shadowing(cos, alpha, distribution)
    x = cos / (alpha * max(np.sqrt(1 - cos * cos), 1e-9))
    return 1 / ((1 + erf(x)) / 2 + np.exp(-x * x) / (2 * x * np.sqrt(np.pi)))


def shadowing(cos, alpha, distribution):
    """G1, for Beckmann by Walter's fit."""
    tan = np.sqrt(np.maximum(1 - cos * cos, 0)) / np.maximum(np.abs(cos), 1e-9)
    if distribution == GGX:
        return 2 / (1 + np.sqrt(1 + (alpha * tan) ** 2))
    x = 1 / (alpha * np.maximum(tan, 1e-9))
    return np.where(x >= 1.6, 1.0, (3.535 * x + 2.181 * x**2) / (1 + 2.276 * x + 2.577 * x**2))


def fresnel(cos, eta):
    """eta is that of the other side over this side's."""
    sin2 = (1 - cos**2) / eta**2
    inside = np.sqrt(np.maximum(1 - sin2, 0))
    s = (cos - eta * inside) / np.maximum(cos + eta * inside, 1e-12)
    p = (eta * cos - inside) / np.maximum(eta * cos + inside, 1e-12)
    return np.where(sin2 >= 1, 1.0, (s**2 + p**2) / 2)


def reflected(cos, eta, alpha, distribution):
    """Share of light from that angle that the interface reflects, once."""
    u, v = (np.arange(ACROSS) + 0.5) / ACROSS, (np.arange(AROUND) + 0.5) / AROUND
    tan2 = -(alpha**2) * np.log1p(-u) if distribution == BECKMANN else alpha**2 * u / (1 - u)
    height = 1 / np.sqrt(1 + tan2)
    m_x = np.sqrt(1 - height**2)[:, None] * np.cos(np.pi * v)  # the other half mirrors it
    facing = m_x * np.sqrt(1 - cos**2) + height[:, None] * cos
    out = 2 * facing * height[:, None] - cos
    weight = fresnel(np.clip(facing, 0, 1), eta) * visible(cos, alpha, distribution)
    weight = weight * shadowing(out, alpha, distribution) * facing / (cos * height[:, None])
    return float(np.where((facing > 0) & (out > 0), weight, 0.0).mean())


@pytest.mark.parametrize(
    ("distribution", "alpha", "eta"), [(BECKMANN, 0.5, 1.97), (BECKMANN, 0.27, 1.5), (GGX, 0.05, 1.97), (GGX, 0.5, 1.5)]
)
def test_what_a_rough_coat_sends_back(distribution, alpha, eta):
    """With it albedos divide by one minus that: a thousandth too much brightens a room by half a percent."""
    cosines = np.arange(1, BSDF_TABLE_SIZE) / (BSDF_TABLE_SIZE - 1)
    expected = sum(2 * c * reflected(c, 1 / eta, alpha, distribution) for c in cosines) / BSDF_TABLE_SIZE
    assert _coat(alpha, alpha, float(distribution), eta)[1] == pytest.approx(expected, abs=3e-4)
