"""The region of interest in the window: drawn with the mouse, undone, taken off by a click."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui

from tests.viewer.driver import drive, make_app
from tests.viewer.fake_session import FakeSession


def at(app, x, y):
    left, top, width, height = app.viewport.rectangle()
    return ImVec2(app.viewport.origin[0] + left + x * width, app.viewport.origin[1] + top + y * height)


def test_a_region_is_drawn_undone_and_taken_off(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    session = FakeSession()
    session.open("box")
    app = make_app(session, tmp_path)

    def script(c):
        state = app.state
        c.mouse_move_to_pos(at(app, 0.2, 0.3))
        c.key_press(imgui.Key.b)
        c.yield_(3)
        pose = state.live_camera()
        c.mouse_down(0)
        c.mouse_move_to_pos(at(app, 0.6, 0.7))
        c.yield_(2)
        c.mouse_up(0)
        c.yield_(3)
        region = state.settings.region
        assert region.on
        assert np.allclose([region.left, region.top, region.right, region.bottom], [0.2, 0.3, 0.6, 0.7], atol=0.01)
        assert state.live_camera() == pose, "the camera stays"
        assert state.inspector.pinned is None
        assert [step.name for step in state.history.done] == ["refine a region"]
        state.undo()
        assert not state.settings.region.on
        state.redo()
        c.key_press(imgui.Key.b)
        c.yield_(2)
        c.key_press(imgui.Key.escape)
        c.yield_(2)
        assert state.settings.region.on, "Esc leaves it as it was"
        assert not app.viewport.region.choosing
        c.key_press(imgui.Key.b)
        c.yield_(2)
        c.mouse_move_to_pos(at(app, 0.5, 0.5))
        c.mouse_click(0)
        c.yield_(3)
        assert not state.settings.region.on
        assert state.settings.region.right == pytest.approx(0.6, abs=0.01)

    drive(app, script)
