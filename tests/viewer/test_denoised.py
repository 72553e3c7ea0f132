"""The denoised picture in the window and in files: beside the picture, never in its place."""

import importlib.util

import numpy as np
import pytest
from imgui_bundle import imgui

from pmviewer.commands.job import load_job
from pmviewer.commands.rendering import render_job
from pmviewer.errors import SettingError
from pmviewer.output.exr import read_exr
from tests.viewer.driver import app_on_engine, drive, on_window_thread, wait_until

VALUES = {"camera.width": 64, "camera.height": 64, "photons.N": 5_000, "render.passes": 2}


@pytest.fixture
def app(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with app_on_engine(tmp_path, "cornell_diffuse", VALUES) as app:
        yield app


def test_its_key_shows_it_and_the_picture_again(app):
    held, shown = [], []

    def script(c):
        wait_until(c, lambda: app.state.frame is not None and app.state.session.status.state == "finished")
        plain = app.state.frame
        held.append("denoised" in plain.diagnostics)
        c.yield_(2)
        shown.append(on_window_thread(c, lambda: app.viewport.capture(overlays=False)))
        c.key_press(imgui.Key.d)
        wait_until(c, lambda: "denoised" in app.state.frame.diagnostics)
        c.yield_(3)
        assert app.state.shown_display.view == "denoised"
        assert app.state.frame.planes is plain.planes, "no new pass"
        shown.append(on_window_thread(c, lambda: app.viewport.capture(overlays=False)))
        c.key_press(imgui.Key.d)
        c.yield_(3)
        assert app.state.shown_display.view == "beauty"
        shown.append(on_window_thread(c, lambda: app.viewport.capture(overlays=False)))

    drive(app, script)
    assert held == [False], "nothing of it while it is not shown"
    assert not np.array_equal(shown[0], shown[1])
    assert np.array_equal(shown[0], shown[2])


def test_files_hold_it_as_a_layer_of_its_own(tmp_path):
    def job():
        return load_job("cornell_diffuse", [f"{path}={value}" for path, value in VALUES.items()], [])

    render_job(job(), [tmp_path / "plain.exr"], seed=2)
    render_job(job(), [tmp_path / "both.exr"], seed=2, denoise=True)
    plain, _ = read_exr(tmp_path / "plain.exr")
    both, about = read_exr(tmp_path / "both.exr")
    assert both.keys() - plain.keys() == {"denoised"}
    for name, layer in plain.items():
        np.testing.assert_array_equal(layer, both[name])
    assert not np.array_equal(both["denoised"], both[""])
    assert any("Open Image Denoise" in str(value) for value in about.values())


def test_where_it_is_not_installed_it_is_refused_before_rendering(tmp_path, monkeypatch):
    found = importlib.util.find_spec
    monkeypatch.setattr(
        "pmviewer.settings.schema.display.find_spec", lambda name: None if name == "pyoidn" else found(name)
    )
    with pytest.raises(SettingError, match=r"pip install 'pmviewer\[denoise\]'"):
        render_job(load_job("cornell_diffuse", [], []), [tmp_path / "a.exr"], denoise=True)
    with pytest.raises(SettingError, match="Open Image Denoise"):
        render_job(load_job("cornell_diffuse", ["display.view=denoised"], []), [tmp_path / "a.png"])
    assert not list(tmp_path.iterdir())
