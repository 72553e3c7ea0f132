"""Random media: a cube or ball of smoke among the rest, the same everywhere or on a lattice."""

from __future__ import annotations

from typing import Any

from pmviewer.bench.agree.draw import Draw
from pmviewer.bench.agree.tree import Node, shapes_of

ABOVE = 1.9
"""Height from which on lights stand over the smoke: those that shine into several media are not right."""
DENSE = 10.0
"""Least factor of the extinction of dense media; others have at most 8."""


def has_media(scene: Node) -> bool:
    """Is anything filled with a medium?"""
    return any("medium" in shape for shape in shapes_of(scene))


def emits(scene: Node) -> bool:
    """Does a medium emit light?"""
    return any("emission" in shape.get("medium", {}) for shape in shapes_of(scene))


def ignite(draw: Draw, scene: Node) -> None:
    """Let all media emit: the same everywhere, or in a lattice, which may be another than that of the extinction."""
    for shape in shapes_of(scene):
        if "medium" in shape:
            medium = shape["medium"]
            brightness = draw.log(0.3, 8.0)
            medium["emission"] = [round(brightness * c, 4) for c in draw.colour(0.1, 1.0)]
            if medium["type"] == "heterogeneous" and draw.chance(0.7):
                same = medium["sigma_t"] if isinstance(medium["sigma_t"], dict) else None
                medium["emission"] = same if same and draw.chance(0.5) else _grid(draw, shape["to_world"])


def thicken(draw: Draw, scene: Node) -> None:
    """Make all smoke so dense that light seldom gets through, on lattices for the most part; some of it is absorbed
    at every collision, so that paths end before their longest length."""
    for shape in shapes_of(scene):
        if "medium" in shape:
            medium = shape["medium"]
            medium["scale"] = draw.log(DENSE, 300.0)
            medium["albedo"] = draw.colour(0.3, 0.95)
            if draw.chance(0.8):
                medium["type"] = "heterogeneous"
                medium["sigma_t"] = _grid(draw, shape["to_world"])


def fill(draw: Draw, scene: Node) -> None:
    """Add a shape with smoke in it, which crosses what stands there, and lift the lights above it."""
    for shape in scene["shapes"]:
        if "emitter" in shape:
            for step in shape["to_world"]:
                if step[0] == "translate" and step is shape["to_world"][-1]:
                    step[1][2] = max(step[1][2], ABOVE + 0.4)
    kind = draw.pick(("cube", "sphere"))
    size = [draw.number(0.35, 0.55) for _ in range(3)]
    steps: list[Any] = [["scale", size if kind == "cube" else 3 * size[:1]], draw.turn(False)]
    steps.append(["translate", [draw.number(-0.3, 0.3), draw.number(-0.3, 0.3), 1.0]])
    scene["shapes"].append({"type": kind, "to_world": steps, "bsdf": {"type": "null"}, "medium": _medium(draw, steps)})


def _medium(draw: Draw, steps: list[Any]) -> Node:
    medium: Node = {"type": "homogeneous", "sigma_t": draw.colour(0.2, 1.0), "albedo": draw.colour(0.3, 1.0)}
    medium["scale"] = draw.log(0.3, 8.0)
    if draw.chance(0.6):
        medium["type"] = "heterogeneous"
        medium["sigma_t"] = _grid(draw, steps)
        if draw.chance(0.3):
            medium["albedo"] = _grid(draw, steps)
    if draw.chance(0.6):
        medium["phase"] = {"type": "hg", "g": draw.number(-0.6, 0.8)}
    return medium


def _grid(draw: Draw, steps: list[Any]) -> Node:
    """A lattice around the shape that the steps place."""
    sides = [draw.integer(1, 12) for _ in range(3)]
    grid = {"kind": "smoke", "seed": draw.seed(), "sides": sides, "channels": draw.pick((1, 3))}
    around = [["translate", [-0.5, -0.5, -0.5]], ["scale", [2.0, 2.0, 2.0]], *steps]
    return {"type": "gridvolume", "grid": grid, "to_world": around}
