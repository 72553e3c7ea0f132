"""Which lobes a material has and to which group they belong; smooth lobes, sides, metals and absorption."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.kernels.bsdf.fresnel import fresnel_channel
from pmviewer.kernels.bsdf.material import beer_lambert, interior_attenuation
from pmviewer.kernels.bsdf.specular import scatter_specular
from pmviewer.kernels.compile.jit import kernel
from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.arrays.material_row import inner_reflectance
from pmviewer.scene.description import Group, Instance, Material, Shape, Sphere
from tests.support.bsdf_probe import EVERYTHING_STORED, FOLLOWED, STORED, Probe
from tests.support.scenes import diffuse_box

WHITE = (1.0, 1.0, 1.0)
BOTH = STORED | FOLLOWED
DIFFUSE = Material("diffuse", "diffuse", (0.5, 0.4, 0.3))
MIRROR = Material("mirror", "conductor", (0.9, 0.8, 0.7), two_sided=True)
GLASS = Material("glass", "dielectric", (0.9, 0.8, 0.7), (0.6, 0.5, 0.4), absorption=(0.5, 1.0, 2.0))
THIN = Material("thin", "thin dielectric", WHITE, (0.6, 0.5, 0.4))
ROUGH = Material("rough", "rough dielectric", WHITE, WHITE, alpha=(0.3, 0.3))
PLASTIC = Material("plastic", "plastic", (0.5, 0.5, 0.5))
METAL = Material("metal", "rough conductor", WHITE, alpha=(0.1, 0.4))
COAT = Material("coat", "rough plastic", (0.5, 0.5, 0.5), alpha=(0.2, 0.2))
COAT_ALONE = Material("coat alone", "rough plastic", (0.0,) * 3, alpha=(0.2, 0.2))
SCHLICK = Material("schlick", "schlick", alpha=(0.5, 0.5), two_sided=True)
WARD = Material("ward", "ward", (0.4, 0.4, 0.4), specular=(0.5, 0.5, 0.5), alpha=(0.3, 0.2))
BLACK = Material("black", "diffuse", (0.0,) * 3)
MATERIALS = [DIFFUSE, MIRROR, GLASS, THIN, ROUGH, PLASTIC, METAL, COAT, COAT_ALONE, SCHLICK, WARD, BLACK]
UP = np.array([[0.0, 0.6, 0.8]], np.float32)


@kernel
def _fresnel(cosines, eta, k, out):
    for i in range(len(cosines)):
        out[i] = fresnel_channel(cosines[i], eta, k)


@kernel
def _absorb(scenes, material, distance, out):
    inside, outside = (np.float32(0), np.float32(0), np.float32(1)), (np.float32(0), np.float32(0), np.float32(-1))
    one = (np.float32(1), np.float32(2), np.float32(3))
    rows = (
        beer_lambert(scenes[0], material, distance),
        interior_attenuation(scenes[0], material, inside, inside, distance, one),
        interior_attenuation(scenes[0], material, outside, inside, distance, one),
    )
    for j in range(3):
        for c in range(3):
            out[j, c] = rows[j][c]


@kernel
def _specular(scenes, material, wo, u, wi, weight, compression):
    n = (np.float32(0), np.float32(0), np.float32(1))
    for k in range(len(wo)):
        d = (-wo[k, 0], -wo[k, 1], -wo[k, 2])
        wi[k], weight[k], compression[k] = scatter_specular(scenes[0], material, n, d, u[k, 0])


@pytest.fixture(scope="module")
def probe():
    return Probe(MATERIALS)


@pytest.mark.parametrize(
    ("material", "glossy", "groups", "delta"),
    [
        (DIFFUSE, 0.5, STORED, False),
        (MIRROR, 0.0, FOLLOWED, True),
        (GLASS, 0.0, FOLLOWED, True),
        (THIN, 0.0, FOLLOWED, True),
        (ROUGH, 0.0, FOLLOWED, False),
        (PLASTIC, 0.0, BOTH, True),
        (METAL, 0.1, STORED, False),
        (METAL, 0.11, FOLLOWED, False),
        (COAT, 0.2, STORED, False),
        (COAT, 0.3, BOTH, False),
        (COAT_ALONE, 0.2, STORED, False),
        (COAT_ALONE, 0.3, FOLLOWED, False),
        (SCHLICK, 0.6, BOTH, False),
        (WARD, 0.25, BOTH, False),
        (BLACK, 0.0, 0, False),
    ],
)
def test_groups(probe, material, glossy, groups, delta):
    found, share, _, flags = probe.describe(material, UP, np.float32(glossy))
    assert found[0] == groups
    assert flags[0, 0] == delta
    assert flags[0, 1] == (material.kind == "diffuse")
    assert flags[0, 2] == material.transparent
    assert (0.05 <= share[0] <= 0.95) if groups == BOTH else (share[0] == (groups == FOLLOWED))


def test_lobes_of_both_groups_add_up(probe):
    """What is stored and what is followed at one `glossy` is what is stored at another."""
    generator = np.random.default_rng(1)
    wi = np.abs(generator.normal(size=(200, 3)))
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    for material in (COAT, SCHLICK, WARD):
        parts = [probe.evaluate(material, g, UP, wi, np.float32(0.9))[0] for g in (STORED, FOLLOWED)]
        whole = probe.evaluate(material, STORED, UP, wi)[0]
        assert parts[0] + parts[1] == pytest.approx(whole, rel=1e-5)
        assert min(p.max() for p in parts) > 0


def test_backs(probe):
    """One-sided materials are black from behind, two-sided ones alike from both sides, glass has an inside."""
    for material in MATERIALS:
        groups = probe.describe(material, np.concatenate([UP, -UP]))[0]
        assert groups[1] == (groups[0] if material.two_sided or material.transparent else 0), material.name
    front = probe.evaluate(SCHLICK, STORED, UP, UP)[0]
    assert front.min() > 0
    assert probe.evaluate(SCHLICK, STORED, -UP, -UP)[0] == pytest.approx(front)
    assert np.all(probe.evaluate(SCHLICK, STORED, UP, -UP)[0] == 0)


def test_shading_normal_that_looks_away_does_not_blacken(probe):
    """At silhouettes of smooth meshes glossy lobes fall back on the geometry's normal."""
    probe.ns = np.array([0.0, -0.8, 0.6], np.float32)
    try:
        wo = np.array([[0.0, 0.995, 0.0998]], np.float32)
        weight = probe.sample(METAL, STORED, wo, [[0.5, 0.5, 0.5]])[1]
    finally:
        probe.ns = probe.ng
    assert weight.min() > 0


