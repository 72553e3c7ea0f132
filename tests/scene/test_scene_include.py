"""<include>, <path> and where files are looked for."""

import os
from pathlib import Path

import pytest

from pmviewer.errors import SceneError
from pmviewer.scene.diagnostics import shortened
from pmviewer.scene.load import load_scene
from tests.scene.helpers import CAMERA, SKY, load, xml_file

CUBE = '<shape type="cube"/>'
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
MESH = '<shape type="obj"><string name="filename" value="{}"/></shape>'


def write(path: Path, *lines: str, version: str = "3.0.0") -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'<scene version="{version}">\n' + "\n".join(lines) + "\n</scene>\n", "utf-8")


def test_what_is_included_stands_in_its_place(tmp_path: Path) -> None:
    write(tmp_path / "parts/more.xml", '<include filename="deeper/one.xml"/>', '<shape type="disk"/>')
    write(
        tmp_path / "parts/deeper/one.xml", '<bsdf type="diffuse" id="m"><rgb name="reflectance" value="0.25"/></bsdf>'
    )
    scene = load(tmp_path, CUBE, '<include filename="parts/more.xml"/>', '<shape type="sphere"><ref id="m"/></shape>')
    assert [shape.name for shape in scene.shapes] == ["cube (line 2)", "disk (line 3)", "sphere (line 4)"]
    assert scene.materials[scene.shapes[2].material].reflectance == (0.25, 0.25, 0.25)
    assert scene.warnings == ()


def test_parameters_go_both_ways(tmp_path: Path) -> None:
    write(
        tmp_path / "part_a.xml",
        '<default name="after" value="3"/>',
        '<default name="before" value="9"/>',
        '<shape type="sphere"><float name="radius" value="$before"/></shape>',
    )
    lines = (
        '<default name="which" value="a"/>',
        '<default name="before" value="2"/>',
        '<include filename="part_$which.xml"/>',
        '<shape type="sphere"><float name="radius" value="$after"/></shape>',
    )
    assert [shape.geometry.radius for shape in load(tmp_path, *lines).shapes] == [2, 3]
    assert [shape.geometry.radius for shape in load(tmp_path, *lines, after="5").shapes] == [2, 5]


def test_an_included_object_that_is_no_scene(tmp_path: Path) -> None:
    (tmp_path / "ball.xml").write_text('<shape version="3.0.0" type="sphere"/>', "utf-8")
    scene = load(tmp_path, '<include filename="ball.xml"/>')
    assert [shape.name for shape in scene.shapes] == ["sphere (line 1)"]


def test_warnings_and_errors_name_the_included_file(tmp_path: Path) -> None:
    write(tmp_path / "part.xml", CUBE.replace("/>", '><float name="glow" value="1"/></shape>'))
    scene = load(tmp_path, '<include filename="part.xml"/>')
    assert scene.warnings == ("line 2 of part.xml: 'glow' of <shape type=\"cube\"> is not supported and was ignored.",)
    write(tmp_path / "part.xml", MESH.format("gone.obj"))
    with pytest.raises(SceneError) as caught:
        load(tmp_path, '<include filename="part.xml"/>')
    assert caught.value.path == tmp_path / "part.xml"
    assert caught.value.line == 2


def test_each_file_has_its_own_version(tmp_path: Path) -> None:
    write(
        tmp_path / "old.xml", '<shape type="sphere"><boolean name="flipNormals" value="true"/></shape>', version="0.6.0"
    )
    scene = load(tmp_path, '<include filename="old.xml"/>', CUBE)
    assert scene.shapes[0].geometry.flip_normals
    assert scene.warnings == ()


def test_circles_and_endless_chains_are_errors(tmp_path: Path) -> None:
    write(tmp_path / "a.xml", '<include filename="b.xml"/>')
    write(tmp_path / "b.xml", '<include filename="a.xml"/>')
    with pytest.raises(SceneError, match=r"a\.xml includes itself, over 3 files"):
        load(tmp_path, CUBE, '<include filename="a.xml"/>')
    for i in range(30):
        write(tmp_path / f"chain{i}.xml", f'<include filename="chain{i + 1}.xml"/>')
    with pytest.raises(SceneError, match="more than 15 deep"):
        load(tmp_path, CUBE, '<include filename="chain0.xml"/>')


@pytest.mark.timeout(20)
def test_included_files_can_not_multiply(tmp_path: Path) -> None:
    for i in range(12):
        write(tmp_path / f"d{i}.xml", *[f'<include filename="d{i + 1}.xml"/>'] * 4)
    write(tmp_path / "d12.xml", CUBE)
    with pytest.raises(SceneError, match="More than 1000 files"):
        load(tmp_path, '<include filename="d0.xml"/>')


