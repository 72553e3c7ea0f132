"""Every sampler against its density (χ²), every density and value against energy, reciprocity and the extremes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from pmviewer.scene.description import Material
from tests.support.bsdf_probe import EVERYTHING_FOLLOWED, EVERYTHING_STORED, FOLLOWED, STORED, Grid, Probe

N = 100_000
"""χ² over some 600 cells at p = 1e-4 finds densities that are wrong by 4 % (4 %² · N = 160 on 600 ± 35)."""
WHITE = (1.0, 1.0, 1.0)
GOLD = ((0.143, 0.375, 1.442), (3.983, 2.386, 1.603))


def rough_metal(alpha, distribution="ggx", metal=None):
    return Material(f"metal {alpha} {distribution}", "rough conductor", WHITE, alpha=alpha, distribution=distribution,
                    metal=metal)  # fmt: skip


def rough_glass(alpha, distribution="ggx", eta=1.5):
    return Material(f"glass {alpha} {distribution}", "rough dielectric", WHITE, WHITE, eta, alpha=alpha,
                    distribution=distribution)  # fmt: skip


def rough_plastic(alpha, distribution="ggx", reflectance=(0.6, 0.4, 0.2), nonlinear=False):
    return Material(f"plastic {alpha} {distribution} {nonlinear}", "rough plastic", reflectance, alpha=alpha,
                    distribution=distribution, nonlinear=nonlinear)  # fmt: skip


def schlick(factor):
    return Material(f"schlick {factor}", "schlick", WHITE, alpha=(factor**0.5,) * 2)


def ward(alpha, reflectance=(0.5, 0.4, 0.3), specular=(0.5, 0.5, 0.5)):
    return Material(f"ward {alpha} {specular}", "ward", reflectance, specular=specular, alpha=alpha)


BLACK_WARD = ward((0.2, 0.2), (0.0,) * 3, WHITE)
GLOSSY = [
    rough_metal((0.01, 0.01)),
    rough_metal((0.1, 0.1), metal=GOLD),
    rough_metal((0.05, 0.4)),
    rough_metal((1.0, 1.0)),
    rough_metal((0.01, 0.01), "beckmann"),
    rough_metal((0.1, 0.5), "beckmann", GOLD),
    rough_plastic((0.01, 0.01)),
    rough_plastic((0.2, 0.2), "beckmann", nonlinear=True),
    schlick(1.0),
    schlick(0.1),
    schlick(1e-4),
    ward((0.01, 0.01)),
    ward((0.1, 0.4)),
    BLACK_WARD,
]
GLASSES = [
    rough_glass((0.01, 0.01)),
    rough_glass((0.1, 0.1)),
    rough_glass((0.1, 0.4)),
    rough_glass((0.7, 0.7), eta=1 / 1.5),
    rough_glass((0.2, 0.2), "beckmann"),
]
SMOOTH = [
    Material("plastic", "plastic", (0.6, 0.4, 0.2)),
    Material("white plastic", "plastic", WHITE, nonlinear=True),
    Material("thin", "thin dielectric", WHITE, WHITE),
    Material("gold", "conductor", WHITE, metal=GOLD),
]
DIFFUSE = Material("diffuse", "diffuse", (0.6, 0.4, 0.2))
PAPER = Material("paper", "diffuse transmitter", (0.0,) * 3, (0.6, 0.4, 0.2), eta=1.0, alpha=(1.0, 1.0))
EXTREME = [
    *(rough_metal((a, a), d) for a in (0.0, 1e-3, 1.0) for d in ("ggx", "beckmann")),
    *(rough_glass((a, a), d) for a in (0.0, 1e-3, 1.0) for d in ("ggx", "beckmann")),
    *(rough_plastic((a, a)) for a in (0.0, 1.0)),
    *(schlick(a) for a in (0.0, 1e-6, 0.5)),
    *(ward((a, a)) for a in (0.0, 1e-3, 1.0)),
    rough_metal((1e-4, 1.0)),
]
ANGLES = (1.0, 0.5, 0.02)
"""Cosines of wo: normal to grazing."""


@pytest.fixture(scope="module")
def probe():
    return Probe([DIFFUSE, PAPER, *GLOSSY, *GLASSES, *SMOOTH, *EXTREME])


@pytest.fixture(scope="module")
def numbers():
    return np.random.default_rng(7).random((N, 3), np.float32)


def towards(cos, azimuth=0.4):
    sin = np.sqrt(1 - cos * cos)
    return np.array([sin * np.cos(azimuth), sin * np.sin(azimuth), cos])


def random_directions(seed, n=4000, both_sides=False):
    d = np.random.default_rng(seed).normal(size=(n, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    if not both_sides:
        d[:, 2] = np.abs(d[:, 2])
    return d.astype(np.float32)


def refracted(wo, eta):
    """Centre of the refraction lobe; along the surface beyond the critical angle."""
    eta = eta if wo[2] > 0 else 1 / eta
    across = -wo[:2] / eta
    sin2 = min(float(across @ across), 0.999)
    across *= np.sqrt(sin2 / max(float(across @ across), 1e-30))
    return np.array([*across, -np.sign(wo[2]) * np.sqrt(1 - sin2)])


def grids(material, wo):
    """Grids over the hemispheres that light may come from."""
    alpha = max(float(np.sqrt(material.alpha[0] * material.alpha[1])), 1e-3)
    width, cos = 2 * alpha, abs(float(wo[2]))
    mirrored = np.array([-wo[0], -wo[1], wo[2]])
    # A mirrored lobe is as narrow across as the view is flat.
    reflection = Grid(mirrored, width, width * max(cos, alpha), wo[2] < 0)
    if not material.transparent:
        return [reflection]
    eta = material.eta if wo[2] > 0 else 1 / material.eta
    # Half vectors of refraction lie on the horizon where z of wo + η·wi vanishes.
    return [reflection, Grid(refracted(wo, material.eta), width / 4, width / 4, wo[2] > 0, cos / eta)]


def group_of(material):
    return FOLLOWED if material.transparent else STORED


def sides(material):
    return [c * s for c in ANGLES for s in ((1, -1) if material.transparent else (1,))]


@pytest.mark.parametrize("material", [DIFFUSE, PAPER, *GLOSSY, *GLASSES], ids=lambda m: m.name)
def test_samples_follow_their_density_and_weigh_the_albedo(probe, numbers, material):
    """χ² of N samples; what falls below the surface is a cell of its own, with the probability that is left. A white
    furnace: their mean weight is the albedo by quadrature, and that is at most 1."""
    cosines = sides(material)
    for cos in cosines:
        wo = towards(cos)
        wi, weight, _, _ = probe.sample(material, group_of(material), wo, numbers)
        used = wi[weight.sum(1) > 0]
        counts, expected, whole_albedo = [], [], np.zeros(3)
        for grid in grids(material, wo):
            directions, solid = grid.quadrature()
            f, pdf, _ = probe.evaluate(material, group_of(material), wo, directions)
            expected.append(grid.sums(pdf * solid))
            counts.append(grid.counts(used))
            whole_albedo += reflected(f, directions, solid)
        counts, expected = np.concatenate(counts), np.concatenate(expected)
        whole = expected.sum()
        assert whole <= 1 + 1e-3
        counts = np.append(counts, N - len(used))
        expected = N * np.append(expected, max(0.0, 1 - whole))
        order = np.argsort(expected)
        # Cells of few expected samples are pooled.
        small = np.searchsorted(np.cumsum(expected[order]), 20.0) + 1
        head = order[:small]
        counts = np.append(counts[order[small:]], counts[head].sum())
        expected = np.append(expected[order[small:]], expected[head].sum())
        p = stats.chi2.sf(((counts - expected) ** 2 / np.maximum(expected, 1e-3)).sum(), len(counts) - 1)
        tests = sum(len(sides(m)) for m in (DIFFUSE, PAPER, *GLOSSY, *GLASSES))
        assert p > 0.01 / tests, (cos, p, whole)
        error = weight.std(0) / np.sqrt(len(weight))
        assert np.all(np.abs(weight.mean(0) - whole_albedo) < 5 * error + 2e-3), (cos, weight.mean(0), whole_albedo)
        assert whole_albedo.max() <= 1 + 1e-3, cos


def reflected(f, directions, solid):
    """Sum (3,) of f |cos| dω over a quadrature's directions."""
    return (f * (np.abs(directions[:, 2]) * solid)[:, None]).sum(0)