@pytest.mark.parametrize("material", [GLASS, MIRROR], ids=lambda m: m.name)
def test_smooth_lobes_are_those_of_simple_scenes(probe, material):
    generator = np.random.default_rng(2)
    wo = generator.normal(size=(2000, 3)).astype(np.float32)
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    u = generator.random((len(wo), 3), np.float32)
    wi, weight, pdf, compression = probe.sample(material, FOLLOWED, wo, u)
    expected_wi, expected_weight, expected = np.empty_like(wo), np.empty_like(wo), np.empty(len(wo), np.float32)
    _specular(probe.record, probe.index(material), wo, u, expected_wi, expected_weight, expected)
    assert np.all(pdf == 0)
    assert np.abs(wi - expected_wi).max() < 1e-6
    assert weight == pytest.approx(expected_weight)
    assert compression == pytest.approx(expected)


def test_thin_glass_goes_straight_on(probe):
    """Both faces with all reflections between them: R = 2F/(1 + F), at normal incidence 0.0769 for index 1.5."""
    wo = np.repeat(np.array([[0, 0, 1]], np.float32), 2, axis=0)
    wi, weight, _, compression = probe.sample(THIN, FOLLOWED, wo, [[0.0768, 0, 0], [0.0770, 0, 0]])
    assert wi[:, 2].tolist() == [1.0, -1.0]
    assert weight[1] == pytest.approx(THIN.transmittance)
    assert compression.tolist() == [1.0, 1.0]
    slanted = probe.sample(THIN, FOLLOWED, UP, [[0.9, 0, 0]])[0]
    assert slanted == pytest.approx(-UP)


