"""Light samples of a surface and of passes complement each other: their error falls faster than chance's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.render.direct.direct import power_heuristic
from pmviewer.render.direct.samples import SAMPLES, SEVERAL, samples_at_surface
from pmviewer.scene.description import Camera, Parallelogram, Scene, Shape
from tests.support.device import from_python
from tests.support.scenes import diffuse, panel, rendered, settings_of

f4 = np.float32


def direct_light(samples, passes):
    """The term direct of a spot of floor beside and below a panel: pixels differ by their light samples alone."""
    floor = Parallelogram((0.29, 0, 0.29), (0, 0, 0.02), (0.02, 0, 0))
    shapes = (Shape("floor", floor, 0), panel(half=0.2, y=0.5, radiance=(1.0,) * 3, material=1))
    camera = Camera((0.3, 0.3, 0.3), (0.3, 0, 0.3), (0, 0, 1), 2.0, near=0.0, far=np.inf)
    scene = Scene("panel", None, shapes, (diffuse(), diffuse("black", (0.0,) * 3)), (), camera, 32, 32)
    settings = settings_of(direct={"mis": False, "samples": samples}, photons={"N": 1000})
    return rendered(scene, settings, passes=passes).frame(1).image("direct")[..., 0].astype(np.float64)


def test_samples_of_surfaces_and_passes_complement_each_other():
    """Eight samples have an eighth of one's variance by chance. However they are divided among passes, theirs is less
    than an eighth of that, for a light whose light grows smoothly from one corner to the other."""
    one = direct_light(1, 1).var()
    for samples, passes in ((1, 8), (2, 4), (8, 1)):
        gain = one / direct_light(samples, passes).var()
        print(f"{samples} samples in each of {passes} passes: variance of one sample over theirs {gain:.0f}")
        assert gain > 64


def test_their_number_follows_from_what_is_rendered():
    direct = settings_of().direct

    def number(direct, path=False, media=False, several=False):
        return samples_at_surface(direct, path, media, several)

    assert number(direct) == SAMPLES < number(direct, several=True) == SEVERAL
    assert number(direct, path=True, several=True) == number(direct, media=True, several=True) == 1
    assert number(settings_of(direct={"samples": 5}).direct, path=True, media=True) == 5


def test_several_lights_and_skies_get_more():
    def number(traits):
        return plan_of(settings_of(), traits).light_samples

    one = open_scene("cornell_diffuse").traits
    assert number(one) == SAMPLES
    assert number(replace(one, has_environment=True)) == number(open_scene("cornell_lights").traits) == SEVERAL


@pytest.mark.parametrize("scale", [1e-30, 1.0, 1e15, 1e30])
def test_samples_of_two_techniques_weigh_one_together_at_any_density(scale):
    """Of densities whose squares float32 does not hold, too; of an infinite one, as a light has that is seen from its
    edge, all: weights that are no numbers would cost the sample."""
    weight = from_python(power_heuristic)
    for a, b in ((1.0, 1.0), (3.0, 1.0), (1.0, 2.5), (1.0, 0.0)):
        first, second = (weight(f4(2), f4(x * scale), f4(2), f4(y * scale)) for x, y in ((a, b), (b, a)))
        assert first == pytest.approx(a * a / (a * a + b * b), rel=1e-6)
        assert first + second == pytest.approx(1.0, rel=1e-6)
    assert weight(f4(1), f4(np.inf), f4(1), f4(scale)) == 1.0
    assert weight(f4(1), f4(scale), f4(1), f4(np.inf)) == 0.0
