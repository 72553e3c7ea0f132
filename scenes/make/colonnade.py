"""A courtyard between two arcades (in the manner of the Sponza atrium of the course guide 2002, figure 6.53).

x runs across the courtyard, y up, and the courtyard lies along z. The sun shines in over the right arcade.
"""

from __future__ import annotations

import numpy as np

from make.document import MadeScene, diffuse, mesh, numbers, rgb
from make.mesh import F8, Mesh, block, height_field, joined, lathe, quad

BAY, BAYS = 2.5, 8
"""Distance of the columns along z, and arches on each side."""
HALF, OUTER = 3.0, 6.0
"""x of the arcades' axes and of the outer walls."""
END = 0.5 * BAY * BAYS
THICK = 0.3
"""Half the thickness of the arcades."""
SPRING, CEILING, TOP = 3.0, 4.6, 6.4
"""Heights of the arches' springing, of the galleries' ceiling and of the walls."""
ARCH, STEPS = 0.95, 32
"""Radius of the arches, and facets of a semicircle."""


def _column() -> Mesh:
    """A shaft with entasis on a base and under a capital, from the floor to the springing."""
    y = np.linspace(0.42, 2.62, 12)
    shaft = np.stack([0.25 - 0.05 * ((y - 0.42) / 2.2) ** 2, y], 1)
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)
    torus = np.stack([0.27 + 0.07 * np.cos(turn), 0.3 + 0.07 * np.sin(turn)], 1)
    bell = np.stack([0.2 + 0.12 * np.linspace(0, 1, 7) ** 2, np.linspace(2.66, 2.82, 7)], 1)
    ring = np.stack([0.2 + 0.03 * np.cos(turn), 2.64 + 0.03 * np.sin(turn)], 1)
    return lathe([torus, np.array([(0.27, 0.37), (0.26, 0.42), (0.25, 0.42)]), shaft, ring, bell], 48)


def _placed(shape: Mesh, x: float, z: float) -> Mesh:
    return Mesh(shape.vertices + (x, 0.0, z), shape.faces, shape.normals)


def _smoothly_joined(meshes: list[Mesh]) -> Mesh:
    """One mesh of several that have normals."""
    together = joined(*meshes)
    return Mesh(together.vertices, together.faces, np.concatenate([m.normals for m in meshes if m.normals is not None]))


def _strip(lower: F8, upper: F8) -> Mesh:
    """Quads between two rows of points (n, 3)."""
    return joined(*(quad(lower[i], lower[i + 1], upper[i + 1], upper[i]) for i in range(len(lower) - 1)))


def _arch(x: float, z: float) -> Mesh:
    """The wall over one bay around z, on both sides, with the arch's inner face; two-sided."""
    angles = np.linspace(0.0, np.pi, STEPS + 1)
    zs, ys = z + ARCH * np.cos(angles), SPRING + ARCH * np.sin(angles)
    parts = []
    curves = []
    for side in (x - THICK, x + THICK):
        curve = np.stack([np.full_like(zs, side), ys, zs], 1)
        curves.append(curve)
        parts.append(_strip(curve, np.stack([np.full_like(zs, side), np.full_like(zs, TOP), zs], 1)))
        for sign in (-1.0, 1.0):
            near, far = z + sign * ARCH, z + sign * 0.5 * BAY
            parts.append(quad((side, SPRING, near), (side, SPRING, far), (side, TOP, far), (side, TOP, near)))
    parts.append(_strip(curves[0], curves[1]))
    for sign in (-1.0, 1.0):
        near, far = z + sign * ARCH, z + sign * 0.5 * BAY
        low, high = x - THICK, x + THICK
        parts.append(quad((low, SPRING, near), (high, SPRING, near), (high, SPRING, far), (low, SPRING, far)))
    return joined(*parts)


def _cloth(x: float, z: float, phase: float) -> Mesh:
    """A cloth that hangs in a bay, in folds."""
    flat = height_field(
        np.linspace(0.0, 2.3, 5),
        np.linspace(-0.85, 0.85, 61),
        lambda y, s: 0.08 * np.sin(14.0 * s + phase) * (1.0 - 0.2 * y),
    )
    down, out, along = flat.vertices.T
    assert flat.normals is not None
    turned = np.stack([flat.normals[:, 1], -flat.normals[:, 0], flat.normals[:, 2]], 1)
    return Mesh(np.stack([x + out, 3.75 - down, z + along], 1), flat.faces, turned)


