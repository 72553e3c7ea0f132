"""Media in Mitsuba's files: what is read, what is said of the rest, and where the camera and lights are."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.immersion import immersed
from pmviewer.engine.media_plan import BLURRED, LOOKED_FOR
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.kernels.media.kinds import RAYLEIGH
from pmviewer.kernels.memory import at_address
from pmviewer.render.camera import resolve_camera
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.load import read_scene
from pmviewer.scene.medium import Medium, Phase
from pmviewer.settings.access import Settings, with_values

LIGHT = '<emitter type="point"><point name="position" x="0" y="0" z="5"/></emitter>'
CAMERA = (
    '<sensor type="perspective"><transform name="to_world"><lookat origin="0,0,6" target="0,0,0" up="0,1,0"/>'
    "</transform>{}</sensor>"
)
FOG = '<medium type="homogeneous" id="fog">{}</medium>'
CUBE = '<shape type="cube"><bsdf type="null"/>{}</shape>'
INSIDE = '<ref name="interior" id="fog"/>'


def scene_of(tmp_path, *elements, camera=""):
    path = tmp_path / "scene.xml"
    path.write_text(f"<scene version='3.0.0'>{''.join(elements)}{CAMERA.format(camera)}{LIGHT}</scene>", "utf-8")
    return read_scene(path)


def medium_of(tmp_path, inner):
    scene = scene_of(tmp_path, FOG.format(inner), CUBE.format(INSIDE))
    return scene.media[0], scene.warnings


@pytest.mark.parametrize(
    ("inner", "expected"),
    [
        ("", Medium("fog")),
        ('<float name="sigma_t" value="2"/><float name="scale" value="3"/>', Medium("fog", (6.0,) * 3)),
        ('<rgb name="albedo" value="0.9 0.5 0"/>', Medium("fog", albedo=(0.9, 0.5, 0.0))),
        (
            '<rgb name="sigma_s" value="3 1 0"/><rgb name="sigma_a" value="1 1 0"/>',
            Medium("fog", (4.0, 2.0, 0.0), (0.75, 0.5, 0.0)),
        ),
        ('<phase type="hg"><float name="g" value="-0.4"/></phase>', Medium("fog", phase=Phase(-0.4))),
        ('<phase type="hg"/>', Medium("fog", phase=Phase(0.8))),
        ('<phase type="isotropic"/>', Medium("fog")),
        ('<phase type="rayleigh"/>', Medium("fog", phase=Phase(RAYLEIGH))),
        (
            '<phase type="blendphase"><phase type="hg"/><phase type="rayleigh"/></phase>',
            Medium("fog", phase=Phase(0.8, RAYLEIGH, 0.5)),
        ),
        (
            '<phase type="blendphase"><float name="weight" value="0.25"/><phase type="isotropic"/>'
            '<phase type="hg"><float name="g" value="0.9"/></phase></phase>',
            Medium("fog", phase=Phase(0.0, 0.9, 0.25)),
        ),
        (
            '<volume name="sigma_t" type="constvolume"><float name="value" value="5"/></volume>',
            Medium("fog", (5.0,) * 3),
        ),
        ('<rgb name="emission" value="1 2 3"/>', Medium("fog", emission=(1.0, 2.0, 3.0))),
    ],
)
def test_homogeneous_media_are_read_as_they_stand(tmp_path, inner, expected):
    medium, warnings = medium_of(tmp_path, inner)
    np.testing.assert_allclose(medium.sigma_t, expected.sigma_t)
    np.testing.assert_allclose(medium.albedo, expected.albedo)
    assert (medium.emission, medium.phase) == (expected.emission, expected.phase)
    assert not warnings


@pytest.mark.parametrize(
    ("inner", "said"),
    [
        ('<phase type="microflake"/>', "scattered alike in all directions"),
        ('<phase type="tabphase"/>', "scattered alike in all directions"),
        ('<phase type="tabphase"><string name="values" value="1, x"/></phase>', "scattered alike in all directions"),
        ('<phase type="tabphase"><string name="values" value="0, 1"/></phase>', "with the same mean cosine, 0.33"),
        ('<float name="sigma_t" value="-1"/>', "negative numbers count as 0"),
        ('<float name="albedo" value="1.5"/>', "above 1 was cut"),
        ('<phase type="hg"><float name="g" value="2"/></phase>', "was taken as"),
        ('<string name="material" value="skin1"/>', "'material' of <medium"),
        ('<volume name="albedo" type="gridvolume"><string name="filename" value="x.vol"/></volume>', "not supported"),
        ('<float name="thickness" value="1"/>', "'thickness' of <medium"),
    ],
)
def test_what_is_not_shown_is_said(tmp_path, inner, said):
    scene = scene_of(tmp_path, FOG.format(inner), CUBE.format(INSIDE))
    assert any(said in warning for warning in scene.warnings), scene.warnings


def test_media_of_other_types_leave_their_shapes_clear_with_a_sentence(tmp_path):
    scene = scene_of(tmp_path, '<medium type="strange" id="fog"/>', CUBE.format(INSIDE))
    assert scene.media == ()
    assert not flatten(scene).has_media
    assert any("what it fills is clear" in warning for warning in scene.warnings)


def test_sides_of_shapes(tmp_path):
    more = '<medium type="homogeneous" id="thin"><float name="sigma_t" value="0.1"/></medium>'
    both = '<ref name="exterior" id="thin"/><medium name="interior" type="homogeneous"/>'
    scene = scene_of(
        tmp_path, FOG.format(""), more, CUBE.format(INSIDE), CUBE.format(both), CUBE.format(""),
        '<shape type="sphere"><bsdf type="dielectric"/><ref name="exterior" id="fog"/></shape>',
    )  # fmt: skip
    assert [shape.media for shape in scene.shapes] == [(0, -1), (1, 2), None, (-1, 0)]
    kinds = [scene.materials[shape.material].kind for shape in scene.shapes]
    assert kinds == ["null", "null", "diffuse", "dielectric"]  # what bounds no medium is passed without a stop
    assert not scene.warnings


def test_clear_scenes_have_the_record_that_they_had(tmp_path):
    flat = flatten(scene_of(tmp_path, FOG.format(""), CUBE.format("")))
    assert not flat.has_media
    assert "media" not in flat.record.dtype.names


def test_the_camera_is_where_boundaries_say(tmp_path):
    """Whatever the file says of its own camera; that counts where no boundary tells."""
    opened = open_scene(scene_of(tmp_path, FOG.format(""), CUBE.format(INSIDE)))
    for z, expected in ((6.0, -1), (0.5, 0), (-3.0, -1)):
        settings = with_values(Settings(), {"camera.origin": (0.1, 0.2, z), "camera.target": (0.1, 0.2, z - 1)})
        camera = immersed(opened.flat, resolve_camera(opened.scene, settings.camera))
        assert camera.medium == expected, z
    everywhere = scene_of(tmp_path, FOG.format(""), '<shape type="sphere"/>', camera='<ref id="fog"/>')
    opened = open_scene(everywhere)
    assert immersed(opened.flat, resolve_camera(opened.scene, Settings().camera)).medium == 0
    assert at_address(opened.flat.record["light_media"][0], 1, np.int32)[0] == 0


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"importance.emission": "Peter-Pietrek"}, "Guided emission does not know of media"),
        ({"gather.cache": "on", "render.method": "gather"}, "irradiance cache does not know of media"),
        ({"direct.shadow_photons": True}, "Shadow photons do not know of media"),
        (
            {"render.method": "virtual lights", "virtual.estimator": "full path"},
            "Virtual lights weighed by whole paths",
        ),
        ({"render.method": "virtual lights", "virtual.choice": "light tree"}, "chosen by a tree, do not know of media"),
        ({"render.method": "global map"}, "A map alone shows no light that media scatter"),
    ],
)
def test_stages_that_know_no_media_do_not_run_and_say_so(tmp_path, changes, said):
    traits = open_scene(scene_of(tmp_path, FOG.format(""), CUBE.format(INSIDE), '<shape type="sphere"/>')).traits
    plan = plan_of(with_values(Settings(), changes), traits)
    assert plan.media
    assert any(said in warning for warning in plan.warnings)
    assert not (plan.importance)
    assert not (plan.cache)
    assert not (plan.shadows)
    assert not (plan.virtual)
    assert not (plan.judges)
    assert plan.volume == ("map alone" not in said and "A map" not in said)


def test_lobes_narrower_than_photons_directions_are_said(tmp_path):
    for g, said in ((0.9, False), (0.999, True)):
        phase = f'<phase type="hg"><float name="g" value="{g}"/></phase>'
        traits = open_scene(scene_of(tmp_path, FOG.format(phase), CUBE.format(INSIDE))).traits
        assert (BLURRED in plan_of(Settings(), traits).warnings) == said


def test_where_media_emit_rays_look_for_light_whatever_is_asked(tmp_path):
    for emission, method, said in (("1", "progressive", True), ("1", "path", False), ("0", "gather", False)):
        fog = FOG.format(f'<rgb name="emission" value="{emission}"/>')
        traits = open_scene(scene_of(tmp_path, fog, CUBE.format(INSIDE))).traits
        plan = plan_of(with_values(Settings(), {"render.method": method, "direct.mis": False}), traits)
        assert (LOOKED_FOR.sentence in plan.warnings) == said
