"""The window, driven with the mouse and the keyboard."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui

from pmviewer.output.exr import read_exr
from pmviewer.output.png import read_png
from pmviewer.output.session_file import read_session
from pmviewer.output.tone import to_uint8, tone_map
from pmviewer.settings.access import SETTINGS, Settings, get, with_values
from tests.viewer.driver import (
    chord,
    drag,
    drag_picture,
    drive,
    item,
    make_app,
    on_window_thread,
    overlay_item,
    viewport_pixels,
)
from tests.viewer.fake_session import SIZE

K = imgui.Key


def test_opens_on_a_scene_and_shows_its_frame(app, session):
    """The framebuffer holds the tone-mapped frame, pixel by pixel where a pixel is a square."""
    seen = {}

    def script(c):
        seen["pixels"] = viewport_pixels(c, app)

    drive(app, script)
    expected = to_uint8(tone_map(session.frame.image("beauty"), 0.0, "sRGB"))
    pixels = seen["pixels"]
    rows = (np.arange(SIZE) + 0.5) * pixels.shape[0] / SIZE
    columns = (np.arange(SIZE) + 0.5) * pixels.shape[1] / SIZE
    got = pixels[np.ix_(rows.astype(int), columns.astype(int))]
    assert np.abs(got.astype(int) - expected).max() <= 1


def test_dragging_n_sends_the_new_value_and_reset_brings_the_default_back(app, session):
    def script(c):
        drag(c, item("photons.N"), 0.5, 0.85)
        assert session.settings.photons.N > 1_000_000
        c.item_click("//Settings/**/\uf0e2##reset.photons.N")
        c.yield_(2)
        assert session.settings.photons.N == Settings().photons.N

    drive(app, script)
    sent = [s.photons.N for s in session.sets]
    assert len(set(sent)) > 2, "the value follows the mouse"


def test_exact_values_are_typed_after_a_double_click(app, session):
    def script(c):
        c.item_double_click(item("photons.q"))
        c.yield_(3)
        c.key_chars_replace_enter("0.125")
        c.yield_(2)
        assert session.settings.photons.q == 0.125
        c.item_double_click(item("photons.N"))
        c.yield_(3)
        c.key_chars_replace_enter("3e5")
        c.yield_(2)
        assert session.settings.photons.N == 300_000
        assert session.settings.photons.q == 0.125
        c.item_double_click(item("estimate.radius"))
        c.yield_(3)
        assert session.settings.estimate.radius == "auto", "clicking to type changes nothing"
        c.key_chars_replace_enter("0.02")
        c.yield_(2)
        assert session.settings.estimate.radius == 0.02
        c.item_double_click(item("photons.N"))
        c.yield_(3)
        c.key_chars_replace_enter("12,345")
        c.yield_(2)
        assert session.settings.photons.N == 12_345

    drive(app, script)


def test_a_refused_value_is_reported_and_changes_nothing(app, session):
    def script(c):
        c.item_double_click(item("photons.N"))
        c.yield_(3)
        c.key_chars_replace_enter("0")
        c.yield_(2)

    drive(app, script)
    assert session.settings.photons.N == Settings().photons.N
    errors = [m.text for m in app.state.log if m.level == "error"]
    assert len(errors) == 1
    assert errors[0].startswith("photons.N = 0 is not allowed: expected a whole number from 1 to ")


def test_dragging_an_automatic_radius_fixes_it_and_auto_returns(app, session):
    def script(c):
        drag(c, item("estimate.radius"), 0.5, 0.7)
        assert isinstance(session.settings.estimate.radius, float)
        c.item_click("//Settings/**/\ue2ca##auto.estimate.radius")
        c.yield_(2)
        assert session.settings.estimate.radius == "auto"

    drive(app, script)


def test_reset_all_restores_every_default(app, session):
    session.settings = with_values(session.settings, {"photons.N": 1000, "render.max_depth": 3, "direct.mis": False})

    def script(c):
        c.item_click("//Settings/**/\uf0e2##reset.all")
        c.yield_(2)
        assert session.settings != Settings(), "it asks"
        c.item_click("//$FOCUSED/Cancel")
        c.yield_(2)
        assert session.settings != Settings()
        c.item_click("//Settings/**/\uf0e2##reset.all")
        c.yield_(2)
        c.item_click("//$FOCUSED/Reset all")
        c.yield_(2)

    drive(app, script)
    assert session.settings == Settings()


def test_ticking_an_overlay_draws_its_photons(app, session):
    """The wall's pattern of red points appears where the wall isn't hidden, and only there while depth is tested."""
    seen = {}

    def script(c):
        seen["before"] = viewport_pixels(c, app)
        c.item_click(overlay_item("caustic photons##overlays.caustic.show"))
        c.yield_(3)
        assert session.settings.overlays.caustic.show
        seen["points"] = viewport_pixels(c, app)
        c.item_click(overlay_item("##overlays.caustic.depth"))
        c.yield_(3)
        seen["all"] = viewport_pixels(c, app)

    drive(app, script)
    red = np.array([255, 89, 89])  # (1, 0.1, 0.1) with gamma 2.2

    def reds(pixels):
        return np.all(np.abs(pixels.astype(int) - red) <= 3, axis=-1)

    side = seen["before"].shape[0]
    assert not reds(seen["before"]).any()
    hidden = np.s_[: side * 3 // 4, int(side * 0.36) : int(side * 0.44)]
    assert reds(seen["points"]).sum() > 1000
    assert not reds(seen["points"])[hidden].any()
    assert reds(seen["all"])[hidden].sum() > 500


def test_points_lie_on_the_picture_to_the_pixel(app, session):
    """A point's pixel is the one that the camera projects its position to."""
    seen = {}

    def script(c):
        c.key_press(K.c)
        c.yield_(3)
        seen["pixels"] = viewport_pixels(c, app)

    drive(app, script)
    frame = session.frame
    positions = frame.clouds["caustic"].photons[:, :3]
    visible = positions[positions[:, 0] > 0.2]
    size = seen["pixels"].shape[0]
    projected = frame.camera.project(visible)[:, :2] * size / SIZE
    x, y = projected.astype(int).T
    around = [
        seen["pixels"][np.clip(y + dy, 0, size - 1), np.clip(x + dx, 0, size - 1)] for dx in (0, -1) for dy in (0, -1)
    ]
    hits = np.any([np.all(np.abs(p.astype(int) - (255, 89, 89)) <= 3, axis=-1) for p in around], axis=0)
    assert hits.mean() > 0.99


