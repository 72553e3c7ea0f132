"""What is compared, how often, what counts as a disagreement; the command's options. Without Mitsuba."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from pmviewer.bench import peer
from pmviewer.bench.agree import bench, results, triage, trial
from pmviewer.bench.agree.generate import needs_particles, scene_of
from pmviewer.bench.agree.known import DEVIATIONS
from pmviewer.bench.agree.media import has_media
from pmviewer.bench.agree.ours import Rendered
from pmviewer.bench.agree.shares import asked_methods, asks_one_scattering, has_panes
from pmviewer.bench.agree.statistics import Outcome
from pmviewer.bench.agree.tree import from_json
from pmviewer.bench.agree.trial import FIRST, STAGES, Question, methods_of, questions
from pmviewer.bench.agree.verdict import DIED, Comparison, Verdict
from pmviewer.bench.agree.workers import try_scenes
from pmviewer.bench.registry import run_bench
from pmviewer.errors import OutputError, PmviewerError, SettingError
from pmviewer.scene.load import load_scene


def noisy(seed: int, runs: int, mean: float) -> np.ndarray:
    return mean * (1 + 0.005 * np.random.default_rng(seed).normal(0, 1, (runs, 51)))


def question(ratios: list[float], asked: list[int], method: str = "path") -> Question:
    """Ours differ by another ratio at each stage; the stages asked for go into `asked`."""

    def pair(stage: int) -> tuple[np.ndarray, np.ndarray]:
        asked.append(stage)
        runs = STAGES[stage].runs
        return noisy(2 * stage, runs, ratios[stage]), noisy(2 * stage + 1, runs, 1.0)

    return Question(method, "Mitsuba path", "picture", pair)


def test_more_is_rendered_only_while_there_is_doubt():
    for ratios, stages in (
        ([1.0, 1.0, 1.0, 1.0, 1.0], 1),
        ([1.3, 1.0, 1.0, 1.0, 1.0], 2),
        ([1.3, 1.3, 1.0, 1.0, 1.0], 3),
        ([1.3, 1.3, 1.3, 1.0, 1.0], 4),
        ([1.3, 1.3, 1.3, 1.3, 1.0], 5),
        ([1.3, 1.3, 1.3, 1.3, 1.3], 5),
    ):
        asked: list[int] = []
        found = question(ratios, asked, "gather").asked(len(STAGES))
        assert list(dict.fromkeys(asked)) == list(range(stages))
        assert found.final == (stages == 5)
        assert (found.p < 1e-6) == (ratios == [1.3] * 5)


def test_path_tracers_that_differ_beyond_doubt_are_not_asked_a_last_time():
    found = question([1.3] * 5, []).asked(len(STAGES))
    assert found.stage == FIRST + 2, "the first stage of fresh seeds"
    assert found.final
    assert found.p < 1e-10
    slight = question([1.01] * 5, []).asked(len(STAGES))
    assert slight.stage == 5


def test_what_is_known_is_asked_for_at_the_first_stage_of_fresh_seeds():
    """Of the photon methods, too, whose last stage takes longest; what nobody knows goes on to it."""
    asked: list[Comparison] = []

    def explain(known: str, comparison: Comparison) -> str:
        asked.append(comparison)
        return known

    for known, stage in (("vertex normals", FIRST + 2), ("", len(STAGES))):
        asked.clear()
        found = question([1.3] * 5, [], "gather").asked(len(STAGES), partial(explain, known))
        assert (found.stage, found.known, found.final) == (stage, known, True)
        assert [c.stage for c in asked] == [FIRST + 2]
        assert all(c.final and c.p < 1e-6 for c in asked)


def test_stages_that_add_look_at_the_runs_of_the_one_before_and_others_have_seeds_of_their_own(monkeypatch, tmp_path):
    """Only so does the p of the last one mean what it says."""
    drawn: list[int] = []

    def our_runs(opened, method, effort, seeds, pool, **more):
        drawn.extend(seeds)
        return Rendered(np.reshape(np.array(seeds, np.float32), (-1, 1, 1, 1)))

    monkeypatch.setattr(trial, "our_runs", our_runs)
    runs = trial.Runs(scene_of(1, 0), tmp_path, None, None, (1, 0))
    found = [runs.ours("path", stage) for stage in range(len(STAGES))]
    assert len(drawn) == len(set(drawn)) == sum(effort.runs for effort in STAGES)
    assert [len(f) for f in found] == [6, 12, 24, 16, 24]
    assert np.array_equal(found[1][:6], found[0])
    assert np.array_equal(found[2][:12], found[1])
    assert [effort.adds for effort in STAGES] == [False, *([True] * FIRST), *([False] * (len(STAGES) - FIRST - 1))]


def test_photon_methods_are_forgiven_what_goes_with_the_radius():
    least = [stage.radius for stage in STAGES]
    assert least == sorted(least, reverse=True)
    off = 1 + 0.8 * trial.FORGIVEN * least[0]
    assert question([off] * 5, [], "gather").asked(len(STAGES)).stage == 1
    assert question([off] * 5, [], "path").asked(len(STAGES)).final
    assert question([1.3] * 5, [], "gather").asked(len(STAGES)).p < 1e-6


def test_each_scene_has_the_main_methods_and_a_lot_and_many_scenes_cover_all():
    """Of 500 scenes each lot has some 125; those with media have all of them."""
    asked = {i: list(asked_methods(scene_of(1, i))) for i in range(500)}
    assert all(methods[:2] == ["gather", "progressive"] for methods in asked.values())
    in_media = [i for i in asked if has_media(scene_of(1, i))]
    assert len(in_media) >= 500 // 13
    for i, methods in asked.items():
        lots = [m for m in methods[2:] if m != "thin glass"]
        assert len(lots) == (4 if i in in_media else 1)
        assert "every vertex" not in lots or i not in in_media
    drawn = Counter(m for i, methods in asked.items() if i not in in_media for m in methods)
    assert all(80 < drawn[m] < 155 for m in ("nearest", "estimation", "virtual"))
    assert all(35 < drawn[m] < 85 for m in ("single step", "every vertex"))
    assert 200 < sum(asks_one_scattering(scene_of(1, i)) for i in asked) < 300


BLOCK_NOISE = 0.06
"""Relative standard error of a block in a run of 8 samples a pixel: the median of random scenes."""


def of_blocks(method: str, error: float, seed: int) -> Question:
    """Ours are off by `error` everywhere, in 16 blocks of three channels as noisy as random scenes are."""
    rng = np.random.default_rng(seed)

    def runs(stage: int, mean: float) -> np.ndarray:
        effort, first = STAGES[stage], STAGES[0]
        more = effort.spp / first.spp
        if method != "path":
            more = effort.passes * effort.photons * effort.radius**2 / (first.passes * first.photons * first.radius**2)
        noise = BLOCK_NOISE / math.sqrt(more)
        count = effort.runs + (len(kept[stage - 1, mean]) if effort.adds else 0)
        blocks = mean * rng.gamma(noise**-2, noise**2, (count, 16, 3))
        if effort.adds:
            blocks[: len(kept[stage - 1, mean])] = kept[stage - 1, mean]
        kept[stage, mean] = blocks
        return np.concatenate([blocks.mean(axis=1), blocks.reshape(count, -1)], axis=1)

    kept: dict[tuple[int, float], np.ndarray] = {}
    return Question(method, "Mitsuba path", "picture", lambda stage: (runs(stage, 1.0 + error), runs(stage, 1.0)))


@pytest.mark.parametrize(("method", "error"), [("path", 0.03), ("path", -0.03), ("gather", 0.08), ("gather", -0.08)])
def test_an_error_of_a_few_percent_everywhere_is_found(method, error):
    """Of photon methods what the radius may do at the first looks is forgiven, 4 %, and only more is looked for."""
    p_of_a_run = 0.01 / 10_000  # Holm's, of the smallest of ten thousand comparisons
    found = [of_blocks(method, error, seed).asked(len(STAGES)) for seed in range(40)]
    assert sum(c.p < p_of_a_run for c in found) >= 36
    equal = [of_blocks(method, 0.0, seed).asked(len(STAGES)) for seed in range(40)]
    assert not any(c.final for c in equal)


class FakeRuns:
    """Pictures that are one everywhere, but for ours of a method: that is what `wrong` says."""

    def __init__(self, scene: dict, wrong: str = "", plain: float = 1.0) -> None:
        self.scene, self.wrong = scene, wrong
        self.seen_plainly = np.zeros((32, 32), bool)
        self.seen_plainly[: round(32 * plain)] = True
        self.modes: set[str] = set()

    def ours(self, method: str, stage: int, max_depth: int = 0) -> np.ndarray:
        return np.full((STAGES[stage].runs, 32, 32, 15), 0.25 if method == self.wrong else 0.2, np.float32)

    def weights(self, method: str, stage: int) -> np.ndarray:
        """ΣG is too large where `wrong` says "weights"."""
        C = np.full((STAGES[stage].runs, 32, 32, 2), 0.5)
        return np.concatenate([1.3 * C if self.wrong == "weights" else C, C], axis=-1)

    def theirs(self, mode: str, stage: int, max_depth: int = 0) -> np.ndarray:
        self.modes.add(mode)
        return np.ones((STAGES[stage].runs, 32, 32, 3))


def test_thin_glass_is_compared_where_rays_straight_through_see_all_of_it():
    panes = [scene for i in range(60) if has_panes(scene := scene_of(5, i))]
    assert not all(has_panes(scene_of(5, i)) for i in range(60))
    asked = [scene for scene in panes if "thin glass" in asked_methods(scene)]
    assert len(panes) / 4 < len(asked) < len(panes)
    for scene in asked[:3]:
        wrong = [q.asked(len(STAGES)) for q in questions(FakeRuns(scene, "thin glass"))]
        found = {c.method for c in wrong if c.p == pytest.approx(0)}
        assert found == {"thin glass"}


@pytest.mark.parametrize("particles", [False, True])
@pytest.mark.parametrize("plain", [1.0, 0.0])
def test_every_method_is_compared_in_every_scene_and_a_wrong_one_is_found(particles, plain):
    scene = next(s for i in range(100) if needs_particles(s := scene_of(1, i)) == particles)
    runs = FakeRuns(scene, plain=plain)
    found = [q.asked(len(STAGES)) for q in questions(runs)]
    everywhere = {"path", *asked_methods(scene)}
    assert methods_of(Verdict(found)) == everywhere
    assert all(c.outcome.p > 0.5 for c in found)
    assert ("ptracer" in runs.modes) == (particles and plain > 0)
    for wrong in sorted(everywhere):
        found = (q.asked(len(STAGES)) for q in questions(FakeRuns(scene, wrong, plain)))
        assert any(c.p == pytest.approx(0) and wrong in (c.method, c.peer) for c in found)


@pytest.mark.parametrize("method", ["single step", "every vertex"])
def test_wrong_weights_of_virtual_lights_are_found(method):
    scene = next(s for i in range(100) if method in asked_methods(s := scene_of(1, i)))
    (off,) = (c for q in questions(FakeRuns(scene, "weights")) if (c := q.asked(len(STAGES))).p < 1e-6)
    assert (off.method, off.what, off.peer) == (method, "weights", "its walks")


def test_weights_that_no_walk_has_met_are_no_disagreement_and_lacking_walks_are():
    """Scene 54 of seed 2026: metal that a lobe's far end lights, where a walk counts once in ten thousand runs."""
    scene = next(s for i in range(100) if "single step" in asked_methods(s := scene_of(1, i)))
    rng = np.random.default_rng(1)

    def asked(G: float) -> Comparison:
        class Rare(FakeRuns):
            def weights(self, method: str, stage: int) -> np.ndarray:
                found = np.zeros((STAGES[stage].runs, 32, 32, 4))
                found[..., :2] = G * rng.uniform(0.9, 1.1, found[..., :2].shape)
                return found

        return next(c for q in questions(Rare(scene)) if q.what == "weights" and (c := q.asked(len(STAGES))))

    assert asked(3e-9).p == 1
    assert asked(3e-2).p < 1e-6


