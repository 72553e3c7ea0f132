"""Every file in tests/broken gives its one clear error or warning, and none hangs."""

import io
import os
from pathlib import Path

import pytest

from pmviewer.errors import SceneError
from pmviewer.scene.load import load_scene
from tests.scene.helpers import CAMERA, SKY, xml_file
from tests.support.marks import warnings_are_errors

BROKEN = Path(__file__).resolve().parent.parent / "broken"

# What the error says: the line (None where the format has none), then words that must be in it.
ERRORS: dict[str, tuple[int | None, tuple[str, ...]]] = {
    "compressed.gltf": (None, ("compressed",)),
    "deep_nesting.xml": (1, ("nested deeper than 64",)),
    "empty.xml": (1, ("The file is empty",)),
    "entity_bomb.xml": (2, ("entities", "refused")),
    "external_entity.xml": (2, ("entities", "refused")),
    "garbage.glb": (None, ("not a glTF file",)),
    "garbage.gltf": (None, ("not a glTF file",)),
    "garbage.obj": (None, ("no faces",)),
    "garbage.ply": (None, ("not a PLY file",)),
    "garbage.stl": (None, ("neither a binary nor a text STL",)),
    "garbage.xml": (1, ("not well-formed XML",)),
    "huge_accessor.gltf": (None, ("shows 333333333333333 triangles", "damaged")),
    "index_out_of_range.obj": (None, ("vertices that do not exist", "there are 3")),
    "index_out_of_range.ply": (None, ("Triangle 0", "does not exist", "there are 5")),
    "missing_buffer.gltf": (None, ("gone.bin", "does not exist", "Copy it")),
    "model.fbx": (None, ("'.fbx' can't be opened", ".glb")),
    "no_surface.xml": (None, ("no surface", "Add a <shape>")),
    "no_triangles.stl": (None, ("no triangle",)),
    "node_circle.gltf": (None, ("nodes contain each other in a circle",)),
    "not_a_scene.xml": (1, ("<html>", "expected <scene>")),
    "only_nan_vertices.ply": (None, ("no triangle", "3 × triangle with a NaN")),
    "only_unknown_shapes.xml": (None, ("no surface", "line 4", "sdfgrid")),
    "parameter_bomb.xml": (17, ("grows beyond 65536 characters",)),
    "truncated.glb": (None, ("cut off", "46 of 5000 bytes")),
    "truncated.ply": (None, ("fewer than 3 rows", "'face'", "complete")),
    "truncated.xml": (3, ("not well-formed XML", "complete")),
    "two_coordinates.obj": (None, ("three coordinates",)),
    "unknown_encoding.xml": (1, ("encoding", "UTF-8")),
    "zero_bytes.obj": (None, ("empty (0 bytes)",)),
    "zero_bytes.ply": (None, ("empty (0 bytes)",)),
}

# Files that open all the same: words of a warning, and what was dropped.
OPENS: dict[str, tuple[str, dict[str, int]]] = {
    "broken_number.xml": (
        "line 4: 'radius' of <shape type=\"sphere\">: expected a number, found '1.2.3'. The shape is",
        {},
    ),
    "camera_in_wall.xml": ("camera stands on the surface of 'rectangle", {}),
    "cyclic_default.xml": ("line 2: Parameter $b in <default> is not defined", {}),
    "duplicate_id.xml": ("line 5: The id 'wall' of <bsdf type=\"diffuse\"> is already taken in line 4", {}),
    "huge_number.xml": ("line 4: 'radius' of <shape type=\"sphere\">: expected a number between -1e+30 and 1e+30", {}),
    "huge_size.xml": ("can't be 2000000000 × 32 pixels", {}),
    "include.xml": ("line 4: <include> of '../secrets.xml' was refused", {}),
    "index_out_of_range.xml": (
        "line 4: Meshes that can't be used, whose shapes are left out: index_out_of_range.ply",
        {},
    ),
    "lookat_up_along_view.xml": ("line 2: <lookat>: 'up' is along the view", {}),
    "missing_mesh.xml": ("line 4: Files that do not exist", {}),
    "nan_number.xml": ("line 4: 'center' of <shape type=\"sphere\">: expected a number, found 'nan'", {}),
    "nan_vertices.ply": ("no light", {"triangle with a NaN, infinite or huge vertex": 2}),
    "no_light.xml": ("The file has no light: a soft light above it, a dim sky and a floor were added.", {}),
    "nan_vertices.xml": ("", {"triangle with a NaN, infinite or huge vertex": 2}),
    "negative_light.xml": ("line 4: 'radiance' of <emitter type=\"area\">: negative numbers", {"light of no power": 1}),
    "recursive_ref.xml": ('line 4: <bsdf type="twosided"> contains itself. A grey diffuse surface replaces it', {}),
    "singular_camera.xml": ('line 2: The to_world matrix of <sensor type="perspective"> is singular', {}),
    "unknown_bsdf.xml": ('line 4: <bsdf type="hair"> is not supported', {}),
    "unknown_ref.xml": ("line 4: <ref> refers to the id 'velvet', which is not defined: it was ignored", {}),
    "unknown_shape.xml": ('line 5: <shape type="sdfgrid"> is not supported', {}),
    "unsupported_light.xml": ('line 4: <emitter type="collimated">', {}),
    "zero_area_light.xml": ("The file has no light", {"zero-area light": 1}),
    "zero_radius.xml": ("", {"empty sphere": 1}),
    "zero_size.xml": ("can't be 0 × 32 pixels", {}),
}


