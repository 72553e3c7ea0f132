"""The tree over virtual lights against a recursion in numpy, and what choosing by it leaves alone (R10)."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.stages.virtual_lights import virtual_dtype
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.memory import stack_i4
from pmviewer.maps.virtual_lights import COLUMNS, V_F, V_FIRST, V_LAMBERTIAN, V_N, V_P, V_PHI, V_Q, V_WI, W_F, W_G
from pmviewer.photons.virtual.tree import intensities, light_tree
from pmviewer.render.planes import CHANNELS, PLANES
from pmviewer.render.virtual_lights.descent import ALIKE, CUT, CUT_WORDS, LEAST, SMALL, ask_cut, descend
from pmviewer.settings.access import Virtual
from tests.support.scenes import diffuse_box, rendered, settings_of

UNWEIGHTED, SINGLE, EVERY = 0, 2, 4
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def lights(n, seed=1, colours=True):
    """Scattered in a cube, with normals any way round, on the side that photons came from."""
    rng = np.random.default_rng(seed)
    rows = np.zeros((n, COLUMNS), np.float32)
    rows[:, V_P : V_P + 3] = rng.uniform(-1, 1, (n, 3))
    normals = rng.normal(size=(n, 3))
    rows[:, V_N : V_N + 3] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    wi = rng.normal(size=(n, 3))
    rows[:, V_WI : V_WI + 3] = wi / np.linalg.norm(wi, axis=1, keepdims=True)
    rows[:, V_PHI : V_PHI + 3] = rng.lognormal(0, 1, (n, 3)) if colours else 1.0
    rows[:, V_F : V_F + 3] = rng.uniform(0.05, 0.3, (n, 3))
    rows[:, V_Q] = rng.lognormal(0, 1, n)
    rows[:, V_LAMBERTIAN] = 1.0
    return rows


def facing(rows):
    n, wi = (rows[:, at : at + 3].astype(np.float64) for at in (V_N, V_WI))
    return n * np.sign((n * wi).sum(axis=1))[:, None]


def record_of(rows, tree, m):
    record = np.zeros(1, virtual_dtype(Virtual(choice="light tree", per_pixel=m, number=max(len(rows), m + 1))))
    record[0]["n"], record[0]["tree"], record[0]["leaves"] = len(rows), tree.ctypes.data, len(tree) // 2
    return record


@kernel
def way(records, p, n, u):
    """A light and its probability, by the kernels' way down."""
    cut = stack_i4(CUT_WORDS)
    ask_cut(records[0], p, n, cut)
    return descend(records[0], p, n, cut, u)


def probabilities(rows, tree, intensity, p, n):
    """Of each light by going down all ways, with angles. A node's sphere and cone are those of the tree, checked here
    to hold its lights."""
    leaves, out = len(tree) // 2, np.zeros(len(rows))
    normals = facing(rows)

    def below(node):
        while node < leaves:
            first, last = node, node
            while first < leaves:
                first, last = 2 * first, 2 * last + 1
            return tree[first : last + 1, 10].astype(int)
        return tree[node : node + 1, 10].astype(int)

    def bound(node):
        row = tree[node].astype(np.float64)
        centre, axis, r, cone = row[0:3], row[3:6], row[6], np.arccos(np.clip(row[7], -1, 1))
        here = below(node)
        points = rows[here, V_P : V_P + 3].astype(np.float64)
        assert (np.linalg.norm(points - centre, axis=1) <= r * (1 + 1e-6) + 1e-6).all()
        assert (np.arccos(np.clip(normals[here] @ axis, -1, 1)) <= cone + 2e-3).all()
        if not row[9] > 0:
            return 0.0, False
        d = np.linalg.norm(centre - p)
        if d <= r:
            return row[9] / r**2, False
        w = (centre - p) / d
        covered = np.arcsin(r / d)
        y = max(np.arccos(np.clip(-w @ axis, -1, 1)) - cone, 0.0)
        y = max(y - covered, 0.0)
        x = max(np.arccos(np.clip(w @ n, -1, 1)) - covered, 0.0)
        alike = r / d < float(SMALL) and row[7] > float(ALIKE) and np.cos(y) > 0
        return row[9] * max(np.cos(y), 0) * max(np.cos(x), float(LEAST)) / d**2, alike

    def go(node, probability, alike):
        if node >= leaves:
            out[int(tree[node, 10])] += probability
            return
        if alike:
            pair = [(tree[child, 9], True) for child in (2 * node, 2 * node + 1)]
        else:
            pair = [bound(2 * node), bound(2 * node + 1)]
        for child, (one, here) in enumerate(pair):
            if one > 0:
                go(2 * node + child, probability * one / (pair[0][0] + pair[1][0]), here)

    first = min(CUT, leaves)  # all ways begin at the nodes of one level, by what they promise
    begin = [bound(node) for node in range(first, 2 * first)]
    for k, (one, alike) in enumerate(begin):
        if one > 0:
            go(first + k, one / sum(other for other, _ in begin), alike)
    return out


@pytest.mark.parametrize("n", [1, 5, 64, 200])
def test_ways_end_at_lights_with_the_probability_that_they_are_told(n):
    rows = lights(n)
    tree, intensity = light_tree(rows, UNWEIGHTED, 1.7), intensities(rows, UNWEIGHTED)
    record = record_of(rows, tree, 8)
    normal = np.array([0.0, 0.0, 1.0])
    for p in (np.array([0.1, -0.2, -1.2]), np.array([0.3, 0.3, 0.2])):
        expected = probabilities(rows, tree, intensity, p, normal)
        counted, told = np.zeros(n), np.zeros(n)
        ways = 2000
        for u in (np.arange(ways) + 0.5) / ways:
            j, probability = way(record, tuple(np.float32(p)), tuple(np.float32(normal)), np.float64(u))
            if j >= 0:
                counted[j] += 1 / ways
                told[j] = probability
        seen = counted > 0
        assert told[seen] == pytest.approx(expected[seen], rel=2e-3, abs=1e-6)
        assert counted == pytest.approx(expected, abs=1.5 / ways)
        facing_p = ((p - rows[:, V_P : V_P + 3]) * facing(rows)).sum(axis=1) > 1e-3
        assert (expected[facing_p] > 0).all(), "whatever may bring light may be chosen"


