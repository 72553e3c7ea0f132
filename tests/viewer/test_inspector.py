"""The inspector in the window: what pins and lets go, what is drawn and listed, and that it costs nothing closed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import ImVec2, hello_imgui, imgui

from pmviewer.engine import diagnose
from pmviewer.engine.inspector.report import PhotonAt, Pinned
from pmviewer.render.camera import resolve_camera
from pmviewer.viewer.overlays.inspected import CHOSEN_COLOUR, DISC_COLOUR, disc_lines
from pmviewer.viewer.panels.inspector.panel import InspectorPanel
from pmviewer.viewer.panels.inspector.plots import on_hemisphere
from pmviewer.viewer.panels.inspector.sorted_table import ordered, unit_of
from pmviewer.viewer.viewport.picking import on_picture
from tests.viewer.driver import (
    app_on_engine,
    click_at_once,
    drag_picture,
    drive,
    finished,
    make_app,
    viewport_pixels,
    wait_until,
)
from tests.viewer.fake_session import FakeSession

K = imgui.Key
VALUES = {
    "camera.width": 64,
    "camera.height": 64,
    "photons.N": 20_000,
    "render.passes": 3,
    "render.method": "progressive",
    "estimate.radius": 0.12,
    "estimate.alpha": 1.0,
}
FLOOR = (32, 57)


def place(app, u, v):
    """On the screen, of a share of the picture's width and height."""
    (x, y), (left, top, width, height) = app.viewport.origin, app.viewport.rectangle()
    return ImVec2(x + left + u * width, y + top + v * height)


def click(c, app, x, y):
    """The middle of a pixel of 64²."""
    c.mouse_move_to_pos(place(app, (x + 0.5) / 64, (y + 0.5) / 64))
    c.mouse_click(0)
    c.yield_(2)


def in_front(label):
    window = imgui.internal.find_window_by_name(label)
    return window is not None and window.active and not window.hidden


def test_a_click_pins_a_pixel_and_lets_it_go(tmp_path):
    """A click pins, another place moves the pin, the same one or Esc or closing the tab lets go; drags, fly mode and
    the start pin nothing."""
    session = FakeSession()
    app = make_app(session, tmp_path)
    app.state.open("scene.xml")
    seen = {}

    def script(c):
        c.yield_(4)
        seen["front at start"] = in_front("Overlays") and not in_front("Inspector")
        drag_picture(c, app, 60, 20)
        assert session.pinned is None
        click(c, app, 16, 48)
        assert session.pinned == Pinned(16, 48)
        c.yield_(4)
        seen["front when pinned"] = in_front("Inspector")
        click(c, app, 48, 48)
        assert session.pinned == Pinned(48, 48)
        drag_picture(c, app, 60, 20)
        assert session.pinned == Pinned(48, 48)
        click(c, app, 48, 48)
        assert session.pinned is None
        click(c, app, 16, 48)
        c.key_press(K.escape)
        assert session.pinned is None
        c.key_press(K.f)
        click(c, app, 16, 48)
        assert session.pinned is None
        c.key_press(K.f)
        click(c, app, 16, 48)
        assert session.pinned is not None
        c.key_press(K.tab)  # hides the panels and nothing else
        c.yield_(4)
        assert session.pinned is not None
        c.key_press(K.tab)
        c.yield_(4)
        docking = hello_imgui.get_runner_params().docking_params
        docking.dockable_window_of_name("Inspector").is_visible = False
        c.yield_(3)
        assert session.pinned is None
        click(c, app, 16, 48)
        c.yield_(3)
        assert docking.dockable_window_of_name("Inspector").is_visible
        app.state.open("other.xml")
        c.yield_(3)
        assert session.pinned is None

    drive(app, script)
    assert seen == {"front at start": True, "front when pinned": True}


@pytest.mark.parametrize("typing", [False, True], ids=["over the search field", "which has the keyboard"])
def test_a_click_counts_in_the_frame_of_its_mouse_move(tmp_path, typing):
    """Wherever the mouse comes from: what it was over in the frame before does not hold it."""
    session, field = FakeSession(), "//Settings/**/##filter"
    app = make_app(session, tmp_path)
    app.state.open("scene.xml")

    def script(c):
        if typing:
            c.item_click(field)
            c.key_chars("samples")
            c.yield_(3)
        c.mouse_move(field)
        assert imgui.get_io().want_text_input == typing
        click_at_once(c, place(app, 0.26, 0.76))
        assert session.pinned == Pinned(16, 48)
        assert not imgui.get_io().want_text_input

    drive(app, script)


