"""Mirror and glass against the textbook: Fresnel, Snell, energy, reciprocity, compression of radiance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.kernels.bsdf.plain import FOLLOWED, NOTHING, plain_bsdf
from pmviewer.kernels.bsdf.specular import fresnel_dielectric, scatter_specular
from pmviewer.kernels.compile.jit import kernel
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Material
from tests.support.scenes import GLASS, MIRROR, diffuse, diffuse_box

ETA = 1.5
TINTED = Material("tinted", "dielectric", (0.9, 0.8, 0.7), (0.6, 0.5, 0.4), eta=1.33)
ONE_SIDED = Material("one-sided mirror", "conductor", (0.9, 0.8, 0.7))
THIN_SIDE = Material("bubble", "dielectric", (1, 1, 1), (1, 1, 1), eta=1 / 1.5)
MATERIALS = [diffuse(), GLASS, MIRROR, TINTED, ONE_SIDED, THIN_SIDE]


@kernel
def _fresnel_many(cosines, eta, reflectance, cos_t):
    for i in range(len(cosines)):
        reflectance[i], cos_t[i] = fresnel_dielectric(cosines[i], eta)


@kernel
def _scatter_many(scenes, material, normals, directions, u, out, weights, compression):
    for i in range(len(directions)):
        n = (normals[i, 0], normals[i, 1], normals[i, 2])
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        out[i], weights[i], compression[i] = scatter_specular(scenes[0], material, n, d, u[i])


@pytest.fixture(scope="module")
def flat():
    return flatten(replace(diffuse_box(), materials=tuple(MATERIALS)))


def fresnel(cosines, eta):
    cosines = np.asarray(cosines, np.float32)
    reflectance, cos_t = np.empty_like(cosines), np.empty_like(cosines)
    _fresnel_many(cosines, np.float32(eta), reflectance, cos_t)
    return reflectance.astype(float), cos_t.astype(float)


def scatter(flat, material, normals, directions, u):
    n = len(directions)
    normals = np.array(np.broadcast_to(normals, (n, 3)), np.float32, order="C")
    out, weights, compression = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32), np.empty(n, np.float32)
    u = np.array(np.broadcast_to(u, n), np.float32)
    directions = np.ascontiguousarray(directions, np.float32)
    _scatter_many(flat.record, MATERIALS.index(material), normals, directions, u, out, weights, compression)
    return out.astype(float), weights.astype(float), compression.astype(float)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def textbook(cos_i, eta):
    """Fresnel's equations by angles, in float64."""
    theta_i = np.arccos(cos_i)
    sin_t = np.sin(theta_i) / eta
    total = sin_t >= 1
    theta_t = np.arcsin(np.where(total, 0.5, sin_t))
    with np.errstate(invalid="ignore", divide="ignore"):
        s = (np.sin(theta_i - theta_t) / np.sin(theta_i + theta_t)) ** 2
        p = (np.tan(theta_i - theta_t) / np.tan(theta_i + theta_t)) ** 2
    return np.where(total, 1.0, (s + p) / 2), np.where(total, 0.0, np.cos(theta_t))


@pytest.mark.parametrize("eta", [1.5, 1 / 1.5, 1.33, 2.4, 1.0001])
def test_fresnel_is_the_textbooks(eta):
    cosines = np.float32(np.linspace(0.02, 0.999, 400))
    critical = np.sqrt(max(0.0, 1 - eta * eta))
    cosines = cosines[np.abs(cosines - critical) > 1e-3]
    ours, cos_t = fresnel(cosines, eta)
    expected, expected_cos = textbook(cosines.astype(float), float(np.float32(eta)))
    assert np.abs(ours - expected).max() < 2e-5
    assert np.abs(cos_t - expected_cos).max() < 2e-4


def test_fresnel_at_the_landmarks():
    normal, cos_t = fresnel([1.0], ETA)
    assert normal[0] == pytest.approx(0.04, abs=1e-7)
    assert cos_t[0] == 1.0
    brewster = np.cos(np.arctan(ETA))
    at_brewster, _ = fresnel([brewster], ETA)
    assert at_brewster[0] == pytest.approx(0.5 * ((ETA**2 - 1) / (ETA**2 + 1)) ** 2, abs=1e-6)  # s light alone
    grazing, _ = fresnel([0.0, 1e-4], ETA)
    assert grazing[0] == pytest.approx(1.0, abs=1e-6)
    assert grazing[1] == pytest.approx(1.0, abs=2e-3)
    critical = np.sqrt(1 - 1 / ETA**2)
    total, cos_t = fresnel([critical - 1e-3, 0.1, 0.0], 1 / ETA)
    assert np.all(total == 1.0)
    assert np.all(cos_t == 0.0)


def test_mirror_reflects(flat):
    generator = np.random.default_rng(1)
    n, d = unit(generator.normal(size=(500, 3))), unit(generator.normal(size=(500, 3)))
    out, weights, compression = scatter(flat, MIRROR, n, d, 0.3)
    assert np.abs(out - (d - 2 * (d * n).sum(1, keepdims=True) * n)).max() < 1e-6
    assert np.all(weights == 1.0)
    assert np.all(compression == 1.0)


@kernel
def _groups_seen_from(scenes, material, ng, ns, wo, groups, normals):
    for i in range(len(wo)):
        n, s, w = (ng[i, 0], ng[i, 1], ng[i, 2]), (ns[i, 0], ns[i, 1], ns[i, 2]), (wo[i, 0], wo[i, 1], wo[i, 2])
        b = plain_bsdf(scenes[0], material, n, s, w)
        groups[i] = b.groups
        normals[i] = b.n


