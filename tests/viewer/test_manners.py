"""What a window owes its user: clicks that turn nothing, errors that go away, folders that are remembered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui

from pmviewer.output.exr import read_exr
from pmviewer.output.session_file import write_session
from pmviewer.settings.access import Settings, with_values
from pmviewer.viewer import layout
from pmviewer.viewer import state as viewer_state
from pmviewer.viewer.dialogs import dialogs
from pmviewer.viewer.viewport import controls
from tests.viewer.driver import drag_picture, drive, item, make_app, on_window_thread

K = imgui.Key


@pytest.fixture
def app(session, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dialogs, "has_native_dialogs", lambda: False)
    return make_app(session, tmp_path)


def test_a_click_turns_nothing_and_a_drag_is_counted_from_the_press(app, session):
    def script(c):
        camera = session.settings.camera
        drag_picture(c, app, 2, -2)
        assert session.settings.camera == camera, "less than the threshold"
        before = app.state.live_camera()
        drag_picture(c, app, 60, 0)
        pivot = np.array([0.0, 0.0, -1.0])  # on the back wall, in the picture's middle
        expected = controls.orbit(before, 60 / app.viewport.rectangle()[3], 0.0, pivot)
        np.testing.assert_allclose(session.settings.camera.origin, expected.origin, rtol=1e-4)
        moved = session.settings.camera
        x, y = app.viewport.origin
        c.mouse_move_to_pos(ImVec2(x + 40, y + 40))
        c.mouse_move_to_pos(ImVec2(x + 240, y + 140))
        c.mouse_click(0)
        c.yield_(2)
        assert session.settings.camera == moved, "what was moved before the press is no drag"

    drive(app, script)


def test_errors_over_the_picture_are_few_and_go_away(app, session, monkeypatch):
    def script(c):
        for number in (1, 2, 3, 3):
            app.state.say("error", f"error {number}")
        app.state.say("warning", "a warning")
        c.yield_(2)
        assert [toast.message.text for toast in app.state.toasts] == ["error 2", "error 3"]
        assert c.window_info("//##toast1").window is not None
        monkeypatch.setattr(viewer_state, "TOAST_SECONDS", -1.0)
        c.yield_(2)
        assert app.state.toasts == []
        monkeypatch.setattr(viewer_state, "TOAST_SECONDS", 1e6)
        app.state.say("error", "of the box")
        c.yield_(2)
        assert len(app.state.toasts) == 1
        app.state.open("another")
        c.yield_(2)
        assert app.state.toasts == [], "the scene that it was about is gone"

    drive(app, script)
    assert [m.text for m in app.state.log if m.level == "error"].count("of the box") == 1


def test_a_new_scene_begins_to_render(app, session):
    def script(c):
        c.key_press(K.space)
        c.yield_(2)
        assert session.paused
        app.state.open("broken")
        c.yield_(3)
        assert session.paused, "the old scene is still there"
        app.state.open("another")
        c.yield_(3)
        assert not session.paused

    drive(app, script)


def test_an_exported_exr_tells_what_is_shown_now(app, session, tmp_path):
    def script(c):
        frame = session.frame
        session.settings = with_values(session.settings, {"overlays.global.show": True, "display.exposure": 2.0})
        session.frame = replace(frame, settings=with_values(frame.settings, {"overlays.caustic.show": True}))
        app.commands.exports.exr(tmp_path / "a.exr")
        c.yield_(3)

    drive(app, script)
    metadata = read_exr(tmp_path / "a.exr")[1]
    assert metadata["overlays.global.show"] == "true"
    assert metadata["overlays.caustic.show"] == "false"
    assert float(metadata["display.exposure"]) == 2.0


def test_dialogs_remember_the_folder(app, tmp_path):
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    chosen = []

    def script(c):
        app.dialogs.save("Save as", tmp_path / "a.png", chosen.append)
        app.dialogs._browser.folder = folder
        c.yield_(3)
        c.item_click("//Save as/###confirm")
        c.yield_(3)
        app.dialogs.save("Save as", tmp_path / "b.png", chosen.append)
        c.yield_(3)
        c.item_click("//Save as/###confirm")
        c.yield_(3)

    drive(app, script)
    assert chosen == [folder / "a.png", folder / "b.png"]


def test_a_session_whose_scene_has_moved_asks_where_it_is(app, session, tmp_path):
    scene, saved = tmp_path / "box.xml", tmp_path / "saved.toml"
    scene.write_text("<scene/>")
    write_session(saved, with_values(Settings(), {"photons.N": 777}), str(scene), 3)
    moved = tmp_path / "moved.xml"
    scene.rename(moved)

    def script(c):
        app.state.open(saved)
        c.yield_(4)
        assert len(session.opened) == 1
        assert app.dialogs.is_open
        c.item_click("//Where is box.xml now?/**/\uf15b  moved.xml")
        c.yield_(2)
        c.item_click("//Where is box.xml now?/###confirm")
        c.yield_(3)

    drive(app, script)
    assert session.opened[1:] == [str(moved)]
    assert session.settings.photons.N == 777
    errors = [m.text for m in app.state.log if m.level == "error"]
    assert len(errors) == 1
    assert "box.xml" in errors[0]


def test_a_search_leaves_the_groups_as_they_were(app):
    def script(c):
        ref = item("gather.rays")
        c.yield_(2)
        assert c.item_info(ref, imgui.test_engine.TestOpFlags_.no_error).id_ == 0, "the group is closed"
        app.settings_panel.find = "gather.rays"
        c.yield_(3)
        assert c.item_info(ref).id_ != 0
        app.settings_panel.find = ""
        c.yield_(3)
        assert c.item_info(ref, imgui.test_engine.TestOpFlags_.no_error).id_ == 0

    drive(app, script)


def test_hiding_and_showing_the_panels_keeps_their_tabs(app):
    def tabs():
        found = [imgui.internal.find_window_by_name(label) for label in layout.PANELS]
        places = [(w.dock_id, w.dock_order, w.dock_node and w.dock_node.selected_tab_id) for w in found]
        return places, (app.viewport.size, app.viewport.origin)

    def script(c):
        c.item_click("**/Error")
        c.yield_(4)
        before = on_window_thread(c, tabs)
        for _ in range(2):
            c.key_press(K.tab)
            c.yield_(6)
            assert app.viewport.size[0] > before[1][0][0] + 100
            c.key_press(K.tab)
            c.yield_(10)
            assert on_window_thread(c, tabs) == before

    drive(app, script)