def test_nothing_known_excuses_weights():
    assert not any(d.concerns("its walks") for d in DEVIATIONS)
    assert any(d.concerns("our path") for d in DEVIATIONS)


def test_what_goes_with_the_radius_is_no_disagreement():
    rng = np.random.default_rng(5)

    def question(error_by_stage: tuple[float, ...]) -> Question:
        def pair(stage: int) -> tuple[np.ndarray, np.ndarray]:
            n = STAGES[stage].runs
            return 1 + error_by_stage[stage] + 1e-3 * rng.normal(size=(n, 4)), 1 + 1e-3 * rng.normal(size=(n, 4))

        return Question("progressive", "our path", "direct", pair)

    assert question((0.2, 0.2, 0.2, 0.1, 0.05)).asked(len(STAGES)).p > 0.01
    for wrong in (0.05, -0.05):
        assert question((wrong,) * 5).asked(len(STAGES)).p < 1e-9


def comparison(
    method: str, p: float, ratio: float = 1.2, peer_name: str = "Mitsuba path", known: str = ""
) -> Comparison:
    return Comparison(method, peer_name, "picture", Outcome(p, ratio, 0.01, 51), len(STAGES), True, known)


def test_a_disagreement_is_saved_and_reported_and_chance_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "smallest", lambda scene, found, salt, most: scene)
    verdicts = {
        0: Verdict([comparison("path", 0.009), comparison("gather", 0.5)], lit=1),
        1: Verdict([comparison("path", 1e-9), comparison("nearest", 1e-9)], lit=1),
        2: Verdict([comparison("gather", 1e-9, known="textured light")], lit=1),
        3: Verdict(refused="Mitsuba 3: no"),
    }
    found = bench.judged(7, verdicts, tmp_path)
    assert {d.index: (d.known, d.methods[:1]) for d in found} == {
        1: ("", ("path",)),
        2: ("textured light", ("gather",)),
        3: ("", ("path",)),
    }
    file = next(d.file for d in found if d.index == 1)
    assert load_scene(file).shapes
    saved = json.loads((tmp_path / "scene_7_1.json").read_text())
    assert saved["shows"]["method"] == "path"
    assert from_json(json.dumps(saved["scene"])) == triage.without_all(scene_of(7, 1))
    result = bench.report(7, verdicts, found, "abc (4)", 12.0)
    target = result.targets[0]
    assert (target.value, target.ok) == (2, False)
    rows = {row[0]: row for row in result.rows}
    assert rows["all"][1] == 4
    assert rows["all"][3:12] == [2, 1, 1, 2, 1, 1, 1, 1, 1]
    assert any(file in note for note in result.notes)
    assert all(any(d.name in note for note in result.notes) for d in DEVIATIONS)
    agreed = bench.report(7, {0: verdicts[0]}, [], "abc (1)", 1.0)
    assert agreed.targets[0].ok


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

        def outcome_of(simpler, like, stage, salt, shared_kernels):
            asked.append(simpler)
            assert (stage, shared_kernels) == (len(STAGES) - 1, True)
            lacks = {d.name for d in DEVIATIONS if d.without(simpler) is None}
            return Outcome(0.5 if agreeing <= lacks else 1e-12, 1.0, 0.01, 51)

        return outcome_of

    monkeypatch.setattr(triage, "outcome_of", answers({names[1]}))
    assert explanation(found) == names[1]
    monkeypatch.setattr(triage, "outcome_of", answers(set(names[:2])))
    assert explanation(found) == " + ".join(names)
    monkeypatch.setattr(triage, "outcome_of", lambda *a: Outcome(1e-12, 1.3, 0.01, 51))
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


