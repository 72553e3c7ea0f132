"""Where the pictures differ for a reason that is known: by Mitsuba's own deviations, or by what is wanted here.

Nothing else is on the list. A disagreement with Mitsuba, or for entries marked so among our own methods, is put down to
an entry only when the scene has what it takes, and the same comparison of the scene without that agrees; otherwise it
stands. How each was verified stands with it, and
docs/scenes.md says the same to users.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pmviewer.bench.agree.materials import TRANSPARENT
from pmviewer.bench.agree.tree import MAPS, Node, copied, innermost, nodes

WALKS = "its walks"
"""Whom weights of virtual lights are compared with."""
GREY = [0.5, 0.5, 0.5]
SEEN_THROUGH = (*TRANSPARENT, "mask", "null", "difftrans")
Place = NDArray[np.float64]


@dataclass(frozen=True)
class Deviation:
    """`without` gives the scene with what the deviation takes replaced by its like, None where there is nothing.

    `rare`: random scenes seldom have it, since it shows nearly always. `among_ours`: our own methods differ by it too.
    `peer`: how the names of those begin that have it.
    """

    name: str
    reason: str
    without: Callable[[Node], Node | None]
    rare: bool = True
    among_ours: bool = False
    peer: str = "Mitsuba"

    def concerns(self, peer: str) -> bool:
        """Whether a comparison with `peer` can come from it. Virtual lights and the walks that normalise them ask the
        same BSDFs the same questions: nothing excuses these."""
        return (self.among_ours and peer != WALKS) or peer.startswith(self.peer)


def _changed(change: Callable[[Node], None]) -> Callable[[Node], Node | None]:
    def without(scene: Node) -> Node | None:
        found = copied(scene)
        change(found)
        return found if found != scene else None

    return without


def _lights(scene: Node, kinds: tuple[str, ...]) -> Iterator[Node]:
    return (s for s in scene["shapes"] if "emitter" in s and s["type"] in kinds)


def _even_lights(scene: Node) -> None:
    for shape in _lights(scene, ("sphere", "cylinder", "cube", "obj", "ply")):
        if isinstance(shape["emitter"]["radiance"], dict):
            shape["emitter"]["radiance"] = GREY


def _outward_lights(scene: Node) -> None:
    for shape in _lights(scene, ("sphere", "cube", "obj", "ply")):
        if _shines_inward(shape):
            shape["flip_normals"] = not shape.get("flip_normals", False)


def _shines_inward(shape: Node) -> bool:
    """Whether a closed shape's front is inside: Mitsuba turns mirrored meshes without vertex normals inside out."""
    flat = "mesh" in shape and (shape.get("face_normals", False) or not shape["mesh"]["normals"])
    sizes = [math.prod(step[1]) for step in shape["to_world"] if step[0] == "scale"]
    matrices = [np.reshape(step[1], (4, 4)) for step in shape["to_world"] if step[0] == "matrix"]
    mirrored = math.prod(sizes) * math.prod(float(np.linalg.det(m[:3, :3])) for m in matrices) < 0
    return bool(shape.get("flip_normals", False)) != (flat and mirrored)


def _flat_lights(scene: Node) -> None:
    for shape in _lights(scene, ("obj", "ply")):
        shape["face_normals"] = True


def _unmirrored_lights(scene: Node) -> None:
    for shape in _lights(scene, ("cylinder",)):
        shape["to_world"] = [s for s in shape["to_world"] if s[0] != "scale" or math.prod(s[1]) > 0]


def _unturned_lights(scene: Node) -> None:
    for shape in _lights(scene, ("sphere",)):
        if any(
            step[0] in ("rotate", "matrix") or (step[0] == "scale" and min(step[1]) < 0) for step in shape["to_world"]
        ):
            center, edge = (_moved(shape["to_world"], np.array([x, 0.0, 0.0])) for x in (0, 1))
            shape["to_world"] = [
                ["scale", [float(np.linalg.norm(edge - center))] * 3],
                ["translate", center.tolist()],
            ]


def _unmirrored_shapes(scene: Node) -> None:
    for node in nodes(scene):
        smooth = node.get("type") in ("cube", "rectangle") or ("mesh" in node and node["mesh"]["normals"])
        if node.get("type") == "instance" or (smooth and not node.get("face_normals", False)):
            for step in node.get("to_world", []):
                if step[0] == "scale" and math.prod(step[1]) < 0:
                    step[1] = [abs(x) for x in step[1]]


def _flat_meshes(scene: Node) -> None:
    for node in nodes(scene):
        if "mesh" in node:
            node["face_normals"] = True


def _unmapped(scene: Node) -> None:
    for node in [scene, *nodes(scene)]:
        for name in ("bsdf", "inside"):
            while name in node and node[name]["type"] in MAPS:
                node[name] = node[name]["inside"]


def _unit_axes(scene: Node) -> None:
    for node in nodes(scene):
        for step in node.get("to_world", []):
            length = math.hypot(*step[1]) if step[0] == "rotate" else 1.0
            if abs(length - 1) > 1e-6:
                step[1] = [x / length for x in step[1]]


