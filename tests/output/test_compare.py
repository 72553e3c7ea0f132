"""Comparing files: the printed figures are those of the metrics, and files that don't fit are one clear error."""

from __future__ import annotations

import re

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.output.compare import ERROR_COLUMNS, Reference, compare_files, error_row, load_reference, pixel_error
from pmviewer.output.exr import write_exr
from pmviewer.output.metric import channel_ratios, mean_ratio, metrics, squared_error


@pytest.fixture
def pair(tmp_path):
    generator = np.random.default_rng(5)
    truth = generator.lognormal(-1, 1, (24, 32, 3)).astype(np.float32)
    image = (truth * (1.5, 1.0, 0.5) * generator.lognormal(0, 0.1, truth.shape)).astype(np.float32)
    write_exr(tmp_path / "image.exr", {"": image})
    write_exr(tmp_path / "truth.exr", {"": truth})
    return image, truth


def test_the_text_has_the_figures_of_the_metrics_in_one_column(pair, tmp_path):
    text = compare_files(tmp_path / "image.exr", tmp_path / "truth.exr")
    rows = dict(re.split(r"  +", line, maxsplit=1) for line in text.splitlines())
    measured = metrics(*pair)
    assert rows["size"] == "32×24 pixels"
    assert rows["relMSE"] == f"{measured.relmse_all:.4e}"
    assert rows["error of 8×8 blocks"] == f"{measured.block_error:.4e}"
    assert rows["mean ratio"] == f"{measured.mean_ratio:.5f}"
    assert [float(v) for v in rows["mean ratio R, G, B"].split()] == pytest.approx([1.5, 1.0, 0.5], rel=0.03)
    assert len({line.index(text) for line, text in zip(text.splitlines(), rows.values(), strict=True)}) == 1


def test_rows_stand_under_their_columns(pair):
    row = error_row(16, 2.5, metrics(*pair))
    assert len(row) == len(ERROR_COLUMNS)
    assert row.split()[:2] == ["16", "2.50"]


def test_channel_ratios_average_to_the_mean_ratio_of_a_grey_reference():
    image = np.random.default_rng(1).uniform(0, 2, (8, 8, 3))
    assert np.mean(channel_ratios(image, np.ones_like(image))) == pytest.approx(mean_ratio(image, np.ones_like(image)))


def test_no_factor_leads_from_black():
    black = np.zeros((8, 8, 3))
    assert np.isnan(mean_ratio(black + 1, black))
    assert np.isnan(channel_ratios(black + 1, black)).all()


def test_an_image_smaller_than_a_block_has_no_block_error():
    measured = metrics(np.ones((4, 4, 3)), np.full((4, 4, 3), 2.0))
    assert np.isnan(measured.block_error)
    assert measured.relmse_all == pytest.approx(1 / 4.01)


def test_a_pixel_of_a_coarse_image_is_compared_with_the_reference_pixel_it_covers(pair, tmp_path):
    image, truth = pair
    reference = Reference(tmp_path / "truth.exr", truth)
    assert pixel_error(image, reference, 31, 7) == pytest.approx(squared_error(image, truth)[7, 31])
    expected = ((image[3, 15].astype(float) - truth[7, 31]) ** 2 / (truth[7, 31].astype(float) ** 2 + 0.01)).mean()
    assert pixel_error(image[:12, :16], reference, 31, 7) == pytest.approx(expected)


def test_files_that_do_not_fit_are_one_error(pair, tmp_path):
    write_exr(tmp_path / "small.exr", {"": pair[0][:8, :8]})
    with pytest.raises(SceneError, match=r"truth\.exr: The reference has 32×24 pixels, the picture 8×8\."):
        compare_files(tmp_path / "small.exr", tmp_path / "truth.exr")
    with pytest.raises(SceneError, match=r"gone\.exr"):
        compare_files(tmp_path / "image.exr", tmp_path / "gone.exr")
    with pytest.raises(SceneError, match=r"a\.png: .*only EXR files"):
        compare_files(tmp_path / "a.png", tmp_path / "truth.exr")
    broken = pair[1].copy()
    broken[2, 3, 1] = np.nan
    write_exr(tmp_path / "broken.exr", {"": broken})
    with pytest.raises(SceneError, match=r"broken\.exr: 1 of its pixels are not finite"):
        load_reference(tmp_path / "broken.exr")
