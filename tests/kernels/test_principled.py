"""Principled materials against Mitsuba's own values, and their samplers against their densities."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Material, Principled
from tests.support.bsdf_probe import EVERYTHING_FOLLOWED, EVERYTHING_STORED, FOLLOWED, STORED, Grid, PrincipledProbe
from tests.support.scenes import diffuse_box

EXPECTED = json.loads(Path(__file__).with_name("principled").joinpath("expected.json").read_text("utf-8"))["materials"]
N = 100_000
"""χ² over some 600 cells at p = 1e-4 finds densities that are wrong by 4 % (4 %² · N = 160 on 600 ± 35)."""
WHITE = (1.0, 1.0, 1.0)
BOTH = STORED | FOLLOWED
OF_PRINCIPLED = ("metallic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness", "clearcoat")


def material_of(values, name):
    """A material by Mitsuba's parameters, whose defaults are the plugin's."""
    aspect = np.sqrt(1 - 0.9 * values.get("anisotropic", 0.0))
    alpha = values.get("roughness", 0.5) ** 2
    eta = values.get("eta", 2 / (1 - np.sqrt(0.08 * values.get("specular", 0.5))) - 1)
    numbers = {key: values[key] for key in (*OF_PRINCIPLED, "clearcoat_gloss") if key in values}
    colour = tuple(values["base_color"])
    pair = (float(alpha / aspect), float(alpha * aspect))
    return Material(name, "principled", colour, eta=float(eta), alpha=pair, principled=Principled(**numbers))


RECORDED = [material_of(values, f"m{i}") for i, values in enumerate(EXPECTED)]
DIFFUSE = Material("diffuse", "diffuse", (0.6, 0.4, 0.2))
METAL = Material("metal", "principled", WHITE, alpha=(0.1, 0.1), principled=Principled(metallic=1.0))
LAYERS = Material("layers", "principled", (0.8, 0.5, 0.3), alpha=(0.3, 0.1),
                  principled=Principled(0.2, 0.0, 0.3, 0.5, 0.5, 0.3, 1.0, 0.3))  # fmt: skip
FROSTED = Material("frosted", "principled", WHITE, alpha=(0.3, 0.3), principled=Principled(spec_trans=1.0))
HALF_CLEAR = Material("half clear", "principled", (0.8, 0.5, 0.3), alpha=(0.25, 0.25),
                      principled=Principled(spec_trans=0.6, clearcoat=0.5))  # fmt: skip
ROUGH = Material("rough", "principled", (0.8, 0.5, 0.3), alpha=(1.0, 1.0), principled=Principled(sheen=1.0))
SMOOTH = Material("smooth", "principled", WHITE, alpha=(0.0, 0.0),
                  principled=Principled(spec_trans=0.5, clearcoat=1.0, clearcoat_gloss=1.0))  # fmt: skip
BLACK = Material("black", "principled", (0.0,) * 3, eta=1.0, alpha=(0.3, 0.3))
OWN = [METAL, LAYERS, FROSTED, HALF_CLEAR, ROUGH]
ANGLES = (1.0, 0.5, 0.05)


def clear(material):
    return material.principled is not None and material.principled.spec_trans > 0


@pytest.fixture(scope="module")
def probe():
    two_sided = replace(LAYERS, name="both sides", two_sided=True)
    return PrincipledProbe([DIFFUSE, *OWN, SMOOTH, BLACK, two_sided, *RECORDED])


@pytest.fixture(scope="module")
def numbers():
    return np.random.default_rng(3).random((N, 3), np.float32)


@pytest.mark.parametrize("index", range(len(EXPECTED)))
def test_values_are_mitsubas(probe, index):
    """Of both groups together; on refraction with the compression that Mitsuba's radiance has."""
    rows = np.array(EXPECTED[index]["pairs"])
    wo, wi, expected = rows[:, :3], rows[:, 3:6], rows[:, 6:]
    for glossy in (EVERYTHING_STORED, EVERYTHING_FOLLOWED, np.float32(0.2)):
        found = 0.0
        for group in (STORED, FOLLOWED):
            f, _, compression = probe.evaluate(RECORDED[index], group, wo, wi, glossy)
            found = found + f * compression[:, None]
        assert found == pytest.approx(expected, rel=2e-3, abs=1e-5), glossy
    assert expected.max() > 0.01


def towards(cos, azimuth=0.4):
    sin = np.sqrt(1 - cos * cos)
    return np.array([sin * np.cos(azimuth), sin * np.sin(azimuth), cos])