def _dark_glass(scene: Node) -> None:
    """Without what is of glass, where the camera is in a closed opaque shape that no light is in."""
    eye = np.array(scene["camera"]["origin"], float)
    lit = [_moved(shape["to_world"], np.zeros(3)) for shape in scene["shapes"] if "emitter" in shape]
    lit += [np.array(light["position"], float) for light in scene["lights"] if "position" in light]
    for shape in scene["shapes"]:
        opaque = "emitter" not in shape and "bsdf" in shape and innermost(shape["bsdf"])["type"] not in SEEN_THROUGH
        if opaque and _holds(shape, eye) and not any(_holds(shape, light) for light in lit):
            kinds = [innermost(s["bsdf"])["type"] if "bsdf" in s else "" for s in scene["shapes"]]
            scene["shapes"] = [s for s, kind in zip(scene["shapes"], kinds, strict=True) if kind not in TRANSPARENT]
            return


def _holds(shape: Node, place: Place) -> bool:
    """Whether a point is inside a cube or a sphere; of others nobody asks."""
    size = {"cube": np.inf, "sphere": 2}.get(shape["type"])
    if size is None:
        return False
    origin, *ends = (_moved(shape["to_world"], place) for place in (np.zeros(3), *np.eye(3)))
    axes = np.array(ends) - origin
    return bool(np.linalg.norm(np.linalg.solve(axes.T, place - origin), size) < 1)


def _moved(steps: list[Any], place: Place) -> Place:
    """A point after the steps of a "to_world"."""
    for kind, *numbers in steps:
        if kind == "rotate":
            place = Rotation.from_rotvec(numbers[1] * np.array(numbers[0]) / math.hypot(*numbers[0]), True).apply(place)
        elif kind == "matrix":
            place = (np.reshape(numbers[0], (4, 4)) @ [*place, 1.0])[:3]
        else:
            place = place * numbers[0] if kind == "scale" else place + numbers[0]
    return place


DEVIATIONS = (
    Deviation(
        "textured light",
        "Mitsuba's light samples of textured area lights disagree with its own BSDF samples: on a sphere by 2 % (path "
        "against direct with emitter_samples 0), on a cube they choose one of the faces that share coordinates, even "
        "when the texture is of one colour",
        _changed(_even_lights),
    ),
    Deviation(
        "light with vertex normals",
        "Mitsuba's light samples of a mesh count its area by the vertex normals, its BSDF samples by the surface: up "
        "to a quarter in places on a tetrahedron (the same two integrators)",
        _changed(_flat_lights),
    ),
    Deviation(
        "mirrored cylinder light",
        "Mitsuba's light samples of a mirrored cylinder shine from the other side than its BSDF samples",
        _changed(_unmirrored_lights),
    ),
    Deviation(
        "light turned inwards",
        "Mitsuba's rays to a light sample end 9e-4 of their length before it, so that closed shapes which shine "
        "inwards light what is outside along their edges: a mean of 1.3e-5 and 2.6e-6 in two scenes with lights of "
        "0.5, where its BSDF samples bring 1.5e-8 and 0 (direct with emitter_samples 0)",
        _changed(_outward_lights),
        rare=False,
    ),
    Deviation(
        "glass in the dark",
        "Mitsuba's rays leave surfaces by 9e-5 of a unit at least, so that light gets through a wall where glass "
        "crosses it. Seen where nothing else brings light: a camera in a closed cube that a ball of glass sticks out "
        "of, mean 1.9e-4 with lights of 3 (6e-6 here), at most 1e-6 without the ball",
        _changed(_dark_glass),
        rare=False,
    ),
    Deviation(
        "mirrored shape by particles",
        "Mitsuba's particle tracer stops at a mirrored rectangle, cube or mesh with vertex normals, whose two normals "
        "are on different sides then: a glass cube beside a lamp that its path tracer finds brings 0.967 of its paths' "
        "light, all others' too (1.003 without the mirror, which changes nothing of a cube), one of a diffuse material "
        "is black to it, and a rectangle brings the same light whatever its material",
        _changed(_unmirrored_shapes),
        rare=False,
        peer="Mitsuba particles",
    ),
    Deviation(
        "turned sphere light by particles",
        "Mitsuba's particles leave a rotated or mirrored sphere light about the normal that it had before: some start "
        "into the sphere and end on it, 4 % of them at a turn by 30 degrees about z, 33 % at 90 and 78 % at 180 or "
        "when mirrored, none without the turn",
        _changed(_unturned_lights),
        rare=False,
        peer="Mitsuba particles",
    ),
    Deviation(
        "vertex normals",
        "wanted: where vertex normals tilt the shading, directions below the surface itself carry no light here; "
        "Mitsuba's BSDFs ask the shading normal alone, and light goes through. Normals of mirrors and gloss "
        "lean towards whoever looks, lest reflections go below the surface: photons look from elsewhere than paths",
        _changed(_flat_meshes),
        among_ours=True,
    ),
    Deviation(
        "bump and normal maps",
        "wanted: as with vertex normals; and under a bump map Mitsuba mixes coordinates of the surface and of the "
        "world when it makes the tangent. Mapped normals that face away lean towards whoever looks, as in Mitsuba; its "
        "particle tracer brought 2.2 times what its path tracer does in a scene whose floor has a normal map",
        _changed(_unmapped),
        among_ours=True,
    ),
    Deviation(
        "axis of rotation",
        "wanted: a rotation about an axis that is not of unit length moves shapes as in Mitsuba, but normals here are "
        "those of the moved surface",
        _changed(_unit_axes),
    ),
)
