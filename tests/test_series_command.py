"""`pmviewer series`: plans, files, and one sentence for what makes no sense."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.commands.cli import main
from pmviewer.commands.series_plan import load_keys, plan_series, varied, way_of
from pmviewer.engine.series.keys import automatic_radius
from pmviewer.engine.store import StageStore
from pmviewer.errors import SettingError
from pmviewer.output.png import read_png
from pmviewer.settings.access import Settings

SMALL = ["--size", "12x12", "--passes", "1", "--set", "photons.N=500"]


def run(*words):
    """The exit code."""
    try:
        main(["series", *map(str, words)])
    except SystemExit as end:
        return end.code
    return 0


def test_ways():
    assert way_of("photons.N=1000..2000").values == ("1000", "2000")
    assert way_of("gather.rays=4, 16,64").values == ("4", "16", "64")
    assert way_of("camera.origin=0,0,1; 0,0,2").values == ("0,0,1", "0,0,2")
    assert way_of("light.1.power=1,2").values == ("1", "2")
    assert way_of("object.a.move=0,0,1;1,1,1").values == ("0,0,1", "1,1,1")


def test_several_ways_at_once():
    ways = [way_of("photons.N=100..10000"), way_of("light.1.power=1,2,4"), way_of("light.2.power=3..1")]
    made = varied([Settings()] * 3, ways)
    assert [one.photons.N for one in made] == [100, 1000, 10_000]
    assert [one.edit.changes for one in made] == [
        {"light.1.power": (power,), "light.2.power": (other,)} for power, other in ((1.0, 3.0), (2.0, 2.0), (4.0, 1.0))
    ]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--vary", "photons.N"], "write NAME=FROM..TO"),
        (["--vary", "photons.N=1000..2000.."], "write NAME=FROM..TO"),
        (["--vary", "photon.N=1..2"], "no setting 'photon.N'"),
        (["--vary", "light.1.size=1..2"], "no property 'size' of a light"),
        (["--vary", "photons.N=1,2", "--vary", "photons.q=0.1,0.2,0.3"], "lists of 2 and of 3 values"),
        (["--vary", "photons.N=100,200", "--pictures", "5"], "--vary lists 2 values"),
        ([], "give one of them"),
        (["--orbit", "90", "--pictures", "3", "--vary", "photons.N=100,200"], "--vary lists 2 values"),
    ],
)
def test_what_is_no_series(tmp_path, capsys, words, said):
    assert run("cornell_diffuse", "--sheet", tmp_path / "a.png", *words) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_names_are_looked_at_before_anything_is_rendered(tmp_path, capsys):
    assert run("cornell_diffuse", "--orbit", "90") == 2
    assert "Nothing would be written" in capsys.readouterr().err
    assert run("cornell_diffuse", "--orbit", "90", "-o", tmp_path / "a.jpg") == 2
    assert "unknown format" in capsys.readouterr().err


def test_keys_are_of_one_scene(tmp_path, capsys):
    for name in ("cornell_diffuse", "office"):
        (tmp_path / f"{name}.toml").write_text(f'format = 1\nscene = "{name}"\n')
    assert run(tmp_path / "cornell_diffuse.toml", tmp_path / "office.toml", "--sheet", tmp_path / "a.png") == 2
    assert "of one scene" in capsys.readouterr().err


def test_pictures_films_and_sheets(tmp_path, capsys):
    """The first picture is that of `pmviewer render`."""
    files = ["-o", tmp_path / "p.png", "-o", tmp_path / "f.gif", "--sheet", tmp_path / "s.png"]
    assert run("cornell_diffuse", "--vary", "light.1.power=1,4", *SMALL, *files) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["f.gif", "p_0001.png", "p_0002.png", "s.png"]
    with pytest.raises(SystemExit):
        main(["render", "cornell_diffuse", "-o", str(tmp_path / "r.png"), *SMALL])
    first, second, rendered = (read_png(tmp_path / f"{name}.png")[0] for name in ("p_0001", "p_0002", "r"))
    assert np.array_equal(first, rendered)
    assert second.mean() > first.mean()
    assert "wrote" in capsys.readouterr().out


def test_a_film_from_key_to_key(tmp_path):
    head = 'format = 1\nscene = "cornell_diffuse"\n[settings.camera]\n'
    (tmp_path / "a.toml").write_text(head)
    (tmp_path / "b.toml").write_text(head + "origin = [0.6, 0.5, -1.0]\n")
    words = [tmp_path / "a.toml", tmp_path / "b.toml", "--pictures", "3", "-o", tmp_path / "p.png"]
    assert run(*words, *SMALL) == 0
    middle = read_png(tmp_path / "p_0002.png")[1]
    (origin,) = [text for name, text in middle.items() if name.endswith(".camera.origin")]
    assert np.allclose([float(x) for x in origin.split()], (0.55, 0.4955036, -1.219424), atol=1e-5)


def plan_of(*words, sources=("cornell_diffuse",), orbit=None, pictures=None, size="12x12"):
    jobs = load_keys([str(source) for source in sources], ([], [], []), 1, size)
    return plan_series(jobs, words, orbit, pictures, 1)


def test_a_way_over_several_stops():
    """Smooth for places, through each stop; numbers evenly between two."""
    plan = plan_of("camera.origin=0,0,1..1,0,1..1,0,2", "photons.q=1..0.5..1", pictures=5)
    origins = [one.camera.origin for one in plan.pictures]
    assert [origins[0], origins[2], origins[4]] == [(0, 0, 1), (1, 0, 1), (1, 0, 2)]
    assert [one.photons.q for one in plan.pictures][::2] == [1, 0.5, 1]


def test_objects_move_on_the_cameras_way(tmp_path):
    """On an orbit, and between sessions that are keys."""
    plan = plan_of("object.1.move=0,0,0..0.2,0,0", "render.seed=1..4", orbit=90.0, pictures=4)
    assert [one.edit.changes["object.1.move"][0] for one in plan.pictures] == pytest.approx([0, 0.2 / 3, 0.4 / 3, 0.2])
    assert [one.render.seed for one in plan.pictures] == [1, 2, 3, 4]
    assert len({one.camera.origin for one in plan.pictures}) == 4
    assert plan.captions[1].startswith("object.1.move")
    head = 'format = 1\nscene = "cornell_diffuse"\n[settings.camera]\n'
    (tmp_path / "a.toml").write_text(head)
    (tmp_path / "b.toml").write_text(head + "origin = [0.6, 0.5, -1.0]\n")
    plan = plan_of("light.1.power=1,2,4", sources=(tmp_path / "a.toml", tmp_path / "b.toml"))
    assert [one.edit.changes["light.1.power"] for one in plan.pictures] == [(1,), (2,), (4,)]
    assert plan.pictures[2].camera.origin == pytest.approx((0.6, 0.5, -1.0))


def test_a_film_has_one_radius():
    """An automatic one follows the camera in steps; a film that comes nearer keeps one between them."""
    plan = plan_of("camera.fov=20..60", pictures=5, size="400x400")
    (radius,) = {one.estimate.radius for one in plan.pictures}
    store = StageStore()
    alone = [automatic_radius(plan.opened, one, store).global_ for one in plan.pictures]
    assert len(set(alone)) > 1
    assert min(alone) < radius < max(alone)
    assert {one.estimate.radius for one in plan_of("photons.N=1..100").pictures} == {"auto"}


def test_unknown_words_of_a_way_are_refused():
    with pytest.raises(SettingError):
        way_of("light.1=3..4")
