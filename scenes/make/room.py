"""A room lit by the sun through a skylight (after the scene of Pharr's extended photon-mapping integrator)."""

from __future__ import annotations

import numpy as np

from make.document import BLACK, MadeScene, diffuse, lamp, mesh, sphere
from make.mesh import Mesh, joined, prism, quad

WIDTH, HEIGHT, DEPTH = 5.0, 3.0, 6.0
OPENING = (2.2, 1.75, 0.27, 0.34)
"""Of the skylight in the ceiling: centre x, z and half sizes in x, z."""
SUN = np.array([0.05, -0.56, -0.827])
"""Direction of the sunlight."""


def _ceiling() -> Mesh:
    """Four quads around the opening, facing down."""
    x, z, a, b = OPENING
    xs, zs = (0, x - a, x + a, WIDTH), (0, z - b, z + b, DEPTH)

    def patch(x0: float, x1: float, z0: float, z1: float) -> Mesh:
        return quad((x0, HEIGHT, z0), (x1, HEIGHT, z0), (x1, HEIGHT, z1), (x0, HEIGHT, z1))

    return joined(
        patch(xs[0], xs[3], zs[0], zs[1]),
        patch(xs[0], xs[3], zs[2], zs[3]),
        patch(xs[0], xs[1], zs[1], zs[2]),
        patch(xs[2], xs[3], zs[1], zs[2]),
    )


def _shaft(length: float) -> Mesh:
    """Black walls from the opening up towards the sun, and their end: no light leaves the scene."""
    x, z, a, b = OPENING
    low = np.array([(x - a, HEIGHT, z - b), (x + a, HEIGHT, z - b), (x + a, HEIGHT, z + b), (x - a, HEIGHT, z + b)])
    high = low - length * SUN
    sides = [quad(low[i], high[i], high[(i + 1) % 4], low[(i + 1) % 4]) for i in range(4)]
    return joined(*sides, quad(*high))


def skylight_room() -> MadeScene:
    """Everything but a patch of the back wall is lit indirectly."""
    w, h, d = WIDTH, HEIGHT, DEPTH
    walls = joined(
        _ceiling(),
        quad((0, 0, 0), (w, 0, 0), (w, h, 0), (0, h, 0)),
        quad((0, 0, d), (0, h, d), (w, h, d), (w, 0, d)),
    )
    floor = quad((0, 0, 0), (0, 0, d), (w, 0, d), (w, 0, 0))
    left = quad((0, 0, 0), (0, h, 0), (0, h, d), (0, 0, d))
    right = quad((w, 0, d), (w, h, d), (w, h, 0), (w, 0, 0))

    def box(x0: float, x1: float, z0: float, z1: float, low: float, high: float) -> Mesh:
        return prism([(x0, z0), (x1, z0), (x1, z1), (x0, z1)], low, high)

    legs = [box(x, x + 0.06, z, z + 0.06, 0, 0.7) for x in (2.9, 4.04) for z in (1.5, 2.24)]
    table = joined(*legs, box(2.8, 4.2, 1.4, 2.4, 0.7, 0.76))
    under = quad((2.8, 0.7, 1.4), (4.2, 0.7, 1.4), (4.2, 0.7, 2.4), (2.8, 0.7, 2.4))
    bench = joined(box(0.25, 0.8, 0.9, 3.3, 0.0, 0.42))
    step = prism([(1.35, 2.55), (1.95, 2.4), (2.1, 3.0), (1.5, 3.15)], 0.0, 0.5)
    # The sun is a small square well up the shaft.
    forward = SUN / np.linalg.norm(SUN)
    opening = np.array([OPENING[0], HEIGHT, OPENING[1]])
    sun = tuple((opening - 1.25 * forward).tolist())
    meshes = {
        "walls": walls,
        "floor": floor,
        "left": left,
        "right": right,
        "table": joined(table, under),
        "bench": bench,
        "step": step,
        "shaft": _shaft(1.4),
    }
    materials = ["white", "wood", "terracotta", "blue", "wood", "terracotta", "white", "shaft"]
    return MadeScene(
        "Room with a skylight",
        "Sunlight falls through a skylight onto the back wall of a furnished room; all surfaces are diffuse.",
        "A room lit by one patch of wall: nearly all light is indirect, what radiance photons and caches are for.",
        (2.75, 1.55, 5.9),
        (2.4, 1.25, 0.0),
        60,
        [
            diffuse("white", 0.78, 0.77, 0.74),
            diffuse("wood", 0.5, 0.38, 0.26),
            diffuse("terracotta", 0.62, 0.3, 0.2),
            diffuse("blue", 0.25, 0.38, 0.55),
            diffuse("shaft", 0.0),
            BLACK,
        ],
        [
            *(mesh(stem, material, flat=True) for stem, material in zip(meshes, materials, strict=True)),
            sphere((3.3, 0.95, 1.95), 0.19, "blue"),
            sphere((1.72, 0.75, 2.78), 0.25, "terracotta"),
            lamp(sun, tuple(opening.tolist()), (0.06, 0.06), (36000, 33400, 28400)),
        ],
        meshes,
        aspect=(384, 288),
    )
