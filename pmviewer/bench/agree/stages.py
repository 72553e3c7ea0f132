"""What is small on a wide stage: the objects of a scene on a floor ten to a hundred times as wide as they are, under a
dome that shines or a panel high above, whose photons aim at them (`pmviewer.photons.projection.small`)."""

from __future__ import annotations

from pmviewer.bench.agree.draw import Draw
from pmviewer.bench.agree.lights import DELTA
from pmviewer.bench.agree.tree import Node

FARTHEST = 5e3
"""Most width of the floor, in the scene's own units: Mitsuba's cameras see 10,000 far."""
FOLLOWED = ("metal only", "glass only", "no diffuse")
"""Profiles whose mirrors show the dome everywhere: of what it reflects itself a look-up as narrow as what stands there
meets one photon in 200,000, and all light from there is missing until one has come."""


def stage(draw: Draw, scene: Node, surroundings: int, half: float) -> None:
    """Replace so many surroundings, which are the scene's first shapes and whose halved edge is `half`, and leave out
    lights of one point or direction, whose caustics a path tracer does not find."""
    around, objects = scene["shapes"][:surroundings], scene["shapes"][surroundings:]
    grey = {"type": "twosided", "inside": {"type": "diffuse", "reflectance": draw.colour(0.2, 0.8)}}
    wide = half * draw.log(8.0, 100.0)
    floor = {"type": "rectangle", "to_world": [["scale", [wide, wide, 1.0]]]}
    shapes: list[Node] = [floor | {"bsdf": around[0]["bsdf"] if around else grey}]
    if draw.chance(0.5):
        up = [["scale", [wide, wide, 1.0]], ["rotate", [1.0, 0.0, 0.0], 90.0], ["translate", [0.0, wide, wide]]]
        shapes.append({"type": "rectangle", "to_world": up, "bsdf": around[-1]["bsdf"] if around else grey})
    under_dome = draw.chance(0.6)
    if under_dome:
        dome = {"type": "sphere", "to_world": [["scale", 3 * [2.5 * wide]]], "flip_normals": True}
        shine = {"type": "area", "radiance": draw.colour(0.2, 1.0)}
        bsdf = {"type": "diffuse", "reflectance": draw.colour(0.0, 0.5)}
        if scene["profile"] in FOLLOWED:
            bsdf["reflectance"] = 3 * [0.0]
    else:
        size, place = wide * draw.number(0.2, 0.5), [wide * draw.number(-0.3, 0.3), 0.0, wide]
        down = [["scale", [size, size, 1.0]], ["rotate", [1.0, 0.0, 0.0], 180.0], ["translate", place]]
        dome = {"type": "rectangle", "to_world": down}
        shine = {"type": "area", "radiance": draw.colour(4.0, 12.0)}
        bsdf = {"type": "diffuse", "reflectance": 3 * [0.0]}
    scene["shapes"] = [*shapes, *objects, dome | {"bsdf": bsdf, "emitter": shine}]
    scene["lights"] = [light for light in scene["lights"] if light["type"] not in DELTA]
    scene |= {"closed": False, "stage": "dome" if under_dome else "panel"}
    if wide * scene["scale"] > FARTHEST:
        scene["scale"] = 1.0
