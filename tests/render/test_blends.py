"""Blends in the whole program: photons, gathering and caches agree with path tracing, and blends with their sums."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.scene.description import Material, PointLight, Principled, Scene, Shape, Sphere
from pmviewer.scene.texture import Bitmap, Checkerboard
from tests.support.scenes import GLASS, MIRROR, box_camera, box_walls, diffuse, panel, rendered, settings_of

pytestmark = pytest.mark.usefixtures("every_surface")

METAL = Material("metal", "rough conductor", (0.9, 0.7, 0.5), alpha=(0.4, 0.4), two_sided=True)
SMOOTHER = replace(METAL, name="smoother", alpha=(0.1, 0.1))
BLACK = Material("black", "diffuse", (0.0,) * 3, two_sided=True)


def blend(weight, first, second, **more):
    """`weight` is the second's share."""
    return Material("blend", "blend", weight=weight, parts=(first, second), **more)


PICTURE, PHOTONS = 48, 16_000
"""The mean of a picture is as exact by many pixels and few photons as by few pixels and many photons, at a fifth of the
work: most of its noise comes from where pixels are sampled."""


def box(floor, ball=None, light=None, size=PICTURE):
    """A closed box with a floor and a ball of these materials; a large light, or a point. Behind a wall, in the dark,
    lies a crumb of everything: the scenes are all of one kind, so that kernels are compiled once for all of them."""
    shapes = [*box_walls(1.0, (0, 0, 1, 0, 0, 0)), Shape("ball", Sphere((0.2, -0.6, -0.2), 0.35), 2)]
    shapes.append(Shape("crumb", Sphere((1.02, 0.0, 0.0), 0.01), 3))
    if light is None:
        shapes.append(panel(half=0.7))
    materials = (diffuse(albedo=(0.5,) * 3), floor, floor if ball is None else ball, CRUMB)
    return Scene("box", None, tuple(shapes), materials, () if light is None else (light,), box_camera(), size, size)


def pass_means(scene, passes, settings):
    """(passes, terms) means of the picture's terms, pass by pass."""
    pool = WorkPool(2)
    renderer = Renderer(open_scene(scene), settings, pool, StageStore(0))
    totals = []
    for _ in range(passes):
        renderer.step()
        totals.append(renderer.film.sums[:, :15].reshape(-1, 5, 3).mean((0, 2)))
    pool.close()
    assert sum(renderer.tally.dropped.values()) == 0
    return np.diff(np.array(totals), prepend=0, axis=0)


def settings(method, **more):
    groups = {"render": {"method": method}, "photons": {"N": PHOTONS}, "estimate": {"radius": 0.02}}
    for name, values in more.items():
        groups[name] = groups.get(name, {}) | values
    return settings_of(**groups)


def agree(a, b, name, tolerance=0.006):
    total = [x.sum(1) for x in (a, b)]
    error = np.hypot(*(x.std() / np.sqrt(len(x)) for x in total))
    print(f"{name}: {total[0].mean():.5f}, expected {total[1].mean():.5f} ± {error:.5f}")
    assert error < 0.01 * total[1].mean()
    assert abs(total[0].mean() - total[1].mean()) < 4 * error + tolerance * total[1].mean()


LAYERED = Material("p", "principled", (0.8, 0.4, 0.2), alpha=(0.25, 0.25), principled=Principled(metallic=0.6))
FIELD = Checkerboard((0.9,) * 3, (0.1,) * 3)
CRUMB = blend(0.5, blend(0.5, LAYERED, replace(MIRROR, name="bright")), GLASS, textures={"weight": FIELD})
TWO_COLOURS = blend(0.3, diffuse("a", (0.9, 0.1, 0.4)), diffuse("b", (0.2, 0.8, 0.4)))
MIXED = diffuse("mixed", (0.7 * 0.9 + 0.3 * 0.2, 0.7 * 0.1 + 0.3 * 0.8, 0.4))
WAYS = {
    "path": settings("path"),
    "progressive": settings("progressive"),
    "irradiance cache": settings("gather", gather={"cache": "on"}),
}


