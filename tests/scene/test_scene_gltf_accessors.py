"""How glTF stores numbers: strides, integers, sparse and missing data; sizes are checked before they are used."""

import base64
import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.scene.load import load_scene
from tests.scene.gltf_files import TRIANGLE, Gltf, corners, meshes

QUAD = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]


def only(path: Path):
    (mesh,) = meshes(load_scene(path))
    return mesh


def test_interleaved_attributes(tmp_path: Path) -> None:
    f = Gltf()
    rows = np.concatenate([TRIANGLE, np.tile([0, 0, 1], (3, 1)), [[0, 0], [0.5, 0], [0, 0.25]]], axis=1)
    view = f.view(rows.astype("<f4").tobytes(), byteStride=32)
    attributes = {
        "POSITION": f.accessor(3, "f", 3, bufferView=view),
        "NORMAL": f.accessor(3, "f", 3, bufferView=view, byteOffset=12),
        "TEXCOORD_0": f.accessor(3, "f", 2, bufferView=view, byteOffset=24),
    }
    f.mesh(attributes)
    mesh = only(f.write(tmp_path))
    assert corners(mesh) == [TRIANGLE.tolist()]
    assert mesh.normals.tolist() == [[0, 0, 1]] * 3
    assert mesh.uv.tolist() == [[0, 0], [0.5, 0], [0, 0.25]]


def test_quantized_integers(tmp_path: Path) -> None:
    f = Gltf(extensionsRequired=["KHR_mesh_quantization"])
    attributes = {
        "POSITION": f.array([[0, 0, 0], [1000, 0, 0], [0, -500, 0]], "h"),
        "NORMAL": f.array([[0, 0, 127], [0, 0, 127], [0, 0, 127]], "b", normalized=True),
        "TEXCOORD_0": f.array([[0, 0], [65535, 0], [0, 13107]], "H", normalized=True),
        "COLOR_0": f.array([[255, 0, 51], [0, 0, 0], [0, 0, 255]], "B", normalized=True),
    }
    f.mesh(attributes)
    scene = load_scene(f.write(tmp_path, nodes=[{"mesh": 0, "scale": [0.001] * 3}]))
    (mesh,) = meshes(scene)
    assert corners(mesh) == [[[0, 0, 0], [1, 0, 0], [0, -0.5, 0]]]
    assert mesh.normals == pytest.approx(np.tile([0, 0, 1.0], (3, 1)))
    assert mesh.uv == pytest.approx(np.array([[0, 0], [1, 0], [0, 0.2]]))
    assert mesh.colours == pytest.approx(np.array([[1, 0, 0.2], [0, 0, 0], [0, 0, 1]]))
    assert scene.materials[scene.shapes[0].material].vertex_colours
    assert not any("extension" in w for w in scene.warnings)


@pytest.mark.parametrize("component", ["B", "H", "I"])
def test_indices_of_every_width(tmp_path: Path, component: str) -> None:
    f = Gltf()
    f.mesh({"attributes": {"POSITION": f.array(QUAD)}, "indices": f.array([0, 1, 2, 2, 1, 3, 0], component)})
    assert corners(only(f.write(tmp_path))) == [[QUAD[0], QUAD[1], QUAD[2]], [QUAD[2], QUAD[1], QUAD[3]]]


@pytest.mark.parametrize("indexed", [False, True])
@pytest.mark.parametrize(
    ("mode", "expected"),
    [(4, [[0, 1, 2]]), (5, [[0, 1, 2], [1, 3, 2]]), (6, [[1, 2, 0], [2, 3, 0]])],
)
def test_lists_strips_and_fans(tmp_path: Path, mode: int, expected: list, indexed: bool) -> None:
    f = Gltf()
    more = {"indices": f.array([0, 1, 2, 3], "H")} if indexed else {}
    f.mesh({"attributes": {"POSITION": f.array(QUAD)}, "mode": mode, **more})
    assert corners(only(f.write(tmp_path))) == [[QUAD[i] for i in face] for face in expected]


