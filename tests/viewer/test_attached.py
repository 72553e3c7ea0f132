"""Programs that attach to a window in another process, or, here, on another thread: what they set, read and show."""

from __future__ import annotations

import multiprocessing.connection as connections
import os
import threading

import numpy as np
import pytest

import pmviewer
from pmviewer.errors import PmviewerError, SettingError, WindowError
from pmviewer.library.attaching import wire
from pmviewer.library.attaching.attached import attach
from pmviewer.library.attaching.listening import attachable
from tests.viewer.driver import app_on_engine, drive, wait_until

SMALL = {"camera.width": 24, "camera.height": 24, "render.passes": 2, "photons.N": 2000}


@pytest.fixture(autouse=True)
def at_home(tmp_path, monkeypatch):
    """Windows are written down in a folder of the test's own."""
    monkeypatch.setattr(wire, "folder", lambda: tmp_path / "windows")


def test_a_program_sets_reads_and_shows(tmp_path):
    seen = {}

    def program():
        try:
            w = pmviewer.attach()
            assert w.pid == os.getpid()
            assert w.wait()
            seen["before"], seen["scene"] = w.picture(), w.scene
            with pytest.raises(SettingError, match=r"photons\.N"):
                w.set(N=-1)
            w.set(N=500, origin=(0.5, 0.5, -1.2))
            assert w.wait(passes=1)
            assert w.wait()
            seen["after"], seen["settings"] = w.picture(), w.settings
            w.say("hello from outside")
            assert w.wait(passes=10**6, seconds=0.1), "finished is enough"
            assert w.show(np.full((24, 24, 3), 0.25), "grey") == 1
            assert w.show(np.full((24, 24, 3), 0.5), "grey") == 1
            with pmviewer.open("cornell_caustic", SMALL) as s:
                seen["frame"] = s.render(passes=1)
                assert w.show(seen["frame"]) == 2
            with pytest.raises(SettingError, match="array"):
                w.show(np.zeros(3), "flat")
            with pytest.raises(SettingError):
                w.set(N=object())
            assert w.settings.photons.N == 500, "the connection is still good"
            seen["attached"] = w
        except BaseException as error:
            seen["error"] = error
            raise

    with app_on_engine(tmp_path, "cornell_caustic", SMALL) as app:
        attachable(lambda: app, True)()
        thread = threading.Thread(target=program, daemon=True)

        def script(c):
            thread.start()
            wait_until(c, lambda: "attached" in seen or "error" in seen)
            assert "error" not in seen, seen.get("error")
            state = app.state
            np.testing.assert_array_equal(state.frame.image(), seen["after"])
            assert state.settings == seen["settings"]
            grey, rendered = state.snapshots.all
            assert (grey.name, rendered.name) == ("grey", "from Python")
            assert float(grey.image("beauty").max()) == 0.5, "shown again, it takes the old one's place"
            np.testing.assert_array_equal(rendered.image("beauty"), seen["frame"].beauty)
            assert rendered.settings.photons.N == 2000
            assert any("hello from outside" in line.text for line in state.log)
            state.undo()
            assert state.settings.photons.N == 2000, "what a program sets is a step to undo"
            (file,) = (tmp_path / "windows").iterdir()
            assert file.stat().st_mode & 0o077 == 0, "its user's alone"

        drive(app, script)
    assert seen["scene"] == "cornell_caustic"
    assert not np.array_equal(seen["before"], seen["after"])
    with pytest.raises(WindowError, match="closed"):
        seen["attached"].set(N=1)
    with pytest.raises(WindowError, match="--listen"):
        attach()
    assert not list((tmp_path / "windows").iterdir())


def test_a_window_is_allowed_to_listen_in_its_menu_and_lets_no_stranger_in(app, session, tmp_path):
    made = attachable(lambda: app, False)()

    def script(c):
        with pytest.raises(WindowError):
            attach()
        c.menu_click("//##MainMenuBar/File/Let Python programs attach")
        c.yield_(3)
        assert made.state.is_attachable()
        ((_, place),) = wire.places()
        with pytest.raises(connections.AuthenticationError):
            connections.Client(place.address, authkey=b"guessed")
        connection = connections.Client(place.address, authkey=bytes.fromhex(place.key))
        wire.send(connection, {"do": "what nobody knows"})
        answer, _ = wire.receive(connection)
        assert "what nobody knows" in answer["error"]
        connection.send_bytes(b"no message")
        with pytest.raises(EOFError):
            wire.receive(connection)
        c.yield_(3)
        texts = [line.text for line in app.state.log]
        assert any("without this window's key" in text for text in texts)
        assert any("let go" in text for text in texts)
        c.menu_click("//##MainMenuBar/File/Let Python programs attach")
        c.yield_(3)
        assert not made.state.is_attachable()
        with pytest.raises(WindowError):
            attach()

    drive(app, script)


def test_files_of_windows_that_crashed_are_passed_over_and_removed(tmp_path):
    wire.write_place(wire.Place(1, str(tmp_path / "gone"), "00", 0.0))
    (tmp_path / "windows" / "2.json").write_text("{", encoding="utf-8")
    with pytest.raises(WindowError):
        attach()
    with pytest.raises(WindowError, match="process 7"):
        attach(7)
    assert [path.name for path in (tmp_path / "windows").iterdir()] == ["2.json"]


def test_errors_keep_their_kind():
    from pmviewer.library.attaching.attached import _error

    assert type(_error("SettingError", "x")) is SettingError
    assert type(_error("SystemExit", "x")) is PmviewerError


@pytest.mark.slow
def test_a_rendering_opens_a_window_of_its_own_and_shows_pictures_in_it(tmp_path, monkeypatch):
    for name in ("XDG_CONFIG_HOME", "XDG_STATE_HOME"):
        monkeypatch.setenv(name, str(tmp_path / name))
    monkeypatch.setenv("PYTHONPATH", os.getcwd())
    monkeypatch.setattr(wire, "folder", lambda: tmp_path / "XDG_STATE_HOME" / "pmviewer" / "windows")
    with pmviewer.open("cornell_caustic", SMALL) as s:
        s.edit({"light.1.power": 2})
        s.set(origin=(0.5, 0.5, -1.25))
        with s.window() as w:
            assert w.wait()
            assert w.settings == s.settings
            np.testing.assert_array_equal(w.picture(), s.render(passes=2).beauty)
            assert w.show(s.frame()) == 1
            w.quit()
        with pytest.raises(WindowError):
            w.set(N=1)
