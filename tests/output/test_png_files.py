"""PNG files hold the pixels and texts that were given."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.output.png import read_png, write_png


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3), (5, 7, 4), (1, 1, 3)])
def test_bytes_come_back(tmp_path, shape):
    image = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    write_png(tmp_path / "a.png", image)
    pixels, texts = read_png(tmp_path / "a.png")
    np.testing.assert_array_equal(pixels, image)
    assert texts == {}


def test_floats_are_rounded_and_one_channel_is_grey(tmp_path):
    image = np.array([[[0.0], [0.5], [1.0]]])
    write_png(tmp_path / "a.png", image)
    np.testing.assert_array_equal(read_png(tmp_path / "a.png")[0], [[0, 128, 255]])


def test_views_of_arrays_are_written_as_they_look(tmp_path):
    image = np.random.default_rng(1).integers(0, 256, (8, 6, 3), dtype=np.uint8)
    for view in (image[::-1], image[:, ::2], image[..., ::-1], image.transpose(1, 0, 2)):
        write_png(tmp_path / "a.png", view)
        np.testing.assert_array_equal(read_png(tmp_path / "a.png")[0], view)


def test_texts_come_back(tmp_path):
    texts = {"Title": "box", "pmviewer.units": "W/(m² sr) — ▸"}
    write_png(tmp_path / "a.png", np.zeros((2, 2), np.uint8), texts)
    assert read_png(tmp_path / "a.png")[1] == texts


@pytest.mark.parametrize("shape", [(2, 2, 2), (4,), (0, 3, 3)])
def test_what_is_no_image_is_refused(tmp_path, shape):
    with pytest.raises(ValueError, match="an image is"):
        write_png(tmp_path / "a.png", np.zeros(shape, np.uint8))
    assert not (tmp_path / "a.png").exists()


def test_broken_files_are_explained(tmp_path):
    path = tmp_path / "a.png"
    write_png(path, np.random.default_rng(1).integers(0, 256, (40, 40, 3), dtype=np.uint8))
    whole = path.read_bytes()
    for data in (b"", b"GIF89a" + bytes(40), whole[:20], whole[: len(whole) // 2]):
        path.write_bytes(data)
        with pytest.raises(SceneError, match="not a whole PNG"):
            read_png(path)
