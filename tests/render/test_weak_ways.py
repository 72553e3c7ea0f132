"""Weak ways from the camera, over a coat or the weaker side of glass: thinned out where they meet more than a mirror,
or shown from the global map where the method gathers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.inspection import Wanted
from pmviewer.engine.inspector.report import Pinned
from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.render.planes import PLANES
from pmviewer.scene.description import Material, PointLight, Scene, Shape, Sphere
from tests.support.scenes import GLASS, MIRROR, box_camera, box_walls, closed_sphere, diffuse, panel, settings_of

SIZE = 24
PLASTIC = Material("plastic", "plastic", (0.5,) * 3, eta=1.5, two_sided=True)
SPECULAR = PLANES["specular"]
RADIUS = 0.02
"""Of look-ups, over the scene's diagonal: less than half of the way from the floor's middle to any wall."""


def renderer_of(scene, pool, method="gather", seed=1, N=4000, **gather):
    groups = {"gather": gather} if gather else {}
    render = {"method": method, "outline_rays": 0, "seed": seed, "mirror_rays": 1}
    groups |= {"render": render, "photons": {"N": N}, "estimate": {"radius": RADIUS}}
    return Renderer(open_scene(scene), settings_of(**groups), pool, StageStore(0))


def coated_floor(floor=PLASTIC):
    """A box lit by a point, which no ray meets: what a smooth coat shows is what the walls reflect."""
    materials = diffuse("white", (0.7,) * 3), floor
    light = PointLight("point", (0.1, 0.4, 0.2), (1.0, 1.0, 1.0))
    walls = box_walls(materials=(0, 0, 1, 0, 0, 0))
    return Scene("coated floor", None, walls, materials, (light,), box_camera(), SIZE, SIZE)


def weak_look_ups(renderer, x, y):
    told = renderer.inspect(Wanted(pinned=Pinned(x, y, None))).pixel
    return [one for one in told.look_ups if one.used and one.depth > 0 and one.map == "global"]


def test_what_a_coat_shows_is_one_look_up_a_pass(pool):
    """The term of the film is the value that the inspector tells, and the sum over its photons."""
    renderer = renderer_of(coated_floor(), pool, N=40_000)
    renderer.step()
    film, seen = renderer.film.planes(), 0
    for x, y in ((12, 20), (6, 22), (18, 21), (9, 23)):
        looked = weak_look_ups(renderer, x, y)
        value = film[y, x, SPECULAR]
        assert np.all(value > 0)
        assert sum(one.value for one in looked) == pytest.approx(value, rel=1e-5)
        assert sum(one.sum for one in looked) == pytest.approx(value, rel=1e-4)
        assert {one.shows for one in looked} == {"specular"}
        seen += len(looked)
    assert seen == 4


@pytest.mark.parametrize("floor", [PLASTIC, replace(PLASTIC, kind="rough plastic", alpha=(0.1, 0.1))])
def test_coats_show_as_much_as_by_the_path_tracer(pool, floor):
    """The sum over the floor within 3 %, and 4 standard errors below it for what look-ups lose at corners."""
    found = {}
    for method, passes, N in (("gather", 24, 20_000), ("path", 200, 100)):
        runs = []
        for seed in range(1, 7):
            renderer = renderer_of(coated_floor(floor), pool, method, seed, N)
            for _ in range(passes):
                renderer.step()
            runs.append(float(renderer.film.planes()[..., SPECULAR].sum()))
        found[method] = np.mean(runs), np.std(runs, ddof=1) / len(runs) ** 0.5
    by_gather, by_path = found["gather"], found["path"]
    assert np.hypot(by_gather[1], by_path[1]) < 0.015 * by_path[0]
    assert by_gather[0] == pytest.approx(by_path[0], rel=0.03)


def test_a_glass_ball_does_not_show_in_a_furnace(pool):
    """Radiance 1 everywhere in a closed sphere that emits half and reflects half, over all ways at glass."""
    sphere = closed_sphere(size=SIZE)
    ball = Shape("ball", Sphere((0.1, -0.1, 0.5), 0.25), 1)
    scene = replace(sphere, shapes=(*sphere.shapes, ball), materials=(*sphere.materials, GLASS))
    renderer = renderer_of(scene, pool, N=20_000)
    for _ in range(32):
        renderer.step()
    shown = renderer.film.planes()[..., SPECULAR].mean(axis=-1)
    in_glass = shown > 0.9 * np.median(shown[shown > 0])
    assert in_glass.sum() > 60
    assert renderer.frame(0).beauty[in_glass].mean() == pytest.approx(1.0, abs=0.01)


def test_progressive_pictures_take_nothing_of_it(pool):
    """There the global map lacks direct light."""
    renderer = renderer_of(coated_floor(), pool, "progressive")
    renderer.step()
    assert all({one.shows for one in weak_look_ups(renderer, x, 20)} <= {"specular"} for x in (6, 12, 18))
    masks = [int(row["class_mask"]) for row in rows_of(renderer, 12, 20) if row["depth"] > 0]
    assert 0b1111 not in masks


def rows_of(renderer, x, y):
    from pmviewer.engine.inspector.look_ups import Replay

    return Replay(renderer.latest, None, y * SIZE + x, 1).rows


def test_at_corners_the_way_is_thinned_out(pool):
    """Where a look-up would be dark: with `gather.secondary`, rays too short for it."""
    renderer = renderer_of(coated_floor(), pool, secondary=20.0, N=500)
    renderer.step()
    assert not weak_look_ups(renderer, 12, 20)


def test_mirrors_on_a_weak_way_are_followed_by_all(pool):
    """A lamp in a mirror that a coat shows: every sample sees it with the coat's 4 %, none with more. Before, one in
    five saw it five times as bright."""
    materials = diffuse("black", (0.0,) * 3), MIRROR, replace(PLASTIC, reflectance=(0.01,) * 3)
    walls = (*box_walls(materials=(0, 0, 2, 0, 1, 0)), panel(half=0.9))
    scene = Scene("lamp in a mirror", None, walls, materials, (), box_camera(), SIZE, SIZE)
    runs = []
    for seed in range(1, 13):
        renderer = renderer_of(scene, pool, "progressive", seed=seed, N=500)
        renderer.step()
        runs.append(renderer.film.planes()[..., SPECULAR].astype(float)[-4:].max())
    assert max(runs) < 0.12 * 5.0  # the coat reflects 4 to 11 % of the lamp's radiance there
    assert max(runs) > 0.04 * 5.0  # and does show it
