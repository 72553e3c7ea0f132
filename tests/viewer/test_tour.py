"""The first tour: five steps, each at a control that is there; skipped, begun again, not shown to tests."""

from __future__ import annotations

import pytest
from imgui_bundle import ImVec2, imgui

from pmviewer.viewer.tour import STEPS, beside, without
from tests.viewer.driver import drag_picture, drive, make_app
from tests.viewer.fake_session import FakeSession


@pytest.mark.parametrize("size", [(1120, 700), (800, 600)])
def test_all_steps_point_at_something_and_the_card_is_in_the_window(tmp_path, monkeypatch, size):
    monkeypatch.chdir(tmp_path)
    session = FakeSession()
    session.open("box")
    app = make_app(session, tmp_path)
    app.params.app_window_params.window_geometry.size = size

    def script(c):
        tour = app.tour
        assert tour.number is None, "a window that remembers nothing doesn't begin it"
        app.commands.table["begin_tour"]()
        for number in range(len(STEPS)):
            c.yield_(6)
            assert tour.number == number
            assert tour.shown_at is not None, f"{STEPS[number].title}: what it points at is there"
            card = c.window_info("//Tour").window
            assert 0 <= card.pos.x <= size[0] - card.size.x, STEPS[number].title
            assert 0 <= card.pos.y <= size[1] - card.size.y, STEPS[number].title
            c.item_click("//Tour/Next##tour" if number + 1 < len(STEPS) else "//Tour/Done##tour")
        assert tour.number is None
        tour.begin()
        c.yield_(4)
        c.item_click("//Tour/Skip the tour##tour")
        c.yield_(2)
        assert tour.number is None

    drive(app, script)


def test_what_is_dark_takes_no_clicks_and_what_is_lit_is_live(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    session = FakeSession()
    session.open("box")
    app = make_app(session, tmp_path)

    def script(c):
        tour, state = app.tour, app.state
        poses = [state.live_camera()]

        def moved_by_a_drag():
            drag_picture(c, app, 60, 30)
            c.yield_(2)
            poses.append(state.live_camera())
            return poses[-1] != poses[-2]

        tour.begin()
        c.yield_(6)
        x, y = app.viewport.origin
        c.mouse_move_to_pos(ImVec2(x + app.viewport.size[0] / 2, y + 0.85 * app.viewport.size[1]))
        c.mouse_down(0)
        c.mouse_move_to_pos(ImVec2(x + app.viewport.size[0] / 2 + 60, y + 0.85 * app.viewport.size[1] + 20))
        c.mouse_up(0)
        c.yield_(3)
        assert state.live_camera() != poses[0], "the picture is lit: it turns"
        c.item_click("//Tour/Next##tour")
        c.mouse_click(0)  # at once, as a double click does
        c.yield_(4)
        assert tour.number == 1
        assert state.inspector.pinned is None
        poses.append(state.live_camera())
        assert not moved_by_a_drag(), "the picture is dark"
        c.mouse_wheel_y(3.0)
        c.yield_(3)
        assert state.live_camera() == poses[-1]
        c.item_click("//Tour/Next##tour")
        assert tour.number == 2, "the card lies above"
        c.key_press(imgui.Key.escape)
        c.yield_(4)
        assert tour.number is None
        assert moved_by_a_drag()

    drive(app, script)


def test_it_waits_for_what_was_opened(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    session = FakeSession()
    session.open("box")
    app = make_app(session, tmp_path)

    def script(c):
        def shown():
            return c.item_exists("//Tour/Next##tour")

        app.tour.begin()
        c.yield_(4)
        assert shown()
        app.state.help_open = True
        c.yield_(4)
        assert not shown()
        c.key_press(imgui.Key.escape)
        c.yield_(4)
        assert app.tour.number == 0, "Esc closed what lay above"
        assert shown()

    drive(app, script)


def test_a_card_stands_beside_its_target():
    whole = (0.0, 0.0, 1000.0, 600.0)
    for target in ((0, 50, 200, 600), (800, 50, 1000, 600), (0, 0, 1000, 60), (0, 450, 1000, 600), None):
        x, y = beside(target, whole, (250, 150), 10)
        assert 0 <= x <= 750
        assert 0 <= y <= 450
        if target is not None:
            apart = x >= target[2] or x + 250 <= target[0] or y >= target[3] or y + 150 <= target[1]
            assert apart, target


def test_all_but_two_rectangles_is_dark():
    whole, target, card = (0, 0, 20, 12), (2, 1, 9, 12), (7, 3, 15, 8)
    dark = [part for around in without(whole, target) for part in without(around, card)]

    def within(x, y, r):
        return r[0] <= x < r[2] and r[1] <= y < r[3]

    for x in range(20):
        for y in range(12):
            count = sum(within(x, y, part) for part in dark)
            assert count == (not within(x, y, target) and not within(x, y, card)), (x, y)