def test_verdicts_are_kept_and_a_run_goes_on_from_them(tmp_path, monkeypatch):
    """Pieces at two revisions; what was not finished, another effort or another seed does not count."""
    path, ran = tmp_path / "kept.json", []

    def tries(seed, indices):
        for index in indices:
            ran.append(index)
            yield index, Verdict([comparison("path", 1e-9 if index == 1 else 0.5, float(index))], lit=0.5)

    def run(scenes, seed=7, **more):
        ran.clear()
        return bench.run(scenes=scenes, seed=seed, json=path, **more)

    monkeypatch.setattr(peer, "installed", lambda: True)
    monkeypatch.setattr(bench, "try_scenes", tries)
    monkeypatch.setattr(bench, "smallest", lambda scene, found, salt, most: scene)
    monkeypatch.setattr(results, "revision", lambda: "aaa")
    first = run(2)
    assert ran == [0, 1]
    assert first.targets[0].value == 1
    path.open("a").write('{"seed": 7, "scene": 3, "verdi')
    monkeypatch.setattr(results, "revision", lambda: "bbb-dirty")
    monkeypatch.setattr(results, "sources_stamp", lambda: "0123456789")
    whole = run(4)
    assert ran == [2, 3]
    assert whole.rows[0][1] == 4
    assert whole.targets[0].value == 1
    assert "scenes by revision: aaa (2), bbb-dirty 01234567 (2)" in whole.notes
    monkeypatch.setattr(bench, "smallest", lambda *_: pytest.fail("it has been shrunk before"))
    assert run(4).rows == whole.rows
    assert ran == []
    monkeypatch.setattr(bench, "smallest", lambda scene, found, salt, most: scene)
    assert "scenes by revision: bbb-dirty 01234567 (4)" in run(4, again=True).notes
    assert ran == [0, 1]
    run(1, seed=8)
    assert ran == [0]
    monkeypatch.setattr(results, "STAGES", STAGES[:2])
    run(1)
    assert ran == [0]


