"""Nodes of glTF files: trees, copies, skins, morph targets, animations, cameras, scenes."""

import math
from pathlib import Path

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.render.camera import resolve_camera
from pmviewer.scene.formats.gltf.shared import _condition
from pmviewer.scene.load import load_scene
from pmviewer.settings.access import CameraSettings
from tests.scene.gltf_files import TRIANGLE, Gltf, corners, meshes

HALF = math.sqrt(0.5)


def simple(**parts) -> Gltf:
    f = Gltf(**parts)
    f.triangle()
    return f


def places(scene) -> list:
    """First corner of each mesh."""
    return [np.round(mesh.vertices[mesh.faces[0, 0]], 5).tolist() for mesh in meshes(scene)]


@pytest.mark.parametrize("name", ["a.glb", "a.gltf"])
def test_transformations_of_nodes(tmp_path: Path, name: str) -> None:
    nodes = [
        {"children": [1], "translation": [0, 0, 5]},
        {"mesh": 0, "rotation": [0, 0, 2 * HALF, 2 * HALF], "scale": [2, 2, 2]},  # not of unit length: scaled to it
    ]
    f = simple()
    f.header["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = f.array([[0, 0, 1]] * 3)
    if name.endswith(".gltf"):
        f.header["buffers"] = [{"uri": "b.bin", "byteLength": len(f.data)}]
        (tmp_path / "b.bin").write_bytes(f.data)
    (mesh,) = meshes(load_scene(f.write(tmp_path, name, nodes=nodes, scenes=[{"nodes": [0]}])))
    # Scaled by two, turned by 90° about z, moved along z.
    assert corners(mesh) == [[[0, 0, 5], [0, 2, 5], [-2, 0, 5]]]
    assert mesh.normals == pytest.approx(np.tile([0, 0, 1], (3, 1)))


def test_a_mirroring_node_keeps_the_front_in_front(tmp_path: Path) -> None:
    f = simple()
    (mesh,) = meshes(load_scene(f.write(tmp_path, nodes=[{"mesh": 0, "scale": [-1, 1, 1]}])))
    a, b, c = mesh.vertices[mesh.faces[0]]
    assert np.cross(b - a, c - a)[2] > 0


def test_matrices_and_meshes_used_twice(tmp_path: Path) -> None:
    matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 8, 9, 1]
    scene = load_scene(simple().write(tmp_path, nodes=[{"mesh": 0}, {"mesh": 0, "matrix": matrix}]))
    assert places(scene) == [[0, 0, 0], [7, 8, 9]]


@pytest.mark.parametrize("emits", [False, True])
def test_shared_meshes_become_instances_where_that_saves_memory(tmp_path: Path, monkeypatch, emits: bool) -> None:
    monkeypatch.setattr("pmviewer.scene.formats.gltf.shared.FEWEST_SAVED", 2)
    f = Gltf(materials=[{"emissiveFactor": [1, 1, 1]} if emits else {}])
    f.triangle(material=0)
    nodes = [{"mesh": 0, "translation": [3 * i, 0, 0], "name": f"tri {i}"} for i in range(3)]
    path = f.write(tmp_path, nodes=[*nodes, {"mesh": 0, "scale": [1, 1, 0]}])  # a flat node can't be an instance
    scene = load_scene(path)
    if emits:  # nor can a light
        assert scene.instances == ()
        assert len(meshes(scene)) == 4
        return
    assert [i.name for i in scene.instances] == ["tri 0", "tri 1", "tri 2"]
    assert len(scene.groups) == len(meshes(scene)) == 1
    assert [i.to_world[0, 3] for i in scene.instances] == [0, 3, 6]
    monkeypatch.setattr("pmviewer.scene.formats.gltf.shared.FEWEST_SAVED", 4)
    alone = load_scene(path)
    assert alone.instances == ()
    assert alone.camera == scene.camera


def test_thousands_of_copies_that_are_no_instances_are_one_shape(tmp_path: Path, monkeypatch) -> None:
    """The same triangles, normals and coordinates as apart; mirrored and squeezed ones too. A shape a primitive."""
    places = [{"translation": [3, 0, 0]}, {"scale": [-1, 2, 1], "rotation": [0, 0.6, 0, 0.8]}, {"scale": [1, 1, 0]}]
    f = Gltf(materials=[{"emissiveFactor": [1, 1, 1]}, {}])
    attributes = {
        "POSITION": f.array(TRIANGLE),
        "NORMAL": f.array([[0, 0.6, 0.8]] * 3),
        "TEXCOORD_0": f.array(TRIANGLE[:, :2]),
    }
    f.mesh([{"attributes": attributes, "material": i} for i in range(2)])
    path = f.write(tmp_path, nodes=[{"mesh": 0, **place} for place in places])
    apart = meshes(load_scene(path))
    monkeypatch.setattr("pmviewer.scene.formats.gltf.load.MOST_APART", 2)
    scene = load_scene(path)
    assert [shape.radiance for shape in scene.shapes[:2]] == [(1.0, 1.0, 1.0), None]
    for i, joined in enumerate(meshes(scene)):
        own = apart[i::2]
        assert corners(joined) == [triangle for mesh in own for triangle in corners(mesh)]
        for name in ("normals", "uv"):
            together = np.concatenate([getattr(mesh, name)[mesh.faces] for mesh in own])
            np.testing.assert_allclose(getattr(joined, name)[joined.faces], together, atol=1e-12)


