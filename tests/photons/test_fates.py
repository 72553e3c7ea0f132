"""What becomes of photons, judged again for showing them: the same as in the pass, and all accounted for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.inspection import Wanted
from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.importance.lights import importance_of_lights
from pmviewer.maps.record import unpack
from pmviewer.photons.deposition.deposited import DISCARDED, REDISTRIBUTED, REJECTED, STORED
from pmviewer.photons.deposition.fates import FATE_BITS
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Scene
from pmviewer.scene.light_places import light_places
from pmviewer.viewer.overlays.fates import Fates, fate_counts
from pmviewer.viewer.overlays.light_importance import light_points
from pmviewer.viewer.panels.light_list import light_rows, top_lights
from tests.support.scenes import box_camera, box_walls, cornell_box, diffuse, light_scene, panel, settings_of

RULES = {
    "clamp": {"deposition": "Keller-Wald", "epsilon": 0.3, "f": 0.3},
    "discard": {"deposition": "Keller-Wald", "epsilon": 0.3, "f": 0.3, "cut_off": "discard"},
    "step": {"deposition": "density control"},
    "cosine": {"deposition": "density control", "acceptance": "cosine"},
    "constant": {"deposition": "constant density"},
    "converging": {"deposition": "density control", "convergence": "square"},
    "guided": {"deposition": "density control", "emission": "Peter-Pietrek"},
    "Christensen": {"emission": "Christensen keep"},
}


@pytest.fixture(scope="module")
def scene():
    return open_scene(cornell_box(size=12))


def stepped(scene, pool, method="progressive", passes=1, N=20_000, **importance):
    how = {"map": "screen", "N": 1500, "neighbours": 20, **importance}
    settings = settings_of(render={"method": method}, photons={"N": N, "q": 0.5}, importance=how)
    renderer = Renderer(scene, settings, pool, StageStore(0))
    for _ in range(passes):
        renderer.step()
    return renderer


@pytest.mark.parametrize("rule", RULES)
def test_fates_are_those_of_the_pass_and_add_up(scene, pool, rule):
    """The second pass, so that its own photons and rules are meant: counts as in the statistics, stored ones where the
    map has them."""
    renderer = stepped(scene, pool, passes=2, **RULES[rule])
    assert (renderer.light.latest.lights is not None) == (rule in ("guided", "Christensen"))
    rows = renderer.inspect(Wanted(fates=1_000_000)).fates
    found = unpack(rows, 1.0)
    fates, maps = found["light"] & 7, found["light"] >> FATE_BITS
    for number, name in enumerate(("caustic", "global")):
        deposited = renderer.tally.deposited[name]
        counts = np.bincount(fates[maps == number], minlength=4)
        assert counts.sum() == deposited.arrived > 200
        assert counts[STORED] == deposited.stored
        assert counts[REDISTRIBUTED] == deposited.redistributed
        assert counts[REJECTED] + counts[DISCARDED] == deposited.rejected - deposited.redistributed
        assert (counts[DISCARDED] > 0) == (rule == "discard")
        assert tuple(counts) == fate_counts(rows, name)
        stored = found["position"][(maps == number) & (fates == STORED)]
        in_map = renderer.light.photons.caustic if name == "caustic" else renderer.light.photons.global_
        np.testing.assert_array_equal(stored, in_map[:, :3])
    assert fate_counts(rows) == tuple(np.bincount(fates, minlength=4))


def test_fewer_trajectories_are_the_first_ones(scene, pool):
    renderer = stepped(scene, pool, **RULES["step"])
    few, many = (renderer.inspect(Wanted(fates=n)).fates for n in (3000, 1_000_000))  # a batch, and all
    for map_ in (0, 1):
        a, b = (rows[rows.view(np.uint32)[:, 5] >> 16 >> FATE_BITS == map_] for rows in (few, many))
        assert 100 < len(a) < len(b)
        np.testing.assert_array_equal(a.view(np.uint32), b[: len(a)].view(np.uint32))


def test_nothing_is_judged_again_unless_asked_for(scene, pool):
    renderer = stepped(scene, pool)
    assert renderer.inspect(Wanted(fates=1000)).fates is None  # all are stored
    assert renderer.frame(1).inspection.fates is None
    assert renderer.frame(1).inspection.lights is None


@pytest.mark.parametrize(
    ("map_", "only", "drawn"),
    [
        ("both", "all", {0, 1, 2, 3, 8, 9, 10, 11}),
        ("caustic", "all", {0, 1, 2, 3}),
        ("global", "stored", {8}),
        ("both", "not stored", {1, 2, 3, 9, 10, 11}),
    ],
)
def test_choice_of_what_is_drawn(map_, only, drawn):
    style = settings_of(**{"overlays.fates": {"map": map_, "only": only}}).overlays.fates
    assert {number for number in range(32) if Fates.tags(style) >> number & 1} == drawn


# --- lights -----------------------------------------------------------------------------------------------------------


def two_rooms():
    """Two closed boxes with a lamp of the same power each; the camera is in the left one."""

    def moved(shape, name):
        g = shape.geometry
        return replace(shape, name=name, geometry=replace(g, corner=(g.corner[0] + 5.0, *g.corner[1:])))

    left = (*box_walls(), panel())
    right = tuple(moved(shape, f"right {shape.name}") for shape in left)
    return Scene("two rooms", None, (*left, *right), (diffuse(),), (), box_camera(), 12, 12)


@pytest.mark.parametrize("method", ["progressive", "gather"])
def test_the_light_in_the_other_room_lights_nothing(pool, method):
    renderer = stepped(open_scene(two_rooms()), pool, method)
    lights = renderer.inspect(Wanted(lights=True)).lights
    assert lights.names == ("panel", "right panel")
    np.testing.assert_allclose(lights.power, [0.5, 0.5])
    np.testing.assert_allclose(lights.lit, [1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(lights.factor, 1.0)
    assert top_lights(lights, 5) == [0]
    assert light_rows(lights, 5) == [("1: panel", "100.0%"), ("1 others", "0.0%")]
    frame = renderer.frame(1, Wanted(lights=True))
    assert frame.known_lights.names == lights.names
    points = unpack(light_points(lights, frame.light_places), 1.0)
    np.testing.assert_allclose(points["position"], [[0, 0.9, 0], [5, 0.9, 0]], atol=1e-6)
    np.testing.assert_allclose(points["Phi"][:, :2], [[1, 1], [0, 1]], rtol=1e-3)


def test_shares_follow_power(pool):
    """Two lamps in one place, one twice as strong."""
    strong = replace(panel(), name="strong", radiance=(10.0,) * 3)
    weak = panel(half=0.4, y=0.85)
    shapes = (*box_walls(), replace(strong, geometry=replace(strong.geometry, corner=(-0.9, 0.9, -0.4))), weak)
    weak = replace(weak, geometry=replace(weak.geometry, corner=(0.1, 0.9, -0.4)))
    scene = Scene("two lamps", None, (*shapes[:-1], weak), (diffuse(),), (), box_camera(), 12, 12)
    lights = stepped(open_scene(scene), pool).inspect(Wanted(lights=True)).lights
    np.testing.assert_allclose(lights.power, [2 / 3, 1 / 3])
    np.testing.assert_allclose(lights.lit, [2 / 3, 1 / 3], atol=0.03)  # the picture is symmetric


def test_no_photon_no_importance():
    lights = importance_of_lights(("a", "b"), np.array([1.0, 0.0]), [], lambda tasks: [])
    np.testing.assert_array_equal(lights.lit, 0.0)
    assert top_lights(lights, 3) == []


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("parallelogram", (0.15, 2.0, 0.2)),
        ("disk", (0.2, 2.0, 0.1)),
        ("sphere", (0.3, 1.5, -0.2)),
        ("cylinder", (-0.05, 1.55, 0.15)),
        ("mesh", (0.1, 1.8, 0.2)),
        ("point", (0.3, 1.2, -0.4)),
        ("environment", (np.nan,) * 3),
    ],
)
def test_places_of_lights(name, place):
    np.testing.assert_allclose(light_places(flatten(light_scene(name)))[0], place, atol=1e-5)
