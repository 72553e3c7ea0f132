"""Pictures of the window from the command line."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.commands.job import load_job
from pmviewer.commands.shot import take_shot
from pmviewer.errors import PmviewerError
from pmviewer.output.png import read_png

SMALL = ["camera.width=200", "camera.height=160", "photons.N=2000", "importance.N=500"]


def take(tmp_path, *settings, pixel=None, pin=None, window=False, captions=True, hemisphere=False):
    path, shown = tmp_path / "shot.png", (pixel, pin, "")
    job = load_job("cornell_diffuse", [*SMALL, *settings], [])
    take_shot(job, path, 1, None, window, shown, captions, 1, hemisphere=hemisphere)
    return read_png(path)[0]


def test_overlays_and_legends_are_in_the_picture(tmp_path):
    plain = take(tmp_path).astype(int)
    assert plain.shape == (160, 200, 3)
    photons = take(tmp_path, "overlays.global.show=true").astype(int)
    view = take(tmp_path, "display.view=look-up radius").astype(int)
    assert 200 < (np.abs(photons - plain).max(axis=-1) > 20).sum() < 20_000
    unnamed = take(tmp_path, "display.view=look-up radius", captions=False).astype(int)
    assert (view[5:40, 5:100] != unnamed[5:40, 5:100]).any(axis=-1).mean() > 0.3
    legend = view[10:80, -22:-12]
    assert np.abs(np.diff(legend.mean(axis=1), axis=0)).sum() > 100, "no colour bar"


def test_a_pinned_pixel_is_in_the_picture(tmp_path):
    """Its frame and the disc of its look-up: around the pixel and nowhere else."""
    settings = "render.method=progressive", "camera.width=120", "camera.height=120", "estimate.radius=0.1"
    plain, pinned = (take(tmp_path, *settings, pin=pin).astype(int) for pin in (None, "60,100"))
    rows, columns = np.nonzero((plain != pinned).any(axis=-1))
    assert len(rows) > 100
    assert abs(columns.mean() - 60) < 6
    assert rows.min() > 60
    with pytest.raises(PmviewerError, match="outside"):
        take(tmp_path, *settings, pin="120,5")


def test_a_hemisphere_is_of_a_pixel_that_gathers(tmp_path):
    for pin in (None, "100,140"):
        with pytest.raises(PmviewerError, match="--hemisphere"):
            take(tmp_path, "gather.estimation=off", pin=pin, hemisphere=True)
    assert not list(tmp_path.glob("*.png"))


@pytest.mark.parametrize(
    ("settings", "pixel", "said"),
    [
        (["display.view=required density"], None, "importance"),
        (["render.method=gather", "overlays.gather.show=true"], "500,20", "outside"),
        ([], "20", "not a pixel"),
        (["camera.width=99999"], None, "not allowed"),
    ],
)
def test_what_cannot_be_shown_is_an_error(tmp_path, settings, pixel, said):
    with pytest.raises(PmviewerError, match=said):
        take(tmp_path, *settings, pixel=pixel)
    assert not list(tmp_path.glob("*.png"))
