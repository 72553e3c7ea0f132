"""What a window keeps on disk, and what the next one makes of it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.kernels.compile.jit import user_cache_root
from pmviewer.output.checkpoint_header import read_header
from pmviewer.output.session_file import read_session, write_session
from pmviewer.output.snapshot import read_snapshot
from pmviewer.settings.access import Settings, with_values
from pmviewer.viewer.autosave import FILM, KEPT, KEPT_DAYS, SESSION, Autosave
from pmviewer.viewer.background import Background
from pmviewer.viewer.dialogs.restore_dialog import TITLE, told
from pmviewer.viewer.snapshots import Snapshots
from tests.viewer.driver import drive, make_app, wait_until
from tests.viewer.fake_session import FakeSession

OFTEN = with_values(Settings(), {"display.autosave": 0.001})


class Window:
    """What a window has of its autosave, without the window."""

    def __init__(self, root: Path) -> None:
        self.session = FakeSession(OFTEN)
        self.session.open("cornell_caustic")
        self.background = Background(lambda level, text: None)
        self.snapshots = Snapshots(self.background, lambda level, text: None)
        self.autosave = Autosave(root, self.session, self.background)
        self.autosave.begin()

    def write(self) -> None:
        time.sleep(0.005)
        self.autosave.poll({"res": "8"}, self.snapshots, (), 3)
        for work in self.background.running():
            work.done.wait(10)

    def crash(self) -> None:
        """What the system does then."""
        self.autosave._lock._file.close()


def folders(root: Path) -> list[Path]:
    return [path for path in root.iterdir() if path.is_dir()]


def test_a_window_that_is_closed_leaves_nothing(tmp_path):
    window = Window(tmp_path)
    window.write()
    (folder,) = folders(tmp_path)
    saved = read_session(folder / SESSION)
    assert (saved.scene, saved.settings, saved.parameters) == ("cornell_caustic", OFTEN, {"res": "8"})
    assert window.session.film_file == folder / FILM
    window.autosave.end()
    assert window.session.film_file is None
    assert list(tmp_path.iterdir()) == []


def test_what_a_crash_has_left_is_offered_once_and_taken_over(tmp_path):
    first = Window(tmp_path)
    first.write()
    (folder,) = folders(tmp_path)
    assert Window(tmp_path).autosave.left is None  # that window is open
    first.crash()
    second, third = Window(tmp_path), Window(tmp_path)
    assert second.autosave.left.folder == folder
    assert "cornell_caustic" in told(second.autosave.left)
    assert third.autosave.left is None  # it is being asked for
    assert second.autosave.restore() == (folder / SESSION, None)
    assert second.session.film_file == folder / FILM
    second.crash()
    fourth = Window(tmp_path)
    assert fourth.autosave.left.folder == folder
    fourth.autosave.leave()
    fifth = Window(tmp_path)
    fifth.autosave.discard()
    assert not folder.exists()


def test_snapshots_are_written_once(tmp_path):
    window = Window(tmp_path)
    for _ in range(2):
        window.snapshots.take(window.session.frame, None, "")
    window.write()
    (folder,) = folders(tmp_path)
    first, second = sorted((folder / "session.snapshots").iterdir())
    before = first.stat().st_mtime_ns, first.stat().st_ino
    window.snapshots.rename(window.snapshots.all[1], "other")
    window.snapshots.take(window.session.frame, None, "")
    window.write()
    assert (first.stat().st_mtime_ns, first.stat().st_ino) == before
    assert [read_snapshot(path).name for _, path in read_session(folder / SESSION).snapshots][1] == "other"
    window.snapshots.remove(window.snapshots.all[0])
    first.unlink()
    second.unlink()
    window.write()
    kept = [path for _, path in read_session(folder / SESSION).snapshots]
    assert kept == [second, folder / "session.snapshots" / "3.exr"]
    assert read_snapshot(second).name == "other", "what somebody has removed is written again"


def test_the_tour_waits_for_what_a_crash_has_left(tmp_path):
    first = Window(tmp_path)
    first.write()
    first.crash()
    session = FakeSession()
    session.open("box")
    app = make_app(session, tmp_path / "config", autosaves=tmp_path)

    def script(c):
        app.tour.begin()
        c.yield_(4)
        assert app.restore_dialog.is_open
        assert app.tour.shown_at is None
        c.item_click(f"//{TITLE}/Not now##autosave")
        c.yield_(4)
        assert not app.restore_dialog.is_open
        assert app.tour.shown_at is not None

    drive(app, script)


def test_old_and_empty_ones_go(tmp_path):
    for number in range(KEPT + 2):
        folder = tmp_path / f"2026-{number}"
        folder.mkdir()
        write_session(folder / SESSION, Settings(), "cornell_caustic", 0)
        os.utime(folder / SESSION, (time.time() - 100 * number,) * 2)
        os.utime(folder, (time.time() - 100 * number,) * 2)
    (tmp_path / "empty").mkdir()
    old = tmp_path / "old"
    old.mkdir()
    write_session(old / SESSION, Settings(), "cornell_caustic", 0)
    for path in (old / SESSION, old):
        os.utime(path, (time.time() - (KEPT_DAYS + 1) * 86400,) * 2)
    window = Window(tmp_path)
    assert window.autosave.left.folder == tmp_path / "2026-0"
    left = {path.name for path in folders(tmp_path)} - {window.autosave._folder.name}
    assert left == {f"2026-{number}" for number in range(KEPT)}


def test_a_folder_that_cannot_be_made_keeps_nothing(tmp_path):
    (tmp_path / "file").write_text("")
    window = Window(tmp_path / "file" / "below")
    window.write()
    assert window.session.film_file is None
    window.autosave.end()


def test_never_means_never(tmp_path):
    window = Window(tmp_path)
    window.session.settings = with_values(OFTEN, {"display.autosave": 0})
    window.write()
    (folder,) = folders(tmp_path)
    assert not (folder / SESSION).exists()


PROGRAM = """
import sys
from pmviewer.engine.checkpoint import autosave
from pmviewer.output.snapshot import read_snapshot
from pmviewer.settings.access import Settings, with_values
from pmviewer.viewer import app

