"""Two rooms and a door ajar between them (Veach's scene; Keller and Wald's "problematic setting", figure 4)."""

from __future__ import annotations

import numpy as np

from make.document import BLACK, MadeScene, bsdf, diffuse, mesh, number, panel, rgb, sphere
from make.glasses import spline
from make.mesh import Mesh, block, joined, lathe, prism, room

WIDTH, HEIGHT, DEPTH = 5.0, 2.7, 5.0
"""Of either room; the camera's has z from 0, the other one lies behind its back wall."""
WALL = 0.12
DOOR = (1.9, 2.8, 2.05)
"""Opening in the wall: x of the hinge, x of the other jamb, height."""
AJAR = np.deg2rad(20.0)


def _wall() -> Mesh:
    """The wall between the rooms, around the opening."""
    hinge, jamb, top = DOOR
    return joined(
        block((0, 0, -WALL), (hinge, HEIGHT, 0)),
        block((jamb, 0, -WALL), (WIDTH, HEIGHT, 0)),
        block((hinge, top, -WALL), (jamb, HEIGHT, 0)),
    )


def _leaf() -> Mesh:
    """The door, turned about its hinge into the camera's room, and its handle on this side."""
    hinge, jamb, top = DOOR
    along, across = np.array([np.cos(AJAR), np.sin(AJAR)]), np.array([-np.sin(AJAR), np.cos(AJAR)])

    def plank(start: float, end: float, near: float, far: float, low: float, high: float) -> Mesh:
        corners = [(start, near), (end, near), (end, far), (start, far)]
        at = [(hinge, 0.0) + s * along + t * across for s, t in corners]
        return prism([(float(x), float(z)) for x, z in at], low, high)

    width = jamb - hinge
    panels = [plank(0.12, width - 0.12, 0.0, 0.012, low, low + 0.72) for low in (0.22, 1.14)]
    return joined(plank(0.0, width, -0.04, 0.0, 0.0, top - 0.004), *panels)


def _handle() -> Mesh:
    """A lever of two bars near the free edge of the leaf."""
    along, across = np.array([np.cos(AJAR), np.sin(AJAR)]), np.array([-np.sin(AJAR), np.cos(AJAR)])

    def bar(start: float, end: float, near: float, far: float, low: float, high: float) -> Mesh:
        at = [
            (DOOR[0], 0.0) + s * along + t * across for s, t in ((start, near), (end, near), (end, far), (start, far))
        ]
        return prism([(float(x), float(z)) for x, z in at], low, high)

    return joined(bar(0.825, 0.845, 0.0, 0.06, 1.02, 1.04), bar(0.72, 0.845, 0.045, 0.065, 1.018, 1.042))


def _jug() -> Mesh:
    profile = [(0.0, 0.0), (0.07, 0.0), (0.1, 0.02), (0.13, 0.09), (0.115, 0.17), (0.06, 0.25), (0.05, 0.31)]
    return lathe([spline([*profile, (0.065, 0.35)], 6)], 40)


def door_slit() -> MadeScene:
    """All light comes from one panel in the other room; the camera's room is lit through the slit alone."""
    hull = room((0, 0, -WALL - DEPTH), (WIDTH, HEIGHT, DEPTH))
    legs = [block((x, 0, z), (x + 0.05, 0.68, z + 0.05)) for x in (0.85, 2.15) for z in (1.5, 2.2)]
    table = joined(block((0.75, 0.68, 1.4), (2.3, 0.72, 2.35)), *legs)
    meshes = {
        "walls": joined(_wall(), *(hull[side] for side in ("ceiling", "left", "right", "back", "front"))),
        "floor": hull["floor"],
        "door": _leaf(),
        "handle": _handle(),
        "table": table,
        "jug": _jug(),
        "crate": prism([(3.55, 1.3), (4.0, 1.12), (4.18, 1.57), (3.73, 1.75)], 0.0, 0.45),
    }
    ggx = '<string name="distribution" value="ggx"/>'
    brass = (rgb("eta", 0.45, 0.53, 1.18), rgb("k", 3.6, 2.5, 1.85), ggx, number("alpha", 0.25))
    lacquer = (ggx, number("alpha", 0.15), rgb("diffuse_reflectance", 0.1, 0.22, 0.42))
    return MadeScene(
        "A door ajar",
        "Two rooms of 5 × 5 m; the only light hangs in the other one, and the door between them stands ajar by 20°.",
        "Few photons find the slit and all that matter come through it: what storing by importance is made for.",
        (2.95, 1.5, 4.4),
        (2.3, 0.95, 0.6),
        52,
        [
            diffuse("plaster", 0.74, 0.72, 0.68),
            diffuse("parquet", 0.45, 0.31, 0.2),
            diffuse("paint", 0.62, 0.56, 0.45),
            diffuse("wood", 0.55, 0.36, 0.22),
            diffuse("clay", 0.62, 0.28, 0.17),
            diffuse("ball", 0.35, 0.5, 0.22),
            diffuse("crate", 0.55, 0.45, 0.3),
            bsdf("roughplastic", "lacquer", *lacquer, two_sided=True),
            bsdf("roughconductor", "brass", *brass, two_sided=True),
            BLACK,
        ],
        [
            mesh("walls", "plaster", flat=True),
            mesh("floor", "parquet", flat=True),
            mesh("door", "paint", flat=True),
            mesh("handle", "brass", flat=True),
            mesh("table", "wood", flat=True),
            mesh("crate", "crate", flat=True),
            mesh("jug", "clay", transform='<translate x="1.27" y="0.72" z="1.75"/>'),
            sphere((1.66, 0.87, 1.8), 0.15, "ball"),
            sphere((2.03, 0.83, 2.1), 0.11, "lacquer"),
            panel((1.0, HEIGHT - 0.02, -1.7), (0.35, 0, 0), (0, 0, 0.35), "black", (1900, 1740, 1460)),
        ],
        meshes,
        aspect=(320, 240),
    )
