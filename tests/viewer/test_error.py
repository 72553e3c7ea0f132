"""Comparing with a reference in the window: loading, the curve, the views, and references that don't fit."""

from __future__ import annotations

import time

import numpy as np
import pytest
from imgui_bundle import imgui

from pmviewer.output.exr import write_exr
from pmviewer.output.falsecolour import ERROR_SCALE, false_colour
from pmviewer.output.metric import relmse, squared_error
from pmviewer.output.tone import to_uint8, tone_map
from pmviewer.render.planes import PLANES
from pmviewer.settings.access import with_values
from pmviewer.viewer.comparison import EARLIER_RUNS, next_mark, run_of
from pmviewer.viewer.panels.error_panel import log_limits
from pmviewer.viewer.sides import snapshot_side
from tests.viewer.driver import chord, drive, on_window_thread, viewport_pixels
from tests.viewer.fake_session import SIZE

K = imgui.Key


@pytest.fixture
def truth(session, tmp_path):
    """The picture that the session's frames come closer to, also as a file."""
    image = session.frame.image("beauty") * 0.8
    write_exr(tmp_path / "truth.exr", {"": image})
    return image


def wait(context, condition):
    """For what happens on other threads."""
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end, "it takes too long"
        context.yield_(1)
        time.sleep(0.005)


def noisy(session, truth, amount):
    """Planes whose image is the truth with that relative error."""
    planes = np.zeros_like(session.frame.planes)
    planes[..., :3] = truth * (1 + amount)
    return planes


def load(context, app, path):
    app.drop([str(path)])
    wait(context, lambda: app.state.comparison.reference is not None)


def test_the_error_of_each_pass_is_measured_and_falls(app, session, truth, tmp_path):
    def script(c):
        app.dialogs.open = lambda title, name, patterns, chosen: chosen(tmp_path / "truth.exr")
        c.key_press(chord(K.r, K.mod_ctrl))
        wait(c, lambda: app.state.comparison.current and app.state.comparison.current.points)
        for amount in (0.1, 0.05, 0.02):
            session.publish(noisy(session, truth, amount))
            passes = session.frame.statistics.passes
            wait(c, lambda passes=passes: app.state.comparison.current.points[-1].passes == passes)
        c.window_focus("//Error")
        c.yield_(3)
        assert c.item_info("//Error/**/passes").id_ != 0
        c.item_click("//Error/**/passes")
        c.yield_(3)

    drive(app, script)
    points = app.state.comparison.current.points
    assert [p.passes for p in points] == [1, 2, 3, 4]
    errors = [p.metrics.relmse_all for p in points]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] == pytest.approx(relmse(session.frame.image(), truth), rel=1e-5)
    assert points[-1].metrics.mean_ratio == pytest.approx(1.02, rel=1e-3)
    assert [m.text for m in app.state.log if "comparing" in m.text] == [f"comparing with {tmp_path / 'truth.exr'}"]


def test_the_error_view_shows_the_exporters_false_colours_and_v_the_reference(app, session, truth, tmp_path):
    seen = {}
    planes = session.frame.planes.copy()
    planes[..., :3] *= np.random.default_rng(2).lognormal(0, 0.4, (SIZE, SIZE, 3))
    planes[1, 2, 0] = np.nan
    session.publish(planes)

    def script(c):
        seen["before"] = viewport_pixels(c, app)
        load(c, app, tmp_path / "truth.exr")
        c.key_down(K.v)
        c.yield_(4)
        seen["reference"] = on_window_thread(c, lambda: app.viewport.capture(overlays=False))
        c.key_up(K.v)
        c.yield_(4)
        seen["after"] = viewport_pixels(c, app)
        session.settings = with_values(session.settings, {"display.view": "error", "display.shading": 0.0})
        c.yield_(4)
        seen["error"] = on_window_thread(c, lambda: app.viewport.capture(overlays=False))

    drive(app, script)
    np.testing.assert_array_equal(seen["before"], seen["after"])
    expected = to_uint8(tone_map(truth, 0.0, "sRGB"))
    assert np.abs(seen["reference"].astype(int) - expected).max() <= 1
    errors = squared_error(session.frame.image(), truth)
    off = np.abs(seen["error"].astype(int) - to_uint8(false_colour(errors, ERROR_SCALE)))
    assert off.max() <= 8, "one step of the colour table where rounding differs"
    assert (off <= 1).mean() > 0.99
    assert tuple(seen["error"][1, 2]) == (255, 0, 255)


def test_shading_lies_under_the_errors_and_follows_its_slider(app, session, truth, tmp_path):
    seen, planes = {}, session.frame.planes.copy()
    planes[:, :32, PLANES["normal"]] = (0.6, 0.0, 0.8)
    session.publish(planes)

    def script(c):
        load(c, app, tmp_path / "truth.exr")
        for strength in (0.0, 0.5, 1.0):
            session.settings = with_values(session.settings, {"display.view": "error", "display.shading": strength})
            c.yield_(4)
            seen[strength] = on_window_thread(c, lambda: app.viewport.capture(overlays=False)).astype(float)

    drive(app, script)
    for strength, factor in ((0.5, 0.92), (1.0, 0.84)):  # 0.2 + 0.8 · 0.8 of the whole
        assert np.abs(seen[strength][:, :32] - factor * seen[0.0][:, :32]).max() <= 1
        np.testing.assert_array_equal(seen[strength][:, 32:], seen[0.0][:, 32:])