autosave.WORTH = autosave.SHARE = 0.0
values = {"camera.width": 24, "camera.height": 16, "photons.N": 2000, "display.autosave": 0.05}
values["display.compile_ahead"] = False
app.run_viewer("cornell_diffuse", with_values(Settings(), values), 1)
"""


@pytest.mark.slow
def test_a_killed_window_goes_on_in_the_next_one(tmp_path):
    """The real one, on the real engine: killed, offered, restored by a click, and bit for bit the same."""
    from pmviewer.engine.effects import inactive_reason
    from pmviewer.engine.session import Session

    homes = {f"XDG_{name}_HOME": str(tmp_path / name) for name in ("STATE", "CONFIG")}
    homes |= {"HOME": str(tmp_path), "PMVIEWER_CACHE": str(user_cache_root())}  # with the kernels that there are
    environment = os.environ | homes | {"PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-c", PROGRAM], env=environment, cwd=tmp_path)
    root, end = tmp_path / "STATE" / "pmviewer" / "autosave", time.monotonic() + 240
    while not (list(root.glob(f"*/{FILM}")) and list(root.glob(f"*/{SESSION}"))):
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.1)
    process.kill()
    process.wait()
    (folder,) = folders(root)
    kept = read_header(folder / FILM).passes
    session = Session(threads=2)
    app = make_app(session, tmp_path, inactive_reason=inactive_reason, autosaves=root)
    state = app.state

    def script(context):
        wait_until(context, lambda: app.restore_dialog.is_open)
        context.item_click("//pmviewer was not closed properly/Restore##autosave")
        wait_until(context, lambda: state.frame is not None and state.frame.statistics.passes > kept)

    state.open("cornell_caustic", keep_camera=True)
    drive(app, script)
    session.close()
    frame = state.session.frame
    assert any(f"going on after pass {kept}" in message.text for message in state.log)
    assert state.recent.entries[0] == "cornell_diffuse"
    again = Renderer(open_scene("cornell_diffuse"), frame.settings, WorkPool(1), StageStore(0))
    for _ in range(frame.statistics.passes):
        again.step()
    np.testing.assert_array_equal(again.frame(0).planes, frame.planes)
    assert folders(root) == []