def test_points_and_lines_are_left_out(tmp_path: Path) -> None:
    f = Gltf()
    position = f.array(TRIANGLE)
    modes = [{"attributes": {"POSITION": position}, "mode": mode} for mode in (0, 1, 2, 3, 4)]
    f.mesh([*modes, {"attributes": {"NORMAL": position}}])
    scene = load_scene(f.write(tmp_path))
    assert len(meshes(scene)) == 1
    assert sum("Points, lines" in w for w in scene.warnings) == 1


def test_sparse_accessor_changes_some_items(tmp_path: Path) -> None:
    f = Gltf()
    where, what = f.view(np.array([2], "<u2").tobytes()), f.view(np.array([[0, 7, 0]], "<f4").tobytes())
    change = {
        "count": 1, "indices": {"bufferView": where, "componentType": 5123}, "values": {"bufferView": what}
    }  # fmt: skip
    view = f.view(TRIANGLE.tobytes())
    f.mesh({"POSITION": f.accessor(3, "f", 3, bufferView=view, sparse=change)})
    assert corners(only(f.write(tmp_path))) == [[[0, 0, 0], [1, 0, 0], [0, 7, 0]]]


def test_an_accessor_without_a_view_is_zeros_with_sparse_changes(tmp_path: Path) -> None:
    f = Gltf()
    where = f.view(np.array([1, 2], np.uint8).tobytes())
    what = f.view(np.array([[4, 0, 0], [0, 5, 0]], "<f4").tobytes())
    change = {
        "count": 2, "indices": {"bufferView": where, "componentType": 5121}, "values": {"bufferView": what}
    }  # fmt: skip
    f.mesh({"POSITION": f.accessor(3, "f", 3, sparse=change)})
    assert corners(only(f.write(tmp_path))) == [[[0, 0, 0], [4, 0, 0], [0, 5, 0]]]


def test_primitives_that_share_vertices_keep_their_own_only(tmp_path: Path) -> None:
    f = Gltf()
    position = f.array(np.concatenate([TRIANGLE + [0, 0, i] for i in range(100)]))
    f.mesh({"attributes": {"POSITION": position}, "indices": f.array([297, 298, 299], "H")})
    mesh = only(f.write(tmp_path))
    assert len(mesh.vertices) == 3
    assert corners(mesh) == [(TRIANGLE + [0, 0, 99]).tolist()]


@pytest.mark.parametrize("uri", ["base64", "percent", "file", "file with a space"])
def test_buffers_beside_the_file_and_in_it(tmp_path: Path, uri: str) -> None:
    f = Gltf()
    f.triangle()
    name = "a file.bin" if " " in uri else "b.bin"
    (tmp_path / name).write_bytes(f.data)
    uris = {
        "base64": "data:application/octet-stream;base64," + base64.b64encode(f.data).decode(),
        "percent": "data:application/gltf-buffer," + "".join(f"%{b:02x}" for b in f.data),
    }
    f.header["buffers"] = [{"uri": uris.get(uri, name.replace(" ", "%20")), "byteLength": len(f.data)}]
    f.data = b""
    assert corners(only(f.write(tmp_path, "a.gltf"))) == [TRIANGLE.tolist()]


