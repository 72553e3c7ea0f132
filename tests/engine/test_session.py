"""The session: what it shows and when, what it recomputes, how it fails. Scenes are small and photons few."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.renderer import Renderer
from pmviewer.engine.session import Session
from pmviewer.engine.stages import tracer
from pmviewer.scene.description import Scene
from pmviewer.settings.access import Settings, with_values
from tests.support.scenes import cornell_box, diffuse_box, rendered, settings_of
from tests.support.sessions import PATIENCE, errors, until

SMALL = settings_of(photons={"N": 2000}, render={"passes": 4})


@pytest.fixture
def session():
    opened = Session(threads=2, settings=SMALL)
    yield opened
    opened.close()


def watch(session):
    """All frames and states that the session shows from now on."""
    frames, states = [], []

    def look():
        frame, state = session.frame, session.status.state
        if frame is not None and (not frames or frames[-1].serial != frame.serial):
            frames.append(frame)
        if not states or states[-1] != state:
            states.append(state)

    session.on_update = look
    return frames, states


def test_opening_a_scene_shows_a_coarse_frame_and_then_passes(session):
    frames, states = watch(session)
    assert session.status.state == "empty"
    session.open(cornell_box())
    assert session.wait(timeout=PATIENCE)
    session.on_update = None
    assert [s for s in states if s != "preparing"] in (["loading", "rendering", "finished"], ["rendering", "finished"])
    assert frames[0].coarse
    assert frames[0].planes.shape == (12, 12, 22)
    assert [f.statistics.passes for f in frames[1:]] == [1, 2, 3, 4]
    assert all(f.planes.shape == (48, 48, 22) and not f.coarse for f in frames[1:])
    assert [f.serial for f in frames] == sorted({f.serial for f in frames})
    assert len({f.version for f in frames}) == 1
    assert session.status.passes == 4
    assert session.status.progress == 1.0
    assert session.scene is not None
    assert session.scene.name == session.scene_path == "cornell box"
    assert session.traits is not None
    assert session.traits.has_specular
    assert session.geometry is not None
    assert len(session.geometry.vertices) % 3 == 0
    assert any("opened cornell box" in m.text for m in session.take_messages())
    assert session.take_messages() == []


@pytest.mark.parametrize("method", ["progressive", "gather", "path"])
def test_same_film_as_the_renderer_bit_for_bit(session, method):
    settings = with_values(SMALL, {"render.method": method, "render.passes": 6})
    session.open(cornell_box(), settings)
    assert session.wait(timeout=PATIENCE)
    expected = rendered(cornell_box(), settings, 6).frame(1)
    assert session.frame.statistics.passes == 6
    assert np.array_equal(session.frame.planes, expected.planes)
    assert session.frame.statistics.emitted == expected.statistics.emitted
    assert session.frame.statistics.rays == expected.statistics.rays
    assert set(session.frame.statistics.dropped.values()) == {0}


def test_a_new_setting_shows_its_coarse_frame_first(session):
    session.open(cornell_box())
    session.wait(timeout=PATIENCE)
    frames, _ = watch(session)
    version = session.set(with_values(session.settings, {"photons.N": 3000}))
    assert session.wait(timeout=PATIENCE)
    session.on_update = None
    new = [f for f in frames if f.version == version]
    assert new[0].coarse
    assert new[0].settings.photons.N == 3000
    assert [f.statistics.passes for f in new[1:]] == [1, 2, 3, 4]


def test_many_changes_become_one(session):
    """Hundred values at once: the newest is rendered, hardly any other is, and none after it."""
    session.open(cornell_box())
    session.wait(timeout=PATIENCE)
    frames, _ = watch(session)
    for i in range(100):
        version = session.set(with_values(session.settings, {"photons.N": 2100 + i}))
    assert session.wait(timeout=PATIENCE)
    session.on_update = None
    assert frames[-1].version == version
    assert frames[-1].settings.photons.N == 2199
    versions = [f.version for f in frames]
    assert versions == sorted(versions)
    assert len(set(versions)) < 20
    assert all(f.coarse for f in frames if f.version != version and f.settings.photons.N != 2000)


def test_a_slider_that_keeps_moving_shows_frames(session):
    """Changes that arrive faster than a coarse frame takes do not keep it from being shown."""
    session.open(cornell_box(size=256))
    session.wait(passes=1, timeout=PATIENCE)
    frames, _ = watch(session)
    i = 0
    while len(frames) < 4 and i < 20_000:
        i += 1
        session.set(with_values(session.settings, {"photons.N": 30_000 + i}))
        time.sleep(0.001)
    session.on_update = None
    print(f"{len(frames)} frames while {i} values were set")
    assert len(frames) >= 4


def count_light_passes(monkeypatch):
    calls = []
    trace = tracer.trace_pass
    monkeypatch.setattr(tracer, "trace_pass", lambda *a, **k: calls.append(a) or trace(*a, **k))
    return calls


def test_only_what_follows_is_recomputed(session, monkeypatch):
    """Camera, radius and filter use the photons of the first passes again, and those that radii follow from; N and the
    seed use the latter alone."""
    calls = count_light_passes(monkeypatch)
    session.open(cornell_box())
    session.wait(timeout=PATIENCE)
    assert len(calls) == 1 + 4  # for radii, and of passes: the coarse frame has pass 0's where N is small
    for path, value in (
        ("camera.fov", 60.0),
        ("estimate.caustic_radius", 0.3),
        ("estimate.filter", "cone"),
        ("gather.rays", 2),
    ):
        session.set(with_values(session.settings, {path: value}))
        assert session.wait(timeout=PATIENCE)
        assert len(calls) == 5, path
    session.set(with_values(session.settings, {"photons.N": 2500}))
    session.wait(timeout=PATIENCE)
    assert len(calls) == 9
    session.set(with_values(session.settings, {"render.seed": 5}))
    session.wait(timeout=PATIENCE)
    assert len(calls) == 13
    session.set(with_values(session.settings, {"estimate.radius": 0.05}))
    assert session.wait(timeout=PATIENCE)
    assert len(calls) == 13


def test_display_settings_recompute_nothing(session):
    session.open(cornell_box())
    session.wait(timeout=PATIENCE)
    before = session.frame
    for path, value in (("display.exposure", 2.0), ("display.view", "caustic"), ("overlays.global.show", True)):
        assert session.set(with_values(session.settings, {path: value})) == before.version
    time.sleep(0.1)
    assert session.frame is before
    assert session.status.state == "finished"
    assert session.settings.display.exposure == 2.0


@pytest.mark.parametrize("paused", [False, True])
def test_a_diagnostic_view_is_added_to_the_frame_that_is_there(session, paused):
    """No new version, no new pass, the same planes; and the view that nothing can show asks for nothing."""
    session.open(cornell_box(), with_values(SMALL, {"render.passes": 100_000 if paused else 4}))
    assert session.wait(passes=3, timeout=PATIENCE)
    if paused:
        session.pause()
        until(lambda: session.status.state == "paused")
        time.sleep(0.2)  # the pass that was under way ends
    session.wait(timeout=0.5)
    before = session.frame
    values = {"display.view": "photon count", "overlays.paths.show": True}
    assert session.set(with_values(session.settings, values)) == before.version
    until(lambda: "photon count" in session.frame.diagnostics)
    frame = session.frame
    assert frame.version == before.version
    assert frame.statistics is before.statistics
    assert frame.planes is before.planes
    assert frame.inspection.paths.n == session.settings.overlays.paths.count
    session.set(with_values(session.settings, {"display.view": "radiance cells"}))  # without radiance photons
    time.sleep(0.2)
    assert session.frame is frame
    assert session.status.state == ("paused" if paused else "finished")
    assert not errors(session)


def test_display_settings_do_not_disturb_rendering(session):
    session.open(cornell_box(), with_values(SMALL, {"render.passes": 10_000}))
    session.wait(passes=3, timeout=PATIENCE)
    version = session.frame.version
    session.set(with_values(session.settings, {"display.exposure": 1.0}))
    assert session.wait(passes=session.frame.statistics.passes + 3, timeout=PATIENCE)
    assert session.frame.version == version


def test_pause_resume_restart(session):
    session.open(cornell_box(), with_values(SMALL, {"render.passes": 100_000}))
    assert session.wait(passes=3, timeout=PATIENCE)
    session.pause()
    assert session.paused
    assert session.status.state == "paused"
    time.sleep(0.2)  # the pass that was under way ends
    stopped = session.frame.statistics.passes
    assert session.status.state == "paused"
    time.sleep(0.1)
    assert session.frame.statistics.passes == stopped >= 3

    version = session.set(with_values(session.settings, {"photons.N": 2500}))  # shows its first pass while paused
    assert session.wait(passes=1, timeout=PATIENCE)
    time.sleep(0.1)
    assert (session.frame.version, session.frame.statistics.passes) == (version, 1)
    assert session.status.state == "paused"

    session.resume()
    assert session.status.state == "rendering"
    assert session.wait(passes=5, timeout=PATIENCE)
    session.restart()
    assert session.wait(passes=1, timeout=PATIENCE)
    assert session.frame.version == version + 1


def test_restart_renders_the_same_again(session):
    session.open(cornell_box())
    session.wait(timeout=PATIENCE)
    first = session.frame
    session.restart()
    assert session.wait(timeout=PATIENCE)
    assert session.frame.version == first.version + 1
    assert np.array_equal(session.frame.planes, first.planes)


def test_stop_rules(session):
    """A raised limit goes on where it stopped, a lowered one stops, both without a new version."""
    session.open(cornell_box())
    assert session.wait(timeout=PATIENCE)
    version = session.frame.version
    assert session.frame.statistics.passes == 4
    session.set(with_values(session.settings, {"render.passes": 7}))
    assert session.wait(timeout=PATIENCE)
    assert (session.frame.version, session.frame.statistics.passes) == (version, 7)
    expected = rendered(cornell_box(), session.settings, 7).frame(1)
    assert np.array_equal(session.frame.planes, expected.planes)

    session.set(with_values(session.settings, {"render.passes": 100_000}))
    assert session.wait(passes=9, timeout=PATIENCE)
    session.set(with_values(session.settings, {"render.passes": 3}))
    assert session.wait(timeout=PATIENCE)
    assert session.status.state == "finished"

    session.set(with_values(session.settings, {"render.passes": 1_000_000, "render.time_limit": 0.3}))
    session.restart()
    assert session.wait(timeout=PATIENCE)
    assert session.frame.statistics.seconds >= 0.3


def test_a_scene_that_fails_to_open_keeps_the_old_one(session):
    session.open(cornell_box(), with_values(SMALL, {"render.passes": 100_000}))
    session.wait(passes=1, timeout=PATIENCE)
    session.take_messages()
    session.open("no/such/scene.xml")
    until(lambda: session._loader.done == 2)
    assert len(found := errors(session)) == 1
    assert "no/such/scene.xml" in found[0]
    passes = session.frame.statistics.passes
    assert session.wait(passes=passes + 3, timeout=PATIENCE)
    assert session.scene.name == "cornell box"
    assert session.status.state == "rendering"


def test_a_first_scene_that_fails_is_not_the_end(session):
    dark = replace(diffuse_box(), shapes=tuple(replace(s, radiance=None) for s in diffuse_box().shapes))
    session.open(dark)
    assert not session.wait(timeout=PATIENCE)
    assert session.status.state == "failed"
    assert len(found := errors(session)) == 1
    assert "no light" in found[0]
    session.open(diffuse_box())
    assert session.wait(timeout=PATIENCE)
    assert session.status.state == "finished"
    assert errors(session) == []


def test_the_last_of_two_scenes_wins(session):
    session.open(cornell_box())
    session.open(diffuse_box())
    assert session.wait(timeout=PATIENCE)
    assert session.scene.name == "diffuse box"
    assert session.frame.scene_name == "diffuse box"


def test_another_scene_replaces_everything(session):
    session.open(cornell_box())
    session.wait(timeout=PATIENCE)
    first = session.frame
    session.open(diffuse_box(size=32), with_values(SMALL, {"render.passes": 2}))
    assert session.wait(timeout=PATIENCE)
    assert session.frame.version > first.version
    assert session.frame.scene_name == "diffuse box"
    assert session.frame.planes.shape[:2] == (32, 32)
    expected = rendered(diffuse_box(size=32), session.settings, 2).frame(1)
    assert np.array_equal(session.frame.planes, expected.planes)


def test_an_impossible_camera_is_one_error_and_not_the_end(session):
    session.open(cornell_box())
    session.wait(timeout=PATIENCE)
    session.take_messages()
    last = session.frame
    session.set(with_values(session.settings, {"camera.origin": (0, 0, 0), "camera.target": (0, 0, 0)}))
    assert not session.wait(timeout=PATIENCE)
    assert session.status.state == "failed"
    assert len(found := errors(session)) == 1
    assert "camera" in found[0].lower()
    assert session.frame is last
    version = session.set(with_values(session.settings, {"camera.origin": (0, 0, 0.5)}))
    assert session.wait(timeout=PATIENCE)
    assert session.frame.version == version
    assert session.status.state == "finished"
    assert errors(session) == []


def test_an_unexpected_error_is_reported_and_not_the_end(session, monkeypatch):
    session.open(cornell_box())
    session.wait(timeout=PATIENCE)
    session.take_messages()
    step = Renderer.step
    broken = {"on": True}

    def fail(self):
        if broken["on"]:
            raise RuntimeError("out of paint")
        step(self)

    monkeypatch.setattr(Renderer, "step", fail)
    session.restart()
    assert not session.wait(timeout=PATIENCE)
    assert len(found := errors(session)) == 1
    assert "out of paint" in found[0]
    assert "report" in found[0]
    broken["on"] = False
    session.restart()
    assert session.wait(timeout=PATIENCE)


def test_a_failing_listener_does_not_stop_the_session(session):
    def fail():
        raise ValueError("no window")

    session.on_update = fail
    session.open(cornell_box())
    assert session.wait(timeout=PATIENCE)
    assert [text for text in errors(session) if "no window" in text]


def test_close_ends_the_threads():
    before = set(threading.enumerate())
    session = Session(threads=2, settings=with_values(SMALL, {"render.passes": 100_000}))
    session.open(cornell_box())
    session.wait(passes=2, timeout=PATIENCE)
    session.close()
    until(lambda: not {t for t in set(threading.enumerate()) - before if t.name.startswith("pmviewer")})
    frame = session.frame
    assert not session.wait(passes=10_000, timeout=1)
    assert session.frame is frame
    session.close()


def test_waiting_can_time_out(session):
    assert not session.wait(timeout=0.05)
    session.open(cornell_box(), with_values(SMALL, {"render.passes": 100_000}))
    assert not session.wait(passes=90_000, timeout=0.05)


def test_scene_warnings_reach_the_log(session):
    scene: Scene = replace(diffuse_box(), warnings=("line 3: 'fog' is ignored.",), dropped={"degenerate triangle": 2})
    session.open(scene)
    session.wait(timeout=PATIENCE)
    warnings = [m.text for m in session.take_messages() if m.level == "warning"]
    assert warnings == ["line 3: 'fog' is ignored.", "2 × degenerate triangle left out"]


def test_a_session_starts_with_the_default_settings():
    session = Session(threads=1)
    assert session.settings == Settings()
    session.close()


def test_loading_says_what_it_does_and_can_be_cancelled(session, tmp_path):
    points = "".join(f"v {i % 7} {i % 11} {i % 13}\n" for i in range(300))
    (tmp_path / "a.obj").write_text(points + "".join(f"f {i} {i + 1} {i + 2}\n" for i in range(1, 290)))
    seen = []

    def look():
        if session.loading and session.loading not in seen:
            seen.append(session.loading)
            if "building the tree" in session.loading:
                session.cancel_loading()

    session.on_update = look
    session.open(tmp_path / "a.obj")
    until(lambda: session.status.state == "failed")
    assert [text.rsplit(": ", 1)[-1].split(" over")[0] for text in seen[1:]] == [
        "reading a.obj", "joining the corners", "looking for broken triangles", "building the tree",
    ]  # fmt: skip
    assert session.loading == ""
    assert session.scene is None
    (message,) = session.take_messages()
    assert (message.level, "cancelled" in message.text) == ("info", True)
    session.on_update = None
    session.open(tmp_path / "a.obj")
    until(lambda: session.scene is not None)
    assert session.loading == ""


def thing_file(folder) -> str:
    """A tetrahedron: neither camera nor light."""
    path = folder / "thing.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    return str(path)


def test_other_lights_do_not_read_the_file_again(tmp_path, monkeypatch):
    from pmviewer.engine import opened

    reads = []
    read = opened.read_scene
    monkeypatch.setattr(opened, "read_scene", lambda *a: reads.append(a) or read(*a))
    small = {"camera.width": 32, "camera.height": 32, "photons.N": 1000, "render.passes": 2}
    session = Session(threads=1, settings=with_values(Settings(), small))
    try:
        session.open(thing_file(tmp_path))
        assert session.wait(timeout=120)
        assert "light above" in [shape.name for shape in session.scene.shapes]
        studio = session.frame.exposure
        session.set(with_values(session.settings, {"light.rig": "headlight"}))
        assert session.wait(timeout=120)
        assert [light.name for light in session.scene.lights] == ["headlight"]
        assert len(reads) == 1
        assert session.frame.image().max() > 0
        session.set(with_values(session.settings, {"light.rig": "studio"}))
        assert session.wait(timeout=120)
        assert session.frame.exposure == studio
        session.set(with_values(session.settings, {"light.rig": "file"}))
        assert session.wait(timeout=120)
        assert any("light.rig asks for the file's alone" in message.text for message in session.take_messages())
        assert "light above" in [shape.name for shape in session.scene.shapes]
    finally:
        session.close()


def test_exposure_is_decided_once(tmp_path):
    small = {"camera.width": 32, "camera.height": 32, "photons.N": 1000, "render.passes": 3, "light.rig": "headlight"}
    session = Session(threads=1, settings=with_values(Settings(), small))
    seen = set()
    session.on_update = lambda: seen.add(session.frame.exposure) if session.frame else None
    try:
        session.open(thing_file(tmp_path))
        assert session.wait(timeout=120)
        session.set(with_values(session.settings, {"camera.origin": (3.0, 3.0, 3.0), "render.method": "path"}))
        assert session.wait(timeout=120)
        assert len(seen) == 1
    finally:
        session.close()


def test_what_passes_tell_is_said_once_and_of_the_next_picture_no_more(session):
    """Albedo 1 in a closed box: that light is cut off shows in the first pass, after the first picture. Numbers of the
    sentence may change from pass to pass."""

    def cut_off():
        return [m.text for m in session.take_messages() if m.level == "warning" and "still on its way" in m.text]

    settings = settings_of(photons={"N": 500, "max_bounces": 8}, estimate={"radius": 0.1}, render={"passes": 4})
    session.set(settings)
    session.open(diffuse_box(albedo=1.0, size=8))
    assert session.wait(timeout=PATIENCE)
    assert len(cut_off()) == 1
    session.set(with_values(settings, {"photons.max_bounces": 9}))
    assert session.wait(timeout=PATIENCE)
    assert cut_off() == []
