"""Known deviations explain what they are known for and nothing else. Without Mitsuba."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.bench.agree import triage
from pmviewer.bench.agree.generate import scene_of
from pmviewer.bench.agree.known import DEVIATIONS
from pmviewer.bench.agree.statistics import Outcome
from pmviewer.bench.agree.trial import STAGES
from tests.support.agreeing import comparison


@pytest.mark.parametrize(
    ("shape", "inward"),
    [
        ({"type": "cube", "to_world": []}, False),
        ({"type": "cube", "to_world": [], "flip_normals": True}, True),
        ({"type": "ply", "mesh": {"normals": True}, "to_world": [["scale", [-1, 1, 1]]], "face_normals": True}, True),
        ({"type": "ply", "mesh": {"normals": False}, "to_world": [["scale", [-1, 1, 1]]]}, True),
        ({"type": "ply", "mesh": {"normals": True}, "to_world": [["scale", [-1, 1, 1]]]}, False),
        ({"type": "obj", "mesh": {"normals": False}, "to_world": [["scale", [-1, -1, 1]]]}, False),
        ({"type": "obj", "mesh": {"normals": False}, "to_world": [["matrix", [*np.diag([1, 1, -1, 1]).flat]]]}, True),
        ({"type": "rectangle", "to_world": [], "flip_normals": True}, False),
    ],
)
def test_closed_lights_that_shine_inwards_are_known(shape, inward):
    """Those of scenes 287 and 324 of seed 31, and others."""
    known = next(d for d in DEVIATIONS if d.name == "light turned inwards")
    scene = {"shapes": [{**shape, "emitter": {"radiance": [1, 1, 1]}}], "groups": {}}
    turned = known.without(scene)
    assert (turned is not None) == inward
    assert turned is None or known.without(turned) is None


def test_glass_around_a_camera_that_sits_in_the_dark_is_known():
    """Scene 72 of seed 2611: light gets into a closed cube where a ball of glass crosses it. Not so with a lamp in it,
    where the camera is beside it, or without the glass."""
    known = next(d for d in DEVIATIONS if d.name == "glass in the dark")
    scene = scene_of(2611, 72)
    dark = known.without(scene)
    assert len(dark["shapes"]) == len(scene["shapes"]) - 1
    assert known.without(dark) is None
    cube, lamp = scene["shapes"][2], scene["shapes"][-1]
    inside = {**lamp, "to_world": [["scale", [0.01] * 3], *cube["to_world"]]}
    assert known.without({**scene, "shapes": [*scene["shapes"], inside]}) is None
    assert known.without({**scene, "camera": {**scene["camera"], "origin": [-1.5, 1.5, 0.3]}}) is None
    assert known.without({**scene, "lights": [{"type": "point", "position": [-0.04, -0.3, 0.5]}]}) is None


def test_mirrored_glass_is_known_to_stop_particles_alone():
    """Scene 30012 of seed 9: a mirrored cube of glass. Our own methods and Mitsuba's paths have no such excuse."""
    known = next(d for d in DEVIATIONS if d.name == "mirrored shape by particles")
    assert [known.concerns(peer) for peer in ("Mitsuba particles", "Mitsuba path", "our path")] == [True, False, False]
    scene = scene_of(9, 30012)
    without = known.without(scene)
    changed = [i for i, shape in enumerate(scene["shapes"]) if shape != without["shapes"][i]]
    assert [scene["shapes"][i]["type"] for i in changed] == ["cube"]
    assert ["scale", [1.0, 1.0, -1.0]] in scene["shapes"][changed[0]]["to_world"]
    assert ["scale", [1.0, 1.0, 1.0]] in without["shapes"][changed[0]]["to_world"]
    assert known.without(without) is None


@pytest.mark.parametrize(
    ("kind", "stops"), [("rectangle", True), ("cube", True), ("disk", False), ("cylinder", False), ("sphere", False)]
)
def test_mirrored_shapes_that_stop_particles(kind, stops):
    """Scene 267 of seed 2611 has a metal rectangle."""
    known = next(d for d in DEVIATIONS if d.name == "mirrored shape by particles")
    mirrored = {"shapes": [{"type": kind, "to_world": [["scale", [-1.0, 1.0, 1.0]]]}], "groups": {}}
    assert (known.without(mirrored) is not None) == stops
    plain = {"shapes": [{"type": kind, "to_world": [["scale", [1.0, 1.0, 1.0]]]}], "groups": {}}
    assert known.without(plain) is None


