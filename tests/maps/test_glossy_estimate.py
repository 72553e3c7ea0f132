"""Reflected radiance with a BSDF: Lambertian surfaces agree with the irradiance estimate, tilted ones with the sum."""

import numpy as np
import pytest
from numba import njit

from pmviewer.kernels.bsdf.plain import STORED, PlainBsdf
from pmviewer.maps.estimate.estimate import irradiance_at_knn, irradiance_at_radius
from pmviewer.maps.estimate.filters import FILTERS, Filter
from pmviewer.maps.estimate.glossy import GRAZING, radiance_knn, radiance_radius
from pmviewer.maps.estimate.nearest import Neighbours
from pmviewer.maps.record import unpack
from pmviewer.maps.search.grid import build_grid
from pmviewer.maps.search.kdtree import build_kdtree
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.render.record import EYE_DTYPE
from tests.support import naive_maps as naive

f4, i4 = np.float32, np.int32
ANY = np.uint32(0)
ALBEDO = (f4(0.8), f4(0.5), f4(0.25))


def _estimate(**fields) -> np.ndarray:
    eye = np.zeros(1, EYE_DTYPE)
    for name, value in {"cone_k": 1.1, "share": 1, **fields}.items():
        eye[name] = value
    return eye


@njit
def _radius(records, eyes, p, n, ns, radius, out):
    for i in range(len(p)):
        facing = (ns[i, 0], ns[i, 1], ns[i, 2])
        b = PlainBsdf(STORED, ALBEDO, 0, facing, facing)
        normal = (n[i, 0], n[i, 1], n[i, 2])
        point = (p[i, 0], p[i, 1], p[i, 2])
        out[i] = radiance_radius(records[0], eyes[0], radius, point, normal, i4(ALL_CLASSES), b, STORED, ANY, normal)


def _by_radius(records, p, n, ns, radius, flatness, kind, out):
    _radius(records, _estimate(flatness=flatness, filter=kind), p, n, ns, radius, out)


@njit
def _knn(records, eyes, p, n, ns, radius, out):
    for i in range(len(p)):
        facing = (ns[i, 0], ns[i, 1], ns[i, 2])
        b = PlainBsdf(STORED, ALBEDO, 0, facing, facing)
        normal = (n[i, 0], n[i, 1], n[i, 2])
        point = (p[i, 0], p[i, 1], p[i, 2])
        out[i], _ = radiance_knn(records[0], eyes[0], radius, point, normal, i4(ALL_CLASSES), b, STORED, ANY, normal)


def _by_knn(records, p, n, ns, k, radius, flatness, kind, rim, out):
    _knn(records, _estimate(flatness=flatness, filter=kind, k=k, rim=rim), p, n, ns, radius, out)


@pytest.fixture(scope="module")
def cloud():
    rng = np.random.default_rng(4)
    n = 5000
    wi = rng.normal(size=(n, 3))
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    photons = naive.pack(naive.clustered(n, 5), wi, rng.uniform(0, 1, (n, 3)), rng.integers(0, 256, n))
    points = naive.clustered(40, 6)
    normals = rng.normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return photons, points.astype(f4), normals.astype(f4)


@pytest.mark.parametrize("kind", [FILTERS.index("constant"), FILTERS.index("cone")])
def test_lambertian_within_a_radius_is_irradiance_times_albedo_over_pi(cloud, kind):
    photons, points, normals = cloud
    grid = build_grid(photons, 0.2, power_unit=2.0)
    L, E, counts = np.empty((40, 3), f4), np.empty((40, 3), f4), np.empty(40, i4)
    _by_radius(grid.record, points, normals, normals, f4(0.2), f4(0.5), i4(kind), L)
    weighting = Filter(i4(kind), f4(1.1))
    irradiance_at_radius(grid.record, points, normals, f4(0.2), f4(0.5), i4(ALL_CLASSES), weighting, 0, 40, E, counts)
    assert counts.sum() > 50
    np.testing.assert_allclose(L, E * np.array(ALBEDO) / np.pi, rtol=2e-4, atol=1e-7)


def test_lambertian_from_the_nearest_is_irradiance_times_albedo_over_pi(cloud):
    photons, points, normals = cloud
    tree = build_kdtree(photons, power_unit=2.0)
    L, E = np.empty((40, 3), f4), np.empty((40, 3), f4)
    counts, radii = np.empty(40, i4), np.empty(40, f4)
    kind, rim = i4(FILTERS.index("simpson")), i4(1)
    _by_knn(tree.record, points, normals, normals, i4(30), f4(1.0), f4(0.5), kind, rim, L)
    irradiance_at_knn(
        tree.record,
        points,
        normals,
        Neighbours(i4(30), f4(1.0), rim, f4(1.0)),
        f4(0.5),
        i4(ALL_CLASSES),
        Filter(kind, f4(1.1)),
        0,
        40,
        E,
        counts,
        radii,
    )
    np.testing.assert_allclose(L, E * np.array(ALBEDO) / np.pi, rtol=2e-4, atol=1e-7)


def test_a_tilted_shading_normal_weighs_each_photon_by_its_cosines(cloud):
    photons, points, normals = cloud
    tilted = normals + 0.4 * np.roll(normals, 1, axis=1)
    tilted = (tilted / np.linalg.norm(tilted, axis=1, keepdims=True)).astype(f4)
    grid = build_grid(photons, 0.2, power_unit=1.0)
    L = np.empty((40, 3), f4)
    _by_radius(grid.record, points, normals, tilted, f4(0.2), f4(1.0), i4(0), L)
    known = unpack(photons, 1.0)
    for i in range(40):
        offset = known["position"] - points[i]
        front = known["wi"] @ normals[i]
        shading = known["wi"] @ tilted[i]
        near = (
            (np.linalg.norm(offset, axis=1) < 0.2)
            & naive.arriving(photons, points[i], normals[i], 0.2 / 2048)
            & (shading > 0)
        )
        quotient = shading[near] / np.maximum(front[near], np.minimum(GRAZING, shading[near]))
        expected = (known["Phi"][near] * quotient[:, None]).sum(0) * np.array(ALBEDO) / np.pi / (np.pi * 0.2**2)
        np.testing.assert_allclose(L[i], expected, rtol=2e-3, atol=1e-6)
