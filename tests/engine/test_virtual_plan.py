"""What runs with virtual lights, what does not, and what settings do."""

from __future__ import annotations

import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.maps.record import CAUSTIC, INDIRECT_CAUSTIC
from pmviewer.maps.virtual_lights import ESTIMATORS
from pmviewer.settings.access import SETTINGS, Settings, with_values
from tests.support.scenes import GLASS, ball_in_environment, cornell_box, diffuse_box, light_scene, rendered


def settings(**values):
    chosen = {"render.method": "virtual lights", **{f"virtual.{name}": value for name, value in values.items()}}
    return with_values(Settings(), chosen)


def test_a_diffuse_scene_has_no_light_pass_beside_the_virtual_lights():
    traits = open_scene(diffuse_box(size=4)).traits
    plan = plan_of(settings(), traits)
    assert plan.virtual
    assert not plan.photons
    assert {"light pass", "global map", "final gather"} <= {name for name, _ in plan.skipped}
    assert not plan_of(Settings(), traits).virtual


def test_mirrors_and_glass_have_the_caustic_map_and_else_the_global_one_for_their_light():
    traits = open_scene(cornell_box(size=4)).traits
    plan = plan_of(settings(), traits)
    assert plan.caustic_mask == 1 << CAUSTIC | 1 << INDIRECT_CAUSTIC
    assert plan.global_classes == 0
    without = plan_of(with_values(settings(), {"photons.indirect_caustics": False}), traits)
    assert without.global_mask == without.global_classes == 1 << INDIRECT_CAUSTIC


def test_many_lights_keep_the_photons_that_choose_them():
    traits = open_scene(light_scene("point", "disk", "sphere")).traits
    plan = plan_of(with_values(settings(), {"direct.choice": "photons"}), traits)
    assert plan.choice == "photons"
    assert plan.photons


def test_a_scene_that_stores_nothing_has_no_virtual_lights():
    traits = open_scene(ball_in_environment(GLASS)).traits
    assert not plan_of(settings(), traits).virtual


def test_one_map_for_all_passes_keeps_its_virtual_lights():
    renderer = rendered(diffuse_box(size=4), with_values(settings(number=20), {"photons.renew": "once"}), 2)
    first = renderer.latest.virtual
    renderer = rendered(diffuse_box(size=4), with_values(settings(number=20), {"photons.renew": "once"}), 1)
    assert (first.lights.rows == renderer.latest.virtual.lights.rows).all()


def test_the_schema_has_the_estimators_in_the_order_of_their_numbers():
    assert SETTINGS["virtual.estimator"].choices == tuple(ESTIMATORS)


@pytest.mark.parametrize(
    ("path", "does", "does_not"),
    [
        ("virtual.clamp", {"estimator": "clamped"}, {}),
        ("virtual.density", {}, {"estimator": "full path"}),
        ("virtual.photons", {}, {"density": "virtual lights"}),
        ("virtual.k", {"estimator": "printed single step"}, {"estimator": "unweighted"}),
        ("virtual.normalisation", {}, {"estimator": "clamped"}),
        ("virtual.walks", {"normalisation": "per object"}, {"estimator": "unweighted"}),
        ("virtual.window", {}, {"normalisation": "per pixel"}),
        ("virtual.number", {}, None),
        ("virtual.choice", {"per_pixel": 20}, {}),
    ],
)
def test_a_setting_that_does_nothing_says_why(path, does, does_not):
    traits = open_scene(diffuse_box(size=4)).traits
    assert inactive_reason(path, settings(**does), traits) is None
    without = Settings() if does_not is None else settings(**does_not)
    assert inactive_reason(path, without, traits)


def test_gather_rays_bring_light_to_gloss_alone():
    glossy, diffuse = open_scene("glossy_room").traits, open_scene(diffuse_box(size=4)).traits
    assert inactive_reason("virtual.gather_rays", settings(), glossy) is None
    assert "glossy" in inactive_reason("virtual.gather_rays", settings(), diffuse)
    for other in ({"estimator": "every vertex"}, {"density": "virtual lights"}, {"normalisation": "none"}):
        assert inactive_reason("virtual.gather_rays", settings(**other), glossy)


@pytest.mark.parametrize(
    ("values", "word"),
    [
        ({"estimator": "printed full path"}, "every albedo is ½"),
        ({"estimator": "printed single step"}, "whole discs"),
        ({"normalisation": "per object"}, "false light"),
        ({"normalisation": "none"}, "too bright"),
        ({}, ""),
    ],
)
def test_biased_forms_say_so(values, word):
    renderer = rendered(diffuse_box(size=4), settings(number=20, photons=500, **values), 1)
    said = [w for w in renderer.frame(0).statistics.warnings if "irtual lights" in w]
    assert [word in w for w in said] == [True] * bool(word)
