"""Automatic mode in the window: a click tries ways of rendering, says what it picked, and one undo takes it back."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from imgui_bundle import icons_fontawesome_6 as fa

from pmviewer.engine.frame import Status
from pmviewer.settings.access import SETTINGS, Settings, get, with_values
from pmviewer.settings.presets import assignments, given
from pmviewer.viewer.automatic import AutomaticRun
from tests.viewer.driver import app_on_engine, drive, finished, wait_until
from tests.viewer.fake_session import FakeSession

VALUES = {"camera.width": 24, "camera.height": 24, "photons.N": 3_000, "render.passes": 2}
BUTTON = f"**/{fa.ICON_FA_GAUGE_HIGH}##choose_automatically"


@pytest.fixture
def app(tmp_path, monkeypatch, every_path_may_split):
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
        app.state.redo()
        wait_until(c, lambda: finished(app))
        other = next(m for m in SETTINGS["render.method"].choices if m != after.render.method)
        app.state.change({"estimate.alpha": 0.5})
        app.state.change({"render.method": other})
        c.yield_(2)
        seen["by hand"] = app.state.settings == with_values(before, {"render.method": other, "estimate.alpha": 0.5})
        seen["why"] = [message.text for message in app.state.log if "What automatic mode chose" in message.text]

    drive(app, script)
    assert seen["changed"]
    assert seen["changed"] <= set(assignments({}))
    assert len(seen["said"]) == 1
    assert seen["undone"]
    assert seen["by hand"], "numbers of one method that automatic mode has chosen are not for another"
    assert len(seen["why"]) == 1
    assert "photons.N" in seen["why"][0]


def test_another_scene_has_the_own_settings_again_and_a_trial_of_its_own(app, monkeypatch):
    app.state.automatic.at_start = True
    session, left, picked = app.state.session, [], []
    opening = session.open

    def opened_with(source, settings, *more):
        left.append(given(settings))
        opening(source, settings, *more)

    monkeypatch.setattr(session, "open", opened_with)

    def script(c):
        wait_until(c, lambda: finished(app))
        app.state.change({"render.passes": 100_000, "photons.N": SETTINGS["photons.N"].default})
        for times, scene in enumerate(("cornell_diffuse", "corner_room"), 1):
            app.state.open(scene, keep_camera=True)
            wait_until(c, lambda times=times: sum(m.text.startswith("automatic: ") for m in app.state.log) == times)
            c.yield_(2)
            picked.append(given(app.state.settings))

    drive(app, script)
    assert left == [[], []]
    assert all(picked)


def test_a_scene_that_is_opened_is_tried_by_itself_once_it_shows_passes(app):
    app.state.automatic.at_start = True
    seen = {}

    def script(c):
        wait_until(c, lambda: finished(app))
        seen["asked"] = app.state.automatic.running
        endless = {"render.passes": 100_000, "photons.N": SETTINGS["photons.N"].default}
        app.state.change(endless)
        app.state.open("cornell_diffuse", keep_camera=True)
        wait_until(c, lambda: any(m.text.startswith("automatic: ") for m in app.state.log))
        c.yield_(2)
        seen["settings"] = app.state.settings
        seen["log"] = [m.text for m in app.state.log if m.text.startswith("automatic: ")]

    drive(app, script)
    assert seen["asked"] is False
    assert len(seen["log"]) == 1
    assert get(seen["settings"], "render.passes") == 100_000


class Run(AutomaticRun):
    """Notes when a trial would begin."""

    def _start(self, opened, *, asked):
        self.begun.append(asked)


@pytest.fixture
def waiting():
    """A run that has seen a scene being opened, whose third pass is shown."""
    session = FakeSession()
    run = Run(session, None, lambda level, text: None, lambda values: None)
    run.begun, run.at_start = [], True

    def shown(chosen=False, passes=3, before=(), **settings):
        """`before`: states while the frame is still the one of the scene before."""
        run.opening(chosen=chosen)
        session.settings = with_values(Settings(), settings)
        session.opened_scene = SimpleNamespace(scene=SimpleNamespace(name="box"))
        statistics = SimpleNamespace(passes=passes)
        session.frame = SimpleNamespace(coarse=False, statistics=statistics, scene_name="box")
        session.is_newest = False
        for state in before:
            session.status = Status(state, "")
            run.poll()
        session.is_newest, session.status = True, Status("rendering", "")
        run.poll()
        return run.begun

    return shown


def test_a_trial_begins_once_by_itself(waiting):
    assert waiting() == [False]
    assert waiting() == [False, False]  # another scene


def test_what_is_left_of_a_scene_before_begins_no_trial_and_takes_none_away(waiting):
    assert waiting(before=("finished", "loading", "preparing")) == [False]


@pytest.mark.parametrize(
    ("how", "settings"),
    [
        ({"chosen": True}, {}),
        ({"passes": 1}, {}),
        ({}, {"render.method": "gather"}),
        ({}, {"photons.N": 1000}),
        ({}, {"display.automatic": False}),
    ],
)
def test_what_somebody_has_chosen_is_left_alone(waiting, how, settings):
    assert waiting(**how, **settings) == []
