"""Focusing by a click, and the focal plane over the picture."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui

from pmviewer.engine.opened import open_scene
from pmviewer.render.camera import resolve_camera
from pmviewer.scene.description import Parallelogram, PointLight, Scene, Shape
from pmviewer.settings.access import with_values
from pmviewer.viewer.overlays.focal_plane import CELLS, COLOUR, plane_vertices
from tests.support.scenes import diffuse
from tests.viewer.driver import drive, on_window_thread
from tests.viewer.fake_session import FakeSession

WALL, QUAD = 5.0, 4.0
"""Distances of what `fake_session.room` shows in the middle and on the left, from its camera."""


@pytest.fixture
def session() -> FakeSession:
    """The room, with surfaces that rays meet."""
    fake = FakeSession()
    fake.open("box")
    shapes = (
        Shape("wall", Parallelogram((-1, -1, -1), (2, 0, 0), (0, 2, 0)), 0),
        Shape("quad", Parallelogram((-0.9, -0.9, 0), (0.8, 0, 0), (0, 1.8, 0)), 0),
    )
    lamp = PointLight("lamp", (0, 0, 3), (1.0, 1.0, 1.0))
    camera = fake.scene.camera
    fake.opened_scene = open_scene(Scene("box", None, shapes, (diffuse(),), (lamp,), camera, 64, 64))
    fake.scene = fake.opened_scene.scene
    return fake


def click(context, app, u, v, ctrl=True):
    left, top, width, height = app.viewport.rectangle()
    x, y = app.viewport.origin
    context.mouse_move_to_pos(ImVec2(x + left + u * width, y + top + v * height))
    if ctrl:
        context.key_down(imgui.Key.mod_ctrl)
    context.mouse_click(0)
    if ctrl:
        context.key_up(imgui.Key.mod_ctrl)
    context.yield_(2)


def test_ctrl_and_a_click_focus_the_lens(app, session):
    def script(c):
        c.yield_(3)
        click(c, app, 0.6, 0.5)
        assert session.settings.camera.focus == "auto", "without a lens nothing is focused"
        assert any("no lens" in message.text for message in app.state.log)
        app.state.change({"camera.aperture": 0.1})
        c.yield_(3)
        assert app.state.resolved("camera.focus") == pytest.approx(WALL, rel=1e-5)
        click(c, app, 0.35, 0.5, ctrl=False)
        assert session.settings.camera.focus == "auto"
        click(c, app, 0.35, 0.5)
        assert session.settings.camera.focus == pytest.approx(QUAD, rel=1e-5)
        click(c, app, 0.6, 0.5)
        assert session.settings.camera.focus == pytest.approx(WALL, rel=1e-5)
        click(c, app, 0.02, 0.5)
        assert session.settings.camera.focus == pytest.approx(WALL, rel=1e-5)
        assert any("no surface to focus on" in message.text for message in app.state.log)

    drive(app, script)


def test_the_free_camera_focuses_the_render_camera(app, session):
    """What is clicked at is seen from elsewhere; the distance is along the render camera's view."""
    above = {"free_camera.on": True, "free_camera.origin": (-0.5, 0.0, 2.0), "free_camera.target": (-0.5, 0.0, 0.0)}

    def script(c):
        app.state.change({"camera.aperture": 0.1, **above})
        c.yield_(3)
        click(c, app, 0.5, 0.5)
        assert session.settings.camera.focus == pytest.approx(QUAD, rel=1e-5)

    drive(app, script)


def test_the_plane_is_what_the_camera_sees_at_that_distance():
    camera = FakeSession()
    camera.open("box")
    for projection in ("perspective", "orthographic"):
        settings = with_values(camera.settings, {"camera.projection": projection, "camera.aperture": 0.2,
                                                 "camera.focus": 3.0, "camera.shift_x": 0.1})  # fmt: skip
        pose = resolve_camera(camera.scene, settings.camera)
        vertices = plane_vertices(pose)
        assert vertices.shape == (CELLS * CELLS * 6, 8)
        x, y, depth = pose.project(vertices[:, :3].astype(float)).T
        assert depth == pytest.approx(3.0, abs=1e-5)
        for pixels in (x, y):
            assert np.unique(np.round(pixels, 2)) == pytest.approx(np.arange(CELLS + 1) * 64 / CELLS, abs=0.02)


def test_what_lies_behind_the_plane_is_tinted(app, session):
    """In focus between the quad and the wall: the wall alone gets the plane's colour."""

    def script(c):
        app.state.change({"camera.aperture": 0.1, "camera.focus": 4.5, "display.view": "albedo"})
        c.yield_(3)
        seen = [on_window_thread(c, lambda: app.viewport.capture(overlays=True)).astype(int)]
        app.state.change({"overlays.focal.show": True, "overlays.focal.opacity": 1.0})
        c.yield_(3)
        seen.append(on_window_thread(c, lambda: app.viewport.capture(overlays=True)).astype(int))
        hidden, tinted = (24, 33), (39, 33)
        assert np.array_equal(seen[0][hidden[1], hidden[0]], seen[1][hidden[1], hidden[0]])
        colour = seen[1][tinted[1], tinted[0]]
        assert colour == pytest.approx(255 * np.array(COLOUR), abs=3)
        app.state.change({"camera.focus": 10.0})
        c.yield_(3)
        beyond = on_window_thread(c, lambda: app.viewport.capture(overlays=True)).astype(int)
        assert np.array_equal(beyond[33, 39], seen[0][33, 39]), "behind everything it is hidden"

    drive(app, script)
