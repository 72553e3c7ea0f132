"""Snapshots as files: what is written comes back, other programs' pictures open, and what is no picture is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.errors import SceneError, SettingError
from pmviewer.output.exr import write_exr
from pmviewer.output.frame_export import write_frame_exr
from pmviewer.output.png import write_png
from pmviewer.output.session_file import read_session, write_session
from pmviewer.output.snapshot import CurvePoint, read_snapshot, snapshot_of, write_snapshot
from pmviewer.output.tone import tone_map
from pmviewer.settings.access import Settings, with_values
from tests.viewer.fake_session import FakeSession

CHANGED = {"photons.N": 12345, "estimate.alpha": 0.7, "camera.origin": (0.1, -2.5, 1 / 3), "overlays.global.show": True}


@pytest.fixture
def frame():
    session = FakeSession(with_values(Settings(), CHANGED))
    session.open("box")
    return session.frame


def test_a_snapshot_comes_back_as_it_was(frame, tmp_path):
    curve = (CurvePoint(1, 0.5, 1.25, 0.125), CurvePoint(3, 1 / 3, 2.5, 1e-7))
    taken = replace(snapshot_of(4, "with alpha · 0.7", frame), curve=curve, truth="/some/truth.exr")
    write_snapshot(tmp_path / "4.exr", taken)
    back = read_snapshot(tmp_path / "4.exr", 9)
    assert (back.number, back.name, back.curve, back.truth) == (9, taken.name, curve, taken.truth)
    assert back.layers.keys() == taken.layers.keys()
    for view, layer in taken.layers.items():
        np.testing.assert_array_equal(back.image(view), layer)
    assert back.settings == frame.settings == taken.settings
    assert back.camera == taken.camera
    assert back.figure("cpu_seconds") == pytest.approx(frame.statistics.cpu_seconds)
    assert back.figure("passes") == frame.statistics.passes
    assert not back.encoded


def test_an_exported_picture_opens_with_its_settings(frame, tmp_path):
    write_frame_exr(tmp_path / "mine.exr", frame)
    opened = read_snapshot(tmp_path / "mine.exr", 1)
    assert opened.name == "mine"
    assert opened.settings == frame.settings
    np.testing.assert_array_equal(opened.image("caustic"), frame.image("caustic"))


def test_pictures_of_other_programs_have_their_picture_alone(tmp_path):
    grey = np.random.default_rng(0).uniform(0, 3, (5, 7, 1)).astype(np.float32)
    write_exr(tmp_path / "grey.exr", {"": grey})
    opened = read_snapshot(tmp_path / "grey.exr")
    np.testing.assert_array_equal(opened.image("beauty"), np.repeat(grey, 3, axis=2))
    np.testing.assert_array_equal(opened.image("caustic"), opened.image("beauty"))
    assert opened.settings is None
    assert opened.figure("passes") is None
    assert opened.size == (7, 5)


def test_a_png_is_decoded_by_the_curve_that_encoded_it(tmp_path):
    radiance = np.linspace(0, 1, 300, dtype=np.float32).reshape(10, 10, 3)
    write_png(tmp_path / "shown.png", tone_map(radiance, 0.0, "sRGB"))
    opened = read_snapshot(tmp_path / "shown.png")
    assert opened.encoded
    np.testing.assert_allclose(opened.image("beauty"), radiance, atol=0.006)


def test_settings_of_another_version_are_taken_as_far_as_they_are_known(frame, tmp_path):
    taken = snapshot_of(1, "old", frame)
    about = {**taken.about, "photons.gone": 3, "render.method": "of another time", "gather.rays": "many"}
    settings = replace(taken, about=about).settings
    assert settings == with_values(frame.settings, {"render.method": Settings().render.method,
                                                   "gather.rays": Settings().gather.rays})  # fmt: skip


@pytest.mark.parametrize("name", ["none.exr", "text.txt", "broken.exr", "layers.exr"])
def test_what_is_no_picture_is_refused_in_a_sentence(name, tmp_path):
    (tmp_path / "text.txt").write_text("hello")
    (tmp_path / "broken.exr").write_bytes(b"\x76\x2f\x31\x01" + bytes(40))
    write_exr(tmp_path / "layers.exr", {"N": np.zeros((2, 2, 3))})
    with pytest.raises(SceneError) as refusal:
        read_snapshot(tmp_path / name)
    assert name in str(refusal.value)


def test_session_files_keep_snapshots_beside_them(frame, tmp_path):
    taken = [snapshot_of(number, f"picture {number}", frame) for number in (1, 3)]
    path = tmp_path / "look.toml"
    write_session(path, frame.settings, "cornell_diffuse", 2, snapshots=taken)
    saved = read_session(path)
    assert saved.snapshots == ((1, tmp_path / "look.snapshots" / "1.exr"), (3, tmp_path / "look.snapshots" / "3.exr"))
    assert [read_snapshot(file, number).name for number, file in saved.snapshots] == ["picture 1", "picture 3"]

    other = tmp_path / "look.snapshots" / "mine.exr"
    other.write_bytes(b"not ours")
    write_session(path, frame.settings, "cornell_diffuse", 2, snapshots=taken[1:])
    assert [number for number, _ in read_session(path).snapshots] == [3]
    assert sorted(file.name for file in (tmp_path / "look.snapshots").iterdir()) == ["3.exr", "mine.exr"]
    write_session(path, frame.settings, "cornell_diffuse", 2)
    assert read_session(path).snapshots == ()


@pytest.mark.parametrize("rows", ["1", '[{number = 1}]', '[{number = 0, file = "a"}]', '[{number = true, file = "a"}]',
                                  '[{number = 1, file = ""}]', '[{number = 1, file = "a"}, {number = 1, file = "b"}]',
                                  '[{number = 1, file = "a", more = 2}]', '["a.exr"]'])  # fmt: skip
def test_wrong_rows_of_snapshots_are_refused(rows, tmp_path):
    path = tmp_path / "wrong.toml"
    path.write_text(f'format = 1\nscene = "cornell_diffuse"\nsnapshots = {rows}\n')
    with pytest.raises(SettingError, match="snapshots"):
        read_session(path)
