"""The hand-made table of what scenes need is right: the same pictures, with nothing that is not said."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pmviewer.bench.measures import unused
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.resources import data_folder


@pytest.fixture
def pool():
    pool = WorkPool(2)
    yield pool
    pool.close()


def test_the_table_names_bundled_scenes_and_the_bench_says_which_it_lacks(monkeypatch):
    folders = {path.parent.name for path in data_folder("scenes").glob("*/scene.xml")}
    assert set(unused.NEEDS) <= folders
    assert set(unused.lacking()) == folders - set(unused.NEEDS)
    monkeypatch.setattr(unused, "NEEDS", {})
    assert unused.lacking() == sorted(folders)


@pytest.mark.parametrize("name", ["cornell_diffuse", "cornell_caustic", "cornell_lights"])
def test_stripped_scenes_give_the_same_picture(name, pool, monkeypatch):
    monkeypatch.setattr(unused, "WIDTH", 32)
    came, stripped = unused.sides(open_scene(name), unused.NEEDS[name], pool)
    assert (came.picture() == stripped.picture()).all()
    assert came.opened.flat.record.dtype == stripped.opened.flat.record.dtype


def test_a_record_that_carries_too_much_is_cut_and_one_that_lacks_something_is_refused():
    glossy = open_scene("cornell_glossy")
    cut = unused.stripped_scene(glossy, unused.NEEDS["cornell_diffuse"])
    assert "bsdfs" in glossy.flat.record.dtype.names
    assert "bsdfs" not in cut.flat.record.dtype.names
    assert cut.flat.record["radius"] == glossy.flat.record["radius"]
    with pytest.raises(ValueError, match="which its record lacks"):
        unused.stripped_scene(glossy, replace(unused.NEEDS["cornell_glossy"], fields=("bsdfs", "instances")))


def test_ratio_of_sides_is_the_median_of_pairs():
    class Fixed:
        def __init__(self, *seconds):
            self.left = list(seconds) * 20

        def seconds(self):
            return self.left.pop(0)

    ratio, error, pairs, seconds = unused.median_ratio(Fixed(1.1, 1.1, 9.0), Fixed(1.0), budget=0.0)
    assert (ratio, pairs, seconds) == (pytest.approx(1.1), unused.FEWEST, 1.1)
    assert error > 0
