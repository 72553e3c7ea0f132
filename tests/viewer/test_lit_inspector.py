"""Virtual lights in the window: those that reach the pinned pixel, listed and drawn, and the overlay by object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui

from pmviewer.engine.frame import PhotonCloud
from pmviewer.engine.inspection import Inspection
from pmviewer.engine.inspector.report import History, LitPlace, Pinned, PixelReport
from pmviewer.viewer.gl.palette import light_colour
from pmviewer.viewer.gl.records import tags, with_tags
from pmviewer.viewer.overlays.inspected import CHOSEN_COLOUR, MOST_REACHING, REACH_COLOUR, brightness, spokes
from pmviewer.viewer.panels.inspector.virtual_lights import LightTable, place_name, place_rows
from tests.viewer.driver import drive, make_app, viewport_pixels, wait_until
from tests.viewer.fake_session import FakeSession, photons_at

POINTS = np.array([[0.8, 0.5, -0.9], [-0.2, 0.8, -0.9], [0.5, -0.9, -0.5], [0.9, 0.9, -0.9]])
ADDS = np.array([0.4, 0.3, 0.2, 0.1])


def place(**values):
    made = {
        "shows": "indirect",
        "depth": 0,
        "p": np.array([0.2, -0.2, -1.0]),
        "n": np.array([0.0, 0.0, 1.0]),
        "asked": 7,
        "quotient": 1.25,
        "number": np.array([5, 0, 3, 1]),
        "points": POINTS,
        "Phi": np.full((4, 3), 2.0),
        "distance": np.array([1.0, 2.0, 3.0, 4.0]),
        "adds": np.repeat(ADDS[:, None], 3, axis=1),
        "weight": np.array([3.0, 0.0, 1.0, 0.0]),
        "bounces": np.arange(4),
        "light": np.zeros(4, np.int64),
        "objects": ("wall", "wall", "floor", "quad"),
        "blocked": np.zeros((2, 3)),
    }
    return LitPlace(**{**made, **values})


def report():
    of, none = Pinned(32, 32), np.zeros((0, 3))
    lit = (place(),)
    return PixelReport(of, 3, 100, np.zeros((5, 3)), none, (), (), None, {}, "", History(), ("lamp",), None, lit=lit)


def share(pixels, colour):
    return (np.abs(pixels.astype(int) - np.round(np.array(colour) * 255)).max(axis=-1) <= 2).mean()


def test_a_row_marks_its_light_in_the_picture(tmp_path):
    session, seen = FakeSession(), {}
    app = make_app(session, tmp_path)
    app.state.open("scene.xml")

    def script(c):
        c.yield_(4)
        inspector = app.state.inspector
        seen["lines before"] = share(viewport_pixels(c, app), REACH_COLOUR)
        inspector.pin((32, 32))
        session.frame = replace(session.frame, serial=session.frame.serial + 1, inspection=Inspection(pixel=report()))
        wait_until(c, lambda: inspector.report and inspector.lit_of(inspector.report))
        c.yield_(4)
        seen["lines"] = share(viewport_pixels(c, app), REACH_COLOUR)
        seen["marked before"] = share(viewport_pixels(c, app), CHOSEN_COLOUR)
        heading = c.item_info("//Inspector/**/###adds")
        line = heading.rect_full.max.y - heading.rect_full.min.y
        c.mouse_move_to_pos(ImVec2(heading.rect_full.min.x + 4, heading.rect_full.max.y + 1.5 * line))
        c.mouse_click(0)
        c.yield_(4)
        assert inspector.light == (3, 0), "the second of the list, by its number in the pass"
        seen["marked"] = share(viewport_pixels(c, app), CHOSEN_COLOUR)
        c.key_press(imgui.Key.escape)
        assert inspector.light is None

    drive(app, script)
    assert seen["lines"] > 1e-4 > seen["lines before"]
    assert seen["marked"] > 1e-4 > seen["marked before"]


def test_the_list_says_what_each_adds_and_weighs():
    columns = LightTable().columns_of(place())
    assert columns[0] == pytest.approx([0.4, 0.3, 0.2, 0.1])
    assert columns[3] == pytest.approx([0.75, 0, 0.25, 0])
    rows = dict(place_rows(place()))
    assert (rows["Reach it"], rows["Hidden"], rows["ΣA·c / ΣG"]) == ("4 of 7 asked", "2", "1.25")
    assert rows["Sum of them"] == "1.00 W/(m² sr)"
    assert "ΣA·c / ΣG" not in dict(place_rows(place(weight=np.zeros(4))))
    assert "surface 2" in place_name(place(depth=1))


def test_lines_lead_from_the_surface_to_the_lights_that_add_most():
    ends = spokes(np.zeros(3), POINTS)
    assert (ends[::2] == 0).all()
    assert (ends[1::2] == POINTS).all()
    assert brightness(place().adds) == pytest.approx(np.sqrt(ADDS / 0.4))
    assert MOST_REACHING < 100


def test_lights_are_coloured_by_the_object_that_they_lie_on(tmp_path):
    """Two objects, whose colours show in the picture only where that is asked for."""
    session, shares = FakeSession(), {}
    app = make_app(session, tmp_path)
    app.state.open("scene.xml")
    x, y = np.meshgrid(np.linspace(0.1, 0.9, 8), np.linspace(-0.8, 0.8, 8))
    points = np.stack([x.ravel(), y.ravel(), np.full(64, -0.99)], axis=1)
    cloud = PhotonCloud(
        photons_at(points), 1.0, objects=np.repeat([1, 2], 32), object_names=("none", "lower", "upper", "instances")
    )

    def script(c):
        c.yield_(4)
        for colour in ("power", "object"):
            style = {"show": True, "size": 6.0, "depth": False, "colour": colour}
            app.state.change({f"overlays.virtual.{name}": value for name, value in style.items()})
            c.yield_(2)  # the session makes a frame of its own for it
            session.frame = replace(session.frame, serial=session.frame.serial + 1, clouds={"virtual": cloud})
            c.yield_(4)
            pixels = viewport_pixels(c, app)
            shares[colour] = [share(pixels, light_colour(i)) for i in range(4)]

    drive(app, script)
    assert max(shares["power"]) < 1e-4
    assert min(shares["object"][1:3]) > 1e-3
    assert max(shares["object"][0], shares["object"][3]) < 1e-4


def test_tags_take_the_place_of_lights():
    records = photons_at(POINTS, light=3)
    again = with_tags(records, np.array([0, 7, 65_535, 100_000]))
    assert list(tags(again)) == [0, 7, 65_535, 65_535]
    assert (again[:, :5] == records[:, :5]).all()
    assert (again.view(np.uint32)[:, 5] & 0xFFFF == records.view(np.uint32)[:, 5] & 0xFFFF).all()
    assert list(tags(records)) == [3] * 4
