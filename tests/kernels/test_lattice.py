"""Numbers on lattices and their integrals along rays, against NumPy's trilinear interpolation and plain sums."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from pmviewer.kernels.media.lattice import line_of, value_at, walk
from pmviewer.kernels.scene import GRID_FIELDS
from pmviewer.scene.arrays.grids import grid_arrays
from pmviewer.scene.grid import Grid
from pmviewer.scene.medium import Medium

TO_WORLD = np.array([[2, 0.3, 0, -1], [0, 1.5, 0.2, -0.5], [0.1, 0, 1, 0.2], [0, 0, 0, 1.0]])
SIDES = np.array([12, 17, 9])


@pytest.fixture(scope="module")
def lattice():
    """Record, its arrays, and the numbers: half of them 0, so that blocks are empty."""
    values = np.random.default_rng(3).random((9, 17, 12, 1)).astype(np.float32) ** 4
    values[:, :9] = 0
    medium = Medium("m", density=Grid(values, TO_WORLD))
    arrays = {name: np.ascontiguousarray(array) for name, array in grid_arrays((medium,)).items()}
    record = np.zeros(1, np.dtype(GRID_FIELDS))
    for name, array in arrays.items():
        record[0][name] = array.ctypes.data
    return record, arrays, values[..., 0]


def interpolated(values, points):
    """At points (n, 3) of the world; 0 outside of the box."""
    u = np.linalg.solve(TO_WORLD[:3, :3], (points - TO_WORLD[:3, 3]).T).T
    x = u * SIDES - 0.5
    i = np.floor(x).astype(int)
    total = np.zeros(len(points))
    for corner in np.ndindex(2, 2, 2):
        j = np.clip(i + corner, 0, SIDES - 1)
        total += np.prod(np.where(corner, x - i, 1 - (x - i)), axis=1) * values[j[:, 2], j[:, 1], j[:, 0]]
    return np.where(((u >= 0) & (u <= 1)).all(axis=1), total, 0)


@njit
def asked(records, points, found, o, d, share, depths):
    scene = records[0]
    for i in range(len(points)):
        found[i] = value_at(scene, 0, (points[i, 0], points[i, 1], points[i, 2]), True)[0]
    for i in range(len(o)):
        line = line_of(scene, 0, (o[i, 0], o[i, 1], o[i, 2]), (d[i, 0], d[i, 1], d[i, 2]))
        whole = walk(scene, 0, line, 0.0, 50.0, 0, np.inf).depth[0]
        part = walk(scene, 0, line, 0.0, 50.0, 0, share * whole)
        depths[i, 0], depths[i, 1] = whole, part.t
        depths[i, 2] = walk(scene, 0, line, 0.0, part.t, 0, np.inf).depth[0]
        depths[i, 3] = part.stops


def test_values_and_depths_are_those_of_numpy(lattice):
    """Rays along axes and slanting, from inside and outside; where a share of the depth is reached, too."""
    record, _, values = lattice
    rng = np.random.default_rng(5)
    inside = (rng.random((400, 3)) @ TO_WORLD[:3, :3].T + TO_WORLD[:3, 3]).astype(np.float32)
    points = np.concatenate([inside, inside + np.float32(1.5)])
    o = np.concatenate([2 * rng.normal(size=(30, 3)), inside[:10]]).astype(np.float32)
    d = inside[20:60] - o
    d[:3] = np.eye(3)
    d[30:33] = -np.eye(3)
    d = (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)
    found, depths = np.zeros(len(points)), np.zeros((len(o), 4))
    asked(record, points, found, o, d, 0.37, depths)
    np.testing.assert_allclose(found, interpolated(values, points.astype(float)), atol=1e-6)
    n, far = 20_000, 12.0
    t = (np.arange(n) + 0.5) / n * far
    sums = [interpolated(values, a + t[:, None] * b).mean() * far for a, b in zip(o.astype(float), d)]
    np.testing.assert_allclose(depths[:, 0], sums, atol=2e-4)
    met = depths[:, 0] > 1e-3
    assert met.sum() > 10
    np.testing.assert_allclose(depths[met, 2], 0.37 * depths[met, 0], rtol=1e-5)
    assert depths[met, 3].all()