@pytest.fixture
def app(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with app_on_engine(tmp_path, "cornell_caustic", VALUES) as app:
        yield app


def share(pixels, colour):
    return (np.abs(pixels.astype(int) - np.round(np.array(colour) * 255)).max(axis=-1) <= 2).mean()


def test_the_photons_of_a_pixel_are_drawn_listed_and_followed(app, monkeypatch):
    """Pinned after the last pass: no pass is rendered for it. The disc is drawn; a row's click draws that photon's
    path; Alt+click tells the life of a photon that is drawn. Nothing is computed before and after."""
    calls = []
    report_of = diagnose.pixel_report
    monkeypatch.setattr(diagnose, "pixel_report", lambda *a: calls.append(a) or report_of(*a))
    shares, frames = {}, []

    def script(c):
        wait_until(c, lambda: finished(app))
        c.yield_(4)
        inspector = app.state.inspector
        assert calls == []
        frames.append(app.state.frame)
        shares["disc before"] = share(viewport_pixels(c, app), DISC_COLOUR)
        click(c, app, *FLOOR)
        wait_until(c, lambda: inspector.report is not None)
        assert app.state.frame.planes is frames[0].planes
        assert len(calls) == 1
        c.yield_(4)
        shares["disc"] = share(viewport_pixels(c, app), DISC_COLOUR)
        shares["path before"] = share(viewport_pixels(c, app), CHOSEN_COLOUR)
        inspector.number = 1
        c.yield_(4)
        look_up = inspector.look_up_of(inspector.report)
        assert look_up.map == "global"
        assert look_up.found.n > 5
        nearest = look_up.found.records[0, :3]
        heading = c.item_info("//Inspector/**/###distance")
        c.mouse_move_to_pos(heading.rect_full.get_center())
        c.mouse_click(0)
        c.yield_(3)
        c.mouse_move_to_pos(ImVec2(heading.rect_full.min.x, heading.rect_full.max.y + 8))
        c.mouse_click(0)
        wait_until(c, lambda: inspector.report is not None and inspector.report.life is not None)
        np.testing.assert_array_equal(np.float32(inspector.photon.position), nearest)
        assert inspector.report.life.stored_at > 0
        c.yield_(4)
        shares["path"] = share(viewport_pixels(c, app), CHOSEN_COLOUR)
        app.state.change({"overlays.caustic.show": True})
        c.yield_(4)
        camera = resolve_camera(app.state.session.scene, app.state.settings.camera)
        photons = app.state.frame.clouds["caustic"].photons
        _, off = on_picture(camera, photons[:, :3], 1.0, (0.66, 0.9))
        c.mouse_move_to_pos(place(app, 0.66, 0.9))
        c.key_down(K.mod_alt)
        c.mouse_click(0)
        c.key_up(K.mod_alt)
        wait_until(
            c, lambda: inspector.photon is not None and tuple(inspector.photon.position) != tuple(map(float, nearest))
        )
        chosen = np.flatnonzero((photons[:, :3] == np.float32(inspector.photon.position)).all(axis=1))
        assert len(chosen)
        assert off[chosen[0]] < 0.03
        wait_until(c, lambda: inspector.report is not None and inspector.report.life is not None)
        assert inspector.report.life.note == ""
        before = len(calls)
        c.key_press(K.escape)
        app.state.change({"overlays.caustic.show": False, "render.passes": 4})
        wait_until(c, lambda: finished(app) and app.state.frame.statistics.passes == 4)
        c.yield_(4)
        assert len(calls) == before
        assert app.state.frame.inspection.pixel is None
        shares["disc after"] = share(viewport_pixels(c, app), DISC_COLOUR)

    drive(app, script)
    assert shares["disc"] > 0.0002 > shares["disc before"] == shares["disc after"]
    assert shares["path"] > 0.0002 > shares["path before"]


def test_the_panel_outlives_what_changes_while_it_is_drawn(app, monkeypatch):
    """A pass may come between two of its lines, and its own button lets the pixel go."""
    seen = {}

    def script(c):
        wait_until(c, lambda: finished(app))
        click(c, app, *FLOOR)
        inspector, published = app.state.inspector, app.state.session._published
        wait_until(c, lambda: inspector.report is not None)
        heading = InspectorPanel._heading

        def next_pass_after(panel, report):
            heading(panel, report)
            frame = published.frame
            look_ups = tuple(replace(one) for one in frame.inspection.pixel.look_ups)
            pixel = replace(frame.inspection.pixel, look_ups=look_ups)
            published.frame = replace(frame, inspection=replace(frame.inspection, pixel=pixel))
            seen["frames"] = seen.get("frames", 0) + 1

        monkeypatch.setattr(InspectorPanel, "_heading", next_pass_after)
        c.yield_(5)
        monkeypatch.setattr(InspectorPanel, "_heading", heading)
        c.yield_(2)
        c.item_click("//Inspector/Unpin")
        c.yield_(2)
        assert inspector.pinned is None

    drive(app, script)
    assert seen["frames"] >= 5


def test_it_stays_on_its_pixel_while_passes_go_on(app):
    histories = []

    def script(c):
        app.state.change({"render.passes": 100_000})
        wait_until(c, lambda: app.state.frame is not None and not app.state.frame.coarse)
        click(c, app, *FLOOR)
        wait_until(c, lambda: app.state.inspector.report is not None)
        pinned = app.state.inspector.pinned
        wait_until(c, lambda: app.state.inspector.report and len(app.state.inspector.report.history.passes) > 3)
        report = app.state.inspector.report
        histories.append(report.history)
        assert (report.of.x, report.of.y) == pinned == FLOOR
        assert report.index == app.state.frame.statistics.passes - 1
        assert report.terms.sum(axis=0) == pytest.approx(app.state.frame.beauty[FLOOR[1], FLOOR[0]], rel=1e-5)

    drive(app, script)
    assert (np.diff(histories[0].passes) == 1).all()
    assert np.isfinite(histories[0].error[-1])


def test_the_disc_lies_around_its_place():
    n = np.array([2.0, -1.0, 2.0]) / 3
    lines = disc_lines(np.array([1.0, 2.0, 3.0]), n, 0.5)
    rim = lines[:-2] - [1.0, 2.0, 3.0]
    assert np.linalg.norm(rim, axis=1) == pytest.approx(0.5)
    assert rim @ n == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(rim[1::2][:-1], rim[2::2])


def test_directions_are_seen_along_the_normal():
    """The normal is the middle, grazing directions are the rim, and the viewer's side is on the left."""
    n, wo = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.0, 0.8])
    wi = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0], [0.6, 0, 0.8]])
    places = on_hemisphere(wi, n, wo)
    np.testing.assert_allclose(places, [[0, 0], [-1, 0], [0, -1], [-0.6, 0]], atol=1e-12)
    assert np.linalg.norm(on_hemisphere(wi, n, n), axis=1) == pytest.approx([0, 1, 1, 0.6])


