"""Automatic mode on files: errors without the references' noise, and what a table says of a file."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.bench import peer
from pmviewer.bench.measures import auto
from pmviewer.bench.measures.auto_files import COLUMNS, error_against, on_files
from pmviewer.bench.report import BenchResult
from pmviewer.errors import PmviewerError, SettingError
from pmviewer.output.metric import EPSILON

SCENE = """<scene version="3.0.0">
  <sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0, 0, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film></sensor>
  <shape type="sphere"><bsdf type="diffuse"/></shape>
  <emitter type="constant"/>
</scene>"""


def test_errors_are_without_the_noise_of_the_references():
    rng = np.random.default_rng(3)
    references = rng.normal(1.0, 0.05, (2, 64, 64, 3))
    image = np.full((64, 64, 3), 1.02)
    expected = 0.02**2 / (1 + EPSILON)
    assert error_against(image, references) == pytest.approx(expected, abs=6e-5)
    assert float(((image - references[0]) ** 2).mean()) > 5 * expected


@pytest.mark.usefixtures("every_path_may_split")
def test_a_file_is_rendered_at_the_size_of_mitsubas_picture_and_measured_against_it(tmp_path, monkeypatch):
    """Mitsuba's part is made up: a sphere under a white sky, all white, and pictures that are wrong by so much."""
    asked = {}

    def file_images(path, longest, depth, budget, references):
        asked.update(path=path, budget=budget, references=references)
        off = np.array([0.4, 0.2, 0.1], np.float32).reshape(3, 1, 1, 1)
        images = np.ones((3, 8, 8, 3), np.float32) + off
        return {"cpu": np.array([0.1, 0.2, 0.4]), "images": images, "references": np.ones((2, 8, 8, 3), np.float32)}

    monkeypatch.setattr(peer, "variant", lambda: "made up")
    monkeypatch.setattr(peer, "file_images", file_images)
    (tmp_path / "sphere.xml").write_text(SCENE)
    result = on_files(tmp_path, 0.2, None, 1)
    (row,) = result.rows
    assert asked["path"] == tmp_path / "sphere.xml"
    assert asked["references"] > 4 * asked["budget"] > 0
    assert row[6] == pytest.approx(0.2**2 / (1 + EPSILON), rel=1e-5), "after 0.2 CPU seconds"
    assert row[7] == pytest.approx(row[4] / row[6])
    assert float(row[8]) == pytest.approx(0.8, abs=0.2), "the sphere reflects half of the sky"
    assert [target.value for target in result.targets] == pytest.approx([row[7], row[7]])


def test_files_that_do_not_open_are_named(tmp_path, monkeypatch):
    def refuse(*args):
        raise PmviewerError("Mitsuba 3 (made up) could not render it.")

    monkeypatch.setattr(peer, "variant", lambda: "made up")
    monkeypatch.setattr(peer, "file_images", refuse)
    with pytest.raises(SettingError, match="no complete Mitsuba file"):
        on_files(tmp_path, 0.2, None, 1)
    (tmp_path / "sphere.xml").write_text(SCENE)
    result = on_files(tmp_path, 0.2, None, 1)
    assert not result.rows
    assert any("sphere.xml: Mitsuba 3 (made up) could not render it." in note for note in result.notes)
    assert not any(target.ok for target in result.targets)


def test_ten_files_count_together_with_the_bundled_scenes(tmp_path, monkeypatch):
    """P17 is one mean over both. Ten files at 0.4 of Mitsuba's error, seven scenes at 0.1, and seven that it can't
    render."""
    row = ["file.xml", 1, "gather", 0.1, 1.0, 1.0, 1.0, 0.4, "1", ""]
    files = BenchResult("files", COLUMNS, [row] * auto.REAL, [])
    monkeypatch.setattr(auto, "on_files", lambda folder, seconds, count, seed: replace(files, rows=files.rows[:count]))
    monkeypatch.setattr(auto, "_with_choice", lambda scene, seconds, pool: (None, None, None))
    monkeypatch.setattr(auto, "_error", lambda renderer, scene: 1e-3)
    monkeypatch.setattr(auto, "_ratio", lambda scene, error, s: 0.1 if scene in auto.QUICK else math.nan)
    monkeypatch.setattr(peer, "variant", lambda: "made up")
    mean, worst = auto.run(folder=tmp_path).targets
    assert mean.value == pytest.approx((0.4**10 * 0.1**7) ** (1 / 17))
    assert worst.value == 0.4
    assert "7 bundled scenes" in mean.note
    assert not auto.run(folder=tmp_path, scenes=9).targets, "too few"
    assert not auto.run(folder=tmp_path, quick=True).targets
