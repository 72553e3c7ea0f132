"""Warps by χ² and moments, and the vector functions they stand on."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from pmviewer.kernels import warp
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.vector import basis, from_basis, is_good, luminance, normalize

N = 100_000
CONE = np.float32(0.3)
"""1 − cos of the half angle of the cone that is tested."""


@kernel
def _warp_all(uv, disk, cosine, sphere, cone, narrow, triangle, one_minus_cos, tiny):
    for i in range(len(uv)):
        u, v = uv[i, 0], uv[i, 1]
        disk[i, 0], disk[i, 1] = warp.square_to_disk(u, v)
        cosine[i] = warp.square_to_cosine_hemisphere(u, v)
        sphere[i] = warp.square_to_sphere(u, v)
        cone[i] = warp.square_to_cone(u, v, one_minus_cos)
        narrow[i] = warp.square_to_cone(u, v, tiny)
        triangle[i, 0], triangle[i, 1] = warp.square_to_triangle(u, v)


@kernel
def _frames(normals, local, s, t, world):
    for i in range(len(normals)):
        n = (normals[i, 0], normals[i, 1], normals[i, 2])
        s[i], t[i] = basis(n)
        world[i] = from_basis(n, local[i, 0], local[i, 1], local[i, 2])


@kernel
def _colours(values, good, y, unit):
    for i in range(len(values)):
        c = (values[i, 0], values[i, 1], values[i, 2])
        good[i] = is_good(c)
        y[i] = luminance(c)
        unit[i] = normalize(c)


@pytest.fixture(scope="module")
def warped():
    uv = np.random.default_rng(1).random((N, 2), np.float32)
    uv[:9] = [(a, b) for a in (0, 0.5, 1 - 2**-24) for b in (0, 0.5, 1 - 2**-24)]  # corners and centre
    out = {name: np.empty((N, 2 if name in ("disk", "triangle") else 3), np.float32) for name in
           ("disk", "cosine", "sphere", "cone", "narrow", "triangle")}  # fmt: skip
    _warp_all(uv, *out.values(), CONE, np.float32(1e-9))
    return out


def uniform_p(values, bins=64):
    """p value of the hypothesis that values in [0, 1) are uniform."""
    return stats.chisquare(np.bincount(np.clip((values * bins).astype(int), 0, bins - 1), minlength=bins)).pvalue


def turn(points):
    return np.arctan2(points[:, 1], points[:, 0]) / (2 * math.pi) % 1.0


def test_disk(warped):
    points = warped["disk"].astype(float)
    r2 = (points**2).sum(1)
    assert r2.max() <= 1 + 1e-6
    assert uniform_p(r2) > 1e-3
    assert uniform_p(turn(points)) > 1e-3


def test_cosine_hemisphere(warped):
    d = warped["cosine"].astype(float)
    assert np.abs(np.linalg.norm(d, axis=1) - 1).max() < 1e-3  # at the horizon z is the root of a rounding error
    assert d[:, 2].min() >= 0
    assert uniform_p(d[:, 2] ** 2) > 1e-3  # the cosine law: cos² is uniform
    assert uniform_p(turn(d)) > 1e-3
    assert d[:, 2].mean() == pytest.approx(2 / 3, abs=5 * 0.236 / math.sqrt(N))


def test_sphere(warped):
    d = warped["sphere"].astype(float)
    assert np.abs(np.linalg.norm(d, axis=1) - 1).max() < 1e-6
    assert uniform_p((d[:, 2] + 1) / 2) > 1e-3
    assert uniform_p(turn(d)) > 1e-3
    assert np.abs(d.mean(0)).max() < 5 * 0.577 / math.sqrt(N)


def test_cone(warped):
    d = warped["cone"].astype(float)
    assert np.abs(np.linalg.norm(d, axis=1) - 1).max() < 1e-6
    assert d[:, 2].min() >= 1 - CONE - 1e-6
    assert uniform_p((1 - d[:, 2]) / CONE) > 1e-3
    assert uniform_p(turn(d)) > 1e-3


def test_narrow_cone_keeps_its_width(warped):
    """A cone of 1 − cos = 1e-9 is below float32's resolution of the cosine: sin² must still be uniform up to 2e-9."""
    d = warped["narrow"].astype(float)
    assert uniform_p((d[:, 0] ** 2 + d[:, 1] ** 2) / 2e-9) > 1e-3


def test_triangle(warped):
    b = warped["triangle"].astype(float)
    assert b.min() >= 0
    assert b.sum(1).max() <= 1 + 1e-6
    cells = np.histogram2d(b[:, 0], b[:, 1], 16, [[0, 1], [0, 1]])[0]
    inside = np.add.outer(np.arange(16), np.arange(16)) < 15  # cells wholly inside
    expected = N * 2 / 256
    chi2 = float(((cells[inside] - expected) ** 2 / expected).sum())
    assert stats.chi2.sf(chi2, inside.sum() - 1) > 1e-3
    assert np.abs(b.mean(0) - 1 / 3).max() < 5 * 0.236 / math.sqrt(N)


def test_frames_are_orthonormal_and_right_handed():
    generator = np.random.default_rng(2)
    normals = generator.normal(size=(5000, 3))
    special = np.vstack([np.eye(3), -np.eye(3), [[0, 1e-20, -1], [1e-6, 0, -1], [0, 0, -1 + 1e-7]]])
    normals = np.vstack([special, normals])
    normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    local = generator.normal(size=normals.shape).astype(np.float32)
    s, t, world = (np.empty_like(normals) for _ in range(3))
    _frames(normals, local, s, t, world)
    frame = np.stack([s, t, normals], axis=1).astype(float)
    assert np.abs(frame @ frame.transpose(0, 2, 1) - np.eye(3)).max() < 2e-6
    assert np.abs(np.linalg.det(frame) - 1).max() < 2e-6
    assert np.abs(world - np.einsum("nk,nkj->nj", local, frame)).max() < 1e-5


def test_colours():
    inf, nan = np.inf, np.nan
    values = np.array([[1, 2, 3], [0, 0, 0], [-1e-9, 0, 0], [nan, 1, 1], [1, nan, 1], [1, 1, nan], [inf, 0, 0],
                       [0, 0, -inf]], np.float32)  # fmt: skip
    good, y, unit = np.empty(len(values), np.bool_), np.empty(len(values), np.float32), np.empty_like(values)
    _colours(values, good, y, unit)
    assert good.tolist() == [True, True] + [False] * 6
    assert y[0] == pytest.approx(0.2126 + 2 * 0.7152 + 3 * 0.0722, rel=1e-6)
    assert unit[0] == pytest.approx(np.array([1, 2, 3]) / math.sqrt(14), rel=1e-6)
