"""A frame's EXR holds every layer and everything that made it; its PNG is what the window shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.frame import Frame, Statistics
from pmviewer.errors import OutputError
from pmviewer.output.exr import read_exr
from pmviewer.output.frame_export import LAYERS, frame_metadata, write_frame_exr, write_frame_png
from pmviewer.output.png import read_png
from pmviewer.output.tone import display_image, to_uint8
from pmviewer.render.camera import CameraPose
from pmviewer.render.planes import AOVS, CHANNELS, TERMS
from pmviewer.settings.access import SETTINGS, Settings, flat, with_values


@pytest.fixture
def frame() -> Frame:
    values = {"photons.N": 123_456, "render.seed": 7, "display.exposure": -1.5, "camera.origin": (0.1, 2.0, -3.0)}
    planes = np.random.default_rng(1).lognormal(0, 3, (6, 8, CHANNELS)).astype(np.float32)
    return Frame(
        serial=5,
        version=2,
        coarse=False,
        planes=planes,
        settings=with_values(Settings(), values),
        camera=CameraPose((0.1, 2.0, -3.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0), 39.3, 8, 6),
        statistics=Statistics(
            passes=37,
            emitted=7_400_000_000,
            stored={"caustic": 412_000, "global": 3_100_000_000},
            radius={"caustic": 0.0081, "global": 0.0162},
            rays=99,
            seconds=1.5,
            cpu_seconds=2.75,
            dropped={"film": 0},
            remaining=None,
        ),
        scene_name="cornell_caustic",
    )


def test_layers_are_the_beauty_the_terms_and_the_properties():
    assert list(LAYERS) == ["beauty", *TERMS, *AOVS]


def test_beauty_is_the_sum_of_the_exported_terms_bit_for_bit(tmp_path, frame):
    write_frame_exr(tmp_path / "a.exr", frame)
    layers, _ = read_exr(tmp_path / "a.exr")
    total = layers[TERMS[0]].copy()
    for term in TERMS[1:]:
        total += layers[term]
    assert total.tobytes() == layers[""].tobytes() == frame.image("beauty").tobytes()


@pytest.mark.parametrize("half", [False, True])
def test_every_layer_is_in_the_file(tmp_path, frame, half):
    write_frame_exr(tmp_path / "a.exr", frame, half=half)
    layers, _ = read_exr(tmp_path / "a.exr")
    names = {"beauty": "", "normal": "N"}
    assert set(layers) == {names.get(name, name) for name in LAYERS}
    for name in LAYERS:
        exact = not half or name in ("normal", "depth")
        expected = np.minimum(frame.image(name), 65504) if not exact else frame.image(name)
        tolerance = {} if exact else {"rtol": 1e-3, "atol": 1e-7}
        np.testing.assert_allclose(layers[names.get(name, name)], expected, **(tolerance or {"rtol": 0}), err_msg=name)


def test_metadata_says_how_the_picture_was_made(tmp_path, frame):
    write_frame_exr(tmp_path / "a.exr", frame)
    _, metadata = read_exr(tmp_path / "a.exr")
    assert metadata == frame_metadata(frame)
    assert set(SETTINGS) <= set(metadata)
    expected = {
        "scene": "cornell_caustic",
        "units": "W/(m^2 sr)",
        "seed": 7,
        "passes": 37,
        "photons_emitted": 7_400_000_000,
        "photons_stored.caustic": 412_000,
        "photons_stored.global": 3_100_000_000,
        "radius.caustic": 0.0081,
        "dropped.film": 0,
        "photons.N": 123_456,
        "estimate.alpha": 2 / 3,
        "estimate.radius": "auto",
        "photons.indirect_caustics": "true",
        "camera.origin": "0.1 2.0 -3.0",
        "view.fov": 39.3,
        "overlays.global.show": "false",
    }
    assert {name: metadata[name] for name in expected} == expected
    assert str(metadata["program"]).startswith("pmviewer ")


def test_own_metadata_hides_no_setting(frame):
    plain = set(frame_metadata(frame)) - set(SETTINGS)
    assert len(frame_metadata(frame)) == len(plain) + len(flat(frame.settings))


@pytest.mark.parametrize("view", LAYERS)
def test_png_shows_the_view(tmp_path, frame, view):
    write_frame_png(tmp_path / "a.png", frame, view)
    pixels, texts = read_png(tmp_path / "a.png")
    expected = display_image(view, frame.image(view), -1.5, "sRGB").pixels
    np.testing.assert_array_equal(pixels, to_uint8(expected))
    assert texts["Title"] == "cornell_caustic"
    assert texts["pmviewer.photons.N"] == "123456"


def test_png_follows_the_display_settings(tmp_path, frame):
    write_frame_png(tmp_path / "own.png", frame)
    write_frame_png(tmp_path / "beauty.png", frame, "beauty")
    display = with_values(Settings(), {"display.view": "caustic", "display.tone": "filmic"}).display
    write_frame_png(tmp_path / "given.png", frame, display=display)
    given = display_image("caustic", frame.image("caustic"), 0.0, "filmic").pixels
    np.testing.assert_array_equal(read_png(tmp_path / "own.png")[0], read_png(tmp_path / "beauty.png")[0])
    np.testing.assert_array_equal(read_png(tmp_path / "given.png")[0], to_uint8(given))


def test_what_only_the_window_draws_is_refused(tmp_path, frame):
    with pytest.raises(OutputError, match=r"'geometry' is drawn by the window alone. Choose one of beauty"):
        write_frame_png(tmp_path / "a.png", frame, "geometry")
    assert not list(tmp_path.iterdir())


def test_automatic_exposure_is_that_of_the_frame(tmp_path, frame):
    automatic = replace(frame, exposure=-2.0, settings=with_values(frame.settings, {"display.exposure": "auto"}))
    write_frame_png(tmp_path / "a.png", automatic)
    pixels, _ = read_png(tmp_path / "a.png")
    expected = to_uint8(display_image("beauty", frame.image(), -2.0, "sRGB").pixels)
    np.testing.assert_array_equal(pixels, expected)
    assert frame_metadata(automatic)["view.exposure"] == -2.0
    assert frame_metadata(frame)["view.exposure"] == -1.5  # as set, whatever the frame's
    write_frame_exr(tmp_path / "a.exr", automatic)
    layers, _ = read_exr(tmp_path / "a.exr")
    assert layers[""].tobytes() == frame.image().tobytes()
