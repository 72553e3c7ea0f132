"""Pictures at another size than the window's, with the legend of their view."""

from __future__ import annotations

import numpy as np

from pmviewer.output.exr import read_exr
from pmviewer.output.false_look import Look
from pmviewer.output.legend_sheet import with_legend
from pmviewer.output.png import read_png
from tests.viewer.driver import app_on_engine, drive, finished, wait_until

SMALL = {"camera.width": 32, "camera.height": 24, "render.passes": 1, "photons.N": 2000}


def test_a_picture_twice_the_size_beside_the_session(tmp_path):
    with app_on_engine(tmp_path, "cornell_caustic", SMALL) as app:

        def script(c):
            state = app.state
            wait_until(c, lambda: finished(app))
            app.commands.table["export_still"]()
            c.yield_(4)
            c.item_click("//Export at another size/Cancel##still")
            c.yield_(2)
            assert not app.commands.still_dialog.is_open
            state.still.still.width, state.still.still.passes = 64, 2
            state.still.export(tmp_path / "large.png", 32 / 24, "beauty")
            state.still.export(tmp_path / "large.exr", 32 / 24, "beauty")
            wait_until(c, lambda: not state.background.running())
            assert (state.settings.camera.width, state.settings.render.passes) == (32, 1), "the session stays"

        drive(app, script)
    pixels, texts = read_png(tmp_path / "large.png")
    assert pixels.shape == (48, 64, 3)
    assert texts["pmviewer.passes"] == "2"
    layers, _ = read_exr(tmp_path / "large.exr")
    assert {layer.shape[:2] for layer in layers.values()} == {(48, 64)}


def test_a_legend_names_the_ends_and_keeps_the_picture():
    plane = np.linspace(1.0, 9.0, 300 * 200, dtype=np.float32).reshape(200, 300, 1)
    picture = np.full((200, 300, 3), 77, np.uint8)
    sheet = with_legend(picture, "density ratio", plane, Look(range="by hand", low=1.0, high=9.0, spacing="linear"))
    assert sheet.shape[0] == 200
    assert sheet.shape[1] > 360
    assert (sheet[:, :300] == 77).all()
    bar = [len(np.unique(sheet[:, x], axis=0)) for x in range(300, sheet.shape[1])]
    assert max(bar) > 50, "a column of the bar has many colours"
    assert with_legend(picture, "beauty", plane, Look()) is picture