@pytest.mark.extensive
@pytest.mark.parametrize("way", WAYS)
def test_two_colours_are_the_mixed_colour(way):
    """Of the whole box, term by term; look-ups and caches take the part that counts at each hit."""
    passes = 24
    ours, mixed = (pass_means(box(m), passes, WAYS[way]) for m in (TWO_COLOURS, MIXED))
    agree(ours, mixed, way, 0.004)
    for term in range(5):
        a, b = ours[:, term], mixed[:, term]
        error = np.hypot(a.std(), b.std()) / np.sqrt(len(a))
        assert abs(a.mean() - b.mean()) <= 5 * error + 0.006 * b.mean()


MIXES = {
    "diffuse and mirror": (blend(0.3, diffuse("wood", (0.7, 0.5, 0.3)), MIRROR), GLASS),
    "diffuse and glass": (diffuse(), blend(0.7, diffuse("paint", (0.2, 0.3, 0.8)), GLASS)),
    "rough metal and diffuse": (blend(0.7, METAL, diffuse("wood", (0.7, 0.5, 0.3))), GLASS),
    "followed metal and one-sided paint": (
        blend(0.5, SMOOTHER, diffuse("paint", (0.2, 0.3, 0.8), False)),
        blend(0.5, BLACK, MIRROR),
    ),
}


@pytest.mark.parametrize("name", MIXES)
def test_progressive_and_gather_agree_with_path_tracing(name):
    scene = box(*MIXES[name])
    path = pass_means(scene, 24, settings("path"))
    for method, passes in (("progressive", 10), ("gather", 5)):
        agree(pass_means(scene, passes, settings(method)), path, f"{name}, {method}")


def test_light_that_no_path_finds_is_kept_for_every_part():
    """A point behind a mirror and a clear ball, seen in a followed lobe of a blend: what followed lobes look up is what
    they reflect as stored ones."""
    light = PointLight("point", (0.3, 0.6, 0.3), (1.0, 1.0, 1.0))
    scene = box(blend(0.5, replace(METAL, alpha=(0.15, 0.15)), BLACK), blend(0.3, GLASS, MIRROR), light)
    followed = pass_means(scene, 24, settings("progressive", photons={"glossy": 0.2}))
    stored = pass_means(scene, 24, settings("progressive", photons={"glossy": 0.1}))
    agree(followed, stored, "followed", 0.02)


def test_textures_of_weight_and_metal():
    """A textured share is a textured colour; a texture of one value is that value."""
    dark, bright = diffuse("dark", (0.1,) * 3), diffuse("bright", (0.7,) * 3)
    colours = Checkerboard((0.1 + 0.9 * 0.6,) * 3, (0.1 + 0.1 * 0.6,) * 3)
    mixed = box(blend(0.5, dark, bright, textures={"weight": FIELD}), diffuse())
    plain = box(replace(diffuse("floor", (0.4,) * 3), textures={"reflectance": colours}), diffuse())
    agree(pass_means(mixed, 24, settings("path")), pass_means(plain, 24, settings("path")), "path")
    one = Bitmap(np.full((1, 1, 1), 0.6, np.float32))
    numbers, texture = (
        rendered(box(replace(LAYERED, textures=t)), settings("path"), 2).frame(0).image()
        for t in ({"reflectance": Bitmap(np.full((1, 1, 3), (0.8, 0.4, 0.2), np.float32))}, {"metallic": one})
    )
    assert texture == pytest.approx(numbers, rel=1e-3, abs=1e-5)
    assert numbers.max() > 0.1


def test_parts_have_their_own_bumps():
    """Two colours under one bump map are the mixed colour under it, and not what they are without."""
    waves = np.sin(np.arange(32) * np.pi / 4)[:, None, None].repeat(32, 1).astype(np.float32)
    bumps = {"textures": {"bump": Bitmap(waves)}, "bump_scale": 0.3}
    first, second = (replace(part, **bumps) for part in TWO_COLOURS.parts)
    sides = [
        pass_means(box(m, MIRROR), 16, settings("path"))
        for m in (replace(TWO_COLOURS, parts=(first, second)), replace(MIXED, **bumps), MIXED)
    ]
    agree(*sides[:2], "bumped")
    assert abs(sides[0].mean() / sides[2].mean() - 1) > 0.02


def test_threads_change_nothing():
    scene = box(MIXES["diffuse and mirror"][0], MIXES["diffuse and glass"][1])
    one, two = (rendered(scene, settings("progressive"), 2, threads) for threads in (1, 2))
    assert np.array_equal(one.film.sums, two.film.sums)
