"""The file dialog that is drawn in the window."""

from __future__ import annotations

import pytest
from imgui_bundle import imgui

from pmviewer.viewer.dialogs import dialogs
from pmviewer.viewer.dialogs.file_browser import Entry, list_folder
from tests.viewer.driver import chord, drive, make_app
from tests.viewer.fake_session import FakeSession

K = imgui.Key


@pytest.fixture
def app(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dialogs, "has_native_dialogs", lambda: False)
    session = FakeSession()
    session.open("box")
    return make_app(session, tmp_path)


def test_folders_come_first_and_other_files_are_left_out(tmp_path):
    (tmp_path / "b").mkdir()
    for name in ("scene.XML", "a.txt", ".hidden.xml"):
        (tmp_path / name).write_text("12345")
    (tmp_path / "gone.xml").symlink_to(tmp_path / "nowhere.xml")
    assert list_folder(tmp_path, ["*.xml"]) == [Entry("b", True), Entry("scene.XML", False, 5)]


def test_a_scene_is_chosen_by_clicks(app, tmp_path):
    folder = tmp_path / "scenes"
    folder.mkdir()
    (folder / "pool.xml").write_text("<scene/>")

    def script(c):
        c.key_press(chord(K.o, K.mod_ctrl))
        c.yield_(4)
        c.item_click("//Open a scene or session/**/\uf07b  scenes")
        c.yield_(3)
        c.item_click("//Open a scene or session/**/\uf15b  pool.xml")
        c.yield_(2)
        c.item_click("//Open a scene or session/###confirm")
        c.yield_(3)

    drive(app, script)
    assert app.state.session.opened[-1] == str(folder / "pool.xml")
    assert not app.dialogs.is_open


def test_saving_suggests_a_name_and_replacing_takes_a_click(app, tmp_path):
    path = tmp_path / "box-beauty-1.png"
    path.write_bytes(b"old")

    def script(c):
        c.key_press(chord(chord(K.e, K.mod_ctrl), K.mod_shift))
        c.yield_(4)
        c.item_click("//Save as/##name")
        c.key_press(K.enter)
        c.yield_(2)
        assert app.dialogs.is_open, "Enter must not overwrite"
        c.item_click("//Save as/###confirm")
        c.yield_(3)

    drive(app, script)
    assert path.read_bytes().startswith(b"\x89PNG")


def test_escape_cancels(app):
    opened = list(app.state.session.opened)

    def script(c):
        c.key_press(chord(K.o, K.mod_ctrl))
        c.yield_(4)
        c.key_press(K.escape)
        c.yield_(3)
        assert not app.dialogs.is_open

    drive(app, script)
    assert app.state.session.opened == opened
