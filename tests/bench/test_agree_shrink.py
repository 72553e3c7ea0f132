"""Shrinking finds the smallest scene that still shows what is asked for."""

from __future__ import annotations

import copy

from pmviewer.bench.agree.features import features
from pmviewer.bench.agree.generate import scene_of
from pmviewer.bench.agree.known import DEVIATIONS
from pmviewer.bench.agree.shrink import GREY, shrunk, simplifications
from pmviewer.bench.agree.tree import Node, emitters_of, nodes, shapes_of
from pmviewer.bench.agree.xml import write_scene
from pmviewer.scene.load import load_scene


def with_feature(name: str) -> Node:
    return next(s for i in range(500) if name in features(s := scene_of(1, i)))


def size(scene: Node) -> int:
    """How much there is in it: nodes and their properties."""
    return sum(len(node) for node in nodes(scene)) + len(nodes_steps(scene))


def nodes_steps(scene: Node) -> list:
    return [step for node in nodes(scene) for name in ("to_world", "to_uv") for step in node.get(name, [])]


def test_what_shows_it_is_left_alone():
    def still(scene: Node) -> bool:
        return any(s["type"] == "cylinder" and s.get("flip_normals") for s in shapes_of(scene))

    scene = with_feature("shape: cylinder")
    for shape in shapes_of(scene):
        if shape["type"] == "cylinder":
            shape["flip_normals"] = True
    small = shrunk(scene, still, most=1000)
    assert still(small)
    cylinders = [s for s in small["shapes"] if s["type"] == "cylinder"]
    assert len(cylinders) == 1
    assert cylinders[0]["to_world"] == []
    assert len(small["shapes"]) <= 2
    assert len(emitters_of(small)) == 1
    assert small["scale"] == 1
    assert small["groups"] == {}


def test_a_material_inside_others_is_freed_of_them():
    def still(scene: Node) -> bool:
        return any(node["type"] == "roughplastic" for node in nodes(scene))

    small = shrunk(with_feature("bsdf: roughplastic"), still, most=1000)
    assert [n["type"] for n in nodes(small["shapes"]) if n["type"] in ("twosided", "bumpmap", "normalmap")] == []
    rest = [n for n in nodes(small["shapes"]) if n["type"] == "roughplastic"]
    assert len(rest) == 1
    assert set(rest[0]) <= {"type", "diffuse_reflectance", "specular_reflectance"}
    assert all(c == GREY for name, c in rest[0].items() if name != "type")


def test_instances_become_what_they_show_or_fewer():
    scene = with_feature("transform: groups in groups")
    small = shrunk(scene, lambda s: any(x["type"] == "instance" for x in s["shapes"]), most=1000)
    assert len(small["groups"]) == 1
    plain = shrunk(scene, lambda s: True, most=1000)
    assert plain["groups"] == {}
    assert len(shapes_of(plain)) == 1


def test_every_simpler_scene_is_smaller_or_plainer_and_can_be_read(tmp_path):
    for index in (3, 6, 9):
        scene = scene_of(1, index)
        before = copy.deepcopy(scene)
        for n, simpler in enumerate(simplifications(scene)):
            assert simpler != scene
            assert size(simpler) <= size(scene)
            if n % 3 == 0:
                load_scene(write_scene(simpler, tmp_path, f"simpler{index}_{n}")[0])
        assert n > 20
        assert scene == before


def test_tries_are_limited():
    tried = []
    shrunk(scene_of(1, 1), lambda s: bool(tried.append(s)), most=7)
    assert len(tried) == 7


def test_scenes_without_a_deviation_can_be_read_and_are_left_alone_where_they_have_none(tmp_path):
    scenes = [scene_of(1, i) for i in range(240)]
    before = copy.deepcopy(scenes)
    for deviation in DEVIATIONS:
        changed = 0
        for i, scene in enumerate(scenes):
            without = deviation.without(scene)
            if without is not None:
                changed += 1
                assert deviation.without(without) is None
                if changed <= 3:
                    load_scene(write_scene(without, tmp_path, f"without{i}")[0])
        assert 0 < changed < 240, deviation.name
    assert scenes == before