def albedo(probe, material, wo, group, glossy=EVERYTHING_STORED):
    """∫ f |cos| dω by quadrature."""
    total = np.zeros(3)
    for grid in grids(material, wo):
        directions, solid = grid.quadrature()
        f, _, _ = probe.evaluate(material, group, wo, directions, glossy)
        total += reflected(f, directions, solid)
    return total


def test_lossless_lobes_keep_nearly_everything(probe):
    """What single scattering loses vanishes with the roughness."""
    for material in (GLOSSY[0], GLASSES[0]):
        for cos in (1.0, 0.7, 0.2):
            assert albedo(probe, material, towards(cos), group_of(material)).min() > 0.99


@pytest.mark.parametrize("factor", [1.0, 0.5, 0.1, 1e-2, 1e-3, 1e-5])
def test_schlick_creates_no_energy(factor):
    material = schlick(factor)
    probe = Probe([material])
    for cos in (1.0, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4):
        assert albedo(probe, material, towards(cos), STORED).max() <= 1 + 2e-3, cos


def test_schlick_is_jensens_equation():
    """Equations 5 and 6 to the letter where their albedo does not exceed 1."""
    factor = 0.5
    material = schlick(factor)
    wo, wi = random_directions(1), random_directions(2)
    ok = (wo[:, 2] > 0.6) & (wi[:, 2] > 0.6)
    wo, wi = wo[ok].astype(float), wi[ok].astype(float)
    f, _, _ = Probe([material]).evaluate(material, STORED, wo, wi)
    v, w = wo[:, 2], wi[:, 2]
    G = v / (factor - factor * v + v) * w / (factor - factor * w + w)
    h = wo + wi
    t = h[:, 2] / np.linalg.norm(h, axis=1)
    jensen = (1 - G) / np.pi + G / (4 * np.pi * v * w) * factor / (1 + factor * t * t - t * t) ** 2
    assert f[:, 0] == pytest.approx(jensen, rel=1e-5)


