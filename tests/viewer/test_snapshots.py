"""Snapshots and compared pictures in the window: by keys and clicks, pixel for pixel, kept in the session file."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui
from imgui_bundle import icons_fontawesome_6 as fa

from pmviewer.output.colour_maps import SEQUENTIAL, TWO_SIDED
from pmviewer.output.exr import write_exr
from pmviewer.output.falsecolour import Scale, false_colour
from pmviewer.output.png import read_png, write_png
from pmviewer.output.session_file import read_session, write_session
from pmviewer.output.tone import to_uint8, tone_map
from pmviewer.render.planes import PLANES
from pmviewer.settings.access import Settings, changed_stages, with_values
from pmviewer.viewer import snapshots as strip
from pmviewer.viewer.panels.snapshots.table import figure_rows, setting_rows
from pmviewer.viewer.sides import frame_side, same_camera
from tests.viewer.driver import chord, click_at_once, drag_picture, drive, on_window_thread, viewport_pixels
from tests.viewer.fake_session import SIZE, FakeSession

K = imgui.Key


class StillSession(FakeSession):
    """What is shown changes no picture; anything else gives another frame of the same one."""

    def set(self, settings: Settings) -> None:
        self.sets.append(settings)
        before, self.settings = self.settings, settings
        if self.scene is not None and changed_stages(before, settings) - {"display"}:
            self.publish(self.frame.planes)


@pytest.fixture
def session() -> FakeSession:
    fake = StillSession()
    fake.open("box")
    return fake


def brighter(session, factor):
    planes = session.frame.planes.copy()
    planes[..., PLANES["direct"]] *= factor
    return planes


def shown(frame):
    return to_uint8(tone_map(frame.image("beauty"), 0.0, "sRGB")).astype(int)


def wait(context, condition):
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end, "it takes too long"
        context.yield_(1)
        time.sleep(0.005)


def captured(context, app):
    return on_window_thread(context, lambda: app.viewport.capture(overlays=False)).astype(int)


def settle(context, app):
    context.yield_(3)
    wait(context, lambda: not app.state.background.running())
    context.yield_(4)


def test_keys_take_compare_and_flip(app, session):
    seen, first = {}, session.frame

    def script(c):
        c.key_press(K.s)
        c.yield_(2)
        session.publish(brighter(session, 0.5))
        c.yield_(3)
        seen["live"] = captured(c, app)
        c.key_press(K.x)
        c.yield_(4)
        assert session.settings.compare.mode == "wipe"
        seen["wipe"] = captured(c, app)
        c.key_press(K.y)
        c.yield_(4)
        assert session.settings.compare.mode == "flip"
        seen["flip B"] = captured(c, app)
        c.key_press(K.y)
        c.yield_(4)
        seen["flip A"] = captured(c, app)
        app.state.change({"compare.mode": "side by side"})
        c.yield_(4)
        seen["beside"] = captured(c, app)
        c.key_press(chord(K.y, K.mod_shift))
        c.yield_(4)
        assert (session.settings.compare.a, session.settings.compare.b) == ("last", "live")
        seen["swapped"] = captured(c, app)
        before = session.settings
        c.key_press(chord(K.z, K.mod_ctrl))
        c.yield_(3)
        assert session.settings.compare.a == "live", "swapping is undone"
        c.key_press(chord(K.y, K.mod_ctrl))
        c.yield_(3)
        assert session.settings == before

    drive(app, script)
    half, live, kept = SIZE // 2, shown(session.frame), shown(first)
    assert np.abs(live - kept).max() > 30
    assert np.abs(seen["live"] - live).max() <= 1
    assert np.abs(seen["wipe"][:, :half] - live[:, :half]).max() <= 1
    assert np.abs(seen["wipe"][:, half:] - kept[:, half:]).max() <= 1
    assert np.abs(seen["flip B"] - kept).max() <= 1
    assert np.abs(seen["flip A"] - live).max() <= 1
    assert np.abs(seen["beside"] - np.concatenate([live, kept], axis=1)).max() <= 1
    assert np.abs(seen["swapped"] - np.concatenate([kept, live], axis=1)).max() <= 1


def test_differences_are_shown_in_the_colours_of_their_legend(app, session):
    seen, first = {}, session.frame

    def script(c):
        app.state.take_snapshot()
        session.publish(brighter(session, 1.25))
        app.state.change({"compare.mode": "difference", "compare.difference": "absolute"})
        for kind in ("absolute", "signed"):
            app.state.change({"compare.difference": kind, "display.range": "by hand", "display.low": -0.25,
                              "display.high": 0.25})  # fmt: skip
            settle(c, app)
            seen[kind] = captured(c, app), app.state.pair.difference.mean
        c.key_press(chord(K.x, K.mod_shift))
        c.yield_(2)
        assert session.settings.compare.difference == "absolute"
        app.state.change({"display.range": "percentiles", "display.percentile": 0.0, "display.colours": "fire"})
        settle(c, app)
        seen["fire"] = captured(c, app), app.viewport.picture.planes.shown.scale

    drive(app, script)
    a, b = session.frame.image("beauty").astype(np.float64), first.image("beauty").astype(np.float64)
    expected = {
        "absolute": (np.abs(a - b).mean(axis=2), SEQUENTIAL["violet-yellow"]),
        "signed": ((a - b) @ (0.2126, 0.7152, 0.0722), TWO_SIDED["blue-orange"]),
    }
    for kind, (values, table) in expected.items():
        pixels, mean = seen[kind]
        off = np.abs(pixels - to_uint8(false_colour(values, Scale(-0.25, 0.25), table)))
        assert off.max() <= 8, "one step of the colour table where rounding differs"
        assert (off <= 1).mean() > 0.95
        assert mean == pytest.approx(values.mean(), rel=1e-4)
    pixels, scale = seen["fire"]
    values = expected["absolute"][0]
    assert (scale.lower, scale.upper) == pytest.approx((values.min(), values.max()), rel=1e-4)
    off = np.abs(pixels - to_uint8(false_colour(values, scale, SEQUENTIAL["fire"])))
    assert (off <= 4).mean() > 0.95


def test_a_line_is_dragged_and_zoom_is_one_for_both(app, session):
    def script(c):
        app.state.take_snapshot()
        session.publish(brighter(session, 0.5))
        app.state.change({"compare.mode": "wipe"})
        c.yield_(4)
        x, (ox, oy), (_, height) = app.viewport.split_x(), app.viewport.origin, app.viewport.size
        c.mouse_move_to_pos(ImVec2(ox + x, oy + height / 2))
        c.mouse_down(0)
        c.mouse_move_to_pos(ImVec2(ox + x + 60, oy + height / 2))
        c.mouse_up(0)
        c.yield_(3)
        assert session.settings.compare.split == pytest.approx(0.5 + 60 / app.viewport.rectangle()[2], abs=0.02)
        assert app.state.snapshots.all[0].size == (SIZE, SIZE)
        assert app.viewport.side_at((1, 1)).name == "live"
        assert app.viewport.side_at((SIZE - 1, 1)).name == app.state.snapshots.all[0].name
        app.state.change({"compare.mode": "side by side"})
        c.yield_(3)
        (ox, oy), (width, height) = app.viewport.origin, app.viewport.size
        for pane in (0, 1):
            c.mouse_move_to_pos(ImVec2(ox + (0.25 + 0.5 * pane) * width, oy + height / 2))
            c.yield_(2)
            assert app.viewport.pixel_under_mouse() == pytest.approx((SIZE / 2, SIZE / 2), abs=1)
            assert app.viewport.pane_under_mouse() == pane
        camera = session.settings.camera
        drag_picture(c, app, 40, 20)
        assert session.settings.camera != camera, "the live camera moves while pictures are compared"
        pair = app.state.shown_pair()
        assert not same_camera(*pair.sides)
        assert "different cameras" in pair.caution

    drive(app, script)


def test_the_strip_is_clicked_renamed_and_its_settings_taken(app, session):
    def script(c):
        app.state.change({"photons.N": 77_000})
        app.state.take_snapshot()
        app.state.change({"photons.N": 99_000, "estimate.alpha": 0.9})
        app.state.take_snapshot()
        c.window_focus("//Snapshots")
        c.yield_(4)
        first, _ = app.state.snapshots.all
        assert "77,000" in first.name
        c.item_click(f"//Snapshots/**/##snapshot{first.number}")
        c.yield_(3)
        assert (session.settings.compare.mode, session.settings.compare.b) == ("wipe", str(first.number))
        a, b = app.state.pair.sides(session.settings, session.frame)
        assert {row.name: (row.a, row.b) for row in setting_rows(a, b)} == {
            "photons.N": ("99,000 photons", "77,000 photons"),
            "estimate.alpha": ("0.9", "0.6667"),
        }
        figures = {row.name: row for row in figure_rows(a, b, (0.5, 0.25))}
        assert (figures["relMSE"].a, figures["relMSE"].b, figures["relMSE"].ratio) == ("5.000e-01", "2.500e-01", "2")
        passes = session.frame.statistics.passes
        assert figures["Passes"].a == str(passes)
        c.mouse_move(f"//Snapshots/**/##snapshot{first.number}")
        c.mouse_click(1)
        c.yield_(2)
        c.item_click("//$FOCUSED/Take its settings")
        c.yield_(3)
        assert (session.settings.photons.N, session.settings.estimate.alpha) == (77_000, pytest.approx(2 / 3, abs=1e-3))
        app.state.undo()
        assert session.settings.photons.N == 99_000
        app.state.snapshots.rename(first, "  few   photons ")
        assert app.state.snapshots.all[0].name == "few photons"
        app.state.snapshots.remove(app.state.snapshots.all[0])
        c.yield_(3)
        assert app.state.shown_pair() is None
        assert "no snapshot '1'" in app.state.pair.problem(session.settings, session.frame)

    drive(app, script)


def test_files_become_snapshots_and_sessions_keep_them(app, session, tmp_path):
    truth = session.frame.image("beauty") * 0.5
    write_exr(tmp_path / "half.exr", {"": truth})
    write_png(tmp_path / "shown.png", tone_map(truth, 0.0, "sRGB"))
    write_exr(tmp_path / "small.exr", {"": truth[:8]})

    def script(c):
        app.drop([str(tmp_path / name) for name in ("half.exr", "shown.png", "small.exr")])
        wait(c, lambda: len(app.state.snapshots.all) == 3)
        assert [one.name for one in app.state.snapshots.all] == ["half", "shown", "small"]
        app.state.change({"compare.mode": "difference", "compare.b": "3"})
        settle(c, app)
        assert "64×64 and 64×8" in app.state.shown_pair().refusal
        app.state.change({"compare.b": "2"})
        settle(c, app)
        assert "display values" in app.state.shown_pair().caution
        app.state.change({"compare.b": "1", "compare.difference": "relMSE"})
        settle(c, app)
        app.commands.exports.session(tmp_path / "kept.toml")
        wait(c, lambda: (tmp_path / "kept.toml").exists() and not app.state.background.running())
        app.state.snapshots.clear()
        app.state.change({"compare.mode": "off"})
        app.state.open(tmp_path / "kept.toml")
        wait(c, lambda: len(app.state.snapshots.all) == 3)
        assert session.settings.compare.mode == "difference"
        settle(c, app)
        assert app.state.shown_pair().b.name == "half"
        on_window_thread(c, lambda: app.commands.exports.png(tmp_path / "difference.png", overlays=False))
        wait(c, lambda: (tmp_path / "difference.png").exists() and not app.state.background.running())
        app.drop([str(tmp_path / "broken.png")])
        wait(c, lambda: any("broken.png" in m.text for m in app.state.log))

    drive(app, script)
    assert [number for number, _ in read_session(tmp_path / "kept.toml").snapshots] == [1, 2, 3]
    values = ((session.frame.image() - truth) ** 2 / (truth.astype(float) ** 2 + 0.01)).mean(axis=2)
    pixels = read_png(tmp_path / "difference.png")[0].astype(int)
    assert (np.abs(pixels - to_uint8(false_colour(values, Scale(1e-5, 1.0, log=True)))) <= 8).all()


def test_there_is_a_most(app, session, monkeypatch):
    monkeypatch.setattr(strip, "MOST", 2)

    def script(c):
        for _ in range(3):
            app.state.take_snapshot()
        assert len(app.state.snapshots.all) == 2
        c.yield_(2)
        assert any("no room for another snapshot" in m.text for m in app.state.log)
        monkeypatch.setattr(strip, "MOST", 24)
        monkeypatch.setattr(strip, "MOST_BYTES", 3 * app.state.snapshots.all[0].bytes - 1)
        app.state.take_snapshot()
        assert len(app.state.snapshots.all) == 2
        session.publish(coarse=True)
        monkeypatch.undo()
        app.state.take_snapshot()
        assert len(app.state.snapshots.all) == 2, "a coarse picture is no result"

    drive(app, script)


def test_marks_are_drawn_and_counted(app, session):
    seen, planes = {}, np.zeros_like(session.frame.planes)
    planes[..., PLANES["direct"]] = 0.5
    planes[:4, :, 0], planes[4:8, :, 0], planes[8:24, :, :3] = np.nan, -0.9, 3.0
    session.publish(planes)

    def script(c):
        seen["plain"] = viewport_pixels(c, app)
        c.key_press(chord(K.n, K.mod_shift))
        c.yield_(4)
        assert session.settings.display.marks
        seen["marked"] = captured(c, app)
        seen["count"] = app.viewport.picture.planes.marks
        app.state.change({"display.tone": "Reinhard"})
        c.yield_(4)
        seen["Reinhard"] = app.viewport.picture.planes.marks

    drive(app, script)
    marked, count = seen["marked"], seen["count"]
    assert (marked[:4] == (255, 0, 255)).all()
    assert (marked[4:8] == (0, 255, 255)).all()
    white = (marked[8:24] == 255).all(axis=2)
    assert 0.4 < white.mean() < 0.6, "stripes"
    assert (marked[24:] == marked[40, 3]).all()
    assert (count.broken, count.negative, count.clipped) == (4 * SIZE, 4 * SIZE, 16 * SIZE)
    assert seen["Reinhard"].clipped == 0


def test_the_button_at_the_legend_sets_the_range(app, session, tmp_path):
    write_exr(tmp_path / "truth.exr", {"": session.frame.image("beauty") * 0.8})

    def script(c):
        app.drop([str(tmp_path / "truth.exr")])
        wait(c, lambda: app.state.comparison.reference is not None)
        app.state.change({"display.view": "error"})
        settle(c, app)
        shown = app.viewport.picture.planes.shown
        assert (shown.scale.lower, shown.scale.upper, shown.scale.log) == (1e-5, 1.0, True)
        assert shown.histogram.total == SIZE * SIZE
        camera = session.settings.camera
        button = f"//Viewport/**/{fa.ICON_FA_SLIDERS}##false.colours"
        click_at_once(c, c.item_info(button).rect_full.get_center())
        assert session.pinned is None, "the button is not the picture, even at once"
        c.item_click("//$FOCUSED/##display.range")
        c.yield_(2)
        c.item_click("//$FOCUSED/by hand")
        c.yield_(3)
        display = session.settings.display
        assert (display.range, display.low, display.high) == ("by hand", 1e-5, 1.0), "begins with what is shown"
        assert session.settings.camera == camera, "the button is not the picture"

    drive(app, script)


def test_a_number_more_or_less_is_another_camera(session):
    side = frame_side(session.frame, "live")
    moved = replace(side, about={**side.about, "view.origin": "0.0 0.0 4.01"})
    rounded = replace(side, about={**side.about, "view.origin": "0.0 0.0 4.0000001"})
    assert same_camera(side, rounded)
    assert not same_camera(side, moved)
    assert same_camera(side, replace(side, about={}))


def test_the_session_file_of_a_window_without_snapshots_is_as_before(tmp_path):
    write_session(tmp_path / "plain.toml", with_values(Settings(), {"photons.N": 5000}), "cornell_diffuse", 1)
    assert "snapshots" not in (tmp_path / "plain.toml").read_text("utf-8")
    assert not (tmp_path / "plain.snapshots").exists()