def test_every_broken_file_has_its_expectation() -> None:
    assert {p.name for p in BROKEN.iterdir()} == ERRORS.keys() | OPENS.keys()


@pytest.mark.timeout(20)
@warnings_are_errors
@pytest.mark.parametrize("name", ERRORS)
def test_broken_file_gives_one_clear_error(name: str) -> None:
    line, words = ERRORS[name]
    with pytest.raises(SceneError) as caught:
        load_scene(BROKEN / name)
    assert caught.value.line == line
    for word in (name, *words):
        assert word in str(caught.value)


@pytest.mark.timeout(20)
@warnings_are_errors
@pytest.mark.parametrize("name", OPENS)
def test_odd_file_opens_and_says_so(name: str) -> None:
    words, dropped = OPENS[name]
    scene = load_scene(BROKEN / name)
    assert scene.dropped == dropped
    assert any(words in w for w in scene.warnings) if words else scene.warnings == ()


@pytest.mark.timeout(20)
@pytest.mark.parametrize("name", ["nothing_here", "nothing.xml", "", "a\0b", "x" * 5000])
def test_names_that_lead_nowhere(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SceneError):
        load_scene(name)


def test_unknown_name_lists_the_bundled_scenes() -> None:
    with pytest.raises(SceneError, match="cornell_caustic, cornell_diffuse"):
        load_scene("cornel_caustic")


@pytest.mark.parametrize("ending", [".ply", ".obj", ".stl", ".glb"])
@pytest.mark.parametrize("size", [84, 2000])
def test_a_file_that_can_be_opened_and_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str, size: int
) -> None:
    """As on a bad disk, or /proc/self/mem."""

    class Unreadable(io.BytesIO):
        def read(self, size: int | None = -1) -> bytes:
            raise OSError(5, "Input/output error")

    path = tmp_path / f"memory{ending}"
    path.write_bytes(bytes(size))
    monkeypatch.setattr("pmviewer.scene.formats.open_file.os.fdopen", lambda *args: Unreadable())
    with pytest.raises(SceneError, match=r"can't be read: Input/output error\."):
        load_scene(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
@pytest.mark.timeout(20)
def test_pipes_and_devices_are_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.ply")
    with pytest.raises(SceneError, match="not a regular file"):
        load_scene(tmp_path / "pipe.ply")
    mesh = '<shape type="ply"><string name="filename" value="{}"/></shape>'
    for name in ("pipe.ply", "/dev/zero"):
        with pytest.raises(SceneError, match="does not exist"):
            load_scene(xml_file(tmp_path, mesh.format(name), CAMERA, SKY))


@pytest.mark.timeout(60)
def test_every_cut_of_a_binary_mesh_opens_or_raises(tmp_path: Path) -> None:
    whole = (BROKEN.parent.parent / "scenes/cornell_caustic/meshes/red.ply").read_bytes()
    path = tmp_path / "cut.ply"
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(SceneError):
            load_scene(path)
    path.write_bytes(whole)
    assert [shape.name for shape in load_scene(path).shapes[1:]] == ["light above", "floor"]


POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:5e07\nsize 16471\n"


@pytest.mark.parametrize("name", ["a.obj", "a.ply", "a.stl", "a.gltf", "a.glb"])
def test_files_that_git_lfs_has_not_fetched(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(POINTER)
    with pytest.raises(SceneError, match=r"was not downloaded.*Git LFS.*git lfs pull"):
        load_scene(tmp_path / name)


def test_what_a_scene_names_and_git_lfs_has_not_fetched(tmp_path: Path) -> None:
    for name in ("a.obj", "a.png", "sky.exr", "sky.png"):
        (tmp_path / name).write_bytes(POINTER)
    scene = load_scene(
        xml_file(
            tmp_path,
            '<shape type="sphere"><bsdf type="diffuse"><texture type="bitmap" name="reflectance">',
            '<string name="filename" value="a.png"/></texture></bsdf></shape>',
            '<shape type="obj"><string name="filename" value="a.obj"/></shape>',
            '<emitter type="envmap"><string name="filename" value="sky.exr"/></emitter>',
            '<emitter type="envmap"><string name="filename" value="sky.png"/></emitter>',
            CAMERA,
        )
    )
    for name in ("a.obj", "a.png", "sky.exr", "sky.png"):
        assert any(name in w and "Git LFS" in w for w in scene.warnings), (name, scene.warnings)
