"""bench files: what is asked of whom, what counts as complete and as right, and that a run can go on."""

import json
import math
import re
import struct
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from pmviewer.bench import peer
from pmviewer.bench.files import bench
from pmviewer.bench.files.judge import Row
from pmviewer.bench.files.mitsuba_file import as_of_3, by_extinction, noise, small_size
from pmviewer.bench.files.sheet import contact_sheet, write_sheet
from pmviewer.bench.files.store import Store
from pmviewer.bench.files.survey import STATES, candidates, survey, surveys
from pmviewer.errors import SettingError

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
SCENE = """<scene version="3.0.0">
    <default name="mesh" value="mesh"/>
    <integrator type="path"><string name="filename" value="cache.obj"/></integrator>
    <sensor type="perspective"><float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="320"/><integer name="height" value="240"/>
            <string name="filename" value="out.exr"/></film></sensor>
    <shape type="rectangle"><bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.4, 0.2"/></bsdf></shape>
    <emitter type="point"><point name="position" x="1" y="1" z="2"/><rgb name="intensity" value="5, 4, 6"/></emitter>
    MORE
</scene>"""


def write(folder, name: str, content: str | bytes):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def state(folder, name: str, content: str | bytes) -> str:
    return survey(write(folder, name, content)).state


def scene(more: str = "") -> str:
    return SCENE.replace("MORE", more)


MESH = '<shape type="obj"><string name="filename" value="$mesh.obj"/></shape>'


def test_a_scene_is_complete_when_all_that_it_reads_is_there(tmp_path):
    """What integrators and films name are not read; parameters and backslashes are resolved."""
    assert state(tmp_path, "a.xml", scene()) == "complete"
    assert state(tmp_path, "a.xml", scene(MESH)) == "incomplete"
    write(tmp_path, "mesh.obj", OBJ)
    assert state(tmp_path, "a.xml", scene(MESH)) == "complete"
    assert state(tmp_path, "a.xml", scene(MESH.replace("$mesh", ".\\mesh"))) == "complete"
    assert survey(write(tmp_path, "b.xml", scene(MESH.replace("$mesh", "$other")))).missing == ["a value for $other",
                                                                                              "$other.obj"]  # fmt: skip


def test_files_are_looked_for_in_named_folders_and_through_includes(tmp_path):
    write(tmp_path, "deep/mesh.obj", OBJ)
    write(tmp_path, "part.xml", f'<scene version="3.0.0"><path value="deep"/>{MESH}</scene>')
    assert state(tmp_path, "a.xml", scene('<include filename="part.xml"/>')) == "complete"
    found = surveys(candidates(tmp_path))
    assert {path.name: one.state for path, one in found.items()} == {
        "a.xml": "complete", "part.xml": "part", "mesh.obj": "part",
    }  # fmt: skip


def test_a_pointer_in_the_place_of_a_file_is_not_the_file(tmp_path):
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n"
    write(tmp_path, "mesh.obj", pointer)
    assert state(tmp_path, "a.xml", scene(MESH)) == "incomplete"
    assert survey(tmp_path / "mesh.obj").state == "absent"


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.xml", '<bsdf type="diffuse"/>', "fragment"),
        ("a.xml", "<mujoco/>", "foreign"),
        ("a.xml", '<scene><mesh type="obj"/></scene>', "foreign"),
        ("a.xml", '<scene version="3.0.0"/>', "foreign"),
        ("a.xml", "<scene", "broken"),
        ("a.gltf", '{"asset": {"version": "1.0"}}', "foreign"),
        ("a.gltf", '{"asset": {"version": "2.0"}, "meshes": [{}]}', "complete"),
        ("a.gltf", '{"asset": {"version": "2.0"}, "meshes": [{"primitives": [{"mode": 0}]}]}', "foreign"),
        ("a.gltf", '{"asset": {"version": "2.0"}, "meshes": [{}], "buffers": [{"uri": "no%20.bin"}]}', "incomplete"),
        ("a.gltf", '{"asset": {"version": "2.0"}, "meshes": [{}], "buffers": [{"byteLength": 4}]}', "incomplete"),
        ("a.gltf", "{", "broken"),
        ("a.glb", b"glTF", "broken"),
        ("a.obj", OBJ, "complete"),
        ("a.obj", "mtllib none.mtl\n" + OBJ, "incomplete"),
        ("a.obj", "v 0 0 0\np 1\n", "foreign"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 3\nelement face 1\nend_header\n", "complete"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 3\nend_header\n", "foreign"),
        ("a.ply", "nothing", "broken"),
        ("a.stl", b"\0" * 80 + struct.pack("<I", 1) + b"\0" * 50, "complete"),
        ("a.stl", b"\0" * 80 + struct.pack("<I", 9) + b"\0" * 50, "broken"),
        ("a.stl", "solid x\nendsolid x\n", "foreign"),
    ],
)  # fmt: skip
def test_kinds_of_files(tmp_path, name, content, expected):
    assert expected in STATES
    assert state(tmp_path, name, content) == expected