def test_lights_are_worth_what_they_scatter_and_what_they_weigh():
    rows = lights(50)
    brings = (rows[:, V_F : V_F + 3] * rows[:, V_PHI : V_PHI + 3]).astype(float) @ LUMINANCE
    assert intensities(rows, UNWEIGHTED) == pytest.approx(brings / brings.sum(), rel=1e-5)
    q = rows[:, V_Q].astype(float)
    assert intensities(rows, SINGLE) == pytest.approx(0.5 * brings / brings.sum() + 0.5 * q / q.sum(), rel=1e-5)
    rows[:25, V_FIRST] = 1.0
    q = np.where(rows[:, V_FIRST] != 0, q, q * (rows[:, V_F : V_F + 3].astype(float) @ LUMINANCE))
    assert intensities(rows, EVERY) == pytest.approx(0.5 * brings / brings.sum() + 0.5 * q / q.sum(), rel=1e-5)


def test_every_light_is_one_leaf_that_can_be_chosen():
    rows = lights(77)
    tree = light_tree(rows, UNWEIGHTED, 1.7)
    leaves = tree[128:]
    chosen = leaves[leaves[:, 9] > 0, 10].astype(int)
    assert sorted(chosen) == list(range(77))
    assert tree[1, 9] == pytest.approx(1.0, rel=1e-4)
    assert leaves[leaves[:, 9] > 0][:, :3] == pytest.approx(rows[chosen, V_P : V_P + 3], abs=1e-6)


def test_lights_in_one_place_without_power_make_a_tree():
    rows = lights(9)
    rows[:] = rows[0]
    rows[:, V_PHI : V_PHI + 3] = 0.0
    tree = light_tree(rows, UNWEIGHTED, 1.7)
    assert np.isfinite(tree).all()
    record = record_of(rows, tree, 4)
    p, n = tuple(np.float32([0.1, 0.2, 3.0])), tuple(np.float32([0, 0, -1]))
    for u in (0.0, 0.3, 1 - 1e-12):
        j, probability = way(record, p, n, np.float64(u))
        assert (j == -1 and probability == 0) or (0 <= j < 9 and 0 < probability <= 1)


@pytest.mark.parametrize("estimator", ["unweighted", "single step"])
def test_a_pixels_choice_leaves_the_mean_alone(estimator):
    """The same lights, all of them and 24 of 400 for each pixel: the means of ΣF and ΣG agree, and so does the
    picture."""

    def made(per_pixel, passes):
        how = {"number": 400, "photons": 2000, "estimator": estimator, "per_pixel": per_pixel, "walks": 16}
        how["choice"] = "light tree"
        settings = settings_of(render={"method": "virtual lights"}, photons={"renew": "once"}, virtual=how)
        return rendered(diffuse_box(size=12), settings, passes)

    whole, some = made(0, 8), made(24, 80)
    term = PLANES["indirect"].start + 1 if estimator == "unweighted" else CHANNELS + W_F + 1
    columns = [term] if estimator == "unweighted" else [term, CHANNELS + W_G]
    for column in columns:
        a, b = (
            renderer.film.sums[:, column].reshape(12, 12)[2:-2, 2:-2] / renderer.passes for renderer in (whole, some)
        )
        assert b.mean() == pytest.approx(a.mean(), rel=0.02)
        assert np.sqrt(((b / a - 1) ** 2).mean()) < 0.15
    a, b = (renderer.frame(0).image("indirect")[..., 1] for renderer in (whole, some))
    assert b.mean() == pytest.approx(a.mean(), rel=0.02)
    assert some.tally.shadow_rays < whole.tally.shadow_rays


def test_a_pixel_may_ask_for_more_lights_than_there_are():
    """An open scene may have fewer candidates: ways down the tree begin by chance all the same."""
    opened = open_scene(diffuse_box(size=4))
    assert opened.traits is not None
    how = {"number": 60, "per_pixel": 50, "photons": 100, "density": "virtual lights", "estimator": "unweighted"}
    how["choice"] = "light tree"
    settings = settings_of(render={"method": "virtual lights"}, virtual=how)
    renderer = rendered(diffuse_box(size=4), settings, 1)
    assert np.isfinite(renderer.frame(0).planes).all()
    assert renderer.latest.virtual.tree is not None


def test_the_tree_gives_the_same_picture_for_any_number_of_threads():
    how = {"number": 400, "photons": 2000, "estimator": "single step", "per_pixel": 24, "choice": "light tree"}
    settings = settings_of(render={"method": "virtual lights"}, virtual=how)
    one, three = (rendered(diffuse_box(size=12), settings, 2, threads) for threads in (1, 3))
    assert (one.film.sums == three.film.sums).all()


def test_without_the_tree_kernels_know_nothing_of_it():
    names = virtual_dtype(Virtual(choice="even", per_pixel=5)).names or ()
    assert not {"descent", "tree", "leaves"} & set(names)
    assert virtual_dtype(Virtual(choice="light tree")) == virtual_dtype(Virtual(choice="light tree", per_pixel=5)), (
        "a slider compiles nothing"
    )
