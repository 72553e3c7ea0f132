"""Automatic mode in the window: a click tries ways of rendering, says what it picked, and one undo takes it back."""

from __future__ import annotations

import pytest
from imgui_bundle import icons_fontawesome_6 as fa

from pmviewer.engine.auto.candidates import assignments
from pmviewer.settings.access import SETTINGS, get
from tests.viewer.driver import app_on_engine, drive, finished, wait_until

VALUES = {"camera.width": 24, "camera.height": 24, "photons.N": 3_000, "render.passes": 2}
BUTTON = f"**/{fa.ICON_FA_GAUGE_HIGH}##choose_automatically"


@pytest.fixture
def app(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with app_on_engine(tmp_path, "cornell_diffuse", VALUES) as app:
        yield app


def test_one_click_chooses_and_one_undo_takes_it_back(app):
    seen = {}

    def script(c):
        wait_until(c, lambda: finished(app))
        before = app.state.settings
        c.item_click(BUTTON)
        wait_until(c, lambda: app.state.settings != before)
        after = app.state.settings
        c.yield_(2)
        seen["changed"] = {path for path in SETTINGS if get(after, path) != get(before, path)}
        seen["said"] = [message.text for message in app.state.log if message.text.startswith("automatic: ")]
        app.state.undo()
        seen["undone"] = app.state.settings == before
        wait_until(c, lambda: finished(app))

    drive(app, script)
    assert seen["changed"]
    assert seen["changed"] <= set(assignments({}))
    assert len(seen["said"]) == 1
    assert seen["undone"]
