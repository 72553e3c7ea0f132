"""The overlays' table, and what every overlay does alike: upload once, draw in order, free what isn't shown."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from pmviewer.engine.frame import PhotonCloud
from pmviewer.maps.record import unpack
from pmviewer.maps.search.cells import MapCells
from pmviewer.output.false_look import look_of
from pmviewer.settings.access import SETTINGS, Settings, with_values
from pmviewer.viewer.gl.palette import POWER, By, Colouring
from pmviewer.viewer.gl.records import ends_of_scale, log_range, quantity
from pmviewer.viewer.overlays.layers import Layers, any_shown
from pmviewer.viewer.overlays.map_cells import PHOTONS
from pmviewer.viewer.overlays.overlay import Overlay, Source
from pmviewer.viewer.overlays.points import Points
from pmviewer.viewer.overlays.registry import OVERLAYS, SWITCHED
from pmviewer.viewer.shortcuts import BINDINGS, keys_of
from tests.viewer.driver import drive, viewport_pixels
from tests.viewer.fake_session import FakeSession, photons_at


@dataclass(frozen=True)
class Style:
    show: bool = True
    depth: bool = True


@pytest.fixture
def said() -> list[Any]:
    return []


@pytest.fixture
def recorder(said):
    """An overlay that has no OpenGL: it writes down what it was asked for."""

    class Recorder(Overlay):
        name = "recorder"
        shown = True

        @classmethod
        def style(cls, settings: Settings) -> Style:
            return Style(show=cls.shown)

        def needs(self, source):
            if source.frame is None:
                return None
            return source.frame.clouds["caustic"].photons, source.scene_radius

        def take(self, photons, radius):
            said.append(("take", len(photons), radius))

        def release(self):
            said.append("release")

    return Recorder(shaders=None)


def frame_of():
    session = FakeSession()
    session.open("box")
    return session.frame


def test_every_group_of_settings_has_its_overlay_and_every_overlay_its_key():
    groups = Counter(path.split(".")[1] for path in SETTINGS if path.startswith("overlays."))
    assert set(groups) == {overlay.name for overlay in SWITCHED} == set(Settings().overlays.styles())
    assert len({overlay.name for overlay in OVERLAYS}) == len(OVERLAYS)
    for overlay in SWITCHED:
        assert keys_of(f"toggle_{overlay.name}") == overlay.switch.keys
        assert len(overlay.rows()) == groups[overlay.name] - 1, "all but the switch"


def test_no_two_actions_share_a_key():
    pressed = [(key, b.ctrl, b.shift) for b in BINDINGS for key in (b.key, b.alternative) if key is not None]
    assert [chord for chord, count in Counter(pressed).items() if count > 1] == []


def test_every_choice_of_a_colour_of_points_has_its_colours():
    for overlay in SWITCHED:
        if issubclass(overlay, Points):
            assert set(overlay.colourings) == set(SETTINGS[f"overlays.{overlay.name}.colour"].choices)


def test_data_are_uploaded_once_and_freed_when_hidden(recorder, said):
    frame = frame_of()
    source = Source(Settings(), frame, 2.0)
    photons = len(frame.clouds["caustic"].photons)
    assert recorder.upload(source)
    assert said == [("take", photons, 2.0)]
    assert not recorder.upload(source)
    assert not recorder.upload(replace(source, frame=replace(frame, serial=2))), "the photons are the same"
    assert recorder.upload(replace(source, scene_radius=3.0))
    fewer = {"caustic": PhotonCloud(frame.clouds["caustic"].photons[:5].copy(), 1.0)}
    assert recorder.upload(Source(Settings(), replace(frame, clouds=fewer), 3.0))
    assert said[1:] == [("take", photons, 3.0), ("take", 5, 3.0)]
    type(recorder).shown = False
    assert recorder.upload(source)
    assert said[3:] == ["release"]
    assert not recorder.upload(source)
    type(recorder).shown = True
    assert recorder.upload(source), "shown again, it is uploaded again"
    recorder.forget()
    assert said[4:] == [("take", photons, 2.0), "release"]
    assert recorder.upload(source)
    assert recorder.upload(Source(Settings(), None)), "a scene without a frame has nothing to show"
    assert said[6:] == [("take", photons, 2.0), "release"]


class Framebuffer:
    def __init__(self, said: list[Any]) -> None:
        self.depth_mask = True
        self._said = said

    def use(self) -> None:
        self._said.append(f"depth is {'written' if self.depth_mask else 'kept'}")


def test_opaque_things_come_first_and_translucent_ones_by_rank(said, recorder):
    def overlay(title: str, order: int) -> Overlay:
        class Named(type(recorder)):
            rank = order

            def draw(self, drawing, settings):
                said.append(f"{title} opaque")

            def draw_over(self, drawing, settings):
                said.append(f"{title} over")

        return Named(shaders=None)

    layers = Layers.__new__(Layers)
    layers.by_name = {"a": overlay("a", 1), "b": overlay("b", 0), "c": overlay("c", -1)}
    layers.draw(Framebuffer(said), drawing=None, settings=Settings())
    opaque, kept, over, written = said[:3], said[3], said[4:7], said[7:]
    assert opaque == ["a opaque", "b opaque", "c opaque"]
    assert over == ["c over", "b over", "a over"]
    assert (kept, written) == ("depth is kept", ["depth is written"])


def test_the_frustum_is_shown_with_the_free_camera():
    assert not any_shown(Settings())
    assert any_shown(with_values(Settings(), {"free_camera.on": True}))
    assert not any_shown(with_values(Settings(), {"free_camera.on": True, "free_camera.frustum": False}))
    assert any_shown(with_values(Settings(), {"overlays.paths.show": True}))


def test_ends_of_the_scale_of_colours():
    powers = np.geomspace(1.0, 100.0, 1001)
    channels = np.stack([powers, 0.5 * powers, 0.25 * powers], axis=1)
    records = np.concatenate([photons_at(np.zeros((1, 3)), colour) for colour in channels])
    read = unpack(records, 1.0)["Phi"].max(axis=1)
    np.testing.assert_array_equal(quantity(records, POWER), read)
    low, high = ends_of_scale(records)
    assert (low, high) == pytest.approx(np.percentile(read, [1, 99]))
    np.testing.assert_allclose(log_range(records), np.log2([min(low, high / 16), high]))
    mean = Colouring(By.QUANTITY, 3)
    assert ends_of_scale(records, mean) == pytest.approx(np.percentile(0.375 * powers, [1, 99]), rel=2e-3)
    around = ends_of_scale(records, Colouring(By.QUANTITY, 0, scale="around one"))
    assert around[0] * around[1] == pytest.approx(1.0)
    assert around[1] == pytest.approx(high)
    share = ends_of_scale(records, Colouring(By.QUANTITY, 0, scale="share"))
    assert share == pytest.approx((1.0, 100.0), rel=2e-3)
    assert ends_of_scale(photons_at(np.zeros((3, 3)), (0, 0, 0))) == (1.0, 1.0)


def test_photons_are_coloured_by_where_they_came_from(app, session):
    """+x, −y and +z, as the record has them: octahedral, twelve bits each, a half is none."""
    photons = session.frame.clouds["caustic"].photons.copy()
    words = photons.view(np.uint32)
    codes = {(255, 128, 128): (4094, 2047), (128, 0, 128): (2047, 0), (128, 128, 255): (2047, 2047)}
    for third, (u, v) in enumerate(codes.values()):
        words[third::3, 3] = (u << 20) | (v << 8) | 5
    seen = {}

    def script(c):
        app.state.change({"display.view": "geometry", "overlays.caustic.show": True, "overlays.caustic.size": 6.0})
        app.state.change({"overlays.caustic.colour": "direction"})
        frame = session.frame
        clouds = {**frame.clouds, "caustic": PhotonCloud(photons, 1e-3)}
        session.frame = replace(frame, serial=frame.serial + 1, clouds=clouds)
        c.yield_(6)
        seen["pixels"] = viewport_pixels(c, app).reshape(-1, 3).astype(int)

    drive(app, script)
    for colour in codes:
        near = np.abs(seen["pixels"] - colour).max(axis=1) <= 2
        assert near.sum() > 100, f"nothing is drawn in {colour}"


def test_cells_of_a_map_are_boxes_in_the_colours_of_their_photons(app, session):
    """The one with fewest photons in the first colour of the scale, that with most in the last, each where it is."""
    low = np.array([[-0.8, -0.5, -0.3], [0.2, -0.5, -0.3]], np.float32)
    cells = MapCells("global", "grid", low, low + np.float32(0.6), np.array([1, 1000]), np.zeros(2, np.int64), 2)
    seen = {}

    def script(c):
        app.state.change({"display.view": "geometry", "overlays.cells.show": True, "overlays.cells.size": 4.0})
        app.state.change({"overlays.cells.depth": False})
        frame = session.frame
        session.frame = replace(frame, serial=frame.serial + 1, inspection=replace(frame.inspection, cells=cells))
        c.yield_(6)
        seen["shown"] = viewport_pixels(c, app).astype(int)
        app.state.change({"overlays.cells.show": False})
        c.yield_(6)
        seen["hidden"] = viewport_pixels(c, app).astype(int)

    drive(app, script)
    table = PHOTONS.table(look_of(Settings().display))
    middles = []
    for end in (table[0], table[-1]):
        colour = 255 * end
        near = [np.abs(picture - colour).max(axis=2) <= 6 for picture in (seen["shown"], seen["hidden"])]
        assert near[0].sum() > 100 + near[1].sum(), f"nothing is drawn in {colour}"
        middles.append(np.nonzero(near[0] & ~near[1])[1].mean())
    assert abs(middles[0] - middles[1]) > 20, "both boxes are in one place"
