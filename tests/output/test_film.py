"""Films and contact sheets, read back by others."""

from __future__ import annotations

import re
import subprocess
import sys

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image, ImageSequence

from pmviewer.errors import OutputError
from pmviewer.output.contact_sheet import contact_sheet
from pmviewer.output.film import Film


def pictures(count=5, height=33, width=50):
    """A bright bar that goes from left to right over blue."""
    made = []
    for number in range(count):
        picture = np.full((height, width, 3), (20, 40, 160), np.uint8)
        at = round(number * width / count)
        picture[:, at : at + width // count] = (250, 240, 60)
        made.append(picture)
    return made


def read(path):
    """(n, h, w, 3) and seconds."""
    if path.suffix == ".mp4":
        # Not by imageio_ffmpeg.read_frames, which leaves pipes of processes that have ended to the garbage collector.
        command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
        done = subprocess.run(command, capture_output=True, check=True, timeout=60)
        said = done.stderr.decode()
        width, height = map(int, re.findall(r"Video: .*?, (\d+)x(\d+)[ ,]", said)[0])
        hours, minutes, seconds = map(float, re.findall(r"Duration: (\d+):(\d+):([\d.]+)", said)[0])
        pixels = np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3)
        return pixels, 3600 * hours + 60 * minutes + seconds
    with Image.open(path) as film:
        shown = [(np.array(f.convert("RGB")), f.info["duration"]) for f in ImageSequence.Iterator(film)]
    return np.stack([pixels for pixels, _ in shown]), sum(duration for _, duration in shown) / 1000


@pytest.mark.parametrize("suffix", [".mp4", ".gif", ".webp"])
def test_a_film_holds_its_pictures_in_their_order(tmp_path, suffix):
    path, made = tmp_path / f"film{suffix}", pictures()
    film = Film(path, fps=10)
    for picture in made:
        film.add(picture)
    assert not path.exists(), "whole or not at all"
    film.close()
    frames, seconds = read(path)
    assert len(frames) == 5
    assert seconds == pytest.approx(0.5, abs=0.11)
    assert frames.shape[1] in (33, 34), "H.264 wants even sides"
    for frame, picture in zip(frames, made, strict=True):
        assert np.abs(frame[:33, :50].astype(float) - picture).mean() < 12
    assert list(tmp_path.iterdir()) == [path]


def test_what_is_no_film(tmp_path, monkeypatch):
    with pytest.raises(OutputError, match="unknown format"):
        Film(tmp_path / "a.avi", 24)
    with pytest.raises(OutputError, match="does not exist"):
        Film(tmp_path / "none" / "a.gif", 24)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(OutputError, match="needs the extra 'film'"):
        Film(tmp_path / "a.mp4", 24)


def test_a_sheet_has_every_picture_below_its_caption():
    made = [np.full((40, 60, 3), 30 * (number + 1), np.uint8) for number in range(7)]
    sheet = contact_sheet(made, [f"number {n}\nof 7, a caption that is far too long" for n in range(7)], columns=3)
    for number in range(7):
        rows, columns = np.nonzero((sheet == 30 * (number + 1)).all(axis=2))
        assert len(rows) >= 40 * 60
        box = sheet[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1] if number not in (5, 6) else None
        if box is not None and len(rows) == 2400:
            assert box.shape == (40, 60, 3)
    assert sheet.shape[1] < 3 * 60 + 2 * 30


def test_wide_pictures_are_made_smaller():
    assert contact_sheet([np.zeros((100, 3000, 3), np.uint8)] * 2, ["a", "b"], columns=1).shape[1] <= 2400
