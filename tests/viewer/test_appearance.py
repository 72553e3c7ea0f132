"""The interface's size and look: the user's own, with the picture as it is."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import imgui

from pmviewer.viewer import theme
from tests.viewer.driver import chord, drive, make_app, on_window_thread, viewport_pixels, window_pixels
from tests.viewer.fake_session import FakeSession

K = imgui.Key


@pytest.fixture
def app(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    session = FakeSession()
    session.open("box")
    yield make_app(session, tmp_path)
    theme.use("dark")


def test_light_and_dark_change_the_panels_and_not_the_picture(app, tmp_path):
    seen = {}

    def script(c):
        for look in ("dark", "light", "dark again"):
            c.yield_(4)
            seen[look] = window_pixels(app, c, tmp_path / f"{look}.png"), viewport_pixels(c, app)
            c.key_press(chord(chord(K.l, K.mod_ctrl), K.mod_shift))

    drive(app, script)
    np.testing.assert_array_equal(seen["dark"][1], seen["light"][1])
    left = {look: float(np.median(window[100:500, 5:200])) / 255 for look, (window, _) in seen.items()}
    grounds = {look: theme.LOOKS[look].grounds["window_bg"] for look in theme.LOOKS}
    assert left["dark"] == left["dark again"] == pytest.approx(grounds["dark"], abs=0.08)
    assert left["light"] == pytest.approx(grounds["light"], abs=0.08)


def test_text_and_spacing_grow_and_shrink(app):
    def script(c):
        def height():
            return on_window_thread(c, lambda: (imgui.get_style().item_spacing.y, app.state.appearance.scale))

        before = height()
        size = c.item_info("//Settings/**/##photons.N").rect_full
        c.key_press(chord(K.equal, K.mod_ctrl))
        c.key_press(chord(K.equal, K.mod_ctrl))
        c.yield_(4)
        after = height()
        assert after[1] == 1.5
        assert after[0] == pytest.approx(1.5 * before[0])
        grown = c.item_info("//Settings/**/##photons.N").rect_full
        ratio = (grown.max.y - grown.min.y) / (size.max.y - size.min.y)
        assert ratio == pytest.approx(1.5, abs=0.1)
        for _ in range(9):
            c.key_press(chord(K.minus, K.mod_ctrl))
        c.yield_(3)
        assert height()[1] == 0.75
        c.menu_click("//##MainMenuBar/View/Size of the interface/100%")
        c.yield_(3)
        assert height() == before

    drive(app, script)
