"""The window on the real engine, end to end."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import imgui

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.session import Session
from pmviewer.output.png import read_png
from pmviewer.output.tone import to_uint8, tone_map
from pmviewer.settings.access import Settings, with_values
from tests.viewer.driver import chord, drag, drive, item, make_app, on_window_thread, viewport_pixels, wait_until

K = imgui.Key


@pytest.fixture
def session():
    small = with_values(Settings(), {"camera.width": 96, "camera.height": 96, "photons.N": 20_000, "render.passes": 4})
    session = Session(settings=small)
    yield session
    session.close()


def test_open_drag_overlay_export_and_a_broken_file(session, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    broken = tmp_path / "broken.xml"
    broken.write_text('<scene version="3.0.0"><shape type="blob"/>')
    app = make_app(session, tmp_path, inactive_reason=inactive_reason)
    app.state.open("cornell_caustic", keep_camera=True)
    seen = {}

    def finished():
        return session.status.state == "finished" and app.state.frame is not None

    def script(c):
        wait_until(c, lambda: session.geometry is not None)
        c.yield_(3)
        seen["geometry"] = viewport_pixels(c, app)
        wait_until(c, finished)
        c.yield_(3)
        seen["picture"] = on_window_thread(c, lambda: app.viewport.capture(overlays=False))
        seen["frame"] = app.state.frame
        version = app.state.frame.version
        drag(c, item("photons.N"), 0.45, 0.55)
        wait_until(c, lambda: app.state.frame.version > version and finished())
        assert app.state.frame.settings.photons.N == session.settings.photons.N != 20_000
        before = viewport_pixels(c, app)
        c.key_press(K.g)
        c.yield_(4)
        seen["points"] = (viewport_pixels(c, app) != before).any(axis=-1).mean()
        c.key_press(chord(K.f12, K.mod_ctrl))
        app.drop([str(broken)])
        wait_until(c, lambda: any(m.level == "error" for m in app.state.log))
        c.yield_(2)

    drive(app, script)
    assert seen["geometry"].std() > 20, "the geometry stands in before the first picture"
    expected = to_uint8(tone_map(seen["frame"].image("beauty"), 0.0, "sRGB"))
    assert np.abs(seen["picture"].astype(int) - expected).max() <= 1
    assert seen["points"] > 0.05
    assert session.scene.name.startswith("cornell")
    assert session.frame is not None
    errors = [m.text for m in app.state.log if m.level == "error"]
    assert len(errors) == 1
    assert "broken.xml" in errors[0]
    assert read_png(tmp_path / f"{session.scene.name}-beauty-4.png")[0].shape == (96, 96, 3)
    assert app.state.recent.entries == ["cornell_caustic"]
