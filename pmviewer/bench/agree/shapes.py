"""Random shapes and transformations that both programs know in full."""

from __future__ import annotations

from typing import Any

from pmviewer.bench.agree.draw import Draw
from pmviewer.bench.agree.tree import Node

KINDS = ("rectangle", "disk", "sphere", "cylinder", "cube", "obj", "ply")
FREE = frozenset(("rectangle", "cube", "obj", "ply"))
"""Shapes that may be scaled unevenly and sheared; the others stay what they are under even scale alone."""
TILT = 25.0
"""Most degrees that given vertex normals are tilted."""


def mesh(draw: Draw, format: str, kinds: tuple[str, ...], tilt: float, uv: bool) -> Node:
    """What describes a mesh file (`pmviewer.bench.agree.files`)."""
    kind = draw.pick(kinds)
    file_format = draw.pick(("ply", "ascii ply")) if format == "ply" else format
    return {
        "kind": kind,
        "seed": draw.seed(),
        "detail": draw.integer(1, 2) if kind == "blob" else draw.integer(1, 4),
        "tilt": tilt if kind != "tetra" else 0.0,
        "normals": tilt > 0 or draw.chance(0.6),
        "uv": uv,
        "format": file_format,
    }


def shape(draw: Draw, kind: str, size: float, tilted: bool = False, uv: bool = False, closed: bool = False) -> Node:
    """A shape of that kind, some `size` large, around the origin. `closed`: it has an inside."""
    if kind in ("obj", "ply"):
        kinds = ("blob", "tetra") if closed else ("blob", "tetra", "sheet", "quad")
        tilt = draw.number(3, TILT) if tilted else 0.0
        node: Node = {"type": kind, "mesh": mesh(draw, kind, kinds, tilt, uv or draw.chance(0.3))}
        if draw.chance(0.2) and not tilted:
            node["face_normals"] = True
    elif kind == "sphere" and draw.chance(0.5):
        node = {"type": "sphere", "center": draw.within(0.2), "radius": draw.number(0.6, 1)}
    elif kind == "cylinder" and draw.chance(0.5):
        node = {"type": "cylinder", "p0": [0.0, 0.0, -1.0], "p1": draw.within(0.3)[:2] + [0.8], "radius": 0.6}
    else:
        node = {"type": kind}
    node["to_world"] = [["scale", [size, size, size]], *steps(draw, kind in FREE)]
    return node


def steps(draw: Draw, free: bool) -> list[Any]:
    """A random linear transformation of about unit size: turned, some mirrored, where `free` uneven and sheared."""
    found: list[Any] = []
    if free and draw.chance(0.5):
        found.append(["scale", [draw.number(0.5, 1.5) for _ in range(3)]])
    if draw.chance(0.25):
        found.append(["scale", draw.pick(([-1.0, 1.0, 1.0], [1.0, 1.0, -1.0], [-1.0, -1.0, -1.0]))])
    if draw.chance(0.8):
        found.append(draw.turn(free))
    if free and draw.chance(0.25):
        a, b = draw.number(-0.6, 0.6), draw.number(-0.6, 0.6)
        found.append(["matrix", [1.0, a, 0.0, 0.0, 0.0, 1.0, b, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    if draw.chance(0.3):
        found.append(draw.turn(free))
    return found
