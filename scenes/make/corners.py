"""Closed rooms full of corners, diffuse and glossy: where point lights near a wall make bright spots (R10)."""

from __future__ import annotations

from make.document import BLACK, MadeScene, bsdf, diffuse, mesh, panel, rgb
from make.mesh import Mesh, joined, prism, room

WIDTH, HEIGHT, DEPTH = 4.0, 2.8, 5.0
ORIGIN, TARGET, FOV = (2.9, 1.6, 4.7), (1.7, 1.1, 0.6), 62.0
SHELF = [(0.0, 1.1), (0.5, 1.1), (0.5, 2.6), (0.0, 2.6)]
CRATE = [(2.2, 0.7), (2.95, 0.95), (2.7, 1.7), (1.95, 1.45)]
STEP = [(0.9, 2.2), (1.6, 2.2), (1.6, 2.9), (0.9, 2.9)]


def _geometry() -> dict[str, Mesh]:
    faces = room((0, 0, 0), (WIDTH, HEIGHT, DEPTH))
    pillar = [(3.3, 0.0), (4.0, 0.0), (4.0, 0.7), (3.3, 0.7)]
    return {
        "floor": faces["floor"],
        "walls": joined(faces["ceiling"], faces["back"], faces["front"]),
        "left": faces["left"],
        "right": faces["right"],
        "blocks": joined(prism(SHELF, 0.0, 0.9), prism(pillar, 0.0, HEIGHT)),
        "crate": joined(prism(CRATE, 0.0, 0.8), prism(STEP, 0.0, 0.35)),
    }


def _room(title: str, description: str, shows: str, bsdfs: list[str], materials: dict[str, str]) -> MadeScene:
    meshes = _geometry()
    lamp = panel((2.0, HEIGHT - 0.01, 2.4), (0.5, 0, 0), (0, 0, 0.5), "black", (14, 13, 11))
    shapes = [mesh(stem, materials[stem], flat=True) for stem in meshes]
    return MadeScene(title, description, shows, ORIGIN, TARGET, FOV, [*bsdfs, BLACK], [*shapes, lamp], meshes)


PLAIN = [
    diffuse("white", 0.7, 0.69, 0.66),
    diffuse("red", 0.62, 0.16, 0.12),
    diffuse("blue", 0.18, 0.3, 0.6),
    diffuse("grey", 0.3, 0.3, 0.32),
    diffuse("wood", 0.55, 0.38, 0.22),
]


def corner_room() -> MadeScene:
    """All of it diffuse, with albedos from 0.2 to 0.7."""
    materials = {"floor": "grey", "walls": "white", "left": "red", "right": "blue", "blocks": "white", "crate": "wood"}
    return _room(
        "Diffuse room full of corners",
        "A closed room with a pillar, a shelf, a crate and a step under one square light, all diffuse.",
        "Virtual lights near corners make bright spots that weighted importance sampling removes (R10).",
        PLAIN,
        materials,
    )


def glossy_room() -> MadeScene:
    """The floor and the crate are glossy, rough enough to store photons."""
    rough = '<string name="distribution" value="ggx"/><float name="alpha" value="{}"/>'
    none = '<string name="material" value="none"/>'
    sheen = rgb("specular_reflectance", 0.6, 0.6, 0.58)
    gold = (rgb("eta", 0.143, 0.374, 1.442), rgb("k", 3.983, 2.386, 1.603), rough.format(0.3))
    metals = [
        bsdf("roughconductor", "floor", none, rough.format(0.25), sheen, two_sided=True),
        bsdf("roughconductor", "gold", *gold, two_sided=True),
    ]
    materials = {"floor": "floor", "walls": "white", "left": "red", "right": "blue", "blocks": "white", "crate": "gold"}
    return _room(
        "Glossy room full of corners",
        "The room of corner_room with a floor of brushed metal and a crate and a step of rough gold.",
        "Glossy reflections of virtual lights are spots; weighted importance sampling makes them smooth (R10).",
        [*PLAIN, *metals],
        materials,
    )
