"""Cornell boxes of one metre, open at the front: a glossy floor, four lights, water."""

from __future__ import annotations

import numpy as np

from make.document import BLACK, MadeScene, bsdf, dielectric, diffuse, mesh, panel, rgb, sphere
from make.mesh import F8, Mesh, height_field, joined, prism, quad

ORIGIN, TARGET, FOV = (0.5, 0.5, -1.42), (0.5, 0.5, 0.0), 39.5
WHITE = diffuse("white", 0.725, 0.71, 0.68)
RED = diffuse("red", 0.63, 0.065, 0.05)
GREEN = diffuse("green", 0.14, 0.45, 0.091)

FLOOR = quad((0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0))
CEILING = quad((0, 1, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1))
BACK = quad((0, 0, 1), (0, 1, 1), (1, 1, 1), (1, 0, 1))
RIGHT = quad((0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1))  # the camera looks along +z, so x runs to its left
LEFT = quad((1, 0, 1), (1, 1, 1), (1, 1, 0), (1, 0, 0))
TALL = [(0.742, 0.39), (0.837, 0.675), (0.552, 0.77), (0.457, 0.485)]
SHORT = [(0.21, 0.115), (0.5, 0.205), (0.41, 0.49), (0.125, 0.4)]


def walls(*white: Mesh) -> tuple[dict[str, Mesh], list[str]]:
    """Meshes and shapes of the side walls and of everything white."""
    meshes = {"white": joined(*white), "green": RIGHT, "red": LEFT}
    return meshes, [mesh(stem, stem, flat=True) for stem in meshes]


def glossy() -> MadeScene:
    """Glossy floor and a brushed-gold block (Jensen 1996, figure of the glossy box)."""
    meshes, shapes = walls(CEILING, BACK, prism(SHORT, 0, 0.3))
    meshes |= {"floor": FLOOR, "block": prism(TALL, 0, 0.6)}
    rough = '<string name="distribution" value="ggx"/><float name="alpha" value="{}"/>'
    floor = ('<string name="material" value="none"/>', rough.format(0.12), rgb("specular_reflectance", 0.7, 0.68, 0.65))
    gold = (rgb("eta", 0.143, 0.374, 1.442), rgb("k", 3.983, 2.386, 1.603), rough.format(0.25))
    return MadeScene(
        "Cornell box with a glossy floor",
        "The box with a floor of roughened metal, a block of rough gold and a white block under one area light.",
        "Glossy reflections of the whole box, and light that glossy surfaces throw on: photons meet every BSDF.",
        ORIGIN,
        TARGET,
        FOV,
        [
            WHITE,
            RED,
            GREEN,
            BLACK,
            bsdf("roughconductor", "floor", *floor, two_sided=True),
            bsdf("roughconductor", "gold", *gold, two_sided=True),
        ],
        [
            *shapes,
            mesh("floor", "floor", flat=True),
            mesh("block", "gold", flat=True),
            panel((0.5, 0.998, 0.5), (0.16, 0, 0), (0, 0, 0.14), "black", (17, 15, 11.5)),
        ],
        meshes,
    )


def lights() -> MadeScene:
    """Four coloured lights near the corners of the ceiling."""
    meshes, shapes = walls(FLOOR, CEILING, BACK, prism(SHORT, 0, 0.3), prism(TALL, 0, 0.6))
    colours = [(34, 6, 5), (6, 24, 5), (5, 8, 38), (24, 19, 4)]
    places = [(0.22, 0.25), (0.78, 0.25), (0.22, 0.78), (0.78, 0.78)]
    panels = [
        panel((x, 0.998, z), (0.06, 0, 0), (0, 0, 0.06), "black", colour)
        for (x, z), colour in zip(places, colours, strict=True)
    ]
    return MadeScene(
        "Cornell box with four lights",
        "The diffuse box with two blocks under a red, a green, a blue and a yellow area light.",
        "Several coloured shadows and penumbrae: how lights are chosen, and photons coloured by their light.",
        ORIGIN,
        TARGET,
        FOV,
        [WHITE, RED, GREEN, BLACK],
        [*shapes, *panels],
        meshes,
    )


WATER_LEVEL = 0.38
_WAVES = [  # amplitude in m, wave numbers along x and z in 1/m, phase
    (0.0060, 21.0, 9.0, 0.3),
    (0.0050, -13.0, 23.0, 1.7),
    (0.0035, 31.0, -17.0, 4.1),
    (0.0022, 11.0, 43.0, 2.9),
    (0.0015, -47.0, 29.0, 5.3),
]


def _water_height(x: F8, z: F8) -> F8:
    total = np.full(np.broadcast(x, z).shape, WATER_LEVEL)
    for amplitude, kx, kz, phase in _WAVES:
        total += amplitude * np.sin(kx * x + kz * z + phase)
    return total


def water() -> MadeScene:
    """Waves over the floor; the water reaches a hair into the walls, so that none of its edges shows."""
    hair, front, cells = 2e-3, 0.02, 96
    x = np.linspace(-hair, 1 + hair, cells + 1)
    z = np.linspace(front, 1 + hair, cells + 1)
    surface = height_field(x, z, _water_height)
    top = _water_height(x, np.full_like(x, front))
    foot, edge = np.stack([x, 0 * x - hair, 0 * x + front], 1), np.stack([x, top, 0 * x + front], 1)
    i = np.arange(cells)
    n = cells + 1
    pane = np.concatenate([np.stack([i, n + i, n + i + 1], 1), np.stack([i, n + i + 1, i + 1], 1)])
    meshes, shapes = walls(FLOOR, CEILING, BACK)
    meshes |= {"water": surface, "pane": Mesh(np.concatenate([foot, edge]), pane.astype(np.int32))}
    return MadeScene(
        "Cornell box filled with water",
        "Waves of five sines on water of refractive index 1.33, 38 cm deep, with a ball on the bottom, under one small "
        "light.",
        "Caustics of waves on the bottom and the walls: every path from the light to the bottom is a caustic one.",
        ORIGIN,
        TARGET,
        FOV,
        [WHITE, RED, GREEN, BLACK, dielectric("water", 1.33), diffuse("ball", 0.6, 0.5, 0.3)],
        [
            *shapes,
            mesh("water", "water"),
            mesh("pane", "water", flat=True),
            sphere((0.68, 0.13, 0.55), 0.13, "ball"),
            panel((0.5, 0.998, 0.45), (0.05, 0, 0), (0, 0, 0.05), "black", (150, 140, 120)),
        ],
        meshes,
        max_depth=48,
    )
