"""Saved views: kept by scene, in a file that people may have edited or that can't be written."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import imgui

from pmviewer.render.camera import CameraPose
from pmviewer.viewer.saved_views import MOST, SavedViews, settings_of
from tests.viewer.driver import chord, drag_picture, drive, make_app
from tests.viewer.fake_session import FakeSession

K = imgui.Key
POSE = CameraPose((1.0, 2.0, 3.0), (0.0, 0.5, 0.0), (0.0, 1.0, 0.0), 33.0, 64, 48)


def test_views_are_kept_by_scene_from_one_start_to_the_next(tmp_path):
    path = tmp_path / "new folder" / "views.toml"
    views = SavedViews(path)
    assert [views.add("box", POSE), views.add("box", POSE), views.add("/a/b.xml", POSE)] == [
        "View 1",
        "View 2",
        "View 1",
    ]
    views.remove("box", "View 1")
    again = SavedViews(path)
    assert list(again.of("box")) == ["View 2"]
    assert settings_of(again.of("box")["View 2"], "free_camera") == {
        "free_camera.origin": POSE.origin,
        "free_camera.target": POSE.target,
        "free_camera.up": POSE.up,
        "free_camera.fov": 33.0,
    }
    assert again.add("box", POSE) == "View 3"
    assert again.of("elsewhere") == {}
    for _ in range(MOST + 5):
        again.add("box", POSE)
    assert len(again.of("box")) == MOST


@pytest.mark.parametrize("text", ["", "not toml [", "box = 3", "[box]\n'View 1' = 3", "[box.'View 1']\nfov = 'x'"])
def test_what_is_not_understood_is_begun_anew(tmp_path, text):
    path = tmp_path / "views.toml"
    path.write_text(text)
    views = SavedViews(path)
    assert views.of("box") == {}
    views.add("box", POSE)
    assert list(SavedViews(path).of("box")) == ["View 1"]


def test_the_menu_saves_goes_back_and_forgets(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    session = FakeSession()
    session.open("box")
    app = make_app(session, tmp_path)

    def script(c):
        drag_picture(c, app, 70, 20)
        saved = session.settings.camera
        c.key_press(chord(K.b, K.mod_ctrl))
        c.yield_(2)
        drag_picture(c, app, -90, 10)
        assert session.settings.camera.origin != saved.origin
        c.menu_click("//##MainMenuBar/View/Saved views/View 1")
        c.yield_(2)
        np.testing.assert_allclose(session.settings.camera.origin, saved.origin)
        np.testing.assert_allclose(session.settings.camera.target, saved.target)
        app.state.undo()
        assert session.settings.camera.origin != saved.origin
        c.menu_click("//##MainMenuBar/View/Saved views/Forget/View 1##forget")
        c.yield_(2)
        assert app.state.views.of("box") == {}
        (tmp_path / "views.toml").unlink()
        (tmp_path / "views.toml").mkdir()
        c.key_press(chord(K.b, K.mod_ctrl))
        c.yield_(3)

    drive(app, script)
    errors = [m.text for m in app.state.log if m.level == "error"]
    assert len(errors) == 1
    assert "was not saved" in errors[0]