def row(ours, theirs, warnings=(), spread=0.0) -> Row:
    """A file whose channels have these means; the samples scatter by `spread`."""
    turns = np.array([1 - spread, 1 + spread] * 8)[:, None]
    made = Row("a.xml", "complete", warnings=list(warnings))
    made.ours, made.theirs = (turns * np.array(ours)).tolist(), (turns * np.array(theirs)).tolist()
    return made


@pytest.mark.parametrize(
    ("ours", "theirs", "warnings", "spread", "expected"),
    [
        ([1.0, 1.0, 1.0], [1.015, 0.99, 1.0], [], 0.0, "agrees"),
        ([1.0, 1.0, 1.03], [1.0, 1.0, 1.0], [], 0.0, "differs"),
        ([1.0, 1.0, 1.03], [1.0, 1.0, 1.0], ["line 3: <medium type='x'> is ignored."], 0.0, "said"),
        ([1.0, 1.0, 1.03], [1.0, 1.0, 1.0], ["line 3: <integrator type='x'> is not known."], 0.0, "differs"),
        ([1.0, 1.0, 1.1], [1.0, 1.0, 1.0], [], 0.3, "noisy"),
        ([1.0, 1.0, 2.0], [1.0, 1.0, 1.0], [], 0.3, "differs"),
        ([1.0, 1.0, 0.0], [1.0, 1.0, 0.0005], [], 0.0, "agrees"),
        ([math.nan, 1.0, 1.0], [1.0, 1.0, 1.0], [], 0.0, "differs"),
        ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [], 0.0, "agrees"),
    ],
)
def test_a_picture_is_right_within_two_percent_or_with_a_warning_about_it(ours, theirs, warnings, spread, expected):
    assert row(ours, theirs, warnings, spread).judgement == expected


def test_noise_is_the_standard_error_of_the_ratio():
    found = row([2.0, 2.0, 2.0], [1.0, 1.0, 1.0], spread=0.1)
    assert found.ratio.tolist() == pytest.approx([2.0] * 3)
    one_side = 0.1 * math.sqrt(16 / 15) / 4
    assert found.noise == pytest.approx(one_side * math.sqrt(2))
    assert noise(np.array(found.ours)) == pytest.approx(one_side)


def test_errors_and_crashes_come_before_pictures():
    assert Row("a", "complete", error="no").judgement == "error"
    assert Row("a", "complete", error="no", crash="Traceback").judgement == "crash"
    assert Row("a", "complete").judgement == "not compared"


@pytest.mark.parametrize(
    ("size", "expected"),
    [((1280, 720), (96, 54)), ((512, 512), (96, 96)), ((576, 768), (72, 96)), ((1, 5000), (1, 96))],
)
def test_small_pictures_keep_the_proportions(size, expected):
    assert small_size(*size, 96) == expected


def test_files_are_drawn_from_all_folders(tmp_path):
    paths = [tmp_path / folder / f"{i}.xml" for folder, n in (("many", 50), ("few", 2), ("one", 1)) for i in range(n)]
    chosen = bench.drawn(paths, 6, 1)
    assert chosen == bench.drawn(paths, 6, 1)
    assert chosen != bench.drawn(paths, 6, 2)
    assert {path.parent.name for path in chosen} == {"many", "few", "one"}
    assert sum(path.parent.name == "few" for path in chosen) == 2
    assert bench.drawn(paths, None, 1) == paths


def test_results_hold_as_long_as_the_file_the_effort_and_the_sources_are_the_same(tmp_path, monkeypatch):
    path, kept = write(tmp_path, "a.xml", "one"), tmp_path / "kept.json"
    made = row([1.0] * 3, [1.0] * 3)
    made.seconds = made.luminance = made.grey = made.dark = 0.5  # NaN equals nothing
    Store(kept, "little").keep(made, path)
    kept.open("a").write('{"row": {"fi')  # a run that was ended
    assert Store(kept, "little").row("a.xml", path) == made
    assert Store(kept, "much").row("a.xml", path) is None
    monkeypatch.setattr("pmviewer.bench.files.store.sources_stamp", lambda: "changed")
    assert Store(kept, "little").row("a.xml", path) is None
    theirs = Store(kept, "little").theirs("a.xml", path)
    assert theirs is not None
    assert theirs["theirs"] == made.theirs
    path.write_text("changed")
    assert Store(kept, "little").theirs("a.xml", path) is None


