"""What a frame of the library holds: images, figures, diagnostic views, errors."""

from __future__ import annotations

import numpy as np
import pytest

import pmviewer
from pmviewer.errors import SceneError, SettingError
from pmviewer.output.png import read_png
from tests.support.scenes import cornell_box, diffuse_box

TERMS = ("emission", "direct", "specular", "caustic", "indirect")


@pytest.fixture(scope="module")
def balls():
    with pmviewer.open(cornell_box(size=16), {"N": 3000, "radius": 0.05}, threads=2) as s:
        yield s, s.render(passes=2)


def test_images_have_the_shapes_that_are_documented(balls):
    _, frame = balls
    total = np.zeros((16, 16, 3), np.float32)
    for term in TERMS:
        image = getattr(frame, term)
        assert (image.shape, image.dtype) == ((16, 16, 3), np.float32)
        total += image
    assert np.array_equal(total, frame.beauty)
    assert frame.albedo.shape == frame.normal.shape == (16, 16, 3)
    assert frame.depth.shape == (16, 16)
    with pytest.raises(ValueError, match="read-only"):
        frame.beauty[0, 0] = 1
    with pytest.raises(ValueError, match="read-only"):
        frame.depth[0, 0] = 1
    assert (frame.camera.width, frame.camera.height) == (16, 16)
    assert [frame.unit(view) for view in ("direct", "depth", "photon count")] == [
        "W/(m^2 sr)",
        "scene units",
        "photons",
    ]


def test_depth_and_normal_are_those_of_the_wall():
    """The camera stands 1.95 before the middle of the back wall, which faces +z."""
    with pmviewer.open(diffuse_box(size=16), {"N": 1000}, threads=2) as s:
        frame = s.render(passes=1)
    assert frame.depth[8, 8] == pytest.approx(1.95, rel=0.02)
    assert frame.normal[8, 8] == pytest.approx([0, 0, 1], abs=1e-6)
    assert frame.albedo[8, 8] == pytest.approx([0.5] * 3)


def test_diagnostic_views_are_made_on_demand(balls):
    s, frame = balls
    count = {name: frame.view("photon count", map=name) for name in ("global", "caustic")}
    assert all(plane.shape == (16, 16) for plane in count.values())
    assert all(np.array_equal(plane[plane >= 0], np.round(plane[plane >= 0])) for plane in count.values())
    assert not np.array_equal(count["global"], count["caustic"])
    radius = frame.view("look-up radius", map="global")
    assert radius.max() == pytest.approx(frame.statistics.radius["global"])
    later = s.render(passes=1)
    with pytest.raises(SettingError, match="left this frame behind"):
        frame.view("photon count")
    assert later.view("photon count").shape == (16, 16)
    assert np.array_equal(frame.beauty, frame.view("beauty"))


def test_pictures_are_what_png_files_hold(balls, tmp_path):
    s, _ = balls
    frame = s.frame()
    for view in ("direct", "depth", "photon count"):
        frame.save(tmp_path / "a.png", view=view)
        assert np.array_equal(frame.picture(view), read_png(tmp_path / "a.png")[0])
    assert np.array_equal(frame.picture(), frame.picture("beauty"))
    with pytest.raises(SettingError, match="no view"):
        frame.picture("colours")


def test_they_are_named_in_a_line(balls):
    s, frame = balls
    assert repr(frame) == "<frame of cornell box: 16×16 pixels, 2 passes>"
    assert repr(s).startswith("<rendering of cornell box: ")
    assert repr(frame.photons("caustic")).endswith("photons of the caustic map of cornell box, pass 2>")


@pytest.mark.parametrize(
    ("view", "map_", "said"),
    [
        ("colours", None, "no view 'colours'. There are beauty"),
        ("direct", "global", "is of no map"),
        ("shadow rays skipped", "global", "is of no map"),
        ("importance", None, "display.view = importance"),
        ("photon count", "red", "display.map = 'red' is not allowed"),
    ],
)
def test_views_that_there_are_not_are_one_error(balls, view, map_, said):
    s, _ = balls
    with pytest.raises(SettingError, match=said):
        s.frame().view(view, map_)


def test_a_map_that_there_is_not_is_not_replaced_by_the_other():
    with pmviewer.open(diffuse_box(size=8), {"N": 1000}, threads=2) as s:
        frame = s.render(passes=1)
        with pytest.raises(SettingError, match="no caustic map"):
            frame.view("photon count", map="caustic")


def test_errors_against_images_files_and_the_scenes_own_reference(balls, tmp_path):
    _, frame = balls
    reference = frame.beauty + np.float32(0.1)
    by_hand = np.mean(0.01 / (reference.astype(float) ** 2 + 0.01))
    assert frame.relmse(reference) == pytest.approx(by_hand, rel=1e-4)
    frame.save(tmp_path / "same.exr")
    assert frame.errors(tmp_path / "same.exr").relmse_all == 0
    with pytest.raises(SettingError, match="shape"):
        frame.relmse(reference[:8])
    with pytest.raises(SettingError, match="not finite"):
        frame.relmse(np.where(reference > 0, np.nan, reference))
    with pytest.raises(SceneError, match="no reference of its own"):
        frame.relmse()


def test_the_scenes_own_reference_asks_for_its_size_and_camera():
    with pmviewer.open("cornell_diffuse", {"width": 16, "height": 16, "N": 1000}, threads=2) as s:
        with pytest.raises(SceneError, match="256×256"):
            s.render(passes=1).relmse()
        s.set(fov=20)
        with pytest.raises(SceneError, match="own camera"):
            s.render(passes=1).relmse()
