"""A user who does anything, for a while; `pmviewer bench actions` lets three of them loose for a thousand actions."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from pmviewer.settings.access import with_values
from pmviewer.viewer import random_user
from pmviewer.viewer.random_user import START, RandomUser, let_loose
from tests.viewer.driver import app_on_engine


@pytest.mark.extensive
@pytest.mark.slow
@pytest.mark.parametrize("seed", [7])
def test_random_actions_break_nothing_and_are_undone_to_the_same_picture(tmp_path, monkeypatch, seed):
    monkeypatch.chdir(tmp_path)
    report = let_loose("cornell_caustic", seed, 40, tmp_path)
    assert report.wrong == []
    assert (report.actions, report.rounds) == (40, 1)
    assert sum(report.counts.values()) == 40
    assert report.frames > 10


def test_a_picture_is_finished_whose_settings_had_another_display(tmp_path, monkeypatch):
    """Undoing all at once, the session may take up settings on the way: a display that is none of the picture's."""
    monkeypatch.setattr(random_user, "PATIENCE", 60.0)
    context = SimpleNamespace(yield_=lambda frames: None)
    with app_on_engine(tmp_path, "cornell_caustic", START) as app:
        session, user = app.state.session, RandomUser(app, 0)
        user._settle(context)
        start = session.settings
        session.set(with_values(start, {"photons.N": 3000, "display.tone": "filmic", "render.passes": 3}))
        session.wait(timeout=60)
        assert session.frame.settings == session.settings
        session.set(with_values(session.settings, {"display.tone": "sRGB", "render.passes": 2}))
        user._settle(context)
        assert session.frame.settings != session.settings
        assert user.report.wrong == []
        session.set(start)
        user._settle(context)
        assert session.frame.settings == start, "it waits for what is rendered anew"
        assert session.frame.statistics.passes == 2
