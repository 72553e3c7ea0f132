"""The Cornell box with walls of fractal rock, all of them copies of one tile.

The tile is a square that the program displaces by periodic fractal noise, so neighbours join without a seam; a wall is
a group of tiles, and the box shows five walls: 5 · TILES² · 2 · CUTS² triangles.
"""

from __future__ import annotations

from make.document import BLACK, MadeScene, diffuse, number, panel

COLOURS = {
    "white": diffuse("white", 0.725, 0.71, 0.68),
    "red": diffuse("red", 0.63, 0.065, 0.05),
    "green": diffuse("green", 0.14, 0.45, 0.091),
}
TILES, CUTS = 4, 102
RELIEF = 0.02
"""Height of the rock's first octave; the box's side is 1."""

WALLS = {
    "floor": ("white", "1 0 0 0  0 0 1 0  0 -1 0 1  0 0 0 1"),
    "ceiling": ("white", "1 0 0 0  0 0 -1 1  0 1 0 0  0 0 0 1"),
    "back": ("white", "-1 0 0 1  0 1 0 0  0 0 -1 1  0 0 0 1"),
    "left": ("red", "0 0 -1 1  0 1 0 0  1 0 0 0  0 0 0 1"),
    "right": ("green", "0 0 1 0  0 1 0 0  -1 0 0 1  0 0 0 1"),
}
"""Colour, and the matrix from the unit square that faces +z to the wall, which faces into the box."""


def _tile(colour: str) -> str:
    noise = {"octaves": 7, "frequency": 2, "seed": 3}
    texture = "".join(f'<integer name="{name}" value="{value}"/>' for name, value in noise.items())
    return (
        f'<shape type="shapegroup" id="{colour}_tile"><shape type="rectangle">'
        f'<integer name="subdivision" value="{CUTS}"/>{number("displacement_scale", RELIEF * TILES)}'
        f'<texture name="displacement" type="fractal">{texture}{number("roughness", 0.55)}</texture>'
        '<transform name="to_world"><translate value="1 1 0"/><scale value="0.5"/></transform>'
        f'<ref id="{colour}"/></shape></shape>'
    )


def _wall(colour: str) -> str:
    tiles = "".join(
        f'\n    <shape type="instance"><ref id="{colour}_tile"/><transform name="to_world">'
        f'<translate value="{i} {j} 0"/><scale value="{1 / TILES:g}"/></transform></shape>'
        for i in range(TILES)
        for j in range(TILES)
    )
    return f'<shape type="shapegroup" id="{colour}_wall">{tiles}\n  </shape>'


def _shown(name: str, colour: str, matrix: str) -> str:
    return (
        f'<shape type="instance" id="{name}"><ref id="{colour}_wall"/>'
        f'<transform name="to_world"><matrix value="{matrix}"/></transform></shape>'
    )


def _block(size: str, angle: float, place: str) -> str:
    return (
        f'<shape type="cube"><transform name="to_world"><scale value="{size}"/><rotate y="1" angle="{angle}"/>'
        f'<translate value="{place}"/></transform><ref id="white"/></shape>'
    )


def fractal_box() -> MadeScene:
    """Walls of 1.66 million triangles and two plain blocks under one area light."""
    return MadeScene(
        "Fractal Cornell box",
        "Walls of fractal rock: more than 1.6 million triangles, all of them copies of one displaced square.",
        "Instances: a scene that would fill hundreds of megabytes opens at once, its relief lit like any other.",
        (0.5, 0.5, -1.44),
        (0.5, 0.5, 0.0),
        37.0,
        [*COLOURS.values(), BLACK],
        [
            *(_tile(colour) for colour in COLOURS),
            *(_wall(colour) for colour in COLOURS),
            *(_shown(name, *wall) for name, wall in WALLS.items()),
            _block("0.14 0.28 0.14", -17, "0.66 0.27 0.64"),
            _block("0.14 0.14 0.14", 17, "0.32 0.13 0.33"),
            panel((0.5, 0.96, 0.5), (0.12, 0, 0), (0, 0, 0.1), "black", (30, 25, 17)),
        ],
    )
