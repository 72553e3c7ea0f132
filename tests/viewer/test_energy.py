"""The energy ledger in the statistics: hidden until it is asked for."""

from __future__ import annotations

from pmviewer.viewer.panels import statistics_panel
from tests.viewer.driver import drive, make_app
from tests.viewer.fake_session import FakeSession


def test_ledger_opens_on_demand(tmp_path, monkeypatch):
    session = FakeSession()
    app = make_app(session, tmp_path)
    asked = []
    original = statistics_panel.energy_rows

    def rows(energy):
        asked.append(energy)
        return original(energy)

    monkeypatch.setattr(statistics_panel, "energy_rows", rows)

    def script(context):
        session.open("room")
        context.yield_(4)
        context.window_focus("//Statistics")
        context.yield_(4)
        assert not asked
        context.item_click("//Statistics/**/Energy of a pass")
        context.yield_(4)
        assert asked
        assert asked[-1] is session.frame.statistics.energy

    drive(app, script)