def _plinths() -> list[tuple[float, float]]:
    """Where columns stand, (x, z)."""
    return [(x, i * BAY - END) for x in (-HALF, HALF) for i in range(BAYS + 1)]


def _meshes() -> dict[str, Mesh]:
    """By the stem of the file."""
    bays = [(i + 0.5) * BAY - END for i in range(BAYS)]
    sides, plinths = (-HALF, HALF), _plinths()
    walls = [
        *(quad((x, 0, -END), (x, 0, END), (x, TOP, END), (x, TOP, -END)) for x in (-OUTER, OUTER)),
        *(quad((-OUTER, 0, z), (OUTER, 0, z), (OUTER, TOP, z), (-OUTER, TOP, z)) for z in (-END, END)),
    ]
    roofs = [block((min(x, 2 * x), CEILING, -END), (max(x, 2 * x), CEILING + 0.2, END)) for x in sides]
    copings = [block((x - 0.36, TOP, -END), (x + 0.36, TOP + 0.12, END)) for x in sides]
    basin = lathe(
        [np.array([(1.0, 0.0), (1.0, 0.45)]), np.array([(1.0, 0.45), (0.85, 0.45)]),
         np.array([(0.85, 0.45), (0.8, 0.12), (0.0, 0.1)])],
        64,
    )  # fmt: skip
    return {
        "floor": quad((-OUTER, 0, END), (OUTER, 0, END), (OUTER, 0, -END), (-OUTER, 0, -END)),
        "walls": joined(*walls),
        "arcades": joined(*(_arch(x, z) for x in sides for z in bays), *copings),
        "galleries": joined(*roofs),
        "plinths": joined(
            *(block((x - 0.36, 0, z - 0.36), (x + 0.36, 0.23, z + 0.36)) for x, z in plinths),
            *(block((x - 0.33, 2.82, z - 0.33), (x + 0.33, SPRING, z + 0.33)) for x, z in plinths),
        ),
        "column": _column(),
        "basin": _placed(basin, 0.4, -2.5),
        "red": _smoothly_joined([_cloth(-HALF, bays[i], i) for i in (1, 4)] + [_cloth(HALF, bays[2], 2.0)]),
        "green": _smoothly_joined([_cloth(HALF, bays[i], i) for i in (0, 4)] + [_cloth(-HALF, bays[2], 1.0)]),
    }


def colonnade() -> MadeScene:
    """Seen along the courtyard, from beside its left arcade."""
    smooth = ("basin", "red", "green")
    meshes = _meshes()
    stems = [stem for stem in meshes if stem != "column"]
    sun = f'<vector name="direction" value="{numbers(-0.5, -1.0, -0.38)}"/>{rgb("irradiance", 6.5, 5.9, 4.9)}'
    return MadeScene(
        "Colonnade",
        "A courtyard between two arcades of eighteen columns, under a low sun and a blue sky; cloths hang in some of "
        "the arches.",
        "Indirect light on flat and on round stone, in the galleries nearly all of it: estimated gathers.",
        (-1.1, 1.75, 9.2),
        (0.55, 2.05, -4.0),
        70,
        [
            diffuse("floor", 0.46, 0.41, 0.35),
            diffuse("walls", 0.62, 0.55, 0.45),
            diffuse("arcades", 0.66, 0.6, 0.5),
            diffuse("galleries", 0.6, 0.52, 0.42),
            diffuse("plinths", 0.5, 0.46, 0.41),
            diffuse("columns", 0.68, 0.64, 0.57),
            diffuse("basin", 0.5, 0.5, 0.5),
            diffuse("red", 0.6, 0.09, 0.06),
            diffuse("green", 0.12, 0.36, 0.14),
        ],
        [
            *(mesh(stem, stem, flat=stem not in smooth) for stem in stems),
            *(
                mesh("column", "columns", transform=f'<translate x="{numbers(x)}" z="{numbers(z)}"/>')
                for x, z in _plinths()
            ),
            f'<emitter type="directional">{sun}</emitter>',
            f'<emitter type="constant">{rgb("radiance", 0.42, 0.54, 0.78)}</emitter>',
        ],
        meshes,
        aspect=(320, 240),
    )
