"""What runs where light passes thin glass by rules, what does not, and what is said of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.engine.stages.thin_glass import with_thin_glass
from pmviewer.kernels.scene import SCENE_DTYPE, THIN_TINTED
from pmviewer.scene.analysis import analyse
from pmviewer.scene.description import Material
from pmviewer.settings.access import Settings, with_values
from tests.support.scenes import GLASS, MIRROR, cornell_box, rendered

PANE = Material("pane", "thin dielectric")
RULES = ("exact", "ignored", "tinted", "tinted and reflecting")


def settings(rule, method="progressive", **values):
    return with_values(Settings(), {"render.thin_glass": rule, "render.method": method, **values})


def box_with(*glass):
    """The box with both of its balls of these materials."""
    box = cornell_box(size=4)
    both = glass * 2 if len(glass) == 1 else glass
    return replace(box, materials=(*box.materials[:3], *both))


def test_glass_that_does_not_say_otherwise_is_exact_unless_it_is_thin():
    assert GLASS.thin_rule == "exact"
    assert replace(GLASS, thin_glass="tinted").thin_rule == "tinted"
    assert replace(GLASS, thin_glass="by setting").thin_rule == "by setting"
    assert PANE.thin_rule == "by setting"
    assert replace(PANE, thin_glass="exact").thin_rule == "exact"
    for kind in ("diffuse", "conductor", "rough dielectric"):
        assert Material("other", kind, thin_glass="tinted").thin_rule == "exact"


@pytest.mark.parametrize("rule", RULES)
def test_thick_glass_does_not_go_by_the_setting(rule):
    """Its record is that of every other scene, and the setting greys with the reason."""
    opened = open_scene(cornell_box(size=4))
    plan = plan_of(settings(rule), opened.traits)
    assert plan.thin_glass == ()
    assert with_thin_glass(opened, settings(rule), plan) is opened
    assert opened.flat.record.dtype == SCENE_DTYPE
    assert "No thin glass" in (inactive_reason("render.thin_glass", settings(rule), opened.traits) or "")


def test_panes_go_by_the_setting_or_by_their_own_rule():
    by_setting, own = analyse(box_with(PANE)), analyse(box_with(replace(PANE, thin_glass="ignored")))
    both = analyse(box_with(PANE, replace(GLASS, thin_glass="tinted")))
    assert (by_setting.thin_glass, own.thin_glass) == (("by setting",), ("ignored",))
    assert plan_of(settings("exact"), by_setting).thin_glass == ()
    assert plan_of(settings("tinted"), by_setting).thin_glass == ("tinted",)
    assert plan_of(settings("exact"), own).thin_glass == plan_of(settings("tinted"), own).thin_glass == ("ignored",)
    assert plan_of(settings("exact"), both).thin_glass == ("exact", "tinted")
    assert inactive_reason("render.thin_glass", settings("exact"), by_setting) is None
    assert inactive_reason("render.thin_glass", settings("exact"), own) is not None


def test_a_part_of_a_blend_is_no_pane():
    blend = Material("blend", "blend", parts=(replace(PANE, thin_glass="tinted"), MIRROR))
    assert analyse(box_with(blend)).thin_glass == ()


def test_the_caustic_map_goes_where_nothing_else_makes_caustics():
    pane, mixed = analyse(box_with(PANE)), analyse(box_with(PANE, MIRROR))
    for rule in ("exact", "tinted and reflecting"):
        assert plan_of(settings(rule), pane).caustic_mask
    for rule in ("ignored", "tinted"):
        plan = plan_of(settings(rule), pane)
        assert plan.caustic_mask == 0
        assert "thin glass" in dict(plan.skipped)["caustic map"]
        assert plan_of(settings(rule), mixed).caustic_mask
    # A pane of another rule makes them as ever.
    other = analyse(box_with(PANE, replace(PANE, thin_glass="ignored")))
    assert plan_of(settings("exact"), other).caustic_mask


@pytest.mark.parametrize("method", ["path", "virtual lights"])
def test_methods_that_take_all_glass_as_it_is(method):
    traits = analyse(box_with(PANE))
    plan = plan_of(settings("ignored", method), traits)
    assert plan.thin_glass == ()
    assert "as it is" in (inactive_reason("render.thin_glass", settings("ignored", method), traits) or "")
    assert any("thin glass" in warning for warning in plan.warnings) == (method == "virtual lights")


def test_shadow_photons_do_not_know_thin_glass():
    traits = analyse(box_with(PANE))
    asked = {"direct.shadow_photons": True}
    assert plan_of(settings("exact", **asked), traits).shadows
    plan = plan_of(settings("tinted", **asked), traits)
    assert not plan.shadows
    assert any("Shadow rays" in warning for warning in plan.warnings)


def test_the_record_of_the_kernels_is_that_of_the_scene_and_the_rule():
    opened = open_scene(box_with(PANE))
    chosen = settings("tinted")
    lit = with_thin_glass(opened, chosen, plan_of(chosen, opened.traits))
    assert lit.uid == opened.uid
    assert lit.flat.record[0]["thin"] == THIN_TINTED
    for name in opened.flat.record.dtype.names:
        assert lit.flat.record[0][name] == opened.flat.record[0][name]
    assert "thin" not in opened.flat.record.dtype.names


@pytest.mark.extensive
@pytest.mark.parametrize("rule", RULES)
def test_the_picture_says_what_is_wrong_with_it(rule):
    box = box_with(PANE)
    renderer = rendered(box, settings(rule, **{"photons.N": 1000}), 1)
    said = [warning for warning in renderer.frame(0).statistics.warnings if "thin glass" in warning]
    assert len(said) == (rule != "exact")


@pytest.mark.usefixtures("any_bsdf")
def test_gather_rays_that_follow_mirrors_miss_what_panes_reflect():
    for method, on, sentences in (("gather", False, 2), ("gather", True, 1), ("progressive", False, 1)):
        chosen = settings("tinted and reflecting", method, **{"photons.N": 1000, "photons.indirect_caustics": on})
        said = rendered(box_with(PANE), chosen, 1).frame(0).statistics.warnings
        assert sum("thin glass" in warning for warning in said) == sentences


@pytest.mark.usefixtures("any_bsdf")
def test_the_picture_is_the_same_for_any_number_of_threads():
    box = replace(box_with(PANE), width=64, height=48)
    chosen = settings("tinted and reflecting", **{"photons.N": 20_000})
    one, three = (rendered(box, chosen, 2, threads).frame(0).image() for threads in (1, 3))
    assert np.array_equal(one, three)
