"""Which look-ups are automatic: of the nearest photons where photons aim at what is small on a stage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OpenScene, expected_traits, open_scene, opened_of
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.series.keys import orbits, with_one_radius
from pmviewer.engine.stages.projection import projection_for
from pmviewer.engine.store import StageStore
from pmviewer.settings.access import Settings, with_values
from tests.photons.test_cones import stage
from tests.support.scenes import cornell_box, diffuse

GUIDED = {"importance.map": "average", "importance.emission": "Christensen keep"}


@pytest.fixture(scope="module")
def wide() -> OpenScene:
    """A ball on a floor of some forty times its size, under a lamp."""
    return open_scene(stage("panel"))


def nearest(opened: OpenScene, **values: object) -> bool:
    named = {name.replace("__", "."): value for name, value in values.items()}
    return plan_of(with_values(Settings(), named), opened.traits).nearest


def test_look_ups_reach_to_the_nearest_where_photons_aim(wide):
    """And where they could but don't, within the radius, as in a room."""
    assert nearest(wide)
    assert projection_for(wide, Settings()).gain > 1
    assert not nearest(wide, photons__projection="off")
    assert not nearest(wide, **{name.replace(".", "__"): value for name, value in GUIDED.items()})
    room = open_scene(cornell_box())
    assert not nearest(room)
    assert nearest(room, estimate__lookup="nearest")


@pytest.mark.parametrize(
    "by_hand", [{"estimate.radius": 0.01}, {"estimate.caustic_radius": 0.7}, {"estimate.radius_rule": "pixel"}]
)
def test_radii_that_are_asked_for_are_used(wide, by_hand):
    """Not silently by something else; unless the nearest are asked for as well."""
    assert not plan_of(with_values(Settings(), by_hand), wide.traits).nearest
    assert plan_of(with_values(Settings(), {**by_hand, "estimate.lookup": "nearest"}), wide.traits).nearest


def test_one_map_for_all_passes_is_asked_for_more_neighbours(wide):
    """No later pass averages its noise out. Who asks for a number gets it."""

    def first(**values: object) -> int:
        named = {name.replace("__", "."): value for name, value in values.items()}
        return plan_of(with_values(Settings(), named), wide.traits).neighbours

    assert first() == 20
    assert first(photons__renew="once") == 50
    assert first(photons__renew="once", estimate__k=7) == first(estimate__k=7) == 7


def test_whoever_flattens_a_scene_knows_it(wide):
    """Such as a worker of a cluster, which gets the scene alone."""
    scene = wide.flat.owner
    assert opened_of(scene, wide.flat, expected_traits(scene), "").traits == wide.traits
    assert wide.traits.aims


def test_a_film_with_one_radius_for_all_keeps_it(wide):
    """Its pictures look from elsewhere, and their own radii would differ; only those in fog are in use then."""
    views = orbits(wide.scene, with_values(Settings(), {"camera.width": 24, "camera.height": 24}), 2, 90.0)
    assert all(plan_of(one, wide.traits).nearest for one in with_one_radius(wide, views))


def test_far_parts_of_a_stage_have_less_noise_so(pool):
    """The floor far from what photons aim at, under a dome that reflects half: the variance of a pass of indirect light
    over that by one radius."""
    scene = stage("dome")
    wide = open_scene(replace(scene, materials=(scene.materials[0], diffuse("dome"))))
    camera = {"camera.origin": (-30.0, 8.0, -10.0), "camera.target": (-20.0, 0.0, -25.0), "photons.N": 20_000}
    noise = {}
    for lookup in ("auto", "radius"):
        pictures = []
        for seed in (1, 2):
            settings = with_values(Settings(), {**camera, "estimate.lookup": lookup, "render.seed": seed})
            renderer = Renderer(wide, settings, pool, StageStore(0))
            renderer.step()
            pictures.append(renderer.frame(0).image("indirect").astype(float))
        noise[lookup] = float(((pictures[0] - pictures[1]) ** 2).mean()) / 2
    print(f"variance of a pass: {noise['auto']:.3g}, by one radius {noise['radius']:.3g}")
    assert np.mean(pictures) > 0
    assert noise["auto"] < 0.1 * noise["radius"]
