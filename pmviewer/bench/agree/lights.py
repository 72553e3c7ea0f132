"""Random lights: on shapes of every kind, and without a surface."""

from __future__ import annotations

from typing import Any

from pmviewer.bench.agree.draw import Draw
from pmviewer.bench.agree.materials import Materials
from pmviewer.bench.agree.shapes import KINDS, shape
from pmviewer.bench.agree.tree import Node

PLAIN = ("point", "constant")
MORE = ("spot", "directional", "envmap", *PLAIN)
DELTA = frozenset(("point", "spot", "directional"))
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
