"""`pmviewer sweep`: every combination, its sheet and table, and one sentence for what makes no sense."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from pmviewer.commands.cli import main
from pmviewer.engine.opened import arrangement_of, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.contact_sheet import grid_sheet
from pmviewer.output.exr import read_reference
from pmviewer.output.png import read_png
from pmviewer.settings.access import Settings, with_values

SMALL = ["--size", "16x12", "--passes", "2"]


def run(*words):
    """The exit code."""
    try:
        main(["sweep", *map(str, words)])
    except SystemExit as end:
        return end.code
    return 0


def test_every_combination_by_itself(tmp_path):
    """Settings and edits, rows first; each picture is what its settings alone give; errors are those of NumPy."""
    with pytest.raises(SystemExit):
        main(["render", "cornell_diffuse", "-o", str(tmp_path / "ref.exr"), *SMALL, "--set", "render.seed=9"])
    words = ["--vary", "light.1.power=1,2", "--vary", "photons.N=500..2000", "--steps", "3", *SMALL]
    files = ["-o", tmp_path / "p.exr", "--table", tmp_path / "t.csv", "--reference", tmp_path / "ref.exr"]
    assert run("cornell_diffuse", *words, *files) == 0
    with (tmp_path / "t.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    asked = [(power, N) for power in (1, 2) for N in (500, 1000, 2000)]
    assert [(float(row["light.1.power"]), int(row["photons.N"])) for row in rows] == asked
    reference = read_reference(tmp_path / "ref.exr").astype(float)
    pool = WorkPool(1)
    for number, ((power, N), row) in enumerate(zip(asked, rows, strict=True), 1):
        image = read_reference(tmp_path / f"p_{number:04d}.exr")
        changes = {"camera.width": 16, "camera.height": 12, "photons.N": N, "edit.changes": {"light.1.power": power}}
        settings = with_values(Settings(), changes)
        alone = Renderer(open_scene("cornell_diffuse", None, arrangement_of(settings)), settings, pool, StageStore(0))
        alone.step()
        alone.step()
        np.testing.assert_array_equal(image, alone.frame(1).image())
        error = ((image - reference) ** 2 / (reference**2 + 0.01)).mean()
        assert float(row["relMSE"]) == pytest.approx(error, rel=1e-5)
        assert (int(row["passes"]), int(row["photons"])) == (2, 2 * N)
    pool.close()


def test_sheet_and_markdown_and_going_on(tmp_path, capsys):
    words = ["cornell_diffuse", "--vary", "photons.N=500,1000", *SMALL, "--resume"]
    files = ["--sheet", tmp_path / "s.png", "--table", tmp_path / "t.md"]
    assert run(*words, *files) == 0
    sheet, table = read_png(tmp_path / "s.png")[0], (tmp_path / "t.md").read_text()
    assert "| photons.N | passes |" in table
    capsys.readouterr()
    assert run(*words, *files) == 0
    assert "2 of 2 pictures were there already" in capsys.readouterr().out
    assert (tmp_path / "t.md").read_text() == table
    np.testing.assert_array_equal(read_png(tmp_path / "s.png")[0], sheet)


def test_a_reference_that_comes_later_is_measured_against(tmp_path, capsys):
    words = ["cornell_diffuse", "--vary", "photons.N=500,1000", *SMALL, "--resume", "-o", tmp_path / "p.exr"]
    assert run(*words) == 0
    (tmp_path / "ref.exr").write_bytes((tmp_path / "p_0001.exr").read_bytes())
    capsys.readouterr()
    assert run(*words, "--reference", tmp_path / "ref.exr") == 0
    said = capsys.readouterr().out
    assert "it was not measured against this reference" in said
    assert "relMSE" in said


def test_the_grid_has_labels_on_both_sides_and_pictures_in_their_places():
    """A picture of one colour each; between and around them no such colour."""
    colours = [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 0), (0, 255, 255), (255, 0, 255)]
    pictures = [np.full((30, 40, 3), colour, np.uint8) for colour in colours]
    sheet = grid_sheet(pictures, ["a\nb", "c"], ["x", "y", "z"], [f"{n} s" for n in range(6)])
    places = []
    for colour in colours:
        ys, xs = np.nonzero((sheet == colour).all(axis=2))
        assert len(ys) == 30 * 40
        places.append((ys.min(), xs.min()))
    assert places[0][0] == places[1][0] == places[2][0] < places[3][0] == places[4][0]
    assert places[0][1] == places[3][1] < places[1][1] == places[4][1] < places[2][1]
    left = sheet[:, : places[0][1]]
    assert (left[places[0][0] : places[0][0] + 40] > 200).any()
    assert (left[places[3][0] :] > 200).any()
    assert (sheet[: places[0][0], places[1][1] :] > 200).any()


def test_a_wide_sheet_is_made_to_fit():
    pictures = [np.zeros((10, 1000, 3), np.uint8)] * 4
    assert grid_sheet(pictures, [""], list("abcd"), ["a long text of figures"] * 4).shape[1] <= 2400
    tiny = [np.zeros((10, 10, 3), np.uint8)] * 60
    assert grid_sheet(tiny, [""], ["x"] * 60, ["a long text of figures"] * 60).shape[1] <= 2400


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--vary", "photons.N=1,2", "--vary", "photons.N=3,4"], "given twice"),
        (["--vary", "photons.N=1..1000", "--steps", "1000", "--vary", "photons.q=0.1..1"], "at most 10,000"),
        (["--vary", "photons.M=1,2"], "no setting 'photons.M'"),
        (["--vary", "camera.width=16,32"], "of one size"),
        (["--vary", "light.7.power=1,2"], "no light '7'"),
        (["--vary", "photons.N=1,2", "--passes", "1", "--time", "1"], "exclude each other"),
        (["--vary", "photons.N=1,2", "--reference", "nowhere.exr"], "nowhere.exr"),
        (["--vary", "light.1.power=1,2", "--reference", "auto"], "leave out the edits"),
        (["--vary", "render.passes=0,1"], "render.passes"),
    ],
)
def test_what_is_no_sweep(tmp_path, capsys, words, said):
    assert run("cornell_diffuse", "--sheet", tmp_path / "a.png", "--size", "16x16", *words) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_nothing_to_write(capsys):
    assert run("cornell_diffuse", "--vary", "photons.N=1,2") == 2
    assert "--table" in capsys.readouterr().err
