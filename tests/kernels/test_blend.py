"""Blends: the number that chooses a part, the probabilities of parts, and what photons are kept for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pmviewer.errors import SceneError
from pmviewer.kernels.bsdf.blend import chosen_part, hit_number, inside_attenuation
from pmviewer.kernels.bsdf.scattering import bsdf_at, keeps
from pmviewer.kernels.compile.jit import kernel
from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.blends import DEEPEST
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.arrays.material_row import material_table
from pmviewer.scene.describe import describe
from pmviewer.scene.description import Material, Principled, Shape
from pmviewer.scene.texture import Bitmap
from tests.support.kinds import EVERY_SURFACE
from tests.support.scenes import GLASS, MIRROR, box_walls, diffuse, diffuse_box

STORED, FOLLOWED = 1, 2
N = 1 << 18


@kernel
def _numbers(p, wo, prim, salt, out):
    for k in range(len(p)):
        out[k] = hit_number((p[k, 0], p[k, 1], p[k, 2]), (wo[k, 0], wo[k, 1], wo[k, 2]), prim[k], salt)


@kernel
def _parts(scenes, material, prim, p, wo, out):
    b1, b2, n = np.float32(0.125), np.float32(0.125), (np.float32(0), np.float32(0), np.float32(1))
    for k in range(len(p)):
        o = (wo[k, 0], wo[k, 1], wo[k, 2])
        out[k] = chosen_part(scenes[0], material, prim, b1, b2, (p[k, 0], p[k, 1], p[k, 2]), n, o)


@kernel
def _kept(scenes, material, wo, glossy, out):
    n, zero = (np.float32(0), np.float32(0), np.float32(1)), np.float32(0.25)
    for k in range(len(wo)):
        o = (wo[k, 0], wo[k, 1], wo[k, 2])
        b = bsdf_at(scenes[0], np.int64(0), material, zero, zero, n, n, n, o, glossy, None)
        out[k, 0], out[k, 1] = keeps(scenes[0], material, b, n, o, glossy), b.groups


@kernel
def _through(scenes, material, out):
    n, one = (np.float32(0), np.float32(0), np.float32(1)), (np.float32(1), np.float32(2), np.float32(3))
    out[:] = inside_attenuation(scenes[0], material, n, n, np.float32(0.7), one)


def blend(weight, first, second, name="blend", **more):
    return Material(name, "blend", weight=weight, parts=(first, second), **more)


def directions(n, seed=1):
    d = np.random.default_rng(seed).normal(size=(n, 3))
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def numbers(p, wo, prim=None, salt=0):
    out = np.empty(len(p), np.float32)
    prim = np.zeros(len(p), np.int64) if prim is None else prim
    _numbers(np.ascontiguousarray(p, np.float32), np.ascontiguousarray(wo, np.float32), prim, np.int64(salt), out)
    return out.astype(float)


def is_uniform(values, cells=256):
    counts = np.bincount((values * cells).astype(int), minlength=cells)
    return stats.chisquare(counts).pvalue > 1e-4


def grid():
    """Points of a flat square as close as float32 lets them be, near 1: their bits are nearly the same."""
    side = int(N**0.5)
    step = np.float32(2.0**-23)
    x, z = np.meshgrid(np.arange(side, dtype=np.float32), np.arange(side, dtype=np.float32))
    return np.stack([1 + step * x.ravel(), np.zeros(side * side, np.float32), 1 + step * z.ravel()], 1)


def neighbours():
    """Arguments of `numbers` that differ by next to nothing, one kind after the other."""
    up = np.tile(np.array([[0, 1, 0]], np.float32), (N, 1))
    place = np.tile(np.array([[0.5, 0, 0.25]], np.float32), (N, 1))
    yield "places", (grid(), up)
    turned = np.stack([2.0**-23 * np.arange(N), np.ones(N), np.zeros(N)], 1)
    yield "directions", (place, turned)
    yield "primitives", (place, up, np.arange(N))


@pytest.mark.parametrize(("name", "arguments"), list(neighbours()), ids=lambda x: x if isinstance(x, str) else "")
def test_the_number_is_uniform_and_forgets_its_neighbour(name, arguments):
    values = numbers(*arguments)
    assert is_uniform(values)
    for lag in (1, 2, 512):  # pairs fill the square, and choices of neighbours are independent
        a, b = values[:-lag], values[lag:]
        pairs = np.bincount(16 * (a * 16).astype(int) + (b * 16).astype(int), minlength=256)
        assert stats.chisquare(pairs).pvalue > 1e-4, lag
        for share in (0.01, 0.3, 0.5):
            both = ((a < share) & (b < share)).sum()
            assert abs(both - len(a) * share**2) < 5 * (len(a) * share**2) ** 0.5, (lag, share)


def test_salts_are_independent():
    p, wo = grid(), directions(N)
    a, b = numbers(p, wo, salt=3), numbers(p, wo, salt=4)
    pairs = np.bincount(16 * (a * 16).astype(int) + (b * 16).astype(int), minlength=256)
    assert stats.chisquare(pairs).pvalue > 1e-4
    assert np.array_equal(a, numbers(p, wo, salt=3))


def test_choices_are_no_thinner_or_denser_anywhere():
    """Cells of a floor get the share of choices that chance allows."""
    p = np.random.default_rng(2).random((N, 3), np.float32)
    p[:, 1] = 0
    chosen = numbers(p, directions(N)) < 0.3
    cell = 32 * (p[:, 0] * 32).astype(int) + (p[:, 2] * 32).astype(int)
    count, hits = np.bincount(cell, minlength=1024), np.bincount(cell, chosen, minlength=1024)
    score = ((hits - 0.3 * count) ** 2 / (0.3 * 0.7 * count)).sum()
    assert 1e-4 < stats.chi2.sf(score, 1024) < 1 - 1e-4


def with_floor(material):
    """A box whose every surface has the material."""
    scene = diffuse_box()
    return replace(scene, materials=(material,), shapes=(*box_walls(), scene.shapes[-1]))


def test_parts_are_chosen_by_their_shares():
    """Of a blend of blends: the products of shares; the same for the same hit."""
    parts = [diffuse(name) for name in "abc"]
    nested = blend(0.25, parts[0], blend(0.4, parts[1], parts[2], "inner"), "outer")
    scene = with_floor(nested)
    flat, table = flatten(scene, features_at_least=EVERY_SURFACE), material_table(scene)
    p, wo = np.random.default_rng(3).random((N, 3), np.float32), directions(N)
    out, again = np.empty(N, np.int64), np.empty(N, np.int64)
    _parts(flat.record, np.int64(0), np.int64(0), p, wo, out)
    _parts(flat.record, np.int64(0), np.int64(0), p, wo, again)
    names = [m.name for m in table.materials]
    found = dict(zip(*np.unique([names[i] for i in out], return_counts=True)))
    for name, share in {"a": 0.75, "b": 0.15, "c": 0.1}.items():
        assert abs(found[name] - share * N) < 5 * (share * (1 - share) * N) ** 0.5
    assert np.array_equal(out, again)


def test_a_texture_gives_the_share():
    """Its luminance at the hit: u = 1/4, v = 1/8 lie in the first of four texels."""
    pixels = np.array([[[0.2], [0.9]], [[0.9], [0.9]]], np.float32)
    mixed = blend(0.5, diffuse("a"), diffuse("b"), textures={"weight": Bitmap(pixels, filter="nearest")})
    flat = flatten(with_floor(mixed), features_at_least=EVERY_SURFACE)
    p, wo = np.random.default_rng(4).random((N, 3), np.float32), directions(N)
    p[:, 1] = 0
    out = np.empty(N, np.int64)
    _parts(flat.record, np.int64(0), np.int64(0), p, wo, out)
    assert abs((out == 2).sum() - 0.2 * N) < 5 * (0.2 * 0.8 * N) ** 0.5


def test_a_part_for_each_side():
    """Whatever the weight; inside another blend as well."""
    front, back = diffuse("front"), diffuse("back")
    sides = blend(0.3, front, blend(0.0, back, diffuse("never"), "inner"), by_side=True)
    scene = with_floor(blend(1.0, diffuse("never too"), sides, "outer"))
    flat, table = flatten(scene, features_at_least=EVERY_SURFACE), material_table(scene)
    p, wo = np.random.default_rng(5).random((N, 3), np.float32), directions(N)
    out = np.empty(N, np.int64)
    _parts(flat.record, np.int64(0), np.int64(0), p, wo, out)
    names = np.array([m.name for m in table.materials])[out]
    assert set(names[wo[:, 2] >= 0]) == {"front"}
    assert set(names[wo[:, 2] < 0]) == {"back"}


ROUGH_METAL = Material("metal", "rough conductor", alpha=(0.3, 0.4), two_sided=True)
ROUGH_GLASS = Material("frost", "rough dielectric", alpha=(0.3, 0.3))
ONE_SIDED = diffuse("front", two_sided=False)
BLACK = Material("black", "diffuse", (0.0,) * 3, two_sided=True)
COATED = Material("layers", "principled", alpha=(0.5, 0.5), principled=Principled(clearcoat=1.0))
CLEAR = Material("clear", "principled", alpha=(0.5, 0.5), principled=Principled(spec_trans=0.5))


@pytest.mark.parametrize(
    ("first", "second", "glossy", "front", "back"),
    [
        (diffuse(), MIRROR, 0.2, STORED, STORED),
        (ONE_SIDED, GLASS, 0.2, STORED, 0),
        (MIRROR, GLASS, 0.2, 0, 0),
        (BLACK, diffuse(), 0.2, STORED, STORED),
        (ROUGH_METAL, MIRROR, 0.3, STORED, STORED),
        (ROUGH_METAL, MIRROR, 0.35, FOLLOWED, FOLLOWED),
        (ROUGH_METAL, ONE_SIDED, 0.35, STORED | FOLLOWED, FOLLOWED),
        (ROUGH_GLASS, MIRROR, 0.2, FOLLOWED, FOLLOWED),
        (COATED, MIRROR, 0.2, STORED | FOLLOWED, 0),
        (COATED, MIRROR, 0.01, STORED, 0),
        (CLEAR, MIRROR, 0.2, STORED | FOLLOWED, FOLLOWED),
        (blend(0.5, MIRROR, diffuse()), GLASS, 0.2, STORED, STORED),
        (None, blend(0.5, MIRROR, diffuse(), by_side=True), 0.2, 0, STORED),
        (None, blend(0.5, diffuse(), ROUGH_METAL, by_side=True), 0.35, STORED, FOLLOWED),
    ],
)
def test_photons_are_kept_for_every_part(first, second, glossy, front, back):
    """Whichever part is chosen; and none has lobes that photons are not kept for."""
    scene = with_floor(second if first is None else blend(0.5, first, second))
    flat = flatten(scene, features_at_least=EVERY_SURFACE)
    wo = directions(400)
    out = np.empty((len(wo), 2), np.int64)
    _kept(flat.record, np.int64(0), wo, np.float32(glossy), out)
    assert set(out[wo[:, 2] > 0, 0]) == {front}
    assert set(out[wo[:, 2] < 0, 0]) == {back}
    assert np.all(out[:, 1] & STORED & ~out[:, 0] == 0)


def test_absorption_is_that_of_the_part_which_absorbs():
    glass = replace(GLASS, absorption=(0.5, 1.0, 2.0))
    scene = with_floor(blend(0.5, diffuse(), glass))
    out, flat = np.empty(3, np.float32), flatten(scene, features_at_least=EVERY_SURFACE)
    _through(flat.record, np.int64(0), out)
    assert out == pytest.approx(np.exp(-0.7 * np.array([0.5, 1.0, 2.0])) * [1, 2, 3])


def test_traits_are_those_of_the_parts():
    traits = analyse(with_floor(blend(0.3, diffuse(), blend(0.5, MIRROR, ROUGH_METAL))))
    assert (traits.has_diffuse, traits.has_specular, traits.has_delta, traits.rich) == (True, True, True, True)
    assert traits.glossy_roughness == (0.3,)
    assert not analyse(with_floor(blend(0.3, MIRROR, GLASS))).has_diffuse


def test_nothing_is_compiled_for_scenes_without():
    box = diffuse_box()
    mixed = blend(0.3, diffuse(), MIRROR)
    assert "blends" not in flatten(replace(box, materials=(*box.materials, mixed))).record.dtype.fields
    used = replace(box, materials=(*box.materials, mixed), shapes=(*box.shapes, Shape("x", box.shapes[0].geometry, 1)))
    assert "blends" in flatten(used).record.dtype.fields


def test_blends_too_deep_are_refused():
    """Parts that are shared count once, so that a wide web of blends is no more than its materials."""
    shared = diffuse()
    for _ in range(DEEPEST):
        shared = blend(0.5, shared, shared)
    assert len(material_table(with_floor(shared)).rows) == DEEPEST + 1
    with pytest.raises(SceneError, match="blended more than 32 times"):
        flatten(with_floor(blend(0.5, shared, diffuse())))


def test_description_names_the_parts():
    text = dict(describe(with_floor(blend(0.3, diffuse("wood"), MIRROR, "floor"))))["materials"]
    assert text == "1 blend (floor: 30% of mirror over wood)"