def test_plastic_loses_nothing_when_white(probe):
    """Coat and base of a white plastic: what the coat does not reflect comes back from the base."""
    material = SMOOTH[1]
    for cos in ANGLES:
        wo = towards(cos)
        _, coat, _, _ = probe.sample(material, FOLLOWED, wo, [[0.5, 0.5, 0.5]])
        base = albedo(probe, material, wo, STORED)
        assert base + coat[0] == pytest.approx(np.ones(3), abs=2e-4)


@pytest.mark.parametrize("material", [DIFFUSE, PAPER, *GLOSSY, *GLASSES, SMOOTH[0]], ids=lambda m: m.name)
def test_reciprocity(probe, numbers, material):
    """f(wo, wi) = f(wi, wo), on refraction with radiance over η² instead of radiance."""
    wo = random_directions(3, both_sides=material.transparent)
    wi = random_directions(4, both_sides=material.transparent)
    sampled, weight, _, _ = probe.sample(material, group_of(material), wo, numbers[: len(wo)])
    wi[::2] = sampled[::2]
    good = (np.abs(wi[:, 2]) > 1e-3) & (np.abs(wo[:, 2]) > 1e-3) & (np.arange(len(wo)) % 2 + weight.sum(1) > 0)
    f, _, compression = probe.evaluate(material, group_of(material), wo[good], wi[good])
    back, _, again = probe.evaluate(material, group_of(material), wi[good], wo[good])
    # Radiance from a denser medium is η² times that outside: f·compression is to be equal up to the two η².
    left, right = f * np.sqrt(compression)[:, None], back * np.sqrt(again)[:, None]
    scale = np.maximum(np.abs(left), np.abs(right))
    assert (left.max(1) > 0).sum() > 100
    off = np.abs(left - right) / np.maximum(scale, 1e-4)
    assert np.quantile(off, 0.99) < 2e-3
    assert np.median(off) < 1e-5