def test_a_sphere_light_is_known_to_send_particles_as_before_it_was_turned():
    """Scene 169 of seed 2611. The sphere stays where it is, as large and as bright; others' turns stay, too."""
    known = next(d for d in DEVIATIONS if d.name == "turned sphere light by particles")
    assert [known.concerns(peer) for peer in ("Mitsuba particles", "Mitsuba path")] == [True, False]
    scene = scene_of(2611, 169)
    without = known.without(scene)
    (changed,) = (i for i, shape in enumerate(scene["shapes"]) if shape != without["shapes"][i])
    before, after = scene["shapes"][changed], without["shapes"][changed]
    assert before["type"] == "sphere"
    assert after["emitter"] == before["emitter"]
    assert [kind for kind, _ in after["to_world"]] == ["scale", "translate"]
    np.testing.assert_allclose(after["to_world"][0][1], [0.4] * 3)
    np.testing.assert_allclose(after["to_world"][1][1], [-0.6137, 0.389, 0.2])
    assert known.without(without) is None


def test_known_deviations_explain_only_what_agrees_without_them(monkeypatch):
    scenes = (scene_of(1, i) for i in range(300))
    known = (
        (scene, [d.name for d in DEVIATIONS if d.concerns("Mitsuba path") and d.without(scene)]) for scene in scenes
    )
    # Without glass a scene may lack what other entries take, too.
    scene, names = next((s, names) for s, names in known if len(names) >= 2 and "glass in the dark" not in names)
    found, asked = comparison("path", 1e-9), []

    def explanation(comparison):
        return triage.explanation(scene, comparison, (1,), shared_kernels=True)

    def answers(agreeing: set[str]):
        """A scene agrees when it lacks all that is named."""

        def outcome_of(simpler, like, stage, salt, shared_kernels, believed):
            asked.append(simpler)
            assert (stage, shared_kernels) == (len(STAGES) - 1, True)
            lacks = {d.name for d in DEVIATIONS if d.without(simpler) is None}
            return Outcome(0.5 if agreeing <= lacks else 1e-12, 1.0, 0.01, 51)

        return outcome_of

    monkeypatch.setattr(triage, "outcome_of", answers({names[1]}))
    assert explanation(found) == names[1]
    monkeypatch.setattr(triage, "outcome_of", answers(set(names[:2])))
    assert explanation(found) == " + ".join(names)
    monkeypatch.setattr(triage, "outcome_of", lambda *a, **k: Outcome(1e-12, 1.3, 0.01, 51))
    assert explanation(found) == ""
    own = comparison("gather", 1e-9, peer_name="our path")
    monkeypatch.setattr(triage, "outcome_of", answers(set()))
    among_ours = [d.name for d in DEVIATIONS if d.among_ours and d.name in names]
    assert explanation(own) in ("", *among_ours)
    assert bool(explanation(own)) == bool(among_ours)
    monkeypatch.setattr(triage, "outcome_of", answers({names[1]}))
    asked.clear()
    all_ = triage.all_explained(scene, [found, comparison("path", 1e-3), found], (1,), shared_kernels=True)
    assert [c.known for c in all_] == [names[1], "", names[1]]
    assert asked[-1] == DEVIATIONS[[d.name for d in DEVIATIONS].index(names[1])].without(scene)
    assert len(asked) == 3, "what explained the first is tried first"


def test_a_disagreement_is_shrunk_by_kernels_for_all_where_they_show_it_too(monkeypatch):
    asked = []

    def by(shows):
        def outcome_of(scene, like, stage, salt, shared_kernels):
            asked.append((stage, shared_kernels))
            return Outcome(1e-9 if shows(stage, shared_kernels) else 0.5, 1.2, 0.01, 51)

        return outcome_of

    monkeypatch.setattr(triage, "shrunk", lambda scene, still, most: still(scene) and scene)
    for shows, used in (
        (lambda stage, shared: stage > 0, (1, True)),
        (lambda stage, shared: not shared, (0, False)),
    ):
        monkeypatch.setattr(triage, "outcome_of", by(shows))
        assert triage.smallest({"shapes": []}, comparison("path", 1e-9), (1,), 5)
        assert asked[-1] == used
