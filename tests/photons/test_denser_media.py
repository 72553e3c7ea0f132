"""Media that scatter on a stage: photons aim more densely at what is small there, and none is confined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.stages.projection import projection_for
from pmviewer.maps.record import unpack
from pmviewer.photons.projection.projection import projection_of
from pmviewer.scene.arrays.flatten import LUMINANCE, flatten
from pmviewer.scene.description import ConstantEnvironment, Material, Medium
from tests.photons.test_cones import stage
from tests.support.denser import same_power_less_variance
from tests.support.scenes import cornell_box, rendered, settings_of

pytestmark = pytest.mark.usefixtures("any_light_in_media")

FOG = Medium("fog", (2.0, 1.5, 1.0), (0.9, 0.8, 0.7))
FLAME = replace(FOG, name="flame", emission=(0.5, 0.3, 0.1))
SKY = (ConstantEnvironment("sky", (1.0, 0.9, 0.8)),)
STAGES = {
    "dome": (("dome",), (), FOG, {"dome": "cones"}),
    "dome and a flame": (("dome",), (), FLAME, {"dome": "cones", "flame": "whole"}),
    "sky and a point": (("point",), SKY, FOG, {"point": "cones", "sky": "scales"}),
}


def foggy(lamps, lights, medium):
    """The stage, its ship a ball of the medium that nothing bounds."""
    scene = stage(*lamps)
    null = Material("boundary", "null", (0.0, 0.0, 0.0))
    shapes = tuple(replace(s, material=2, media=(0, -1)) if s.name == "ship" else s for s in scene.shapes)
    media = (medium,)
    return replace(
        scene, shapes=shapes, materials=(*scene.materials, null), lights=(*scene.lights, *lights), media=media
    )


@pytest.mark.parametrize("name", STAGES)
def test_power_in_the_volume_map_is_the_same_and_better_known(name):
    """z-test of the power that photons scatter in the fog after a bounce, and how much less it varies but for a flame
    in it, whose photons are where they always were; the energy balances."""
    *of, modes = STAGES[name]
    flat = flatten(foggy(*of))
    made = projection_of(flat, confined=False)
    assert {m.light: m.mode for m in made.surfaces} == modes
    assert {m.light: m.mode for m in made.caustic} == modes
    outside = np.array([light != "flame" for light in flat.light_names])

    def power_of(maps):
        stored = unpack(maps.volume, maps.volume_unit)
        return stored["Phi"][outside[stored["light"]]].astype(float) @ LUMINANCE

    same_power_less_variance(flat, made, power_of, stored=6, times=10)


def test_photons_are_never_confined_where_media_scatter():
    """Surfaces are what maps know of; a room full of fog has none, whatever is asked for."""
    for wanted in ("auto", "on"):
        settings = settings_of(photons={"projection": wanted})
        made = projection_for(open_scene(foggy(("dome",), (), FOG)), settings)
        assert made is not None
        assert {m.mode for m in made.surfaces} == {"cones"}
        box = cornell_box()
        camera = replace(box.camera, medium=0)
        assert projection_for(open_scene(replace(box, camera=camera, media=(FOG,))), settings) is None


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dome", "sky and a point"])
def test_all_methods_show_the_same_fog(name):
    """What the fog scatters, by paths and by photons; those of the floor far away are noise in few passes."""
    scene = foggy(*STAGES[name][:3])
    means = {}
    for method, passes in (("path", 512), ("progressive", 16), ("gather", 16)):
        settings = settings_of(render={"method": method}, photons={"N": 200_000}, estimate={"radius": 1e-3})
        frame = rendered(scene, settings, passes).frame(1)
        means[method] = sum(float(frame.image(term).astype(float).mean()) for term in ("volume", "volume indirect"))
    print(means)
    assert means["progressive"] == pytest.approx(means["path"], rel=0.03)
    assert means["gather"] == pytest.approx(means["path"], rel=0.03)