def seen_from(flat, material, ng, ns, wo):
    """Groups (n,) and normals (n, 3) of a material with those normals from directions wo (n, 3)."""
    ng, ns, wo = (np.ascontiguousarray(v, np.float32) for v in np.broadcast_arrays(ng, ns, wo))
    groups, normals = np.empty(len(wo), np.int32), np.empty((len(wo), 3), np.float32)
    _groups_seen_from(flat.record, MATERIALS.index(material), ng, ns, wo, groups, normals)
    return groups, normals.astype(float)


def test_back_of_a_one_sided_mirror_absorbs(flat):
    """Which side that is the geometric normal says, however the shading normal leans."""
    n, leaning = np.array([0.0, 0, 1]), unit(np.array([0.9, 0, 0.3]))
    front = unit(np.array([[0.3, 0.1, 1.0], [-1.0, 0.0, 0.05]]))
    for ns in (n, leaning):
        assert list(seen_from(flat, ONE_SIDED, n, ns, front)[0]) == [FOLLOWED, FOLLOWED]
        assert list(seen_from(flat, ONE_SIDED, n, ns, -front)[0]) == [NOTHING, NOTHING]
        assert list(seen_from(flat, MIRROR, n, ns, -front)[0]) == [FOLLOWED, FOLLOWED]


def test_mirrors_reflect_to_the_side_they_are_seen_from(flat):
    generator = np.random.default_rng(2)
    ng, wo = unit(generator.normal(size=(2000, 3))), unit(generator.normal(size=(2000, 3)))
    ns = unit(ng + generator.normal(scale=0.7, size=(2000, 3)))
    ns *= np.sign((ns * ng).sum(1))[:, None]
    groups, n = seen_from(flat, MIRROR, ng, ns, wo)
    assert np.all(groups == FOLLOWED)
    wi, weights, _ = scatter(flat, MIRROR, n, -wo, 0.5)
    assert np.all((wi * ng).sum(1) * (wo * ng).sum(1) > 0)
    assert np.all(weights == 1)
    # Where the shading normal's own mirror image is above the surface, it stays.
    facing, towards = ng * np.sign((ng * wo).sum(1))[:, None], ns * np.sign((ng * wo).sum(1))[:, None]
    image = 2 * (wo * towards).sum(1)[:, None] * towards - wo
    clear = ((image * facing).sum(1) > 0.02) & ((wo * towards).sum(1) > 0.02)
    assert 500 < clear.sum() < 2000
    assert np.abs(wi - image)[clear].max() < 1e-5


@pytest.mark.parametrize("material", [GLASS, TINTED, THIN_SIDE], ids=lambda m: m.name)
def test_glass_obeys_snell_and_fresnel(flat, material):
    """Both branches, from both sides: directions, probabilities, weights and compression."""
    generator = np.random.default_rng(2)
    n, d = unit(generator.normal(size=(2000, 3))), unit(generator.normal(size=(2000, 3)))
    cos_d = -(n * d).sum(1)
    eta = np.where(cos_d > 0, material.eta, 1 / material.eta)
    R, _ = textbook(np.abs(cos_d), eta)

    reflected, weights, compression = scatter(flat, material, n, d, 0.0)
    assert np.abs(reflected - (d + 2 * cos_d[:, None] * n)).max() < 1e-5
    assert weights == pytest.approx(np.broadcast_to(material.reflectance, weights.shape))
    assert np.all(compression == 1.0)

    below, above = R - 1e-3, R + 1e-3
    chosen = (above < 1) & (below > 0)
    just_reflected = scatter(flat, material, n[chosen], d[chosen], below[chosen])[0]
    side = np.sign(cos_d[chosen])
    assert np.all((just_reflected * n[chosen]).sum(1) * side > 0)
    bent, weights, compression = scatter(flat, material, n[chosen], d[chosen], above[chosen])
    assert np.all((bent * n[chosen]).sum(1) * side < 0)
    assert np.abs(np.linalg.norm(bent, axis=1) - 1).max() < 1e-6
    tangential = bent + ((-bent * n[chosen]).sum(1, keepdims=True)) * n[chosen]
    before = d[chosen] + cos_d[chosen, None] * n[chosen]
    assert np.abs(tangential - before / eta[chosen, None]).max() < 2e-5  # Snell, and in one plane
    assert weights == pytest.approx(np.broadcast_to(material.transmittance, weights.shape))
    assert compression == pytest.approx(1 / eta[chosen] ** 2, rel=1e-6)

    total = R >= 1
    if total.any():
        inside = scatter(flat, material, n[total], d[total], 0.999999)[0]
        assert np.all((inside * n[total]).sum(1) * np.sign(cos_d[total]) > 0)


def test_glass_is_reciprocal(flat):
    """Going back along a refracted ray: the same Fresnel transmittance, the direction it came from, and compressions
    whose product is 1, as radiance over η² is an invariant."""
    generator = np.random.default_rng(3)
    d = unit(generator.normal(size=(1000, 3)) + [0, 0, -1.5])
    d = d[d[:, 2] < -0.05]
    n = np.array([0.0, 0, 1])
    bent, _, compression = scatter(flat, GLASS, n, d, 0.99999)
    went_in = bent[:, 2] < 0
    assert went_in.all()
    back, _, compression_back = scatter(flat, GLASS, n, -bent, 0.99999)
    assert np.abs(back + d).max() < 1e-5
    assert compression * compression_back == pytest.approx(np.ones(len(d)), rel=1e-5)
    outside, _ = fresnel(-d[:, 2], ETA)
    inside, _ = fresnel(-bent[:, 2], 1 / ETA)
    assert np.abs(outside - inside).max() < 2e-5