def test_broken_and_missing_files_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "bad.xml").write_text("<scene>\n<oops", "utf-8")
    scene = load(tmp_path, CUBE, '<include filename="bad.xml"/>', '<include filename="gone.xml"/>')
    assert len(scene.shapes) == 1
    assert scene.warnings[0].startswith("line 3: bad.xml can't be included (line 2): This is not well-formed XML")
    assert "Files that do not exist" in scene.warnings[1]
    assert "gone.xml" in scene.warnings[1]


def test_files_outside_of_the_folder_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "secrets/part.xml", CUBE)
    home = tmp_path / "home"
    home.mkdir()
    (home / "link.xml").symlink_to(tmp_path / "secrets/part.xml")
    (home / "folder").symlink_to(tmp_path / "secrets")
    names = ("../secrets/part.xml", str(tmp_path / "secrets/part.xml"), "link.xml", "folder/part.xml", "../none.xml")
    for name in names:
        scene = load(home, CUBE, f'<include filename="{name}"/>')
        assert len(scene.shapes) == 1
        assert f"line 3: <include> of '{shortened(name)}' was refused" in scene.warnings[0]
        assert len(shortened(name)) <= 121
        if name != "../none.xml":
            assert str(tmp_path / "secrets/part.xml") in scene.warnings[0]
        allowed = load_scene(
            xml_file(home, CUBE, f'<include filename="{name}"/>', CAMERA, SKY), {}, [tmp_path / "secrets"]
        )
        assert len(allowed.shapes) == (1 if name == "../none.xml" else 2)


def test_path_names_folders_to_search(tmp_path: Path) -> None:
    write(tmp_path / "common/xml/part.xml", MESH.format("meshes/t.obj"))
    (tmp_path / "common/meshes").mkdir()
    (tmp_path / "common/meshes/t.obj").write_text(TRIANGLE, "utf-8")
    home = tmp_path / "home"
    home.mkdir()
    for where in ("../common", str(tmp_path / "common"), "$folder"):
        lines = (
            '<default name="folder" value="../common"/>',
            f'<path value="{where}"/>',
            '<include filename="xml/part.xml"/>',
        )
        scene = load(home, *lines)
        assert [shape.name for shape in scene.shapes] == ["t (line 2)"]
        assert scene.warnings == ()
    scene = load(home, CUBE, '<path value="nowhere"/>')
    assert scene.warnings == ("line 3: The folder 'nowhere' that <path> names does not exist: it was ignored.",)


def test_path_is_not_too_wide(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "users/me")
    (tmp_path / "users/me/scenes").mkdir(parents=True)
    for wide in ("/", "..", "../..", str(tmp_path)):
        scene = load(tmp_path / "users/me/scenes", CUBE, f'<path value="{wide}"/>')
        assert "was refused" in scene.warnings[0], wide
        assert repr(wide) in scene.warnings[0]


def test_search_paths_of_the_user(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/t.obj").write_text(TRIANGLE, "utf-8")
    (tmp_path / "home").mkdir()
    path = xml_file(tmp_path / "home", MESH.format("t.obj"), CAMERA, SKY)
    with pytest.raises(SceneError, match=r"t\.obj.*does not exist"):
        load_scene(path)
    assert len(load_scene(path, {}, [tmp_path / "meshes"]).shapes) == 1


def test_full_paths_of_another_machine_are_found_by_their_end(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/t.obj").write_text(TRIANGLE, "utf-8")
    for name in (r"C:\Users\me\scene\meshes\t.obj", "/home/someone/scene/meshes/t.obj", r"meshes\t.obj"):
        assert len(load(tmp_path, MESH.format(name)).shapes) == 1


def test_missing_files_are_one_warning(tmp_path: Path) -> None:
    scene = load(tmp_path, CUBE, *[MESH.format(f"gone{i}.obj") for i in range(20)], MESH.format("gone0.obj"))
    assert len(scene.shapes) == 1
    (warning,) = scene.warnings
    assert "gone0.obj, gone1.obj" in warning
    assert "gone11.obj and 8 more" in warning
    assert warning.startswith("lines 3, 4, 5, 6, 7 and 16 more")


def test_broken_meshes_are_one_warning(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_text("not a mesh", "utf-8")
    (tmp_path / "b.serialized").write_bytes(b"")
    shapes = [MESH.format(n).replace('"obj"', f'"{n[2:]}"') for n in ("a.ply", "b.serialized", "a.ply")]
    (warning,) = load(tmp_path, CUBE, *shapes).warnings
    assert warning.startswith(
        "lines 3, 4, 5: Meshes that can't be used, whose shapes are left out: a.ply (This is not a PLY"
    )
    assert "b.serialized (This is not a .serialized file" in warning


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
@pytest.mark.timeout(10)
def test_pipes_are_not_included(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.xml")
    assert "pipe.xml" in load(tmp_path, CUBE, '<include filename="pipe.xml"/>').warnings[0]


def test_a_long_name_is_cut(tmp_path: Path) -> None:
    (warning,) = load(tmp_path, CUBE, f'<include filename="{"a" * 5000}.xml"/>').warnings
    assert len(warning) < 400
    assert "aaaa.xml" in warning