def test_copies_of_gpu_instancing(tmp_path: Path) -> None:
    f = simple(extensionsUsed=["EXT_mesh_gpu_instancing"])
    attributes = {
        "TRANSLATION": f.array([[1, 0, 0], [2, 0, 0]]),
        "ROTATION": f.array([[0, 0, 0, 32767], [0, 0, 32767, 0]], "h", normalized=True),
    }
    node = {"mesh": 0, "translation": [0, 5, 0], "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}
    scene = load_scene(f.write(tmp_path, nodes=[node]))
    first, second = meshes(scene)
    assert corners(first) == [[[1, 5, 0], [2, 5, 0], [1, 6, 0]]]
    assert corners(second) == [[[2, 5, 0], [1, 5, 0], [2, 4, 0]]]  # turned by 180° about z
    assert not any("extension" in w for w in scene.warnings)


def test_deep_trees_are_no_circles(tmp_path: Path) -> None:
    depth = 5000
    nodes = [{"children": [i + 1], "translation": [1, 0, 0]} for i in range(depth)] + [{"mesh": 0}]
    assert places(load_scene(simple().write(tmp_path, nodes=nodes, scenes=[{"nodes": [0]}]))) == [[depth, 0, 0]]


def test_a_node_with_two_parents_is_shown_twice(tmp_path: Path) -> None:
    nodes = [{"children": [2]}, {"children": [2], "translation": [3, 0, 0]}, {"mesh": 0}]
    assert places(load_scene(simple().write(tmp_path, nodes=nodes, scenes=[{"nodes": [0, 1]}]))) == [[0] * 3, [3, 0, 0]]


@pytest.mark.parametrize("children", [[[0]], [[1], [0]], [[1], [2], [1]]])
def test_circles_are_named(tmp_path: Path, children: list) -> None:
    nodes = [{"children": c, "mesh": 0} for c in children]
    with pytest.raises(SceneError, match="contain each other in a circle"):
        load_scene(simple().write(tmp_path, nodes=nodes, scenes=[{"nodes": [0]}]))


@pytest.mark.timeout(10)
def test_a_small_file_cannot_ask_for_many_nodes(tmp_path: Path) -> None:
    nodes = [{"children": [i + 1, i + 1]} for i in range(200)] + [{"mesh": 0}]
    with pytest.raises(SceneError, match="one parent at most"):
        load_scene(simple().write(tmp_path, nodes=nodes, scenes=[{"nodes": [0]}]))


def test_too_many_nodes_are_refused_before_they_are_walked(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("pmviewer.scene.formats.gltf.nodes.MOST_NODES", 10)
    with pytest.raises(SceneError, match="has 11 nodes; 10 is the most"):
        load_scene(simple().write(tmp_path, nodes=[{"mesh": 0}] * 11))


@pytest.mark.parametrize(
    ("nodes", "words"),
    [
        ([{"mesh": 5}], "refers to mesh 5, but the file has 1"),
        ([{"children": [7]}], "names node 7, but the file has 1"),
        ([{"mesh": 0, "translation": [1, 2]}], "not given by usable numbers"),
        ([{"mesh": 0, "matrix": list("abcdefghijklmnop")}], "not given by usable numbers"),
        ([{"mesh": 0, "scale": [math.inf, 1, 1]}], "not given by usable numbers"),
    ],
)
def test_damaged_nodes(tmp_path: Path, nodes: list, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        load_scene(simple().write(tmp_path, nodes=nodes))


def test_hidden_nodes_are_left_out(tmp_path: Path) -> None:
    hidden = {"KHR_node_visibility": {"visible": False}}
    nodes = [{"mesh": 0}, {"children": [2], "extensions": hidden}, {"mesh": 0, "translation": [1, 0, 0]}]
    scene = load_scene(simple().write(tmp_path, nodes=nodes, scenes=[{"nodes": [0, 1]}]))
    assert places(scene) == [[0, 0, 0]]
    assert any("hides" in w for w in scene.warnings)


def test_the_default_scene_or_the_one_that_is_wanted(tmp_path: Path) -> None:
    nodes = [{"mesh": 0}, {"mesh": 0, "translation": [1, 0, 0]}, {"mesh": 0, "translation": [2, 0, 0]}]
    path = simple().write(
        tmp_path, nodes=nodes, scene=1, scenes=[{"nodes": [0]}, {"nodes": [1]}, {"nodes": [2], "name": "last"}]
    )
    scene = load_scene(path)
    assert places(scene) == [[1, 0, 0]]
    assert any("3 scenes" in w for w in scene.warnings)
    assert places(load_scene(path, {"scene": "0"})) == [[0, 0, 0]]
    assert places(load_scene(path, {"scene": "last"})) == [[2, 0, 0]]
    with pytest.raises(SceneError, match=r"no scene 'x'. It has 0, 1, 2 \(last\)"):
        load_scene(path, {"scene": "x"})
    assert any("'colour'" in w for w in load_scene(path, {"colour": "red"}).warnings)


def test_without_scenes_all_nodes_that_have_no_parent_are_shown(tmp_path: Path) -> None:
    nodes = [{"children": [1], "translation": [4, 0, 0]}, {"mesh": 0}]
    assert places(load_scene(simple().write(tmp_path, nodes=nodes, scenes=[]))) == [[4, 0, 0]]


def test_cameras_the_first_or_the_one_that_is_wanted(tmp_path: Path) -> None:
    cameras = [
        {"type": "perspective", "perspective": {"yfov": math.pi / 2, "aspectRatio": 2, "znear": 0.1}},
        {"type": "orthographic", "name": "plan", "orthographic": {"xmag": 3, "ymag": 1.5, "znear": 0.1, "zfar": 50}},
    ]
    nodes = [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 3]}, {"camera": 1, "rotation": [-HALF, 0, 0, HALF]}]
    path = simple().write(tmp_path, nodes=nodes, cameras=cameras)
    scene = load_scene(path)
    assert (scene.width, scene.height) == (1024, 512)
    # 90° vertically from z = 3: the point (0, 3, 0) is on the upper edge, +x to the right.
    projected = resolve_camera(scene, CameraSettings()).project(np.array([[0, 3, 0], [3, 0, 0]], float))
    assert projected[:, :2] == pytest.approx(np.array([[512, 0], [768, 256]]), abs=1e-6)
    assert any("several cameras (-D camera=…): 0 (node 1), 1 (plan)" in w for w in scene.warnings)
    plan = load_scene(path, {"camera": "plan"}).camera
    assert (plan.projection, plan.width, plan.near, plan.far) == ("orthographic", 6, 0.1, 50)
    assert np.subtract(plan.target, plan.origin)[1] < 0  # turned by −90° about x it looks down
    assert load_scene(path, {"camera": "1"}).camera == plan
    with pytest.raises(SceneError, match=r"no camera '2'. It has 0 \(node 1\), 1 \(plan\)"):
        load_scene(path, {"camera": "2"})


def test_cameras_that_cannot_be_used_are_left_out(tmp_path: Path) -> None:
    cameras = [{"type": "fisheye"}, {"type": "perspective", "perspective": {"yfov": 99}}]
    nodes = [{"mesh": 0}, {"camera": 0}, {"camera": 1, "scale": [0, 0, 0]}, {"camera": 1}]
    scene = load_scene(simple().write(tmp_path, nodes=nodes, cameras=cameras))
    assert scene.camera.fov == pytest.approx(179)
    assert sum("is left out" in w for w in scene.warnings) == 2


def test_morph_targets_by_the_node_the_mesh_and_the_animation(tmp_path: Path) -> None:
    f = Gltf()
    targets = [{"POSITION": f.array([[0, 0, 1]] * 3)}, {"POSITION": f.array([[10, 0, 0]] * 3)}]
    f.triangle(targets=targets)
    f.header["meshes"][0]["weights"] = [0.5, 0]
    nodes = [{"mesh": 0}, {"mesh": 0, "weights": [0, 1]}, {"mesh": 0}]
    sampler = {"input": f.array([0, 1]), "output": f.array([0.25, 0.1, 1, 1])}
    animations = [{"samplers": [sampler], "channels": [{"sampler": 0, "target": {"node": 2, "path": "weights"}}]}]
    scene = load_scene(f.write(tmp_path, nodes=nodes, animations=animations))
    assert places(scene) == [[0, 0, 0.5], [10, 0, 0], [1, 0, 0.25]]


@pytest.mark.parametrize("cubic", [False, True])
def test_animations_are_shown_at_their_beginning(tmp_path: Path, cubic: bool) -> None:
    f = simple()
    keys = [[9, 9, 9], [1, 2, 3], [8, 8, 8]] * 2 if cubic else [[1, 2, 3], [4, 5, 6]]
    sampler = {"input": f.array([0.5, 1]), "output": f.array(keys), "interpolation": "CUBICSPLINE" if cubic else "STEP"}
    channels = [
        {"sampler": 0, "target": {"node": 0, "path": "translation"}},
        {"sampler": 7, "target": {"node": 0, "path": "scale"}},
        {"sampler": 0, "target": {"path": "pointer"}},
    ]
    nodes = [{"mesh": 0, "translation": [7, 7, 7], "rotation": [0, 0, 1, 0]}]
    scene = load_scene(f.write(tmp_path, nodes=nodes, animations=[{"samplers": [sampler], "channels": channels}]))
    (mesh,) = meshes(scene)
    assert corners(mesh) == [[[1, 2, 3], [0, 2, 3], [1, 1, 3]]]  # the node's own rotation stays
    assert any("animation is shown at its beginning" in w for w in scene.warnings)
    assert any("can't be read" in w for w in scene.warnings)


def test_skins_move_meshes_by_their_joints_alone(tmp_path: Path) -> None:
    f = Gltf()
    attributes = {
        "JOINTS_0": f.array([[0, 1, 0, 0]] * 3, "B"),
        "WEIGHTS_0": f.array([[1, 0, 0, 0], [0.5, 0.5, 0, 0], [0, 2, 0, 0]]),  # the last is scaled to a sum of 1
        "NORMAL": f.array([[0, 0, 1]] * 3),
    }
    f.triangle(attributes=attributes)
    at_rest = np.array([np.eye(4), np.eye(4)])
    at_rest[1, 3, 0] = -1  # the second joint's frame starts at x = 1 (columns follow each other)
    f.header["skins"] = [{"joints": [1, 2], "inverseBindMatrices": f.array(at_rest.reshape(2, 16))}]
    nodes = [
        {"mesh": 0, "skin": 0, "translation": [99, 0, 0]},  # does not count
        {"translation": [0, 0, 4], "children": [2]},
        {"translation": [1, 0, 0], "rotation": [HALF, 0, 0, HALF]},
    ]
    scene = load_scene(f.write(tmp_path, nodes=nodes, scenes=[{"nodes": [0, 1]}]))
    (mesh,) = meshes(scene)
    # Joint 0 moves by 4 along z; joint 1 as well, and turns by 90° about the x axis: (0, 1, 0) becomes (0, 0, 1).
    assert corners(mesh) == [[[0, 0, 4], [1, 0, 4], [0, 0, 5]]]
    assert mesh.normals[0] == pytest.approx([0, 0, 1])
    assert mesh.normals[2] == pytest.approx([0, -1, 0])


def test_joints_outside_of_the_scene_and_damaged_skins(tmp_path: Path) -> None:
    f = Gltf()
    f.triangle(attributes={"JOINTS_0": f.array([[0] * 4] * 3, "B"), "WEIGHTS_0": f.array([[1, 0, 0, 0]] * 3)})
    f.header["skins"] = [{"joints": [2]}]
    nodes = [{"mesh": 0, "skin": 0}, {"children": [2], "translation": [0, 3, 0]}, {"translation": [0, 0, 2]}]
    scene = load_scene(f.write(tmp_path, nodes=nodes, scenes=[{"nodes": [0]}]))
    assert corners(meshes(scene)[0]) == [(TRIANGLE + [0, 3, 2]).tolist()]
    for skin, words in (({"joints": [9]}, "node 9"), ({}, "no joints"), ({"joints": []}, "no joints")):
        with pytest.raises(SceneError, match=words):
            load_scene(f.write(tmp_path, nodes=nodes, scenes=[{"nodes": [0]}], skins=[skin]))


@pytest.mark.timeout(60)
def test_instances_are_judged_as_the_scene_judges_them() -> None:
    rng = np.random.default_rng(3)
    matrices = np.tile(np.eye(4), (200, 1, 1))
    matrices[:, :3, :3] = rng.normal(size=(200, 3, 3)) * 10.0 ** rng.uniform(-8, 8, (200, 3, 1))
    for matrix in matrices:
        linear = matrix[:3, :3]
        expected = np.linalg.norm(linear) * np.linalg.norm(np.linalg.inv(linear))
        assert _condition(matrix) == pytest.approx(expected, rel=1e-4)
    assert _condition(np.diag([1.0, 1.0, 0.0, 1.0])) == math.inf
