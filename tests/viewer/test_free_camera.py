"""The free camera in the window: navigation, the frustum and its label, and its two ways back to the render camera."""

from __future__ import annotations

import numpy as np
from imgui_bundle import icons_fontawesome_6 as fa

from pmviewer.render.free_camera import frustum_lines
from pmviewer.settings.access import FreeCamera, Settings, with_values
from pmviewer.viewer import theme
from tests.viewer.driver import drag_picture, drive, on_window_thread, viewport_pixels

FROM = {"free_camera.on": True, "free_camera.origin": (3.0, 2.0, 5.0), "free_camera.target": (0.0, 0.0, 1.0)}


def test_the_button_frees_the_camera_and_navigation_moves_it_alone(app, session):
    def script(c):
        c.item_click(f"**/{fa.ICON_FA_VIDEO}##toggle_free")
        c.yield_(3)
        assert session.settings.free_camera.on
        overview = app.state.live_camera()
        assert overview != app.state.render_camera()
        drag_picture(c, app, 60, 20)
        moved = session.settings.free_camera
        assert moved.origin != "auto"
        assert session.settings.camera == Settings().camera
        app.commands.table["reset_camera"]()
        assert app.state.live_camera() == overview

    drive(app, script)


def test_ways_back(app, session):
    def script(c):
        app.commands.table["free_from_above"]()
        above = app.state.live_camera()
        assert above.origin[1] > 4
        assert above.near > 0
        app.commands.table["free_to_render"]()
        free, render = app.state.live_camera(), app.state.render_camera()
        assert session.settings.free_camera.on
        np.testing.assert_allclose(free.ray_frame(), render.ray_frame(), atol=1e-9)
        app.state.change(FROM)
        wanted = app.state.live_camera()
        app.commands.table["free_becomes_render"]()
        assert not session.settings.free_camera.on
        np.testing.assert_allclose(app.state.live_camera().ray_frame(), wanted.ray_frame(), atol=1e-9)
        app.state.open("other")
        assert session.settings.free_camera == FreeCamera()

    drive(app, script)


def test_the_frustum_is_drawn_behind_surfaces_and_before_them(app, session):
    """As lines to the image's corners: bright where nothing is before them, faint behind a wall."""
    shots = {}

    def script(c):
        app.state.change({**FROM, "free_camera.length": 1.0, "display.view": "geometry"})
        c.yield_(4)
        shots["with"] = on_window_thread(c, lambda: app.viewport.capture(overlays=True))
        shots["camera"] = app.viewport.shown_camera()
        shots["ends"] = frustum_lines(app.state.render_camera(), session.geometry.radius)
        app.state.change({"free_camera.frustum": False})
        c.yield_(4)
        shots["without"] = on_window_thread(c, lambda: app.viewport.capture(overlays=True))
        shots["redraws"] = app.viewport.redraws
        c.yield_(4)
        assert app.viewport.redraws == shots["redraws"], "an idle window draws nothing"
        app.state.change({"free_camera.on": False})
        c.yield_(4)
        shots["off"] = on_window_thread(c, lambda: app.viewport.capture(overlays=True))

    session.settings = with_values(session.settings, {"camera.width": 400, "camera.height": 300})
    drive(app, script)
    drawn, plain = shots["with"].astype(float), shots["without"].astype(float)
    changed = np.abs(drawn - plain).max(axis=-1) > 12
    assert 0.002 < changed.mean() < 0.1
    camera, ends = shots["camera"], shots["ends"].reshape(-1, 2, 3)
    yellow = np.array(theme.FREE[:3]) * 255
    bright = np.abs(drawn - yellow).max(axis=-1) < 30
    share = 0.1 + 0.2 * np.arange(5)[:, None]
    for a, b in ends[:4]:
        x, y, _ = camera.project(a + share * (b - a)).T
        inside = (x > 2) & (x < 397) & (y > 2) & (y < 297)
        around = [changed[int(v) - 1 : int(v) + 2, int(u) - 1 : int(u) + 2].any() for u, v in zip(x[inside], y[inside])]
        assert all(around)
    assert bright.sum() > 200
    assert not np.array_equal(shots["off"], shots["without"]), "the picture is the render camera's again"


def test_hidden_parts_are_faint(app, session):
    """The render camera stands behind the quad, as the free camera sees it."""
    seen = {}

    def script(c):
        eye = {"camera.origin": (-0.5, 0.0, -0.5), "camera.target": (-0.5, 0.0, -1.0)}
        free = {"free_camera.origin": (-0.5, 0.3, 3.0), "free_camera.target": (-0.5, 0.0, 0.0)}
        app.state.change({**FROM, **eye, **free, "free_camera.length": 0.1, "free_camera.cut": False})
        app.state.change({"display.view": "geometry"})
        c.yield_(4)
        seen["hidden"] = on_window_thread(c, lambda: app.viewport.capture(overlays=True))
        app.state.change({"camera.origin": (-0.5, 0.0, 0.8), "camera.target": (-0.5, 0.0, 0.0)})
        c.yield_(4)
        seen["free"] = on_window_thread(c, lambda: app.viewport.capture(overlays=True))
        seen["window"] = viewport_pixels(c, app)

    session.settings = with_values(session.settings, {"camera.width": 200, "camera.height": 200})
    drive(app, script)
    yellow = np.array(theme.FREE[:3]) * 255
    close = {name: (np.abs(p.astype(float) - yellow).max(axis=-1) < 30).sum() for name, p in seen.items()}
    assert close["hidden"] == 0
    assert close["free"] > 20
    assert close["window"] > 20
