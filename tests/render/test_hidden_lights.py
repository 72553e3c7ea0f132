"""Pictures that show no lights (`render.lights`): whatever is not behind one stays as it is, bit for bit.

What lies behind them is compared with Mitsuba in test_mitsuba_views.py.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.comparison.reference import reference_for
from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.method import SHOWN, plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.errors import SceneError
from pmviewer.scene.analysis import analyse
from pmviewer.scene.description import ConstantEnvironment
from pmviewer.scene.load import load_scene
from tests.support.scenes import cornell_box, rendered, settings_of

METHODS = ("path", "progressive", "gather")


def pictures(scene, method, **render):
    """The frames with lights shown and hidden."""
    groups = {"photons": {"N": 3000}, "gather": {"rays": 2}}
    of = [
        settings_of(render={"method": method, "lights": lights, **render}, **groups) for lights in ("shown", "hidden")
    ]
    return [rendered(scene, settings, 2).frame(0) for settings in of]


@pytest.mark.parametrize("method", METHODS)
def test_a_lamp_is_gone_and_its_light_stays(method):
    shown, hidden = pictures(cornell_box(size=32), method, outline_rays=0)
    seen = shown.image("emission").sum(axis=-1) > 0
    assert 0.005 < seen.mean() < 0.5
    assert not hidden.image("emission").any()
    assert np.array_equal(shown.beauty[~seen], hidden.beauty[~seen])
    assert (hidden.beauty[seen] > 0).any(axis=-1).all(), "the ceiling above the lamp"
    assert (hidden.image("depth")[seen] >= shown.image("depth")[seen]).all()


@pytest.mark.parametrize("method", METHODS)
def test_the_sky_is_black_and_lights_the_floor(method):
    box = cornell_box(size=32)
    shapes = tuple(s for s in box.shapes if s.radiance is None)[:3]
    scene = replace(box, shapes=shapes, lights=(ConstantEnvironment("sky", (1.0, 0.8, 0.6)),))
    shown, hidden = pictures(scene, method, outline_rays=0)
    seen = shown.image("emission").sum(axis=-1) > 0
    missed = shown.image("depth")[..., 0] == 0
    assert 0.05 < missed.mean() < 0.95
    assert (hidden.beauty[missed] == 0).all()
    assert np.array_equal(shown.beauty[~seen], hidden.beauty[~seen])


def test_outlines_get_no_rays_of_their_own():
    shown, hidden = (frame.image("emission") for frame in pictures(cornell_box(size=32), "progressive"))
    assert shown.any()
    assert not hidden.any()


SCENE = """<scene version="3.0.0">
  <integrator type="path"><boolean name="hide_emitters" value="{}"/></integrator>
  <sensor type="perspective"><transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film></sensor>
  <shape type="sphere"/>{}
  <emitter type="constant"/>
</scene>"""
FOG = """<medium type="homogeneous" name="interior"><float name="sigma_t" value="0.1"/></medium>"""


@pytest.mark.parametrize("value", ["true", "false"])
def test_files_say_it_and_the_setting_has_the_last_word(tmp_path, value):
    path = tmp_path / "hides.xml"
    path.write_text(SCENE.format(value, ""), "utf-8")
    opened = open_scene(path)
    assert opened.scene.camera.hides_lights == (value == "true")
    assert not any("hide" in warning for warning in opened.scene.warnings)
    for lights, hides in (("auto", value == "true"), ("hidden", True), ("shown", False)):
        assert plan_of(settings_of(render={"lights": lights}), opened.traits).hides == hides


def test_scenes_with_media_say_that_they_show_them(tmp_path):
    path = tmp_path / "fog.xml"
    text = SCENE.format("true", "").replace('<shape type="sphere"/>', f'<shape type="sphere">{FOG}</shape>')
    path.write_text(text, "utf-8")
    traits = analyse(load_scene(path))
    plan = plan_of(settings_of(), traits)
    assert not plan.hides
    assert SHOWN in plan.warnings
    assert "media" in inactive_reason("render.lights", settings_of(), traits)
    assert SHOWN not in plan_of(settings_of(render={"lights": "shown"}), traits).warnings


def test_a_reference_is_of_the_lights_that_its_file_shows():
    scene = open_scene("cornell_diffuse").scene
    reference_for(None, scene, settings_of())
    with pytest.raises(SceneError, match=r"leave out render\.lights"):
        reference_for(None, scene, settings_of(render={"lights": "hidden"}))