@pytest.mark.parametrize("material", [DIFFUSE, PAPER, *GLOSSY, *GLASSES], ids=lambda m: m.name)
def test_weight_is_value_times_cosine_over_density(probe, numbers, material):
    """Also in a frame of its own, with a tangent that is neither unit nor orthogonal."""
    n = np.array([0.48, 0.6, 0.64], np.float32)
    probe.ng = probe.ns = n
    probe.tangent = np.array([2.0, 0.3, -1.0], np.float32)
    try:
        wo = random_directions(5, 20_000, True)
        if not material.transparent:
            wo = wo[wo @ n > 0]
        wi, weight, pdf, compression = probe.sample(material, group_of(material), wo, numbers[: len(wo)])
        kept = pdf > 0
        f, again, expected = probe.evaluate(material, group_of(material), wo[kept], wi[kept])
    finally:
        probe.ng = probe.ns = np.array([0, 0, 1], np.float32)
        probe.tangent = np.array([1, 0, 0], np.float32)
    assert np.all(weight[~kept] == 0)
    assert np.all(compression[kept] == expected)
    assert kept.mean() > 0.5
    right = np.abs(wi[kept] @ n) * f[:, 0]
    assert np.median(np.abs(again / pdf[kept] - 1)) < 2e-3
    # Rounding of directions matters in narrow lobes and at grazing angles alone.
    off = np.abs(weight[kept, 0] * again - right) / (weight[kept, 0] * again + 1e-6)
    assert np.quantile(off, 0.98) < 1e-3


def test_no_direction_gives_anything_but_a_finite_number(probe):
    """Normal, grazing, opposite and equal directions, and the corners of the unit cube."""
    tiny = 1e-7
    special = np.array(
        [[0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [1, 0, tiny], [1, 0, 1e-20], [-1, 0, 1e-4], [0.6, 0, 0.8],
         [-0.6, 0, 0.8], [tiny, 0, 1], [0, 0, -1], [0.6, 0, -0.8], [1, 0, -tiny]], np.float32
    )  # fmt: skip
    wo, wi = (x.reshape(-1, 3) for x in np.broadcast_arrays(special[:, None], special[None]))
    top = 1 - 2.0**-24
    cube = np.array([(a, b, c) for a in (0, 0.5, top) for b in (0, 0.5, top) for c in (0, 0.5, top)], np.float32)
    u, o = (x.reshape(-1, 3) for x in np.broadcast_arrays(cube[:, None], special[None]))
    for material in (*EXTREME, *GLOSSY, *GLASSES, *SMOOTH, DIFFUSE, PAPER):
        for group in (STORED, FOLLOWED):
            for glossy in (EVERYTHING_STORED, EVERYTHING_FOLLOWED):
                f, pdf, compression = probe.evaluate(material, group, wo, wi, glossy)
                d, weight, density, factor = probe.sample(material, group, o, u, glossy)
                for values in (f, pdf, compression, d, weight, density, factor):
                    assert np.isfinite(values).all(), (material.name, group)
                assert min(f.min(), pdf.min(), weight.min(), density.min()) >= 0, material.name
                assert np.abs(np.linalg.norm(d, axis=1) - 1).max() < 1e-3, material.name
        groups, share, rough_albedo, _ = probe.describe(material, special)
        assert np.isfinite(rough_albedo).all()
        assert np.all((share >= 0) & (share <= 1)), material.name
        assert groups.min() >= 0
