"""Density control: the density asked for, all power kept, the same set in whatever rounds (I5)."""

import numpy as np
import pytest

from pmviewer.engine.pool import WorkPool
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.random import hash3, unit_float
from pmviewer.maps.density.control import NEAREST, Around, DensityControl
from pmviewer.maps.density.decide import COSINE, STEP
from pmviewer.maps.density.growing_tree import CAPACITY, M
from pmviewer.maps.record import decode_directions, unpack
from tests.maps.test_importance import _codes
from tests.support.naive_maps import pack

f4, f8, u4 = np.float32, np.float64, np.uint32
UP = u4(2047 << 20 | 2047 << 8)
"""Code of the direction (0, 0, 1)."""


def in_order(tasks):
    return [task() for task in tasks]


def plane(n, seed, height=0.0):
    """Photons (n, 6) of power 1 from above, anywhere in the unit square."""
    positions = np.random.default_rng(seed).random((n, 3))
    positions[:, 2] = height
    photons = pack(positions.astype(f4))
    assert np.all(unpack(photons[:1], 1.0)["Phi"] == 1)
    return photons


GUARDED = Around(True, 4.0)


def control(photons, required, rule=STEP, rounds=20_000, run=in_order, normals=None, seed=1, around=GUARDED):
    made = DensityControl(rule, around, seed)
    codes = np.full(len(photons), UP, u4) if normals is None else normals
    needed = np.broadcast_to(np.asarray(required, f4), len(photons))
    for i in range(0, len(photons), rounds):
        part = slice(i, i + rounds)
        made.add(photons[part], codes[part], needed[part], run)
    return made


def inner_density(places, margin=0.15):
    inner = np.all((places[:, :2] > margin) & (places[:, :2] < 1 - margin), axis=1)
    return np.count_nonzero(inner) / (1 - 2 * margin) ** 2


@kernel
def _uniform(seed, i):
    return unit_float(hash3(u4(seed), u4(i), u4(0)))


def naive(photons, normals, required, rule, seed=1):
    """Suykens and Willems's method in plain words: which photons are stored, and their powers (n, 3)."""
    said = unpack(photons, 1.0)
    kept, powers = [], []
    for i, (p, n, Phi) in enumerate(zip(said["position"].astype(f8), normals, said["Phi"].astype(f8), strict=True)):
        if len(kept) >= 20:
            d2 = ((said["position"][kept].astype(f8) - p) ** 2).sum(axis=1)
            nearest = np.argsort(d2)[:20]
            rho = 20 / (np.pi * d2[nearest[-1]]) / required[i]
            accepted = rho < 1 if rule == STEP else rho < 2 and _uniform(seed, i) < 0.5 * (1 + np.cos(np.pi * rho / 2))
            sharing = [j for j in nearest if said["wi"][kept[j]] @ n > 0]
            if not accepted and sharing:
                for j in sharing:
                    powers[j] = powers[j] + Phi / len(sharing)
                continue
        kept.append(i)
        powers.append(Phi)
    return kept, np.array(powers)


def around_a_wall(n, seed):
    """Photons on both sides of a wall of no thickness, twice as many above, with the codes of their normals."""
    photons, up = plane(n, seed), np.random.default_rng(seed).random(n) < 2 / 3
    photons.view(u4)[~up, 3] = _code(-1.0)
    photons.view(u4)[~up, 4] = 0  # blue alone
    return photons, np.where(up, UP, _code(-1.0)).astype(u4), np.where(up, 1.0, -1.0)[:, None] * [0.0, 0.0, 1.0]


@pytest.mark.parametrize("rule", [STEP, COSINE])
def test_nearest_is_the_sources_method_photon_by_photon(rule):
    photons, codes, normals = around_a_wall(4000, 20)
    required = np.where(photons[:, 0] < 0.5, 300, 1200).astype(f4)
    kept, powers = naive(photons, normals, required, rule)
    made = control(photons, required, rule, rounds=1, normals=codes, around=NEAREST).result()
    np.testing.assert_array_equal(made.photons[:, :3], photons[kept, :3])
    np.testing.assert_allclose(made.powers, powers, rtol=1e-6)
    assert 400 < len(kept) < 2500
    assert powers.max() > 4


@pytest.mark.extensive
@pytest.mark.parametrize("rule", [STEP, COSINE])
def test_density_settles_as_by_the_plain_method(rule):
    """By the step at 1.3, by the cosine at 2.2 times what is required, as the settings say."""
    photons = plane(20_000, 1)
    kept, _ = naive(photons, np.tile([0.0, 0.0, 1.0], (len(photons), 1)), np.full(len(photons), 700.0), rule)
    wanted = inner_density(photons[kept]) / 700
    assert wanted == pytest.approx({STEP: 1.3, COSINE: 2.2}[rule], rel=0.12)
    for around in (NEAREST, GUARDED):
        made = control(photons, 700, rule, around=around).result()
        assert inner_density(made.photons) / 700 == pytest.approx(wanted, rel=0.02)


