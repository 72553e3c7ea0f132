"""The comparison with and without importance in the window: started by a click, shown on both sides of a line, and
without effect on the session."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import ImVec2
from imgui_bundle import icons_fontawesome_6 as fa

from pmviewer.output.frame_export import gain_sheet
from pmviewer.output.png import read_png
from pmviewer.output.tone import to_uint8, tone_map
from tests.viewer.driver import app_on_engine, drag_picture, drive, finished, on_window_thread, wait_until

SIZE = 48
VALUES = {
    "camera.width": SIZE,
    "camera.height": SIZE,
    "photons.N": 3_000,
    "render.passes": 2,
    "importance.map": "screen",
    "importance.N": 1_000,
    "importance.deposition": "Keller-Wald",
    "compare.passes": 1,
}
BUTTON = f"**/{fa.ICON_FA_SCALE_BALANCED}##compare_importance"


@pytest.fixture
def app(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with app_on_engine(tmp_path, "cornell_diffuse", VALUES) as app:
        yield app


def test_one_click_shows_both_and_leaves_the_session_alone(app, tmp_path):
    seen, session = {}, app.state.session

    def script(c):
        wait_until(c, lambda: finished(app))
        before = session.settings, session.frame
        c.item_click(BUTTON)
        wait_until(c, lambda: app.state.gain.shown)
        c.yield_(4)
        assert session.settings is before[0]
        assert session.frame is before[1]
        gain = app.state.gain.gain
        seen["window"] = on_window_thread(c, lambda: app.viewport.picture.framebuffers.read("window"))
        seen["place"], seen["gain"] = app.viewport.target().picture, gain

        x, (ox, oy), (_, height) = app.viewport.split_x(), app.viewport.origin, app.viewport.size
        c.mouse_move_to_pos(ImVec2(ox + x, oy + height / 2))
        c.mouse_down(0)
        c.mouse_move_to_pos(ImVec2(ox + x + 60, oy + height / 2))
        c.mouse_up(0)
        c.yield_(3)
        assert session.settings.compare.split == pytest.approx(0.5 + 60 / app.viewport.rectangle()[2], abs=0.02)
        assert session.settings.camera == before[0].camera
        assert session.frame is before[1], "moving the line renders nothing"
        assert app.viewport.frame_at((1, 1)) is gain.with_.frame
        assert app.viewport.frame_at((SIZE - 1, 1)) is gain.without.frame

        shown = app.state.settings.display.view
        app.state.change({"display.view": "error"})
        assert app.state.named_view == "beauty", "menus name what is shown"
        assert "compared" in app.state.refused_view("error")
        app.state.change({"display.view": "normal"})
        assert app.state.named_view == "normal"
        assert app.state.refused_view("normal") is None
        app.state.change({"display.view": shown})
        app.commands.exports.png(tmp_path / "sheet.png", overlays=False)
        wait_until(c, lambda: (tmp_path / "sheet.png").exists() and not app.state.background.running())
        app.state.change({"importance.epsilon": 0.5})
        assert app.state.gain.changed_since() == ["importance.epsilon"]
        assert app.state.gain.shown
        drag_picture(c, app, -40, 30)
        assert not app.state.gain.shown, "another camera sees another picture"
        assert app.state.gain.gain is gain
        assert app.viewport.split_x() is None

    drive(app, script)
    gain, (left, top, width, height) = seen["gain"], seen["place"]
    picture = seen["window"][max(top, 0) : top + height, left : left + width]
    places = ((np.arange(SIZE) + 0.5) * width / SIZE).astype(int)
    got = picture[np.ix_(places, places)].astype(int)
    both = [to_uint8(tone_map(frame.image(), 0.0, "sRGB")).astype(int) for frame in gain.frames()]
    expected = np.where(np.arange(SIZE)[:, None] < SIZE // 2, *both)
    assert np.abs(got - expected).max() <= 1
    assert np.abs(both[0] - both[1]).max() > 20
    np.testing.assert_array_equal(read_png(tmp_path / "sheet.png")[0], gain_sheet(gain))


def test_cancelled_by_its_button_and_refused_where_importance_decides_nothing(app):
    def script(c):
        wait_until(c, lambda: finished(app))
        app.state.change({"compare.passes": 100_000})
        c.item_click(BUTTON)
        wait_until(c, lambda: app.state.gain.running and "pass" in app.state.gain.progress[0])
        c.yield_(4)
        c.item_click(f"//Comparison/**/{fa.ICON_FA_STOP}  Cancel")
        wait_until(c, lambda: not app.state.gain.running)
        assert app.state.gain.gain is None
        wait_until(c, lambda: any("cancelled" in m.text for m in app.state.log))
        app.state.change({"importance.deposition": "all"})
        assert "importance.deposition" in app.state.gain.refusal()
        app.commands.table["compare_importance"]()
        assert not app.state.gain.running
        assert any("No comparison" in m.text for m in app.state.log) or app.state._said

    drive(app, script)
    assert not app.state.gain.running
