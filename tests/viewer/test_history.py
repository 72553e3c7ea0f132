"""Undo and redo: of everything that is a setting or a camera, in steps that a user would count."""

from __future__ import annotations

import random

import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui

from pmviewer.engine.session import Session
from pmviewer.settings.access import SETTINGS, Settings, flat, with_values
from pmviewer.viewer import history as history_module
from pmviewer.viewer.dialogs.recent import RecentFiles
from pmviewer.viewer.history import History
from pmviewer.viewer.state import ViewerState
from tests.support.scenes import diffuse_box, settings_of
from tests.viewer.driver import chord, drag, drag_picture, drive, item

K = imgui.Key
PATIENCE = 120.0


def state_of(session, tmp_path) -> ViewerState:
    return ViewerState(session, lambda path, settings, traits: None, RecentFiles(tmp_path / "recent.txt"))


def random_value(info, rng: random.Random):
    """Anything that the setting accepts."""
    if info.auto and rng.random() < 0.3:
        return "auto"
    if info.scale == "switch":
        return rng.random() < 0.5
    if info.choices:
        return rng.choice(info.choices)
    if info.scale == "edits":
        return {f"light.{rng.randint(1, 3)}.power": (rng.uniform(0, 3),) for _ in range(rng.randint(0, 2))}
    if info.scale == "vector":
        return tuple(rng.uniform(-3, 3) for _ in range(3))
    if info.scale == "name":
        return rng.choice(("auto", "1"))
    low, high = float(info.lower), float(info.upper)
    value = low * (high / low) ** rng.random() if low > 0 else rng.uniform(low, high)
    return min(max(info.kind(value), info.kind(low)), info.kind(high))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_200_random_edits_are_undone_to_the_same_settings_and_redone(session, tmp_path, seed):
    session.publish = lambda: None  # pictures of sixteen thousand pixels' width are not the point
    rng, state = random.Random(seed), state_of(session, tmp_path)
    start, states = state.settings, [state.settings]
    while len(states) <= 200:
        state.history.gesture += 1
        paths = rng.sample(sorted(SETTINGS), rng.choice((1, 1, 1, 2, 4)))
        state.change({path: random_value(SETTINGS[path], rng) for path in paths})
        if state.settings != states[-1]:
            states.append(state.settings)
    assert len(state.history.done) == 200
    assert all(step.name for step in state.history.done)
    for expected in reversed(states[:-1]):
        state.undo()
        assert state.settings == expected
    assert state.settings == start
    state.undo()
    assert state.settings == start, "there is nothing more"
    for expected in states[1:]:
        state.redo()
        assert flat(state.settings) == flat(expected)
    assert not [m for m in state._said if m.level == "error"]


def test_undone_edits_give_the_same_picture(tmp_path):
    small = settings_of(photons={"N": 2000}, render={"passes": 1})
    session = Session(threads=2, settings=small)
    try:
        session.open(diffuse_box())
        assert session.wait(timeout=PATIENCE)
        before, state = session.frame, state_of(session, tmp_path)
        for values in (
            {"photons.N": 3000},
            {"estimate.radius": 0.05},
            {"camera.origin": (0.1, 0.2, 3.0)},
            {"photons.N": 900},
            {"display.exposure": 1.0},
        ):
            state.history.gesture += 1
            state.change(values)
        assert session.wait(timeout=PATIENCE)
        assert not np.array_equal(session.frame.planes, before.planes)
        while state.history.done:
            state.undo()
        assert session.wait(timeout=PATIENCE)
        assert session.settings == small
        np.testing.assert_array_equal(session.frame.planes, before.planes)
    finally:
        session.close()


def test_one_drag_is_one_step_and_a_pause_ends_a_turn_of_the_wheel(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(history_module.time, "monotonic", lambda: clock[0])
    history, settings = History(), Settings()

    def change(values):
        nonlocal settings
        after = with_values(settings, values)
        history.changed(settings, after)
        settings = after

    history.held = True
    for N in (1000, 2000, 3000):
        clock[0] += 5  # however long it takes
        change({"photons.N": N})
    history.held, history.gesture = False, 1
    change({"camera.origin": (1.0, 0, 0), "camera.target": (0, 0, 0.5), "camera.up": (0, 1.0, 0)})
    clock[0] += 0.1
    change({"camera.origin": (2.0, 0, 0)})
    clock[0] += 1
    change({"camera.origin": (3.0, 0, 0)})
    assert [step.name for step in history.done] == [
        "light pass, N: 3,000 photons",
        "move the camera",
        "camera, origin: 3, 0, 0",
    ]
    for _ in range(3):
        settings = history.undo(settings)
    assert settings == Settings()
    change({"photons.q": 0.5})
    assert history.redo(settings) is None, "another way was taken"


def test_keys_and_menu_undo_drags_of_sliders_and_of_the_picture(app, session):
    def script(c):
        start = session.settings
        drag(c, item("photons.N"), 0.5, 0.8)
        more = session.settings
        drag_picture(c, app, 80, 30)
        drag_picture(c, app, -40, 10)
        x, y = app.viewport.origin
        c.mouse_move_to_pos(ImVec2(x + 200, y + 200))
        c.mouse_wheel_y(2)
        c.yield_(3)
        turned = session.settings
        names = [step.name for step in app.state.history.done]
        assert names[1:] == ["move the camera"] * 3
        assert names[0].startswith("light pass, N:")
        for _ in range(3):
            c.key_press(chord(K.z, K.mod_ctrl))
            c.yield_(2)
        assert session.settings == more
        c.menu_click("//##MainMenuBar/Edit/###undo")
        c.yield_(2)
        assert session.settings == start
        for _ in range(2):
            c.key_press(int(K.z) | int(K.mod_ctrl) | int(K.mod_shift))
            c.key_press(chord(K.y, K.mod_ctrl))
            c.yield_(2)
        assert session.settings == turned
        c.menu_click("//##MainMenuBar/Edit/History/###undo3")
        c.yield_(2)
        assert session.settings == start
        app.state.open("another")
        c.yield_(3)
        assert not app.state.history.done

    drive(app, script)
