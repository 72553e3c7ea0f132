"""A pass that takes long: the status bar tells how far it is, and ends it."""

from __future__ import annotations

from pmviewer.engine.frame import Status
from tests.viewer.driver import drive, make_app
from tests.viewer.fake_session import FakeSession


def test_a_long_pass_can_be_stopped_from_the_status_bar(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    session = FakeSession()
    session.open("box")
    app = make_app(session, tmp_path)

    def script(c):
        session.status = Status("rendering", "rendering", 2, 0.1, "light pass", 0.43)
        c.yield_(2)
        c.item_click("**/Stop##pass")
        c.yield_(2)

    drive(app, script)
    assert session.stops == 1
    assert session.paused