def test_verdicts_whose_reason_is_no_longer_known_and_processes_that_died_are_not_kept(tmp_path):
    path = tmp_path / "kept.json"
    kept = results.Results(path, 7)
    kept.keep(1, Verdict([comparison("path", 1e-9, known="a deviation of the past")]))
    kept.keep(2, Verdict([comparison("path", 0.0, math.nan, known="textured light + vertex normals")], lit=0.25))
    kept.keep(3, Verdict(refused=DIED))
    again = results.Results(path, 7).kept({1, 2, 3})
    assert list(again) == [2]
    assert repr(again[2]) == repr(kept.kept({2})[2])  # NaN equals nothing
    with pytest.raises(OutputError, match="results can't be kept"):
        results.Results(tmp_path, 7)


WORK = """
import os
from pmviewer.bench.agree.verdict import Verdict

def work(seed, index):
    if index == 2:
        os._exit(3)
    return Verdict(lit=seed + index)
"""


def test_a_scene_that_kills_its_process_is_named_and_the_others_are_done(tmp_path, monkeypatch):
    (tmp_path / "agree_work_for_tests.py").write_text(WORK)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *(p for p in sys.path if p)]))
    from agree_work_for_tests import work

    found = dict(try_scenes(10, range(1, 5), work, processes=2))
    assert sorted(found) == [1, 2, 3, 4]
    assert found[2].refused == "the process died"
    assert [found[i].lit for i in (1, 3, 4)] == [11, 13, 14]


