"""A script beside the window: what it sets is shown and can be undone, what it reads is what is shown."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.errors import SettingError
from pmviewer.library.live import Live, Scripted
from tests.viewer.driver import app_on_engine, drive, finished, wait_until

SMALL = {"camera.width": 24, "camera.height": 24, "render.passes": 2, "photons.N": 2000}


def test_a_script_changes_the_window_and_reads_it(tmp_path):
    seen = {}

    def script(live: Live) -> None:
        assert live.wait()
        seen["before"] = live.picture()
        with pytest.raises(SettingError):
            live.set(N=-1)
        live.set(N=500)
        assert live.settings.photons.N == 500
        assert live.wait()
        seen["after"] = live.picture()
        live.set({"display.tone": "Reinhard"})  # nothing is rendered for it
        seen["waited"] = live.wait(seconds=120)
        live.set({"display.view": "look-up radius", "display.tone": "filmic"})  # is made from what there is
        seen["held"] = live.wait(seconds=120) and "look-up radius" in app.state.frame.diagnostics
        live.set({"display.view": "beauty"})
        seen["done"] = True
        live.wait(10**6)  # until the window is closed
        raise ValueError("at its end")

    with app_on_engine(tmp_path, "cornell_caustic", SMALL) as app:
        scripted = Scripted(script)

        def window(c):
            scripted.begin(app)
            wait_until(c, lambda: "done" in seen)
            assert finished(app)
            assert np.array_equal(app.state.frame.image(), seen["after"])
            assert not np.array_equal(seen["before"], seen["after"])
            assert seen["waited"]
            assert seen["held"]
            for _ in range(4):
                app.state.undo()
            assert app.state.settings.photons.N == 2000

        drive(app, window)
        with pytest.raises(ValueError, match="at its end"):
            scripted.end()
