"""A glass egg in a room with two lights (course guide 2002, figures 3.4 to 3.6; Suykens and Willems 2000, figure 5)."""

from __future__ import annotations

import numpy as np

from make.document import BLACK, MadeScene, bsdf, dielectric, diffuse, lamp, mesh, panel, rgb
from make.mesh import Mesh, joined, lathe, room

WIDTH, HEIGHT, DEPTH = 4.0, 2.6, 4.2
EGG, BULGE = (0.36, 1.0), 0.22
"""Largest radius (about) and height of the egg; by how much its lower half is the wider one."""


def _egg(steps: int, segments: int) -> Mesh:
    """r = a sin t (1 + BULGE cos t), y = h (1 - cos t) / 2.

    The parameter's steps shrink to nothing at the poles, where the normals of a lathe are one-sided differences.
    """
    u = np.linspace(0, 1, steps + 1)
    t = np.pi * u - np.sin(2 * np.pi * u) / 2
    radius, height = EGG
    profile = np.stack([radius * np.sin(t) * (1 + BULGE * np.cos(t)), height * (1 - np.cos(t)) / 2], 1)
    profile[[0, -1], 0] = 0.0
    return lathe([profile], segments)


def glass_egg() -> MadeScene:
    """The lights are small and hang to the left and the right, so each throws a caustic to the other side."""
    hull = room((-WIDTH / 2, 0, -DEPTH / 2), (WIDTH / 2, HEIGHT, DEPTH / 2))
    tiles = (
        '<texture name="reflectance" type="checkerboard">'
        f"{rgb('color0', 0.5, 0.45, 0.38)}{rgb('color1', 0.38, 0.33, 0.27)}"
        f'<transform name="to_uv"><scale value="{WIDTH:g} {DEPTH:g} 1"/></transform></texture>'
    )
    aim = (0.0, 0.45, 0.0)
    return MadeScene(
        "A glass egg",
        "A glass egg of one metre in a closed room under two small lights, one to its left and one to its right.",
        "Two caustics and what is seen through the egg: where a caustic map must be dense, and where it need not.",
        (0.1, 1.25, 2.05),
        (0.0, 0.47, 0.0),
        56,
        [
            diffuse("wall", 0.7, 0.68, 0.64),
            diffuse("red", 0.6, 0.24, 0.16),
            diffuse("blue", 0.2, 0.33, 0.58),
            bsdf("diffuse", "floor", tiles, two_sided=True),
            dielectric("glass", 1.5),
            BLACK,
        ],
        [
            mesh("walls", "wall", flat=True),
            mesh("left", "red", flat=True),
            mesh("right", "blue", flat=True),
            panel((0, 0, 0), (WIDTH / 2, 0, 0), (0, 0, -DEPTH / 2), "floor"),
            mesh("egg", "glass", transform='<translate y="0.0005"/>'),
            lamp((-1.5, 2.3, -0.5), aim, (0.08, 0.08), (330, 305, 260)),
            lamp((1.6, 1.9, 0.5), aim, (0.08, 0.08), (205, 220, 250)),
        ],
        {
            "walls": joined(*(hull[side] for side in ("ceiling", "back", "front"))),
            "left": hull["left"],
            "right": hull["right"],
            "egg": _egg(56, 88),
        },
        aspect=(320, 256),
        max_depth=32,
    )
