"""A quick part of `pmviewer bench stress`, with the kernels that other tests compile; and the judgement itself."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from pmviewer.bench.stress import suite
from pmviewer.bench.stress.inputs import NONSENSE, inputs
from pmviewer.bench.stress.lab import Case, Lab, Outcome, Row, run_case
from pmviewer.bench.stress.sizes import counts, kept, meshes, pictures, radii, scales
from pmviewer.bench.stress.suite import all_cases, run_cases, table
from pmviewer.bench.stress.surfaces import lights, materials, overlaps
from pmviewer.engine.pool import WorkPool
from pmviewer.errors import SceneError

SLOW = (
    "5,000,000",
    "2,000,000",
    "20,000,000",
    "8K",
    "8,000 times",
    "1000,",
    "size 1,",
    "slivers",
    "1e-05 of",
    "1e-07 of",
)
OTHER_KERNELS = ("rough", "spot", "sky with", "texture", "normal map", "roughness", "all shine", "10,000")


def quick(cases):
    return [
        c for c in cases if not c.long and not any(word in f"{c.group}: {c.name}" for word in (*SLOW, *OTHER_KERNELS))
    ]


QUICK = quick([*scales(), *radii(), *counts(), *materials(), *overlaps(), *lights(), *meshes(), *pictures(), *inputs()])


@pytest.fixture(scope="module")
def lab():
    pool = WorkPool(2)
    yield Lab(pool, seeds=12)
    pool.close()


@pytest.mark.extensive
@pytest.mark.parametrize("case", QUICK, ids=lambda case: f"{case.group}: {case.name}")
def test_case(lab, case):
    row = run_case(lab, case)
    print(row.outcome)
    assert row.wrong == ""


def test_every_case_has_a_name_of_its_own():
    names = [(case.group, case.name) for case in all_cases()]
    assert len(set(names)) == len(names) > 150
    assert {case.group for case in all_cases()} >= {"scale", "far", "radius", "N", "k", "q", "alpha", "albedo", "ior"}


def row_of(outcome, nonsense=False):
    return Row(Case("group", "name", "", lambda lab: outcome, nonsense), outcome, 1.0, 1.5, 10.0)


def test_what_counts_as_wrong():
    right = Outcome(1.01, 0.01, 1.0)
    assert row_of(right).verdict == "ok"
    assert row_of(replace(right, bias="stated")).verdict == "biased as stated"
    assert row_of(replace(right, value=1.2)).verdict == "off"
    assert row_of(replace(right, value=math.nan)).verdict == "off"
    assert row_of(replace(right, error=0.0)).verdict == "off"
    assert row_of(replace(right, value=1.0001, error=0.0)).verdict == "ok"
    assert row_of(replace(right, finite=False)).verdict == "not finite"
    assert row_of(Outcome(), nonsense=True).verdict == "silent"
    assert row_of(Outcome(said=("This can't be.",)), nonsense=True).verdict == "said"
    assert row_of(Outcome(problem="broken")).verdict == "broken"


def test_whatever_a_case_raises_is_its_row(lab):
    def refuse(lab):
        raise SceneError("There is nothing.")

    def fail(lab):
        raise ZeroDivisionError("by nothing")

    assert run_case(lab, Case("a", "b", "", refuse)).verdict == "refused"
    assert run_case(lab, Case("a", "b", "", refuse, nonsense=True)).verdict == "said"
    assert run_case(lab, Case("a", "b", "", fail)).verdict == "ZeroDivisionError: by nothing"
    result = table([row_of(Outcome(1.0, 0.1, 1.0)), row_of(Outcome(problem="broken"))], 1.0)
    assert [target.ok for target in result.targets] == [False, True, True]
    assert any("broken" in note for note in result.notes)


def test_a_case_in_a_process_of_its_own_says_the_same(lab, monkeypatch):
    """A picture with numbers, a file that makes no sense; and a case that isn't there, which ends the process."""
    monkeypatch.setattr(suite, "PROCESSES", 1)  # which is started again after the case that ends it
    cases, told = all_cases(), []
    numbers = [next(i for i, c in enumerate(cases) if c.name == name) for name in ("1 × 1", "fov 180")]
    rows = run_cases([*cases, Case("a", "b", "", lambda lab: Outcome())], [len(cases), *numbers], told.append)
    assert sorted(row.case.name for row in told) == sorted(row.case.name for row in rows)
    assert [row.case for row in rows[1:]] == [cases[i] for i in numbers]
    assert rows[0].wrong.startswith("the process ended with status 1: IndexError")
    for row, number in zip(rows[1:], numbers):
        own = run_case(Lab(lab.pool), cases[number])
        assert repr(row.outcome) == repr(own.outcome)


def test_share_of_a_disc_on_a_sphere_by_points():
    """Uniform points on the unit sphere with the share of cosine-distributed light that comes from the disc's front;
    what faces away from it by more than 120° is another side."""
    import numpy as np

    z = 1 - 2 * (np.arange(400_000) + 0.5) / 400_000
    distance, off = np.sqrt(2 - 2 * z), 1 - z
    for r in (0.1, 0.7, 1.5, 3.0, 20.0):
        inside = (distance <= r) & (off <= 0.2 * r) & (z >= -0.5)
        share = (inside * (1 + z) / 2).mean() * 4 * math.pi / (math.pi * r * r)
        assert share == pytest.approx(kept(r), rel=2e-3)


@pytest.mark.parametrize("name", [n for n in NONSENSE if "pixels" in n and n != "picture of no pixels"])
def test_pictures_of_nonsense_are_answered_when_read(tmp_path, name):
    import numpy as np

    from pmviewer.output.exr import write_exr
    from pmviewer.scene.load import load_scene

    pixels = np.full((4, 8, 3), 0.5, np.float32)
    pixels[1, 2], pixels[2, 5], pixels[0, 0] = np.nan, np.inf, -3.0
    write_exr(tmp_path / "picture.exr", {"": pixels})
    (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">{NONSENSE[name]}</scene>', "utf-8")
    assert any("finite" in sentence for sentence in load_scene(tmp_path / "scene.xml").warnings)


def test_paths_that_end_on_their_way_are_told_of():
    """A mirror room: what the camera follows never ends, whatever the depth."""
    from pmviewer.bench.stress.scenes import MIRROR, furnace
    from pmviewer.scene.description import Shape, Sphere

    inner = Shape("mirror", Sphere((0, 0, 0), 0.9, True), 1)
    scene = furnace(extra=(inner,), materials=(replace(MIRROR, reflectance=(0.9, 0.9, 0.9)),))
    pool = WorkPool(1)
    try:
        for method in ("progressive", "path"):
            lab = Lab(pool)
            lab.measure(scene, None, seeds=1, render__method=method, render__max_depth=5)
            assert any("100.0% of the paths from the camera end on their way" in said for said in lab.said)
            lab = Lab(pool)
            lab.measure(furnace(), None, seeds=1, render__method=method)
            assert not any("end on their way" in said for said in lab.said)
    finally:
        pool.close()