def grids(material, wo):
    alpha = max(float(np.sqrt(material.alpha[0] * material.alpha[1])), 1e-3)
    if material.principled.clearcoat > 0:
        alpha = min(alpha, 0.07)
    width, cos = 2 * alpha, abs(float(wo[2]))
    mirrored = np.array([-wo[0], -wo[1], wo[2]])
    found = [Grid(mirrored, width, width * max(cos, alpha), wo[2] < 0)]
    if clear(material):
        eta = material.eta if wo[2] > 0 else 1 / material.eta
        across = -wo[:2] / eta
        across *= np.sqrt(min(float(across @ across), 0.999) / max(float(across @ across), 1e-30))
        centre = np.array([*across, -np.sign(wo[2]) * np.sqrt(1 - across @ across)])
        found.append(Grid(centre, width / 4, width / 4, wo[2] > 0, cos / eta))
    return found


def cases():
    for material in OWN:
        for glossy in (EVERYTHING_STORED, EVERYTHING_FOLLOWED):
            for group in (STORED, FOLLOWED):
                yield material, glossy, group


CASES = list(cases())


@pytest.mark.parametrize(
    ("material", "glossy", "group"), CASES, ids=[f"{m.name}-{g:g}-{'SF'[i - 1]}" for m, g, i in CASES]
)
def test_samples_follow_their_density_and_weigh_the_albedo(probe, numbers, material, glossy, group):
    """χ² of the directions, and the mean weight against quadrature, per group and view."""
    for cos in (c * s for c in ANGLES for s in ((1, -1) if clear(material) else (1,))):
        wo = towards(cos)
        if probe.describe(material, [wo], glossy)[0][0] & group == 0:
            wi, weight, _, _ = probe.sample(material, group, wo, numbers[:100], glossy)
            assert not weight.any()
            continue
        wi, weight, _, _ = probe.sample(material, group, wo, numbers, glossy)
        used = wi[weight.sum(1) > 0]
        counts, expected, albedo = [], [], np.zeros(3)
        for grid in grids(material, wo):
            directions, solid = grid.quadrature()
            f, pdf, _ = probe.evaluate(material, group, wo, directions, glossy)
            expected.append(grid.sums(pdf * solid))
            counts.append(grid.counts(used))
            albedo += (f * (np.abs(directions[:, 2]) * solid)[:, None]).sum(0)
        counts, expected = np.concatenate(counts), np.concatenate(expected)
        whole = expected.sum()
        assert whole <= 1 + 1e-3
        counts = np.append(counts, N - len(used))
        expected = N * np.append(expected, max(0.0, 1 - whole))
        order = np.argsort(expected)
        small = np.searchsorted(np.cumsum(expected[order]), 20.0) + 1
        head = order[:small]
        counts = np.append(counts[order[small:]], counts[head].sum())
        expected = np.append(expected[order[small:]], expected[head].sum())
        p = stats.chi2.sf(((counts - expected) ** 2 / np.maximum(expected, 1e-3)).sum(), len(counts) - 1)
        assert p > 1e-4, (cos, p, whole)
        error = weight.std(0) / np.sqrt(len(weight))
        assert np.all(np.abs(weight.mean(0) - albedo) < 5 * error + 2e-3), (cos, weight.mean(0), albedo)


def total_albedo(probe, material, wo):
    total = np.zeros(3)
    for group in (STORED, FOLLOWED):
        for grid in grids(material, wo):
            directions, solid = grid.quadrature()
            f, _, _ = probe.evaluate(material, group, wo, directions)
            total += (f * (np.abs(directions[:, 2]) * solid)[:, None]).sum(0)
    return total


def test_white_furnace(probe):
    """White metal and white frosted glass give back nearly all that they receive and no more; of the others no channel
    gives more than the sum of lobes allows by Burley's own account (some 20 % at grazing angles)."""
    for cos in ANGLES[:2]:
        assert 0.95 < total_albedo(probe, METAL, towards(cos)).min() <= 1 + 1e-3
        assert total_albedo(probe, METAL, towards(cos)).max() <= 1 + 1e-3
        assert 0.9 < total_albedo(probe, FROSTED, towards(cos)).min() <= 1 + 1e-3
        assert total_albedo(probe, FROSTED, towards(-cos)).max() <= 1 + 1e-3
        assert total_albedo(probe, LAYERS, towards(cos)).max() < 1.2


@pytest.mark.parametrize("material", OWN, ids=lambda m: m.name)
def test_reciprocity(probe, numbers, material):
    """f(wo, wi) = f(wi, wo), on refraction with radiance over η² instead of radiance."""
    random = np.random.default_rng(4)
    wo, wi = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in random.normal(size=(2, 3000, 3)))
    if not clear(material):
        wo[:, 2], wi[:, 2] = abs(wo[:, 2]), abs(wi[:, 2])
    good = (np.abs(wo[:, 2]) > 0.01) & (np.abs(wi[:, 2]) > 0.01)
    wo, wi = wo[good], wi[good]
    there = back = 0.0
    for group in (STORED, FOLLOWED):
        f, _, compression = probe.evaluate(material, group, wo, wi)
        g, _, again = probe.evaluate(material, group, wi, wo)
        there, back = there + f * np.sqrt(compression)[:, None], back + g * np.sqrt(again)[:, None]
    off = np.abs(there - back) / np.maximum(np.maximum(there, back), 1e-4)
    assert (there.max(1) > 0).sum() > 100
    assert np.quantile(off, 0.99) < 2e-3
    assert np.median(off) < 1e-5