def test_missing_mitsuba_and_senseless_numbers_are_one_clear_error(monkeypatch):
    monkeypatch.setattr(peer, "installed", lambda: False)
    with pytest.raises(PmviewerError, match="pip install"):
        run_bench("agree", options={"scenes": 1})
    with pytest.raises(SettingError, match="at least one scene"):
        run_bench("agree", options={"scenes": 0})


def test_options_reach_the_bench_that_has_them_alone(monkeypatch):
    with pytest.raises(SettingError, match="'rays' has no option --seed"):
        run_bench("rays", options={"seed": 3, "scenes": None})


ORPHAN = """
import os, sys, time
from multiprocessing import get_context
from pmviewer.bench.agree.process import end_with

def child(parent):
    end_with(parent)
    print(os.getpid(), flush=True)
    time.sleep(60)

if __name__ == "__main__":
    get_context("spawn").Process(target=child, args=(os.getpid(),)).start()
"""


def test_workers_end_with_a_bench_that_was_killed(tmp_path):
    script = tmp_path / "orphan.py"
    script.write_text(ORPHAN)
    bench_process = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    assert bench_process.stdout is not None
    worker = int(bench_process.stdout.readline())
    bench_process.kill()
    bench_process.wait()
    for _ in range(100):
        status = Path(f"/proc/{worker}/stat")
        if not status.exists() or status.read_text().rpartition(")")[2].split()[0] == "Z":
            return
        time.sleep(0.1)
    os.kill(worker, signal.SIGKILL)
    pytest.fail("the worker outlived its bench by ten seconds")
