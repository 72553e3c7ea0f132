"""What is said about a pass in which hardly a photon does what its picture needs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.scene.description import Material, Parallelogram, Shape, Sphere
from tests.support.scenes import MIRROR, ball_in_environment, rendered, settings_of

WHITE = Material("white", "diffuse", (0.5, 0.5, 0.5), two_sided=True)
CASES = [(200, "off", True), (200, "guided", False), (200, "aimed", False), (8, "off", False)]


def _under_a_dome(radius):
    """A mirror ball of radius 1 on a floor in a sphere of that radius that shines inwards: the ball meets (1/R)² of the
    dome's photons, as the cross-sections of both are to each other."""
    scene = ball_in_environment(MIRROR)
    floor = Shape("floor", Parallelogram((-3, -1.01, -3), (0, 0, 6), (6, 0, 0)), 1)
    dome = Shape("dome", Sphere((0, 0, 0), radius, True), 2, radiance=(1.0, 1.0, 1.0))
    black = replace(WHITE, name="black", reflectance=(0.0, 0.0, 0.0))
    return replace(scene, shapes=(*scene.shapes, floor, dome), materials=(MIRROR, WHITE, black), lights=())


@pytest.mark.parametrize(("radius", "emission", "told"), CASES)
def test_caustics_of_a_handful_of_photons_are_said(radius, emission, told):
    """Of 200,000 photons 5 meet a ball in a dome 200 times as large, and some of these the floor; 3,100 one in a dome
    of 8. The sentence tells how many, and what it advises sends more of them, as does the aim of photons at what is
    small."""
    guided = {"emission": "Christensen keep", "map": "average"} if emission == "guided" else {}
    projection = "auto" if emission == "aimed" else "off"
    settings = settings_of(
        photons={"N": 200_000, "projection": projection}, estimate={"radius": 0.2 / radius}, importance=guided
    )
    renderer = rendered(_under_a_dome(radius), settings, 4)
    statistics = renderer.frame(1).statistics
    said = [sentence for sentence in statistics.warnings if "bright spot" in sentence]
    count = statistics.stored_in_pass["caustic"]
    print(f"dome of {radius}, emission {emission}: {count} photons of caustics, {said}")
    assert bool(said) == told
    if told:
        assert 0 < count <= 5 + 5 * np.sqrt(5)
        assert f"Only {count} of 200,000 photons" in said[0]
        assert "importance.emission = Christensen keep, importance.map = average" in said[0]
    else:
        assert count > 100
