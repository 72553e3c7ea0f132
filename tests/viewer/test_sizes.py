"""Windows of other sizes: everything can be reached, and the picture keeps its share."""

from __future__ import annotations

import glfw
import pytest
from imgui_bundle.glfw_utils import glfw_window_hello_imgui

from pmviewer.viewer.panels.widgets import how_many
from tests.viewer.driver import drive, on_window_thread


def test_panels_shrink_and_grow_with_the_window(app):
    shares = {}

    def script(c):
        for size in ((1440, 900), (800, 600), (1440, 900)):
            on_window_thread(c, lambda size=size: glfw.set_window_size(glfw_window_hello_imgui(), *size))
            c.yield_(12)
            shares.setdefault(size, []).append((app.viewport.size[0] / size[0], app.viewport.size[1] / size[1]))

    drive(app, script)
    (wide, wide_again), (narrow,) = shares[1440, 900], shares[800, 600]
    assert narrow[0] == pytest.approx(wide[0], abs=0.03)
    assert narrow[0] > 0.5
    assert narrow[1] > 0.45
    assert wide_again == pytest.approx(wide, abs=0.01)


def test_what_has_no_room_in_the_toolbar_is_behind_its_last_button(app, session):
    app.params.app_window_params.window_geometry.size = (800, 600)
    asked = []
    app.commands.table["save_session"] = lambda: asked.append("saved")

    def script(c):
        c.item_click("**/\uf101##more")
        c.yield_(3)
        c.item_click("//$FOCUSED/\uf0c7  Save the session")
        c.yield_(2)

    drive(app, script)
    assert asked == ["saved"]


def test_as_many_items_as_fit_with_the_button_for_the_rest():
    widths = (10.0, 20.0, 30.0)
    assert how_many(widths, 60.0, 5.0) == 3
    assert how_many(widths, 59.0, 5.0) == 2
    assert how_many(widths, 34.0, 5.0) == 1
    assert how_many(widths, 12.0, 5.0) == 0
