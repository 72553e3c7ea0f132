"""The smallest scene that still shows a disagreement: what can be left out or made plain is, one thing at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from pmviewer.bench.agree.tree import TEXTURES, WRAPPERS, Node, copied, emitters_of

GREY = [0.5, 0.5, 0.5]
_COLOURS = ("reflectance", "diffuse_reflectance", "specular_reflectance", "specular_transmittance", "radiance",
            "intensity", "irradiance", "color0", "color1")  # fmt: skip
_NEEDED = frozenset(("type", "inside", "mesh", "picture", "group", "to_world", "emitter", "height", "normalmap",
                     "use_shadowing_function", "raw", "bsdf", "alpha_u", "alpha_v", *_COLOURS))  # fmt: skip
"""What a node can't do without, or what is simplified in another way."""
Path = tuple[Any, ...]


def shrunk(scene: Node, still: Callable[[Node], bool], most: int = 200) -> Node:
    """The smallest scene found for which `still` holds, as it does for `scene`, after at most `most` tries.

    Tries to leave out shapes and lights first, then to simplify what is left, until nothing more can go.
    """
    tries = 0
    progress = True
    while progress and tries < most:
        progress = False
        for simpler in simplifications(scene):
            if tries >= most:
                break
            tries += 1
            if still(simpler):
                scene, progress = simpler, True
                break
    return scene


def simplifications(scene: Node) -> Iterator[Node]:
    """Scenes with one thing less, the largest things first. All of them have a surface and a light."""
    for simpler in _all(scene):
        if simpler["shapes"] and emitters_of(simpler) and simpler != scene:
            yield simpler


def _all(scene: Node) -> Iterator[Node]:
    for i in range(len(scene["lights"])):
        yield _without(scene, ("lights", i))
    for i in range(len(scene["shapes"])):
        yield _tidy(_without(scene, ("shapes", i)))
    for name, members in scene["groups"].items():
        for i in range(len(members) if len(members) > 1 else 0):
            yield _tidy(_without(scene, ("groups", name, i)))
    yield from _opened_groups(scene)
    yield _with(scene, ("scale",), 1.0)
    for path, node in list(_nodes(scene)):
        yield from _simpler_node(scene, path, node)


def _opened_groups(scene: Node) -> Iterator[Node]:
    """Instances replaced by the one shape that their group holds."""
    for i, shape in enumerate(scene["shapes"]):
        if shape["type"] == "instance" and len(scene["groups"][shape["group"]]) == 1:
            member = scene["groups"][shape["group"]][0]
            yield _tidy(_with(scene, ("shapes", i), member | {"to_world": member["to_world"] + shape["to_world"]}))


def _simpler_node(scene: Node, path: Path, node: Node) -> Iterator[Node]:
    kind = node["type"]
    if kind in WRAPPERS:
        yield _with(scene, path, node["inside"])
    elif path[-1] in ("bsdf", "inside") and node != {"type": "diffuse", "reflectance": GREY}:
        yield _with(scene, path, {"type": "diffuse", "reflectance": GREY})
    if kind in TEXTURES and path[-1] not in ("height", "normalmap"):
        yield _with(scene, path, 0.3 if path[-1] == "alpha" else GREY)
    if path[-1] == "bsdf" and "emitter" in _at(scene, path[:-1]):
        yield _without(scene, path)
    for i in range(len(node.get("to_world", []))):
        if node["to_world"][i][0] != "lookat":
            yield _without(scene, (*path, "to_world", i))
    for i in range(len(node.get("to_uv", []))):
        yield _without(scene, (*path, "to_uv", i))
    if "mesh" in node:
        yield _with(scene, (*path, "mesh"), node["mesh"] | {"detail": 1})
        yield _with(scene, (*path, "mesh"), node["mesh"] | {"tilt": 0.0, "uv": False})
        yield _with(scene, (*path, "mesh"), node["mesh"] | {"normals": False})
        yield _with(
            scene, path, {k: v for k, v in node.items() if k not in ("mesh", "face_normals")} | {"type": "cube"}
        )
    if "alpha_u" in node:
        rest = {name: value for name, value in node.items() if name not in ("alpha_u", "alpha_v")}
        yield _with(scene, path, rest | {"alpha": node["alpha_u"]})
    for name, value in node.items():
        if name in _COLOURS and isinstance(value, list) and value != GREY:
            yield _with(scene, (*path, name), GREY)
        if name not in _NEEDED and not isinstance(value, dict):
            yield _without(scene, (*path, name))


def _nodes(tree: Any, path: Path = ()) -> Iterator[tuple[Path, Node]]:
    """Nodes with their place, outer ones first."""
    if isinstance(tree, dict):
        if "type" in tree:
            yield path, tree
        for name, value in tree.items():
            if name not in ("mesh", "picture", "camera"):
                yield from _nodes(value, (*path, name))
    elif isinstance(tree, list):
        for i, value in enumerate(tree):
            yield from _nodes(value, (*path, i))


def _at(tree: Any, path: Path) -> Any:
    for key in path:
        tree = tree[key]
    return tree


def _with(scene: Node, path: Path, value: Any) -> Node:
    found = copied(scene)
    _at(found, path[:-1])[path[-1]] = copied(value)
    return found


def _without(scene: Node, path: Path) -> Node:
    found = copied(scene)
    del _at(found, path[:-1])[path[-1]]
    return found


def _tidy(scene: Node) -> Node:
    """Without groups that nobody shows, and without empty ones."""
    shown: set[str] = set()
    waiting = [s["group"] for s in scene["shapes"] if s["type"] == "instance"]
    while waiting:
        name = waiting.pop()
        if name not in shown:
            shown.add(name)
            waiting += [s["group"] for s in scene["groups"][name] if s["type"] == "instance"]
    return {**scene, "groups": {name: members for name, members in scene["groups"].items() if name in shown}}