@pytest.mark.parametrize("name", ["small.exr", "gone.exr", "broken.exr"])
def test_a_reference_that_does_not_fit_is_one_error_and_changes_nothing(app, session, truth, tmp_path, name):
    write_exr(tmp_path / "small.exr", {"": truth[:16, :16]})
    (tmp_path / "broken.exr").write_bytes((tmp_path / "truth.exr").read_bytes()[:300])

    def script(c):
        load(c, app, tmp_path / "truth.exr")
        before = app.state.comparison.reference
        app.drop([str(tmp_path / name)])
        wait(c, lambda: app.state.toasts)
        c.yield_(3)
        assert app.state.comparison.reference is before

    drive(app, script)
    errors = [m.text for m in app.state.log if m.level == "error"]
    assert len(errors) == 1
    assert name in errors[0]
    if name == "small.exr":
        assert "The reference has 16×16 pixels, the picture 64×64." in errors[0]


def test_without_a_reference_or_with_another_camera_the_views_are_refused_with_a_reason(app, session, truth, tmp_path):
    def script(c):
        assert "no reference" in app.state.refused_view("error")
        app.state.change({"display.view": "error"})
        c.yield_(3)
        assert app.state.shown_display.view == "beauty"
        load(c, app, tmp_path / "truth.exr")
        assert app.state.refused_view("error") is None
        wait(c, lambda: app.state.comparison.latest(app.state.frame))
        app.state.change({"camera.origin": (0.5, 0.0, 4.0)})
        c.yield_(3)
        assert "camera was moved" in app.state.refused_view("reference")
        assert app.state.shown_display.view == "beauty"
        app.state.change({"camera.origin": "auto", "camera.width": 32})
        c.yield_(3)
        assert "64×64" in app.state.refused_view("error")
        assert app.state.refused_view("beauty") is None
        for path, value, told in (
            ("render.filter", "Gaussian", "reconstruction filter was changed"),
            ("render.lights", "hidden", "shows lights as the scene's file says"),
        ):
            app.state.change({"camera.width": "auto", path: value})
            c.yield_(3)
            assert told in app.state.refused_view("error")
            app.state.change({path: "auto"})

    drive(app, script)
    assert not [m for m in app.state.log if m.level == "error"]


def test_a_picture_of_another_camera_has_no_error_against_the_reference(app, session, truth, tmp_path):
    seen = {}

    def script(c):
        load(c, app, tmp_path / "truth.exr")
        state = app.state
        state.take_snapshot()
        state.change({"camera.origin": (0.5, 0.0, 4.0)})
        c.yield_(2)
        state.take_snapshot()
        own, moved = (snapshot_side(one) for one in state.snapshots.all)
        wait(c, lambda: state.measured.error(own) is not None)
        state.measured.error(moved)
        wait(c, lambda: not state.background.running())
        seen["own"], seen["moved"] = state.measured.error(own), state.measured.error(moved)

    drive(app, script)
    assert seen["own"] == pytest.approx(relmse(session.frame.image(), truth), rel=1e-5)
    assert seen["moved"] is None


def test_curves_of_earlier_settings_are_kept_until_cleared(app, session, truth, tmp_path):
    comparison = app.state.comparison

    def measured(context, count):
        wait(context, lambda: comparison.current and len(comparison.current.points) == count)

    def script(c):
        load(c, app, tmp_path / "truth.exr")
        measured(c, 1)
        session.publish()
        measured(c, 2)
        for version, N in enumerate(range(1000, 1000 * (EARLIER_RUNS + 3), 1000), 2):
            session.version = version
            session.set(with_values(session.settings, {"photons.N": N}))
            wait(c, lambda version=version: comparison.current.version == version)
            comparison.current.points += comparison.current.points[:1] or [comparison.earlier[-1].points[0]] * 2
        c.window_focus("//Error")
        c.yield_(4)
        assert len(comparison.earlier) == EARLIER_RUNS
        c.item_click("//Error/**/Clear")
        c.yield_(2)

    drive(app, script)
    assert comparison.earlier == []
    assert comparison.current.label == f"progressive, N {1000 * (EARLIER_RUNS + 2):,}"


def test_marks_are_powers_of_two_and_between():
    marks = [1]
    while marks[-1] < 100:
        marks.append(next_mark(marks[-1]))
    assert marks == [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128]
    assert next_mark(5) == 6
    assert next_mark(0) == 1


def test_labels_name_the_method_and_what_is_not_as_usual(session):
    values = {"render.method": "gather", "gather.rays": 9, "display.exposure": 2.0, "camera.fov": 50.0}
    session.set(with_values(session.settings, values))
    assert run_of(session.frame).label == "gather, rays 9"


@pytest.mark.parametrize("values", [[1.0], [1e-4, 1.0], [0.5, 0.6]])
def test_limits_leave_room_and_span_a_factor_of_four(values):
    low, high = log_limits(values)
    assert low < min(values)
    assert high > max(values)
    assert high / low >= 3.999