def test_density_follows_a_requirement_that_varies():
    photons = plane(200_000, 2)
    required = np.where(photons[:, 0] < 0.5, 800, 4000).astype(f4)
    places = control(photons, required).result().photons[:, :2]
    found = []
    for first in (0.1, 0.6):
        inside = (places[:, 0] > first) & (places[:, 0] < first + 0.3) & (abs(places[:, 1] - 0.5) < 0.4)
        found.append(np.count_nonzero(inside) / 0.24)
    assert found[1] / found[0] == pytest.approx(5, rel=0.08)


@pytest.mark.parametrize("rule", [STEP, COSINE])
def test_all_power_is_kept(rule):
    made = control(plane(50_000, 3), 1000, rule)
    result = made.result()
    assert result.powers.sum() == pytest.approx(3 * 50_000, rel=1e-9)
    assert made.stored + result.redistributed == made.arrived == 50_000
    assert len(result.normals) == len(result.photons) == made.stored < 6000


def test_photons_are_all_stored_where_more_are_required():
    made = control(plane(500, 4), 1e9)
    assert (made.stored, made.redistributed) == (500, 0)
    assert np.all(made.result().powers == 1)


def naive_step(photons, required):
    """Which of photons from above on a plane are stored, one after another."""
    kept = []
    reach2 = M / (np.pi * required)
    for i, p in enumerate(photons[:, :3].astype(f8)):
        near = ((photons[kept, :3].astype(f8) - p) ** 2).sum(axis=1) < reach2
        if np.count_nonzero(near) < M:
            kept.append(i)
    return kept


@pytest.mark.parametrize("rounds", [1, 137, 3000])
def test_stored_set_is_that_of_one_photon_after_another(rounds):
    photons = plane(3000, 5)
    places = control(photons, 600, rounds=rounds).result().photons
    np.testing.assert_array_equal(places[:, :3], photons[naive_step(photons, 600), :3])


