"""Where Mitsuba deviates by itself, and how that was verified. Nothing else is on the list.

A disagreement is put down to a deviation when the scene has what it takes and the same comparison of the scene without
that agrees; otherwise it stands.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass

from pmviewer.bench.agree.tree import Node, nodes


@dataclass(frozen=True)
class Deviation:
    """`without` gives the scene with what the deviation takes replaced by its like, None where there is nothing."""

    name: str
    reason: str
    without: Callable[[Node], Node | None]


def _even_lights(scene: Node) -> Node | None:
    """Textured area lights on meshes shine evenly."""
    found = copy.deepcopy(scene)
    for shape in found["shapes"]:
        if shape["type"] in ("cube", "obj", "ply") and isinstance(shape.get("emitter", {}).get("radiance"), dict):
            shape["emitter"]["radiance"] = [0.5, 0.5, 0.5]
    return found if found != scene else None


def _upright_normals(scene: Node) -> Node | None:
    """Meshes have the normals of their faces, and there are no bump or normal maps."""
    found = copy.deepcopy(scene)
    for node in nodes(found):
        if "mesh" in node:
            node["face_normals"] = True
        for name in ("bsdf", "inside"):
            while name in node and node[name]["type"] in ("bumpmap", "normalmap"):
                node[name] = node[name]["inside"]
    return found if found != scene else None


DEVIATIONS = (
    Deviation(
        "textured mesh light",
        "light samples of textured area lights on meshes disagree with Mitsuba's own BSDF samples by 1–8 %",
        _even_lights,
    ),
    Deviation(
        "light through surfaces",
        "where normals are tilted Mitsuba lets light pass to or from below the surface itself; here it carries none",
        _upright_normals,
    ),
)
