"""Linked cameras: a snapshot is rendered again as the live camera sees the scene."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui

import pmviewer
from pmviewer.settings.access import with_values
from pmviewer.viewer.linked import UNDER_WAY
from pmviewer.viewer.pair import OTHER_CAMERA
from tests.viewer.driver import app_on_engine, chord, drive, finished, wait_until

SMALL = {"camera.width": 32, "camera.height": 24, "render.passes": 1, "photons.N": 2000}
THERE = {"camera.origin": (0.6, 0.45, -1.3), "camera.target": (0.5, 0.49, 0.0)}


def test_a_snapshot_follows_the_live_camera_with_its_own_settings(tmp_path):
    seen = {}

    def sides(app):
        return app.state.pair.sides(app.state.settings, app.state.frame)

    with app_on_engine(tmp_path, "cornell_caustic", SMALL) as app:

        def script(c):
            state = app.state
            wait_until(c, lambda: finished(app))
            state.change({"render.passes": 2})
            wait_until(c, lambda: finished(app))
            state.take_snapshot()
            (kept,) = state.snapshots.all
            state.change({"photons.N": 500, "render.passes": 1, "compare.mode": "side by side", "compare.b": "1"})
            wait_until(c, lambda: finished(app) and state.shown_pair() is not None)
            assert sides(app)[1].frame is None, "one camera: the snapshot itself"
            state.change(THERE)
            wait_until(c, lambda: finished(app) and state.frame.settings == state.settings)
            assert state.shown_pair().caution == OTHER_CAMERA
            c.key_press(chord(imgui.Key.s, imgui.Key.mod_shift))
            c.yield_(3)
            assert state.settings.compare.linked
            wait_until(c, lambda: state.shown_pair().caution == "" and sides(app)[1].fact("passes") == 2)
            seen["linked"], seen["live"] = sides(app)[1].frame, state.frame
            seen["settings"] = with_values(kept.settings, {**THERE, "render.passes": 2})
            state.change({"photons.N": 700})
            wait_until(c, lambda: finished(app) and state.frame.settings == state.settings)
            assert sides(app)[1].frame is seen["linked"], "another setting of the live picture renders nothing again"
            state.change(dict.fromkeys(THERE, "auto"))
            wait_until(c, lambda: finished(app) and state.frame.settings == state.settings)
            c.yield_(3)
            assert sides(app)[1].frame is None, "back at its own camera it is the snapshot"
            assert state.shown_pair().caution == ""

        drive(app, script)
    assert seen["linked"].camera.sees_like(seen["live"].camera)
    settings = seen["settings"]
    values = {"N": settings.photons.N, "camera.width": 32, "camera.height": 24, **THERE}
    with pmviewer.open("cornell_caustic", values) as s:
        alone = s.render(passes=2)
    np.testing.assert_array_equal(seen["linked"].image(), alone.beauty)
    assert not np.array_equal(seen["live"].image(), alone.beauty)


def test_what_cannot_follow_says_why_and_stays(tmp_path):
    from pmviewer.output.png import write_png

    write_png(tmp_path / "other.png", np.full((24, 32, 3), 90, np.uint8), {})
    with app_on_engine(tmp_path, "cornell_caustic", {**SMALL, "compare.linked": True}) as app:

        def script(c):
            state = app.state
            wait_until(c, lambda: finished(app))
            state.snapshots.open([tmp_path / "other.png"])
            wait_until(c, lambda: bool(state.snapshots.all))
            state.change({"compare.mode": "wipe"})
            c.yield_(3)
            # a file without a camera is of any
            assert "PNG" in state.shown_pair().caution
            state.take_snapshot()
            state.snapshots.all[-1].about["scene"] = "elsewhere"
            state.change(THERE)
            wait_until(c, lambda: finished(app) and state.frame.settings == state.settings)
            assert "elsewhere" in state.shown_pair().caution
            assert state.shown_pair().caution != UNDER_WAY
            assert state.pair.sides(state.settings, state.frame)[1].frame is None
            assert not state.background.running()

        drive(app, script)


def test_what_nobody_waits_for_any_more_is_forgotten(tmp_path):
    """Cameras that are unlinked before the first picture is there leave no photons and no pictures behind."""
    with app_on_engine(tmp_path, "cornell_caustic", SMALL) as app:

        def script(c):
            state = app.state
            wait_until(c, lambda: finished(app))
            state.take_snapshot()
            state.change({"compare.mode": "side by side", "compare.b": "1", **THERE})
            wait_until(c, lambda: finished(app) and state.frame.settings.camera == state.settings.camera)
            state.change({"compare.linked": True})
            wait_until(c, lambda: state.linked._store is not None)
            state.change({"compare.linked": False})
            wait_until(c, lambda: not state.background.running())
            c.yield_(3)
            linked = state.linked
            assert (linked._store, linked._arranged, linked._arrived, linked._pictures) == (None, None, [], {})

        drive(app, script)
