"""Random lights: on shapes of every kind, and without a surface."""

from __future__ import annotations

from typing import Any

from pmviewer.bench.agree.draw import Draw
from pmviewer.bench.agree.materials import Materials
from pmviewer.bench.agree.media import ABOVE, has_media
from pmviewer.bench.agree.shapes import KINDS, shape
from pmviewer.bench.agree.tree import Node

PLAIN = ("point", "constant")
MORE = ("spot", "directional", "envmap", *PLAIN)
DELTA = frozenset(("point", "spot", "directional", "projector"))
"""Lights that no path meets by chance."""
DISTANT = frozenset(("directional", "constant", "envmap"))
"""Lights at infinity."""


def bare(draw: Draw, kind: str, above: float) -> Node:
    """A light without a surface, at most `above` over the ground."""
    x, y, z = draw.number(-1, 1), draw.number(-1, 1), draw.number(0.6 * above, above)
    if kind == "point":
        return {"type": "point", "position": [x, y, z], "intensity": draw.colour(2, 10)}
    if kind == "spot":
        cutoff = draw.number(20, 80)
        target = [draw.number(-0.4, 0.4), draw.number(-0.4, 0.4), 0.3]
        look = [["lookat", [x, y, z], target, [0.3, 1.0, 0.1]]]
        return {"type": "spot", "to_world": look, "intensity": draw.colour(5, 20), "cutoff_angle": cutoff,
                "beam_width": draw.number(0.1, 0.95) * cutoff}  # fmt: skip
    if kind == "directional":
        return {"type": "directional", "direction": [x, y, -draw.number(0.5, 2)], "irradiance": draw.colour(1, 4)}
    if kind == "constant":
        return {"type": "constant", "radiance": draw.colour(0.2, 1)}
    picture = {"kind": "sky", "seed": draw.seed(), "width": draw.integer(8, 32), "height": draw.integer(4, 16)}
    return {
        "type": "envmap",
        "picture": picture,
        "scale": draw.number(0.3, 1.5),
        "to_world": [draw.turn(), draw.turn()],
    }


def project(draw: Draw, scene: Node) -> None:
    """Add one or two projectors to the scene, in half of the cases in place of all other lights."""
    if draw.chance(0.5):
        scene["lights"] = []
        scene["shapes"] = [shape for shape in scene["shapes"] if "emitter" not in shape]
    above = 2.2 if scene["closed"] else 2.8
    low = max(0.6 * above, ABOVE if has_media(scene) else 0.0)
    scene["lights"] += [_projector(draw, low, above) for _ in range(draw.pick((1, 1, 2)))]


def _projector(draw: Draw, low: float, above: float) -> Node:
    """Its picture may be mirrored and repeated; a colour fills the whole pyramid."""
    place = [draw.number(-1, 1), draw.number(-1, 1), draw.number(low, above)]
    target = [draw.number(-0.4, 0.4), draw.number(-0.4, 0.4), 0.3]
    size = [draw.pick((1.0, 1.0, -1.0, 2.0)), draw.pick((1.0, 1.0, -1.0)), 1.0]
    look: list[Any] = [["scale", size]] if size != [1.0, 1.0, 1.0] else []
    node: Node = {"type": "projector", "to_world": [*look, ["lookat", place, target, [0.3, 1.0, 0.1]]]}
    to_uv = [["scale", [draw.number(0.5, 4), draw.number(0.5, 4), 1.0]]]
    kind = draw.pick(("bitmap", "bitmap", "checkerboard", "colour"))
    if kind == "bitmap":
        picture = {"kind": "colour", "seed": draw.seed(), "width": draw.integer(2, 24), "height": draw.integer(2, 24)}
        filter, wrap = draw.pick(("bilinear", "nearest")), draw.pick(("repeat", "mirror", "clamp"))
        node["irradiance"] = {"type": kind, "picture": picture, "raw": draw.chance(0.3), "filter_type": filter,
                              "wrap_mode": wrap}  # fmt: skip
        node["irradiance"] |= {"to_uv": to_uv} if draw.chance(0.4) else {}
    elif kind == "checkerboard":
        node["irradiance"] = {"type": kind, "color0": draw.colour(0, 0.4), "color1": draw.colour(0.3, 1)}
        node["irradiance"]["to_uv"] = to_uv
    else:
        node["irradiance"] = draw.colour(0.2, 1)
    node |= {"scale": draw.number(5, 25), "fov": draw.number(20, 90)}
    if draw.chance(0.5):
        node["fov_axis"] = draw.pick(("x", "y", "smaller", "larger", "diagonal"))
    return node


def area(draw: Draw, materials: Materials, above: float, textured: bool, kind: str = "") -> Node:
    """A shining shape that looks down, or goes through the ground or whatever is there. It is large: both path tracers
    find caustics of small lights too seldom."""
    kind = kind or draw.pick(("rectangle", "disk", *KINDS) if textured else KINDS)
    node = shape(draw, kind, 0.4 if kind in ("sphere", "cube", "obj", "ply", "cylinder") else 0.6, uv=textured)
    if "mesh" in node and node["mesh"]["kind"] in ("sheet", "quad"):
        node["mesh"] |= {"kind": "blob", "detail": 1}
    if "mesh" in node and draw.chance(0.7):
        node["face_normals"] = True
    place: list[Any] = [draw.number(-0.8, 0.8), draw.number(-0.8, 0.8), draw.number(0.7 * above, above)]
    if draw.chance(0.25):  # crosses or touches what stands on the ground
        place[2] = draw.pick((0.0, 0.2, 0.4))
    if kind in ("rectangle", "disk"):
        tilt = ["rotate", [1.0, 0.0, 0.0], draw.number(150, 210)]
        node["to_world"] = [["scale", [draw.number(0.4, 0.8), draw.number(0.4, 0.8), 1.0]], tilt]
        if kind == "disk":
            size = draw.number(0.4, 0.8)
            node["to_world"][0] = ["scale", [size, size, size]]
    node["to_world"] = [*node["to_world"], ["translate", place]]
    radiance: Any = draw.colour(1, 8)
    if textured:
        radiance = materials.texture()
    node["emitter"] = {"type": "area", "radiance": radiance}
    if draw.chance(0.3):
        node["bsdf"] = materials.of("diffuse")
    return node
