"""What a shading normal does to photons: the bounds on single photons cost next to nothing in the mean."""

import numpy as np
import pytest

from pmviewer.kernels.bsdf.plain import STORED, PlainBsdf
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.surface import adjoint_cosines
from pmviewer.maps.estimate.glossy import reflected_share


@kernel
def _adjoint(ng, ns, wi, wo, out):
    n, s = (ng[0], ng[1], ng[2]), (ns[0], ns[1], ns[2])
    for i in range(len(wi)):
        out[i] = adjoint_cosines(s, n, (wi[i, 0], wi[i, 1], wi[i, 2]), (wo[i, 0], wo[i, 1], wo[i, 2]))


@kernel
def _shares(ng, ns, wi, out):
    n, s = (ng[0], ng[1], ng[2]), (ns[0], ns[1], ns[2])
    one = np.float32(1)
    b = PlainBsdf(STORED, (one, one, one), 0, s, s)
    for i in range(len(wi)):
        out[i] = reflected_share(b, STORED, n, n, (wi[i, 0], wi[i, 1], wi[i, 2]))[0]


def cosine_directions(n, count, generator):
    """(count, 3) unit vectors with density cos/π around n."""
    v = generator.normal(size=(count, 3))
    v = v / np.linalg.norm(v, axis=1, keepdims=True) + n
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.fixture(scope="module")
def normals():
    angle = 0.6
    return np.array([0, 0, 1.0]), np.array([np.sin(angle), 0, np.cos(angle)])


def test_no_light_is_lost_at_grazing_photons(normals):
    """Photons of a uniform sky arrive with density |ng·wi|; the estimate is ∫ f·(ns·wi) over the sky above both
    normals, which is known in closed form: (1 + cos angle)/2 for albedo 1, the overlap of two hemispheres."""
    ng, ns = normals
    wi = cosine_directions(ng, 4_000_000, np.random.default_rng(1)).astype(np.float32)
    share = np.empty(len(wi), np.float32)
    _shares(ng.astype(np.float32), ns.astype(np.float32), wi, share)
    mean = np.pi * share.mean(dtype=np.float64)  # f = 1/π
    expected = (1 + ns[2]) / 2
    print(f"{mean:.5f}, closed form {expected:.5f}")
    assert mean == pytest.approx(expected, rel=1e-3)


def test_no_light_is_lost_at_grazing_scatterings(normals):
    """Weights of photons that arrive with density |ng·wi|/π and leave with |ns·wo|/π (albedo 1), both above both
    normals, add up to ∫∫ |ns·wi|·|ng·wo|/π²: the square of the overlap. Sampled by the latter density, each counts 1
    unless it is bounded."""
    ng, ns = normals
    generator = np.random.default_rng(2)
    wi, wo = cosine_directions(ns, 1_000_000, generator), cosine_directions(ng, 1_000_000, generator)
    weight = np.empty(len(wi), np.float32)
    _adjoint(*(v.astype(np.float32) for v in (ng, ns, wi, wo)), weight)
    there, here = (wi @ ng) * (wo @ ns), (wi @ ns) * (wo @ ng)
    mean = np.where((wi @ ng > 0) & (wo @ ns > 0), weight * there / here, 0).mean(dtype=np.float64)
    expected = ((1 + ns[2]) / 2) ** 2
    print(f"{mean:.5f}, closed form {expected:.5f}")
    assert mean == pytest.approx(expected, rel=1e-3)
