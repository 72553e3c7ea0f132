"""The handle of a slice through media: dragged, its axis chosen, undone; not there with other views."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import ImVec2

from pmviewer.render.camera import CameraPose
from pmviewer.viewer.viewport.screen_lines import Screen
from tests.viewer.driver import app_on_engine, drive, finished, wait_until

SMALL = {
    "camera.width": 64,
    "camera.height": 64,
    "render.passes": 1,
    "photons.N": 1000,
    "display.view": "extinction slice",
    "display.slice_axis": "y",
}
POSE = CameraPose((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 40.0, 200, 100)
PLACED = Screen(POSE, (30.0, 20.0), (10.0, 5.0, 400.0, 200.0))
"""The picture is twice as large as its pixels, and its corner at (40, 25)."""


def test_points_are_where_the_camera_shows_them():
    assert PLACED.place(np.zeros(3)) == pytest.approx((240.0, 125.0))
    half = 4 * np.tan(np.radians(20.0))
    assert PLACED.place(np.array([half, 0.0, 0.0])) == pytest.approx((440.0, 125.0))
    assert PLACED.place(np.array([0.0, 0.0, 5.0])) is None
    assert PLACED.segment(np.array([0.0, 0.0, 5.0]), np.array([0.0, 0.0, 6.0])) is None
    _, seen = PLACED.segment(np.array([0.0, 1.0, 5.0]), np.zeros(3))
    assert seen == pytest.approx((240.0, 125.0)), "what is behind the camera is cut off"


def test_the_mouse_finds_the_nearest_place_of_a_line():
    a, b = np.array([0.5, -1.0, 0.3]), np.array([0.5, 1.0, -0.8])
    for share in (0.0, 0.25, 1.0, 1.2):
        x, y = PLACED.place(a + share * (b - a))
        assert PLACED.nearest(x, y, a, b) == pytest.approx(share, abs=1e-9)
        assert PLACED.nearest(x + 3.0, y, a, b) == pytest.approx(share, abs=0.1), "beside it, too"
    assert PLACED.nearest(240.0, 125.0, np.zeros(3), np.array([0.0, 0.0, 1.0])) is None, "along the view"


@pytest.mark.usefixtures("any_light_in_media", "every_path_may_split")
def test_the_slice_is_dragged_turned_and_put_back(tmp_path):
    with app_on_engine(tmp_path, "cornell_smoke", SMALL) as app:

        def script(c):
            state, handle = app.state, app.viewport.slice
            wait_until(c, lambda: finished(app) and state.shown_display.view == "extinction slice")
            c.yield_(3)
            before, pose = state.frame.image("extinction slice").copy(), state.live_camera()
            x, y = handle.at
            c.mouse_move_to_pos(ImVec2(x, y))
            c.yield_(3)
            assert handle.holds_mouse
            c.mouse_down(0)
            for step in range(1, 7):
                c.mouse_move_to_pos(ImVec2(x, y - 5 * step))
                c.yield_(2)
            c.mouse_up(0)
            c.yield_(3)
            assert state.settings.display.slice > 0.52, "y points up"
            assert abs(handle.at[1] - (y - 30)) < 2, "the handle follows the mouse"
            assert state.live_camera() == pose, "and the camera stays"
            assert state.inspector.pinned is None
            assert [step.after for step in state.history.done] == [{"display.slice": state.settings.display.slice}]
            wait_until(c, lambda: not np.array_equal(state.frame.image("extinction slice"), before))
            state.undo()
            c.yield_(3)
            assert state.settings.display.slice == 0.5
            c.item_click("//Viewport/##slice.x")
            assert state.settings.display.slice_axis == "x"
            state.undo()
            assert state.settings.display.slice_axis == "y"
            state.change({"display.slice_axis": "z"})
            c.yield_(3)
            x, y = handle.at
            c.mouse_move_to_pos(ImVec2(x, y))
            c.mouse_down(0)
            c.mouse_move_to_pos(ImVec2(x, y - 2000))
            c.yield_(2)
            assert 0.0 <= state.settings.display.slice <= 1.0
            c.mouse_up(0)
            state.change({"display.view": "beauty"})
            c.yield_(6)
            assert not c.item_exists("//Viewport/##slice")

        drive(app, script)