def test_a_folder_of_files_is_opened_looked_at_and_reported(tmp_path, monkeypatch):
    """Real processes, from the survey to the sheet; Mitsuba too where it is installed."""
    monkeypatch.setattr(bench, "NICE", 0)
    monkeypatch.setattr(bench, "available_threads", lambda: 1)
    folder = tmp_path / "files"
    write(folder, "good.xml", scene())
    write(folder, "bad.xml", '<scene version="3.0.0"><shape type="sdfgrid"/></scene>')
    write(folder, "sub/triangle.obj", OBJ)
    write(folder, "lonely.xml", scene(MESH))
    kept, sheet = tmp_path / "kept.jsonl", tmp_path / "sheet.png"
    result = bench.run(folder, quick=True, json=kept, sheet=sheet)
    rows = {cells[0]: dict(zip(result.columns, cells, strict=True)) for cells in result.rows}
    assert set(rows) == {"good.xml", "bad.xml", "sub/triangle.obj"}
    assert rows["good.xml"]["loads"] == rows["sub/triangle.obj"]["loads"] == "yes"
    assert "no surface" in str(rows["bad.xml"]["loads"])
    assert rows["bad.xml"]["judgement"] == "error"
    assert rows["sub/triangle.obj"]["triangles"] >= 1
    assert float(rows["good.xml"]["luminance"]) > 0.01
    opens, *_, crash = result.targets
    assert (opens.value, opens.ok, crash.value) == (pytest.approx(2 / 3), False, 0)
    if peer.installed():
        assert rows["good.xml"]["judgement"] == "agrees"
    entries = [json.loads(line) for line in kept.read_text().splitlines()]
    assert {entry["row"]["file"] for entry in entries} == set(rows)
    assert Image.open(sheet).size == contact_sheet([Row(**entry["row"]) for entry in entries]).size
    again = bench.run(folder, quick=True, json=kept)
    assert [cells[0] for cells in again.rows] == [cells[0] for cells in result.rows]
    assert len(kept.read_text().splitlines()) == len(entries), "nothing was done twice"


def test_a_sheet_without_pictures_is_still_a_picture(tmp_path):
    write_sheet(tmp_path / "none.png", [Row("a.xml", "complete", error="no")])
    assert Image.open(tmp_path / "none.png").size[0] > 0


def test_a_folder_that_is_none_is_refused_in_words(tmp_path):
    for folder in (None, tmp_path / "none"):
        with pytest.raises(SettingError, match="needs a folder"):
            bench.run(folder)
    with pytest.raises(SettingError, match="no complete scene file"):
        bench.run(tmp_path)


MEDIUM = (
    '<medium type="homogeneous" id="fog"><rgb name="sigmaA" value="1 3 2"/><rgb name="sigmaS" value="1 1 6"/></medium>'
)
CLOUD = '<shape type="sphere">{}<ref name="interior" id="fog"/></shape>'


def test_mitsuba_gets_clear_boundaries_of_old_files_media():
    """Before version 2 a shape with a medium and no BSDF lets light pass; in Mitsuba 3 it would be diffuse."""
    old = f'<scene version="0.5.0">{MEDIUM}{CLOUD.format("")}</scene>'
    assert as_of_3(old).count('<bsdf type="null"') == 1
    assert 'type="null"' not in as_of_3(old.replace("0.5.0", "3.0.0"))
    glass = f'<bsdf type="dielectric" id="g"/>{CLOUD.format("""<ref id="g"/>""")}'
    assert 'type="null"' not in as_of_3(f'<scene version="0.6.0">{MEDIUM}{glass}</scene>')


def test_mitsuba_gets_extinction_and_albedo_of_old_files_media():
    """Absorption and scattering of 1, 3, 2 and 1, 1, 6: extinction 2, 4, 8, of which a half, a quarter, three quarters
    scatter. Mitsuba 3 takes no colour above one, so the rest of it is in the scale."""
    props = {"sigma_a": (1, 3, 2), "sigma_s": (1, 1, 6), "scale": 0.5}
    by_extinction(SimpleNamespace(ScalarColor3f=np.array), props)
    assert sorted(props.keys()) == ["albedo", "scale", "sigma_t"]
    assert np.array(props["sigma_t"]) * props["scale"] == pytest.approx([1, 2, 4])
    assert np.array(props["albedo"]) == pytest.approx([0.5, 0.25, 0.75])


def test_mitsuba_gets_colours_of_old_files_in_linear_numbers():
    """IEC 61966-2-1: half of white is 0.21404."""
    text = '<bsdf><srgb name="reflectance" value="0.5 1, 0.04"/><lookAt origin="0 0 1"/></bsdf>'
    found = as_of_3(text)
    numbers = [float(word) for word in re.search(r'<rgb name="reflectance" value="([^"]*)"/>', found)[1].split()]
    assert numbers == pytest.approx([0.2140411, 1.0, 0.04 / 12.92], rel=1e-5)
    assert '<lookat origin="0 0 1"/>' in found
    assert as_of_3('<srgb name="radiance" value="#ff8000"/>') == '<srgb name="radiance" value="#ff8000"/>'