def test_number_keys_switch_the_view(app, session):
    seen = {}

    def script(c):
        for key, view in ((K._8, "normal"), (K._7, "albedo"), (K._9, "depth"), (K._0, "geometry"), (K._3, "direct")):
            c.key_press(key)
            c.yield_(3)
            assert session.settings.display.view == view
            seen[view] = viewport_pixels(c, app)

    drive(app, script)
    middle = {view: pixels[len(pixels) // 2, len(pixels) // 2].astype(int) for view, pixels in seen.items()}
    np.testing.assert_allclose(middle["normal"], (128, 128, 255), atol=1)
    np.testing.assert_allclose(
        middle["albedo"], to_uint8(tone_map(np.full((1, 1, 3), (0.7, 0.4, 0.2)), 0, "sRGB"))[0, 0], atol=1
    )
    depth = seen["depth"][:, 10, 0].astype(int)
    assert depth[2] > 250
    assert depth[-2] < 30
    assert np.all(np.diff(depth) <= 0), "far is darker"
    assert middle["geometry"][0] > middle["geometry"][1], "the red wall, shaded"


@pytest.mark.parametrize("curve", SETTINGS["display.tone"].choices)
def test_tone_curves_on_the_graphics_card_equal_the_exporters(app, session, curve):
    session.settings = with_values(session.settings, {"display.tone": curve, "display.exposure": 1.5})
    planes = session.frame.planes.copy()
    planes[..., :3] = np.geomspace(1e-4, 40, SIZE * SIZE * 3).reshape(SIZE, SIZE, 3)
    planes[0, 0, 0] = np.nan
    session.publish(planes)
    seen = {}

    def script(c):
        seen["pixels"] = on_window_thread(c, lambda: app.viewport.capture(overlays=False))

    drive(app, script)
    expected = to_uint8(tone_map(session.frame.image("beauty"), 1.5, curve))
    expected[0, 0] = (255, 0, 255)
    assert np.abs(seen["pixels"].astype(int) - expected).max() <= 1


def test_exposure_and_toolbar(app, session):
    def script(c):
        c.key_press(K.e)
        c.key_press(chord(K.e, K.mod_shift))
        c.key_press(chord(K.e, K.mod_shift))
        c.yield_(2)
        assert session.settings.display.exposure == -0.5
        c.key_press(K.space)
        c.yield_(2)
        assert session.paused
        c.key_press(K.r)
        c.yield_(2)
        assert session.restarts == 1
        c.key_press(K.h)
        c.yield_(3)
        assert c.window_info("//Keys and mouse").window is not None
        c.key_press(K.escape)
        c.yield_(2)
        assert not app.state.help_open

    drive(app, script)


def test_camera_moves_with_the_mouse_and_keys(app, session):
    def script(c):
        drag_picture(c, app, 60, 0)
        orbited = session.settings.camera
        assert orbited.origin != "auto"
        assert np.linalg.norm(np.subtract(orbited.origin, orbited.target)) == pytest.approx(5.0, rel=1e-5)
        assert orbited.origin[0] < -0.3, "the scene follows the mouse to the right"
        drag_picture(c, app, 0, 40, button=2)
        panned = session.settings.camera
        assert panned.target[1] > 0.1
        x, y = app.viewport.origin
        w, h = app.viewport.size
        c.mouse_move_to_pos(ImVec2(x + w / 2, y + h / 2))  # on the back wall
        before = app.state.live_camera()
        c.mouse_wheel_y(3)
        c.yield_(2)
        zoomed = session.settings.camera
        depth = app.viewport.surroundings.under(before, (SIZE / 2, SIZE / 2)) - before.origin
        travelled = np.linalg.norm(np.subtract(zoomed.origin, before.origin))
        assert travelled / (depth @ before.axes()[2]) == pytest.approx(1 - 0.9**3, rel=1e-3)
        c.key_press(K.home)
        c.yield_(2)
        np.testing.assert_allclose(session.settings.camera.target, (0, 0, 0), atol=1e-6)
        c.key_press(K.backspace)
        c.yield_(2)
        assert session.settings.camera == Settings().camera
        c.key_press(K.f)
        c.key_hold(K.w, 0.3)
        c.yield_(2)
        assert session.settings.camera.origin[2] < 4.0
        c.key_press(K.f)
        c.yield_(2)
        assert not app.state.flying

    drive(app, script)
    assert session.frame.camera.origin == session.settings.camera.origin, "the picture follows"


def test_exports_png_exr_and_session(app, session, tmp_path):
    """Through the file dialog's answer, and without one for screenshots."""

    def script(c):
        app.dialogs.save = lambda title, default, chosen: chosen(default)
        c.key_press(chord(chord(K.e, K.mod_ctrl), K.mod_shift))
        c.key_press(chord(K.e, K.mod_ctrl))
        c.key_press(chord(K.s, K.mod_ctrl))
        c.yield_(2)
        c.key_press(K.c)
        c.yield_(2)
        c.key_press(chord(K.f12, K.mod_ctrl))
        c.key_press(K.f12)
        c.yield_(3)

    first = session.frame
    drive(app, script)
    logged = [m.text for m in app.state.log]
    assert not [m for m in app.state.log if m.level == "error"]
    for name in ("box-beauty-1.png", "box-layers-1.exr", "box-1.toml"):
        assert f"wrote {tmp_path / name}" in logged
    pixels, _ = read_png(tmp_path / "box-beauty-1.png")
    np.testing.assert_array_equal(pixels, to_uint8(tone_map(first.image("beauty"), 0.0, "sRGB")))
    layers, metadata = read_exr(tmp_path / "box-layers-1.exr")
    np.testing.assert_array_equal(layers["direct"], first.image("direct"))
    assert metadata["photons.N"] == Settings().photons.N
    saved = read_session(tmp_path / "box-1.toml")
    assert saved.settings == Settings()
    with_points, _ = read_png(tmp_path / "box-beauty-2.png")
    assert with_points.shape == (SIZE, SIZE, 3)
    assert np.any(np.all(np.abs(with_points.astype(int) - (255, 89, 89)) <= 3, axis=-1))
    window, _ = read_png(tmp_path / "box-window-2.png")
    assert window.shape == (700, 1120, 3)
    assert len(np.unique(window.reshape(-1, 3), axis=0)) > 200, "not an empty window"


def test_an_export_that_fails_is_one_error(app, session, tmp_path):
    def script(c):
        app.commands.exports.exr(tmp_path / "missing folder" / "picture.exr")
        c.yield_(3)

    drive(app, script)
    errors = [m.text for m in app.state.log if m.level == "error"]
    assert len(errors) == 1
    assert "missing folder" in errors[0]
    assert "Traceback" not in errors[0]


def test_a_broken_file_keeps_the_old_scene_and_shows_one_error(app, session):
    scene, frame = session.scene, session.frame

    def script(c):
        app.drop(["/somewhere/broken.xml"])
        c.yield_(3)
        assert len(app.state.toasts) == 1
        assert c.window_info("//##toast0").window is not None
        c.item_click("//##toast0/\uf00d##dismiss")
        c.yield_(2)
        assert app.state.toasts == []

    drive(app, script)
    assert session.opened[-1] == "/somewhere/broken.xml"
    assert session.scene is scene
    assert session.frame is frame
    assert [m.text for m in app.state.log if m.level == "error"] == [
        "/somewhere/broken.xml:3: unknown shape 'blob'. Use sphere, cube or obj."
    ]
    assert app.state.recent.entries == []


def test_a_dropped_scene_opens_with_its_own_camera_and_is_remembered(app, session, tmp_path):
    session.settings = with_values(session.settings, {"camera.fov": 60.0, "photons.N": 5000})
    path = tmp_path / "other.xml"
    path.write_text("<scene/>")

    def script(c):
        app.drop([str(path)])
        c.yield_(3)

    drive(app, script)
    assert session.scene.name == "other"
    assert session.settings.camera.fov == "auto"
    assert session.settings.photons.N == 5000
    assert app.state.recent.entries == [str(path)]


@pytest.mark.parametrize("still", ["opened", "loading", "refused"])
def test_what_was_opened_just_before_the_window_closes_is_remembered_unless_it_was_refused(app, session, still):
    def script(c):
        if still == "opened":
            app.state.open("box2")
        else:
            app.state._opening = "box2", {}  # a session that has not got there, or has refused it
            session.loading = "reading box2" if still == "loading" else ""

    drive(app, script)
    assert app.state.recent.entries == ([] if still == "refused" else ["box2"])


def test_a_broken_session_file_is_one_error(app, session, tmp_path):
    path = tmp_path / "broken-session.toml"
    path.write_text("format = ")
    opened = list(session.opened)

    def script(c):
        app.drop([str(path)])
        c.yield_(2)

    drive(app, script)
    assert session.opened == opened
    assert len([m for m in app.state.log if m.level == "error"]) == 1


def test_an_idle_window_draws_nothing_new(app, session):
    seen = {}

    def script(c):
        before = app.viewport.redraws
        c.yield_(20)
        seen["idle"] = app.viewport.redraws - before
        session.publish()
        c.yield_(3)
        seen["frame"] = app.viewport.redraws - before

    drive(app, script)
    assert seen == {"idle": 0, "frame": 1}


def test_tab_hides_the_panels_and_brings_them_back(app, session):
    def script(c):
        width = app.viewport.size[0]
        c.key_press(K.tab)
        c.yield_(4)
        assert app.viewport.size[0] > width + 300
        c.key_press(K.tab)
        c.yield_(4)
        assert app.viewport.size[0] == pytest.approx(width, abs=2)

    drive(app, script)


def test_every_setting_has_a_widget_that_keeps_its_value(app, session):
    """Drawing all of them changes none."""

    def script(c):
        for path in SETTINGS:
            # The test engine doesn't find combo boxes and groups of fields by name.
            if not path.startswith("overlays.") and SETTINGS[path].scale not in ("choice", "name", "vector", "edits"):
                app.settings_panel.find = path
                c.yield_(2)
                assert c.item_info(item(path)).id_ != 0, path

    drive(app, script)
    assert session.sets == []


def test_a_setting_without_effect_is_explained(session, tmp_path):
    asked = []

    def reason(path, settings, traits):
        asked.append(path)
        return "the method does not gather" if path == "gather.rays" else None

    app = make_app(session, tmp_path, inactive_reason=reason)

    def script(c):
        c.item_open("//Settings/**/###Final gather")
        c.mouse_move(item("gather.rays"))
        c.sleep_no_skip(0.6, 0.05)
        c.yield_(3)

    drive(app, script)
    assert "gather.rays" in asked
    assert get(session.settings, "gather.rays") == 4


def test_files_on_the_recent_list_that_are_gone_are_taken_off(app, session, tmp_path):
    gone = tmp_path / "gone.xml"
    app.state.recent.entries = [str(gone)]
    assert app.state.recent.is_missing(str(gone))
    assert not app.state.recent.is_missing("cornell_caustic")
    Path(tmp_path / "recent.txt").write_bytes(b"\xff\xfe broken")
    from pmviewer.viewer.dialogs.recent import RecentFiles

    assert RecentFiles(tmp_path / "recent.txt").entries == []


def test_compiling_ahead_is_told_and_can_be_stopped_or_turned_off(app, session):
    """What is being compiled stands in the status bar, with a button that ends it; the menu turns it off."""
    session.ahead = "estimate.lookup = nearest (3 of 20)"

    def script(c):
        c.yield_(2)
        c.item_click("//**/Stop##ahead")
        c.yield_(2)
        assert session.stops_ahead == 1
        assert not c.item_exists("//**/Stop##ahead")
        c.menu_click("//##MainMenuBar/Render/Compile ahead")
        c.yield_(2)

    drive(app, script)
    assert session.settings.display.compile_ahead is False
