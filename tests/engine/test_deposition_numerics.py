"""Deposition rules where importance says little or nothing: finite pictures, an end, and a sentence for the log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.maps.record import unpack
from pmviewer.scene.description import Camera, Parallelogram, PointLight, Scene, Shape, Sphere
from tests.support.scenes import MIRROR, box_camera, box_walls, cornell_box, diffuse, panel, rendered, settings_of

METHODS = ("progressive", "gather")
RULES = {
    "all": {"deposition": "all"},
    "clamp": {"deposition": "Keller-Wald"},
    "discard": {"deposition": "Keller-Wald", "cut_off": "discard"},
    "step": {"deposition": "density control"},
    "cosine": {"deposition": "density control", "acceptance": "cosine"},
    "constant": {"deposition": "constant density"},
    "converging": {"deposition": "density control", "convergence": "square"},
}
BLACK = diffuse("black", (0.0, 0.0, 0.0))
SIZE = 8


def behind_a_mirror():
    """A camera before mirrors alone; the diffuse walls are behind them."""
    walls = [replace(s, material=1) for s in box_walls()]
    hidden = [replace(s, geometry=replace(s.geometry, corner=(*s.geometry.corner[:2], -5.0))) for s in box_walls(0.2)]
    camera = Camera((0.0, 0.0, 0.5), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 40.0, near=0.0, far=np.inf)
    shapes = (*walls, *hidden, panel(material=2))
    return Scene("mirrors", None, shapes, (diffuse(), MIRROR, BLACK), (), camera, SIZE, SIZE)


def looking_away():
    """Nothing is seen: the camera looks out into the dark."""
    floor = Parallelogram((-1.0, 0.0, -1.0), (0.0, 0.0, 2.0), (2.0, 0.0, 0.0))
    ball = Shape("ball", Sphere((0.0, 0.5, 0.0), 0.3), 1)
    camera = Camera((0.0, 1.0, 5.0), (0.0, 1.0, 9.0), (0.0, 1.0, 0.0), 40.0, near=0.0, far=np.inf)
    light = PointLight("point", (0.0, 2.0, 0.0), (3.0, 3.0, 3.0))
    return Scene("away", None, (Shape("floor", floor, 0), ball), (diffuse(), MIRROR), (light,), camera, SIZE, SIZE)


def one_triangle():
    """All importons are on one small square, and most photons elsewhere."""
    scene = cornell_box(size=SIZE)
    spot = Parallelogram((-0.02, 0.0, -0.02), (0.0, 0.0, 0.04), (0.04, 0.0, 0.0))
    camera = Camera((0.0, 0.01, 0.0), (0.0, 0.0, 0.001), (0.0, 0.0, 1.0), 40.0, near=0.0, far=np.inf)
    return replace(scene, shapes=(*scene.shapes, Shape("spot", spot, 0)), camera=camera)


def inside_an_object():
    """The camera is in a small opaque ball and sees its dark inside alone."""
    scene = cornell_box(size=SIZE)
    ball = Shape("solid", Sphere((0.0, 0.0, 0.95), 0.01), len(scene.materials))
    return replace(scene, shapes=(*scene.shapes, ball), materials=(*scene.materials, diffuse("solid")))


def no_light_in_sight():
    """The lamp shines inside a closed black box: no photon and no light sample reaches what is seen."""
    camera = replace(box_camera(), target=(0.0, -0.2, 0.0))
    shapes = (*box_walls(), *(replace(s, material=1) for s in box_walls(0.2)), panel(0.1, material=1))
    ball = Shape("ball", Sphere((0.5, -0.7, 0.0), 0.2), 2)
    return Scene("dark", None, (*shapes, ball), (diffuse(), BLACK, MIRROR), (), camera, SIZE, SIZE)


CASES = {
    "mirrors": (behind_a_mirror, True),
    "away": (looking_away, True),
    "one triangle": (one_triangle, False),
    "inside": (inside_an_object, False),
    "no light": (no_light_in_sight, False),
}
"""Scene, and whether importons find no place at all."""


def settings(method, rule, **importance):
    importance = {"map": "average", "N": 300, "neighbours": 20, **RULES[rule], **importance}
    return settings_of(render={"method": method}, photons={"N": 600}, importance=importance)


def check(renderer):
    frame, photons = renderer.frame(1), renderer.light.photons
    assert np.isfinite(frame.image()).all()
    assert sum(frame.statistics.dropped.values()) == 0
    for map_, unit in ((photons.caustic, photons.caustic_unit), (photons.global_, photons.global_unit)):
        power = unpack(map_, unit)["Phi"]
        assert np.isfinite(power).all()
        assert (power >= 0).all()
    for deposited in frame.statistics.deposited.values():
        assert np.isfinite(
            [deposited.arrived_power, deposited.stored_power, deposited.discarded_power, deposited.largest_arrived]
        ).all()
        if renderer.settings.importance.deposition in ("density control", "constant density"):
            assert deposited.stored_power == pytest.approx(deposited.arrived_power, rel=1e-3)
    return frame


@pytest.fixture(scope="module", params=CASES)
def case(request):
    make, blind = CASES[request.param]
    return request.param, open_scene(make()), blind


@pytest.mark.extensive
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rule", RULES)
def test_degenerate_scenes(case, rule, method):
    name, scene, blind = case
    renderer = rendered(scene, settings(method, rule), 2)
    frame = check(renderer)
    said = " ".join(frame.statistics.warnings)
    assert ("Importance: none of" in said) == blind, said
    if blind:
        assert renderer.importance.latest.n == 0
        if rule in ("clamp", "discard"):
            assert "no importance" in said
    if blind and rule == "discard":
        assert sum(deposited.stored for deposited in frame.statistics.deposited.values()) == 0
    if name == "no light":
        assert frame.image().max() == 0
        assert ("Does light reach" in said) == (rule not in ("all", "constant")), said


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rule", ["clamp", "discard"])
def test_vanishing_probability(rule, method):
    """f → 0: p_k → 0 everywhere, which ε bounds."""
    renderer = rendered(cornell_box(size=SIZE), settings(method, rule, f=1e-9, epsilon=1e-3), 2)
    frame = check(renderer)
    deposited = frame.statistics.deposited["global"]
    assert deposited.stored <= (0 if rule == "discard" else 0.02 * deposited.arrived + 5)
    if rule == "discard":
        assert deposited.discarded_power == pytest.approx(deposited.arrived_power)


@pytest.mark.parametrize("density", [1e-6, 1e12])
def test_extreme_densities(density):
    renderer = rendered(cornell_box(size=SIZE), settings("progressive", "constant", density=density), 2)
    check(renderer)