def on_many_surfaces(n, seed):
    """Photons on a floor, a wall, a slope and a ball, from all over their sides; normals, and densities required that
    differ a thousandfold."""
    rng = np.random.default_rng(seed)
    at, of = rng.random((n, 3)), np.arange(n) % 4
    at[of == 0, 2], at[of == 1, 0] = 0, 0
    at[of == 2, 2] = 0.5 * at[of == 2, 0]
    ball = rng.normal(size=(np.count_nonzero(of == 3), 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    at[of == 3] = [0.5, 0.5, 0.4] + 0.2 * ball
    normals = np.array([[0, 0, 1], [1, 0, 0], [-0.4472136, 0, 0.8944272], [0, 0, 0]])[of]
    normals[of == 3] = ball
    photons, codes = pack(at.astype(f4)), np.empty(n, u4)
    _codes(normals.astype(f4), codes)
    from_side = normals + 0.9 * rng.uniform(-1, 1, (n, 3))
    from_side /= np.linalg.norm(from_side, axis=1)[:, None]
    _codes(from_side.astype(f4), photons.view(u4)[:, 3])
    photons.view(u4)[:, 4:] = 47 << 10
    return photons, codes, (100 * 1000 ** at[:, 1]).astype(f4)


def naive_guarded(photons, normals, required):
    """Which photons are stored by the step and guarded neighbours, one after another."""
    wi, places = unpack(photons, 1.0)["wi"].astype(f8), photons[:, :3].astype(f8)
    kept = np.zeros(len(photons), int)
    n_kept, (at, onto, wanted) = 0, (np.empty_like(x) for x in (places, wi, required))
    for i, n in enumerate(normals):
        off = at[:n_kept] - places[i]
        counted = np.maximum((off**2).sum(axis=1), 25 * (off @ n) ** 2)
        near = (counted < M / (np.pi * required[i])) & (onto[:n_kept] @ n > 0) & (wanted[:n_kept] <= 4 * required[i])
        if np.count_nonzero(near) < M:
            kept[n_kept], at[n_kept], onto[n_kept], wanted[n_kept] = i, places[i], wi[i], required[i]
            n_kept += 1
    return kept[:n_kept]


@pytest.fixture(scope="module")
def many_surfaces():
    """`on_many_surfaces` of 10,000 photons, and which of them are stored by plain searches."""
    photons, codes, required = on_many_surfaces(10_000, 30)
    return photons, codes, required, naive_guarded(photons, decode_directions(codes).astype(f8), required)


@pytest.mark.parametrize("rounds", [2500, 10_000])
def test_stored_set_on_many_surfaces_is_that_of_plain_searches(rounds, many_surfaces):
    """Whether photons look for neighbours alone or many together."""
    photons, codes, required, kept = many_surfaces
    made = control(photons, required, rounds=rounds, normals=codes)
    np.testing.assert_array_equal(made.result().photons[:, :3], photons[kept, :3])
    assert 0.2 < len(kept) / len(photons) < 0.8


def test_groups_of_a_round_follow_one_another_as_they_lie():
    """From one to the next it is hardly farther than leaves are wide, wherever in the tree leaves were split."""
    made = DensityControl(STEP, GUARDED, 1)
    photons, codes = plane(20_000, 12), np.full(20_000, UP, u4)
    made.add(photons, codes, np.full(20_000, 2000, f4), in_order)
    groups = made.groups(photons, codes, in_order)
    middles = np.array([photons[chosen, :2].mean(axis=0) for chosen in np.split(groups.order, groups.starts[1:-1])])
    assert len(middles) > 100
    wide = np.sqrt(1 / len(middles))
    assert np.median(np.linalg.norm(np.diff(middles, axis=0), axis=1)) < 2 * wide
    np.testing.assert_array_equal(np.sort(groups.order), np.arange(20_000))


def test_threads_do_not_matter():
    photons = plane(60_000, 6)
    pool = WorkPool(3)
    try:
        many = control(photons, 1500, COSINE, run=pool.run).result()
    finally:
        pool.close()
    one = control(photons, 1500, COSINE).result()
    np.testing.assert_array_equal(many.photons.view(u4), one.photons.view(u4))
    np.testing.assert_array_equal(many.powers, one.powers)


def test_sides_of_a_surface_are_apart():
    """As many photons from below change nothing above, and no power crosses."""
    above, below = plane(20_000, 7), plane(20_000, 8)
    below.view(u4)[:, 3] = _code(-1.0)
    below.view(u4)[:, 4] = 0  # blue alone
    photons = np.empty((40_000, 6), f4)
    photons[::2], photons[1::2] = above, below
    normals = np.where(np.arange(40_000) % 2 == 0, UP, _code(-1.0)).astype(u4)
    result = control(photons, 1000, normals=normals).result()
    from_above = unpack(result.photons, 1.0)["wi"][:, 2] > 0
    alone = control(above, 1000, rounds=10_000).result()
    np.testing.assert_array_equal(result.photons[from_above, :3], alone.photons[:, :3])
    assert result.powers[from_above].sum() == pytest.approx(60_000)
    differing = np.any(abs(result.powers[from_above] - alone.powers) > 1e-9, axis=1)
    assert np.count_nonzero(differing) < 10  # neighbours equally far share by chance
    assert result.powers[~from_above, 0].sum() == 0


def _code(z):
    from pmviewer.maps.photon_words import encode_direction

    @kernel
    def encode(z):
        return encode_direction(f4(0.0), f4(0.0), z)

    return u4(encode(f4(z)))


def test_power_does_not_seep_into_more_important_places():
    """Photons in a place that needs little, beside one that needs a hundred times more, as behind a thin wall."""
    important, other = plane(40_000, 9), plane(40_000, 10)
    other[:, 0] -= 1
    other.view(u4)[:, 5] = 0  # red and green alone
    important.view(u4)[:, 4] = 0  # blue alone
    photons = np.concatenate([important, other])
    required = np.where(photons[:, 0] > 0, 5000, 50).astype(f4)
    result = control(photons, required).result()
    received = result.powers[result.photons[:, 0] > 0]
    assert received[:, 0].sum() == 0
    assert result.powers[:, 0].sum() == pytest.approx(40_000)


@pytest.mark.parametrize("required", [0.0, -1.0, np.nan, np.inf, 1e-30])
@pytest.mark.parametrize("rule", [STEP, COSINE])
@pytest.mark.parametrize("around", [NEAREST, GUARDED])
def test_any_requirement_is_survived(required, rule, around):
    made = control(plane(5000, 11), required, rule, around=around)
    powers = made.result().powers
    assert np.isfinite(powers).all()
    assert powers.sum() == pytest.approx(15_000)
    assert 0 < made.stored <= 5000


def test_photons_in_one_place():
    photons = plane(2000, 12)
    photons[:, :3] = 0.25
    made = control(photons, 1000.0)
    assert made.stored == M
    assert M > CAPACITY  # a leaf was split that no plane can part
    assert made.result().powers.sum() == pytest.approx(6000)


def test_no_photons():
    made = control(np.empty((0, 6), f4), 10.0)
    result = made.result()
    assert made.stored == 0
    assert result.photons.shape == (0, 6)
    assert result.powers.shape == (0, 3)