@pytest.mark.parametrize(
    ("material", "glossy", "front", "back"),
    [
        (METAL, 0.1, STORED, 0),
        (METAL, 0.11, FOLLOWED, 0),
        (LAYERS, 0.2, BOTH, 0),
        (LAYERS, 0.0, STORED, 0),
        (FROSTED, 0.2, BOTH, FOLLOWED),
        (FROSTED, 0.4, FOLLOWED, FOLLOWED),
        (HALF_CLEAR, 0.2, BOTH, FOLLOWED),
        (BLACK, 0.2, 0, 0),
    ],
)
def test_groups(probe, material, glossy, front, back):
    up = np.array([[0.0, 0.6, 0.8], [0.0, 0.6, -0.8]], np.float32)
    groups, share, albedo, flags = probe.describe(material, up, np.float32(glossy))
    assert groups.tolist() == [front, back]
    assert not flags[:, :2].any()
    assert flags[0, 2] == clear(material)
    assert (0.05 <= share[0] <= 0.95) if front == BOTH else (share[0] == (front == FOLLOWED))
    assert albedo.min() >= 0
    assert albedo.max() <= 1


def test_two_sided_and_other_kinds(probe):
    """The back of a two-sided one is its front; a diffuse material beside principled ones is what it is alone."""
    up = np.array([[0.0, 0.6, 0.8]], np.float32)
    both = replace(LAYERS, name="both sides", two_sided=True)
    front = probe.evaluate(both, STORED, up, up)[0]
    assert front.min() > 0
    assert probe.evaluate(both, STORED, -up, -up)[0] == pytest.approx(front)
    f, pdf, _ = probe.evaluate(DIFFUSE, STORED, up, up)
    assert f[0] == pytest.approx(np.array(DIFFUSE.reflectance) / np.pi)
    assert pdf[0] == pytest.approx(0.8 / np.pi)
    assert probe.describe(DIFFUSE, up)[3][0].tolist() == [False, True, False]


def test_no_direction_gives_anything_but_a_finite_number(probe):
    tiny = 1e-7
    special = np.array(
        [[0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [1, 0, tiny], [1, 0, 1e-20], [-1, 0, 1e-4], [0.6, 0, 0.8],
         [-0.6, 0, 0.8], [tiny, 0, 1], [0, 0, -1], [0.6, 0, -0.8], [1, 0, -tiny]], np.float32
    )  # fmt: skip
    wo, wi = (x.reshape(-1, 3) for x in np.broadcast_arrays(special[:, None], special[None]))
    top = 1 - 2.0**-24
    cube = np.array([(a, b, c) for a in (0, 0.5, top) for b in (0, 0.5, top) for c in (0, 0.5, top)], np.float32)
    u, o = (x.reshape(-1, 3) for x in np.broadcast_arrays(cube[:, None], special[None]))
    for material in (*OWN, SMOOTH, BLACK):
        for group in (STORED, FOLLOWED):
            for glossy in (EVERYTHING_STORED, EVERYTHING_FOLLOWED):
                f, pdf, compression = probe.evaluate(material, group, wo, wi, glossy)
                d, weight, density, factor = probe.sample(material, group, o, u, glossy)
                for values in (f, pdf, compression, d, weight, density, factor):
                    assert np.isfinite(values).all(), (material.name, group)
                assert min(f.min(), pdf.min(), weight.min(), density.min()) >= 0, material.name
                assert np.abs(np.linalg.norm(d, axis=1) - 1).max() < 1e-3, material.name


def test_traits_and_record():
    """What a scene with such materials needs, and that others are not compiled for it."""

    def traits(material):
        return analyse(replace(diffuse_box(), materials=(material,)))

    assert traits(METAL).glossy_roughness == (0.1,)
    assert (traits(METAL).has_diffuse, traits(METAL).has_specular) == (False, False)
    layers = traits(LAYERS)
    assert layers.glossy_roughness == pytest.approx((0.0703, 0.1))
    assert (layers.has_diffuse, layers.has_specular, layers.has_delta) == (True, False, False)
    frosted = traits(FROSTED)
    assert (frosted.has_diffuse, frosted.has_specular, frosted.has_rough_glass) == (False, True, True)
    assert traits(BLACK).glossy_roughness == ()
    box = diffuse_box()
    assert flatten(replace(box, materials=(METAL,))).record.dtype.fields["principled"]
    assert "principled" not in flatten(replace(box, materials=(*box.materials, METAL))).record.dtype.fields