@pytest.mark.parametrize("index", [(0.143, 3.983), (1.5, 0.0), (2.0, 0.1), (4.37, 5.2), (0.0, 1.0), (0.0, 0.0)])
def test_metals_reflect_as_complex_fresnel_says(index):
    cosines = np.linspace(0.0, 1.0, 201, dtype=np.float32)
    out = np.empty_like(cosines)
    _fresnel(cosines, np.float32(index[0]), np.float32(index[1]), out)
    cos, n = cosines.astype(float), complex(*index)
    inside = np.sqrt(n * n - (1 - cos**2) + 0j)
    with np.errstate(invalid="ignore"):
        s, p = (cos - inside) / (cos + inside), (n * n * cos - inside) / (n * n * cos + inside)
    expected = np.where(np.isfinite(p), (np.abs(s) ** 2 + np.abs(p) ** 2) / 2, 1.0)
    assert np.abs(out - expected).max() < 2e-5


def test_diffuse_light_under_a_smooth_coat():
    """The known 59.6 % for index 1.5, and the exact link between both sides: (1 − R_inside)·η² = 1 − R_outside."""
    assert inner_reflectance(1.5) == pytest.approx(0.5964, abs=1e-3)
    for eta in (1.1, 1.5, 2.4):
        cos = (np.arange(200_000) + 0.5) / 200_000
        inside = np.sqrt(1 - (1 - cos**2) / eta**2)
        s, p = (cos - eta * inside) / (cos + eta * inside), (eta * cos - inside) / (eta * cos + inside)
        outside = ((s**2 + p**2) * cos).mean()
        assert (1 - inner_reflectance(eta)) * eta**2 == pytest.approx(1 - outside, rel=1e-6)


def test_absorption_inside_glass(probe):
    """Beer–Lambert on rays that arrive from inside, and only on those."""
    out = np.empty((3, 3), np.float32)
    _absorb(probe.record, probe.index(GLASS), np.float32(0.7), out)
    expected = np.exp(-0.7 * np.array(GLASS.absorption))
    assert out[0] == pytest.approx(expected, rel=1e-6)
    assert out[1] == pytest.approx(expected * [1, 2, 3], rel=1e-6)
    assert out[2].tolist() == [1, 2, 3]
    _absorb(probe.record, probe.index(PLASTIC), np.float32(0.7), out)
    assert out[1].tolist() == [1, 2, 3]


def test_anisotropy_follows_the_tangent(probe):
    """The lobe is narrow along the tangent, wide across it."""
    u = np.random.default_rng(3).random((20_000, 3), np.float32)
    up = np.array([[0, 0, 1]], np.float32)
    along = probe.sample(METAL, STORED, up, u, EVERYTHING_STORED)[0]
    assert along[:, 1].std() > 2 * along[:, 0].std()
    probe.tangent = np.array([0, 2, 0], np.float32)
    try:
        turned = probe.sample(METAL, STORED, up, u, EVERYTHING_STORED)[0]
    finally:
        probe.tangent = np.array([1, 0, 0], np.float32)
    assert turned[:, 0].std() > 2 * turned[:, 1].std()


def test_a_material_only_instances_have_makes_a_scene_rich():
    box = diffuse_box()
    group = Group("balls", (Shape("ball", Sphere((0, 0, 0), 0.1), len(box.materials)),))
    scene = replace(box, materials=(*box.materials, COAT), instances=(Instance("one", group, np.eye(4)),))
    assert analyse(scene).rich
    assert analyse(scene).glossy_roughness == (0.2,)
    assert flatten(scene).record.dtype.fields["bsdfs"]
    assert not analyse(box).rich
    assert "bsdfs" not in flatten(box).record.dtype.fields


def test_traits_depend_on_what_counts_as_glossy():
    box = diffuse_box()
    scene = replace(box, materials=(METAL,) * len(box.materials))
    traits = analyse(scene)
    assert (traits.has_specular, traits.has_diffuse) == (False, False)
    assert (traits.follows(0.1), traits.stores(0.1)) == (False, True)
    assert (traits.follows(0.2), traits.stores(0.2)) == (True, False)