BROKEN = {
    "no data for 10^6 items": ({"count": 10**6}, "claims 1000000 items and has no data"),
    "no data for 10^8 items": ({"count": 10**8}, "33333333 triangles"),
    "no data for 10^30 items": ({"count": 10**30}, "shows 3333333333"),
    "a negative count": ({"count": -1}, "claims -1 items"),
    "a count that is no number": ({"count": "many"}, "claims many items"),
    "an unknown type": ({"type": "VEC9"}, "VEC9"),
    "a matrix": ({"type": "MAT4"}, "MAT4"),
    "an unknown component type": ({"componentType": 1}, "component type 1"),
    "more items than bytes": ({"bufferView": 0, "count": 4}, "claims 4 items of 12 bytes"),
    "an offset beyond the view": ({"bufferView": 0, "byteOffset": 4}, "from byte 4 on"),
    "a negative offset": ({"bufferView": 0, "byteOffset": -4}, "from byte -4 on"),
    "a view that does not exist": ({"bufferView": 9}, "refers to buffer view 9"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_claims_are_checked_before_memory_is_taken(tmp_path: Path, case: str) -> None:
    row, words = BROKEN[case]
    f = Gltf()
    f.view(TRIANGLE.tobytes())
    f.header["accessors"].append({"componentType": 5126, "count": 3, "type": "VEC3", **row})
    f.mesh({"POSITION": 0})
    path = f.write(tmp_path)
    tracemalloc.start()
    with pytest.raises(SceneError, match=words) as caught:
        load_scene(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6
    assert caught.value.path == path


@pytest.mark.parametrize(
    ("view", "words"),
    [
        ({"byteLength": 10**12}, "but its buffer has 36"),
        ({"byteOffset": 1, "byteLength": 36}, "36 bytes from 1 on"),
        ({"byteOffset": -1, "byteLength": 36}, "36 bytes from -1 on"),
        ({"byteLength": 36, "byteStride": 1}, "claims 3 items"),
        ({"byteLength": 36, "buffer": 3}, "refers to buffer 3"),
    ],
)
def test_views_stay_inside_their_buffer(tmp_path: Path, view: dict, words: str) -> None:
    f = Gltf()
    f.triangle()
    f.header["bufferViews"][0] = view
    with pytest.raises(SceneError, match=words):
        load_scene(f.write(tmp_path))


@pytest.mark.parametrize(
    ("buffer", "words"),
    [
        ({"uri": "gone.bin", "byteLength": 36}, "'gone.bin' does not exist. Copy it"),
        ({"uri": "short.bin", "byteLength": 36}, "cut off: 10 of 36 bytes"),
        ({"uri": "https://example.org/a.bin", "byteLength": 36}, "nothing is downloaded"),
        ({"uri": "data:;base64,@", "byteLength": 36}, "base64|cut off"),
        ({"uri": 7, "byteLength": 36}, "no file name"),
        ({"uri": "a\0b", "byteLength": 36}, "does not exist"),
        ({"byteLength": 36}, "is not in the file"),
    ],
)
def test_buffers_that_are_missing_or_too_short(tmp_path: Path, buffer: dict, words: str) -> None:
    (tmp_path / "short.bin").write_bytes(b"0" * 10)
    f = Gltf(buffers=[buffer])
    f.triangle()
    f.data = b""
    with pytest.raises(SceneError, match=words):
        load_scene(f.write(tmp_path, "a.gltf"))


def test_indices_without_a_vertex(tmp_path: Path) -> None:
    f = Gltf()
    f.triangle(indices=f.array([0, 1, 3], "H"))
    with pytest.raises(SceneError, match=r"mesh 0 uses vertex 3, which does not exist \(there are 3\)"):
        load_scene(f.write(tmp_path))


def test_attributes_of_different_lengths(tmp_path: Path) -> None:
    f = Gltf()
    f.triangle(attributes={"NORMAL": f.array([[0, 0, 1]])})
    with pytest.raises(SceneError, match="not of one length"):
        load_scene(f.write(tmp_path))


def test_a_small_file_cannot_ask_for_many_triangles(tmp_path: Path) -> None:
    f = Gltf()
    f.header["materials"] = [{"emissiveFactor": [1, 1, 1]}]  # lights are written out
    position = f.array(np.random.default_rng(0).uniform(size=(300, 3)))
    f.mesh([{"attributes": {"POSITION": position}, "material": 0}] * 1000)
    with pytest.raises(SceneError, match="shows 100000000 triangles"):
        load_scene(f.write(tmp_path, nodes=[{"mesh": 0}] * 1000))


@pytest.mark.parametrize("text", ["[]", '{"asset": []}', '{"asset": {"version": "1.0"}}', "{"])
def test_json_that_is_no_gltf(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.gltf").write_text(text)
    with pytest.raises(SceneError, match=r"glTF"):
        load_scene(tmp_path / "a.gltf")


@pytest.mark.parametrize("kind", ["nodes", "meshes", "accessors", "materials", "textures"])
@pytest.mark.parametrize("value", [7, {"a": 1}, [1], None, "x"])
def test_lists_that_are_none(tmp_path: Path, kind: str, value) -> None:
    f = Gltf()
    f.triangle()
    path = f.write(tmp_path, "a.gltf", **{kind: value})
    with pytest.raises(SceneError, match=f"'{kind}' are not a list of objects"):
        load_scene(path)
    assert json.loads(path.read_text())[kind] == value