def test_tables_sort_and_choose_units():
    values = np.array([2.0, 1.0, 2.0, 3.0])
    assert list(ordered(values, False)) == [1, 0, 2, 3]
    assert list(ordered(values, True)) == [3, 0, 2, 1]
    assert [unit_of(x) for x in (2.0, 0.5, 2.5e-5, 3e-9, 1e-13)] == [
        (1.0, ""),
        (1e-3, "m"),
        (1e-6, "µ"),
        (1e-9, "n"),
        (1e-12, "p"),
    ]


def test_photons_are_picked_where_they_are_drawn():
    """The projection of the picker against the ray of the pixel, for both kinds of cameras and off the axis."""
    session = FakeSession()
    session.open("scene.xml")
    camera = session.frame.camera
    wide = replace(camera, projection="orthographic", view_width=2.0)
    for pose in (camera, wide, replace(camera, shift=(0.2, -0.1))):
        for u, v in ((0.5, 0.5), (0.1, 0.8)):
            o, d = pose.rays(np.array([u * pose.width]), np.array([v * pose.height]))
            points = np.concatenate([o + 3.0 * d, o + 5.0 * d])
            depth, off = on_picture(pose, points, 1.75, (u, v))
            assert 0 < depth[0] < depth[1]
            assert off == pytest.approx(0.0, abs=1e-6)
    behind, _ = on_picture(camera, np.array([camera.origin]) - 1.0 * camera.axes()[2], 1.75, (0.5, 0.5))
    assert not behind[0] > 0
    assert PhotonAt(0, 1, (1.0, 2.0, 3.0)) == PhotonAt(0, 1, (1.0, 2.0, 3.0))
